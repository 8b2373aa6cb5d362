//! How finely an edge is diced.
//!
//! The rate of an edge is a function of the edge alone, so the faces on its two sides agree without talking.

use super::camera::Camera;
use super::description::Rate;
use crate::mesh::shapes::noise::hash;
use crate::subdiv::MAX_RATE;
use glam::DVec3;

/// A dicing rule with the camera it refers to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DicingRate {
    /// Every edge is cut into this many pieces, 1..=4096.
    Fixed(u32),
    /// Pieces are at most about `length` pixels long wherever they lie.
    Pixels {
        /// Eye of the dicing camera, in world space.
        eye: DVec3,
        /// Pieces of length 1 at distance 1 from the eye are this many target lengths long.
        pieces_per_unit: f64,
    },
    /// Every edge has its own rate, drawn with this seed from 1..=1000, with as many in 1..2 as in 2..4, 4..8 and so
    /// on: the hardest neighbours for tests.
    Random(u64),
}

impl DicingRate {
    /// The rule `rate`, seen from `camera` in a picture `height` pixels high.
    pub fn new(rate: Rate, camera: &Camera, height: u32) -> Self {
        match rate {
            Rate::Fixed(n) => Self::Fixed(n.clamp(1, MAX_RATE)),
            Rate::Pixels(length) => {
                Self::Pixels { eye: camera.eye(), pieces_per_unit: camera.pixels_per_unit(height) / length }
            }
        }
    }

    /// Number of pieces, 1..=4096, of an edge between `a` and `b` in world space. The order of `a` and `b` does not
    /// matter.
    ///
    /// The length in pixels is what the edge would cover if it faced the camera at the distance of its nearest point.
    /// So foreshortened edges are not starved (a silhouette is foreshortened), no piece is longer on the screen than
    /// asked for, edges behind the camera or off the screen are diced like visible ones at their distance, and an edge
    /// through the eye gets the largest rate.
    pub fn edge_rate(&self, a: DVec3, b: DVec3) -> u32 {
        match *self {
            Self::Fixed(n) => n,
            Self::Random(seed) => {
                let (a, b) = in_order(a, b);
                random_rate(a.to_array().into_iter().chain(b.to_array()).fold(seed, |h, x| hash(h, x.to_bits(), 0)))
            }
            Self::Pixels { eye, pieces_per_unit } => {
                let (a, b) = in_order(a, b);
                let pieces = (b - a).length() * pieces_per_unit / distance_to_segment(eye, a, b);
                // The cast takes NaN (a point at the eye) to 0 and infinity to the largest integer.
                (pieces.ceil() as u32).clamp(1, MAX_RATE)
            }
        }
    }
}

/// One order for both neighbours, so that rounding agrees too.
fn in_order(a: DVec3, b: DVec3) -> (DVec3, DVec3) {
    if a.to_array() <= b.to_array() { (a, b) } else { (b, a) }
}

/// A rate from 64 random bits: the number of its binary digits is uniform, and then the digits are.
fn random_rate(bits: u64) -> u32 {
    let leading = 1 << (bits % 10);
    (leading | (bits >> 32) as u32 & (leading - 1)).min(1000)
}

fn distance_to_segment(p: DVec3, a: DVec3, b: DVec3) -> f64 {
    let edge = b - a;
    // `max` discards the NaN of an edge without length.
    let along = ((p - a).dot(edge) / edge.length_squared()).max(0.0);
    (p - (a + along.min(1.0) * edge)).length()
}

#[cfg(test)]
mod tests {
    use super::super::description::CameraDescription;
    use super::*;

    fn pixels(length: f64) -> DicingRate {
        let camera = CameraDescription { eye: DVec3::ZERO, at: DVec3::X, up: DVec3::Y, fov: 90.0 };
        DicingRate::new(Rate::Pixels(length), &Camera::new(&camera), 200)
    }

    #[test]
    fn an_edge_that_faces_the_camera_is_cut_by_its_length_in_pixels() {
        // At distance 4 with a field of 90 degrees, 200 pixels span 8 units: an edge of 1.98 units covers 49.5 pixels.
        let (a, b) = (DVec3::new(4.0, -0.99, 0.0), DVec3::new(4.0, 0.99, 0.0));
        assert_eq!(pixels(1.0).edge_rate(a, b), 50);
        assert_eq!(pixels(10.0).edge_rate(a, b), 5);
        assert_eq!(pixels(60.0).edge_rate(a, b), 1);
    }

    #[test]
    fn both_ends_see_the_same_rate() {
        let mut state = 1u32;
        let mut next = || {
            state = state.wrapping_mul(747796405).wrapping_add(2891336453);
            f64::from(state) * 2f64.powi(-30) - 2.0
        };
        for _ in 0..2000 {
            let (a, b) = (DVec3::new(next(), next(), next()), DVec3::new(next(), next(), next()));
            assert_eq!(pixels(0.1).edge_rate(a, b), pixels(0.1).edge_rate(b, a));
        }
    }

    #[test]
    fn random_rates_belong_to_the_edge_and_mix_ones_with_hundreds() {
        let rate = |k: u32, seed: u64| DicingRate::Random(seed).edge_rate(DVec3::X, f64::from(k) * DVec3::Y);
        let rates: Vec<u32> = (0..500).map(|k| rate(k, 7)).collect();
        assert!((0..500).all(|k| rate(k, 7) == DicingRate::Random(7).edge_rate(f64::from(k) * DVec3::Y, DVec3::X)));
        assert!(rates.iter().all(|r| (1..=1000).contains(r)));
        assert!(rates.iter().filter(|&&r| r == 1).count() > 25 && rates.iter().filter(|&&r| r > 500).count() > 25);
        assert_ne!(rates, (0..500).map(|k| rate(k, 8)).collect::<Vec<_>>());
    }

    #[test]
    fn edges_around_the_eye_and_without_length_stay_in_range() {
        assert_eq!(pixels(1.0).edge_rate(-DVec3::X, DVec3::X), MAX_RATE);
        assert_eq!(pixels(1.0).edge_rate(DVec3::X, DVec3::X), 1);
        assert_eq!(pixels(1.0).edge_rate(DVec3::ZERO, DVec3::ZERO), 1);
        assert_eq!(pixels(1.0).edge_rate(DVec3::ZERO, DVec3::X), MAX_RATE);
        assert!(pixels(1.0).edge_rate(DVec3::splat(1e300), -DVec3::splat(1e300)) <= MAX_RATE);
    }

    #[test]
    fn what_lies_behind_is_diced_like_what_lies_before() {
        let (a, b) = (DVec3::new(4.0, -1.0, 0.0), DVec3::new(4.0, 1.0, 0.0));
        assert_eq!(pixels(1.0).edge_rate(a, b), pixels(1.0).edge_rate(-a, -b));
    }
}
