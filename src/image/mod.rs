//! Pictures after rendering: from radiance to display values, and how far two pictures are apart.
//!
//! **Display values** are what a screen is sent, 0 to 1 a channel: linear RGB (Rec. 709 primaries), clamped, through
//! the sRGB transfer function. There is no exposure and no tone curve: radiance 1 is white. All differences and
//! tolerances of lazytess are in **display units**, that is differences of display values; 1/255 is one 8-bit step.
//!
//! Read [`display`] first, then [`comparison`], which gathers what the other files measure.

pub mod color_map;
pub mod comparison;
pub mod difference;
pub mod display;
pub mod missed;
pub mod perceptual;

pub use comparison::{Comparison, compare};
pub use display::LinearImage;
