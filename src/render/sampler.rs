//! Random numbers as a function of what they are for, so that no order of work can change them.
//!
//! A **stream** is a low-discrepancy sequence of points in the unit square: Sobol's first two dimensions under a nested
//! uniform (Owen) scramble, both made from hashes as in Burley, "Practical Hash-based Owen Scrambling", JCGT 2020.
//! Streams with different keys are independent: each is shuffled by its own key too, so a pixel may use as many of them
//! as it likes without correlation between their points.

use glam::{DVec2, DVec3};

/// PCG's output permutation: a well-mixing hash of 32 bits.
pub fn pcg(value: u32) -> u32 {
    let state = value.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
    let word = ((state >> ((state >> 28) + 4)) ^ state).wrapping_mul(277_803_737);
    (word >> 22) ^ word
}

/// A hash of two words; not symmetric.
pub fn hash2(a: u32, b: u32) -> u32 {
    pcg(pcg(a) ^ b.wrapping_mul(0x9E37_79B9).wrapping_add(0x7F4A_7C15))
}

/// A number in [0, 1) from 32 random bits.
fn unit(bits: u32) -> f64 {
    f64::from(bits) * 2f64.powi(-32)
}

/// The position of sample `index` in every pixel, in [0,1)²: the R2 sequence (Roberts 2018), which starts at the
/// centre.
///
/// All pixels share the pattern. Sample 0 of any number of samples is the one sample of `spp = 1`.
pub fn subpixel(index: u32) -> DVec2 {
    /// The plastic number's reciprocal and its square.
    const STEP: DVec2 = DVec2::new(0.754_877_666_246_692_7, 0.569_840_290_998_053_2);
    (DVec2::splat(0.5) + f64::from(index) * STEP).fract()
}

/// The random numbers of one sample of one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Sampler {
    pixel_key: u32,
    sample: u32,
}

impl Sampler {
    /// Numbers for sample `sample` of the pixel in column `x` and row `y` of the whole picture.
    pub fn new(seed: u32, [x, y]: [u32; 2], sample: u32) -> Self {
        Self { pixel_key: hash2(hash2(hash2(seed, 0), x), y), sample }
    }

    /// The point of stream `stream` that belongs to this sample: over all samples of the pixel they are well spread.
    pub fn point(&self, stream: u32) -> DVec2 {
        self.nth_point(stream, self.sample)
    }

    /// Point `i` of this sample's share of stream `stream`, where each sample takes `n` of them.
    pub fn point_of(&self, stream: u32, i: u32, n: u32) -> DVec2 {
        self.nth_point(stream, self.sample.wrapping_mul(n).wrapping_add(i))
    }

    fn nth_point(&self, stream: u32, index: u32) -> DVec2 {
        let key = hash2(self.pixel_key, stream);
        let [x, y] = sobol(nested_scramble(index, key));
        DVec2::new(unit(nested_scramble(x, pcg(key))), unit(nested_scramble(y, pcg(!key))))
    }
}

/// The first two dimensions of Sobol's sequence as fractions of 2³².
fn sobol(index: u32) -> [u32; 2] {
    let x = index.reverse_bits();
    // The second generator matrix is Pascal's triangle modulo 2, which factors into five butterflies.
    let mut y = x;
    y ^= y << 16;
    y ^= (y & 0x00FF_00FF) << 8;
    y ^= (y & 0x0F0F_0F0F) << 4;
    y ^= (y & 0x3333_3333) << 2;
    y ^= (y & 0x5555_5555) << 1;
    [x, y]
}

/// Owen's scramble: every bit is flipped by a hash of the bits above it (Laine and Karras 2011, constants by Burley).
fn nested_scramble(value: u32, key: u32) -> u32 {
    let mut x = value.reverse_bits();
    x = x.wrapping_add(key);
    x ^= x.wrapping_mul(0x6C50_B47C);
    x ^= x.wrapping_mul(0xB82F_1E52);
    x ^= x.wrapping_mul(0xC7AF_E638);
    x ^= x.wrapping_mul(0x8D22_F6E6);
    x.reverse_bits()
}

/// A direction about the unit vector `normal` with density cos θ / π, from a point of the unit square.
pub fn cosine_direction(normal: DVec3, point: DVec2) -> DVec3 {
    let (sin, cos) = (std::f64::consts::TAU * point.x).sin_cos();
    let (radius, height) = (point.y.sqrt(), (1.0 - point.y).sqrt());
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    radius * cos * tangent + radius * sin * bitangent + height * normal
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pcg_is_the_hash_of_the_peers() {
        // Computed with `pcg` and `hash2` of common.hpp.
        assert_eq!([pcg(0), pcg(1), hash2(1, 2)], [129_708_002, 2_831_084_092, 4_008_320_684]);
    }

    #[test]
    fn the_first_sample_is_the_pixel_centre() {
        assert_eq!(subpixel(0), DVec2::splat(0.5));
        assert!((1..100).all(|i| subpixel(i).cmpge(DVec2::ZERO).all() && subpixel(i).cmplt(DVec2::ONE).all()));
    }

    #[test]
    fn sobol_agrees_with_its_direction_numbers() {
        for index in [1u32, 2, 3, 5, 77, 123_456_789, u32::MAX] {
            let (mut direction, mut y) = (1u32 << 31, 0);
            for bit in 0..32 {
                y ^= if index >> bit & 1 == 1 { direction } else { 0 };
                direction ^= direction >> 1;
            }
            assert_eq!(sobol(index)[1], y, "index {index}");
        }
    }

    #[test]
    fn sixteen_points_of_a_stream_fall_one_in_each_elementary_interval() {
        for (columns, rows) in [(16, 1), (4, 4), (1, 16), (8, 2)] {
            let mut seen = vec![0; 16];
            for i in 0..16 {
                let p = Sampler::new(7, [3, 4], i).point(5);
                seen[(p.x * f64::from(columns)) as usize * rows + (p.y * rows as f64) as usize] += 1;
            }
            assert_eq!(seen, vec![1; 16], "{columns} x {rows}");
        }
    }

    #[test]
    fn streams_do_not_correlate() {
        let n = 4096;
        let product = |i| {
            let sampler = Sampler::new(0, [10, 20], i);
            (sampler.point(0).x - 0.5) * (sampler.point(1).x - 0.5)
        };
        let covariance = (0..n).map(product).sum::<f64>() / f64::from(n);
        assert!(covariance.abs() < 0.005, "{covariance}");
    }

    #[test]
    fn cosine_directions_have_mean_cosine_two_thirds() {
        let normal = DVec3::new(2.0, -1.0, 0.5).normalize();
        let cosine = |i| normal.dot(cosine_direction(normal, Sampler::new(1, [0, 0], i).point(0)));
        let mean = (0..1024).map(cosine).sum::<f64>() / 1024.0;
        assert!((mean - 2.0 / 3.0).abs() < 1e-3);
    }
}
