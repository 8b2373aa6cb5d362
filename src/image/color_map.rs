//! Colours for measures.

use super::display::linear_from_srgb;
use glam::Vec3;

/// Every eighth of matplotlib's viridis (Smith and van der Walt 2015), sRGB bytes.
const VIRIDIS: [[u8; 3]; 9] = [
    [0x44, 0x01, 0x54],
    [0x47, 0x2d, 0x7b],
    [0x3b, 0x52, 0x8b],
    [0x2c, 0x72, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x28, 0xae, 0x80],
    [0x5e, 0xc9, 0x62],
    [0xad, 0xdc, 0x30],
    [0xfd, 0xe7, 0x25],
];

/// Dark blue at 0, green in the middle, yellow at 1, in perceptually even steps; linear RGB. Values beyond are clamped.
pub fn viridis(value: f32) -> Vec3 {
    let place = value.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f32;
    let below = (place as usize).min(VIRIDIS.len() - 2);
    let encoded = |i: usize| Vec3::from(VIRIDIS[i].map(f32::from)) / 255.0;
    let mixed = encoded(below).lerp(encoded(below + 1), place - below as f32);
    Vec3::from(mixed.to_array().map(linear_from_srgb))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::display::srgb_from_linear;

    #[test]
    fn viridis_runs_from_dark_blue_to_yellow_and_gets_lighter_all_the_way() {
        let bytes = |v| viridis(v).to_array().map(|c| (255.0 * srgb_from_linear(c)).round() as u8);
        assert_eq!((bytes(0.0), bytes(1.0), bytes(2.0)), (VIRIDIS[0], VIRIDIS[8], VIRIDIS[8]));
        let luminance = |i| viridis(i as f32 / 100.0).dot(Vec3::new(0.2126, 0.7152, 0.0722));
        assert!((0..100).all(|i| luminance(i) < luminance(i + 1)));
    }
}
