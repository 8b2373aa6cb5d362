//! Random numbers as functions of a seed and a place: the same on every machine, in any order.
//!
//! Only additions, multiplications and comparisons are used, which IEEE 754 fixes to the bit.

use glam::{DVec3, IVec3};

/// Mixes a seed and two numbers into 64 well-stirred bits (the finaliser of SplitMix64, three times).
pub(crate) fn hash(seed: u64, a: u64, b: u64) -> u64 {
    mix(mix(mix(seed) ^ a) ^ b)
}

fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// A sequence of random numbers.
#[derive(Clone, Debug)]
pub(crate) struct Random {
    seed: u64,
    drawn: u64,
}

impl Random {
    /// Stream number `stream` of a seed; streams are independent.
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { seed: hash(seed, stream, 0x005e_ed0f), drawn: 0 }
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.drawn += 1;
        (hash(self.seed, self.drawn, 0) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Uniform in [low, high).
    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// One of `0..n`.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    /// True with the given probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }
}

/// Smooth random values about 0, within -1..1, with hills about as wide as the unit (gradient noise after Perlin 2002).
pub(super) fn noise(seed: u64, p: DVec3) -> f64 {
    let cell = p.floor();
    let at = p - cell;
    let fade = at * at * at * (at * (at * 6.0 - 15.0) + 10.0);
    let cell = cell.as_ivec3();
    let slope = |x: i32, y: i32, z: i32| {
        let corner = IVec3::new(x, y, z);
        gradient(seed, cell + corner).dot(at - corner.as_dvec3())
    };
    let along_x = |y: i32, z: i32| mix_between(slope(0, y, z), slope(1, y, z), fade.x);
    let along_y = |z: i32| mix_between(along_x(0, z), along_x(1, z), fade.y);
    mix_between(along_y(0), along_y(1), fade.z)
}

fn mix_between(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// One of the twelve directions to the edges of a cube.
fn gradient(seed: u64, corner: IVec3) -> DVec3 {
    let word = |x: i32| u64::from(x as u32);
    let bits = hash(seed, word(corner.x) | word(corner.y) << 32, word(corner.z));
    let sign = |bit: u64| if bits >> bit & 1 == 0 { -1.0 } else { 1.0 };
    let (a, b) = (sign(8), sign(9));
    match (bits >> 16) % 3 {
        0 => DVec3::new(a, b, 0.0),
        1 => DVec3::new(a, 0.0, b),
        _ => DVec3::new(0.0, a, b),
    }
}

/// Noise over `octaves` scales, each twice as fine and `gain` times as high as the one before.
pub(super) fn fractal_noise(seed: u64, p: DVec3, octaves: u32, gain: f64) -> f64 {
    let (mut sum, mut height, mut p) = (0.0, 1.0, p);
    for octave in 0..octaves {
        sum += height * noise(seed.wrapping_add(u64::from(octave)), p);
        height *= gain;
        // The shift keeps lattice points of different octaves, where noise is 0, apart.
        p = 2.0 * p + DVec3::new(0.37, 0.71, 0.13);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_is_continuous_across_cells_and_bounded() {
        for k in 0..1000 {
            let p = DVec3::new(f64::from(k) * 0.173 - 80.0, 3.0, f64::from(k) * 0.311);
            assert!((noise(7, p) - noise(7, p - DVec3::Y * 1e-9)).abs() < 1e-7);
            assert!(noise(7, p + DVec3::splat(0.4)).abs() <= 1.2);
        }
    }

    #[test]
    fn streams_are_uniform_and_differ() {
        let (mut a, mut b) = (Random::new(1, 0), Random::new(1, 1));
        let mean = (0..10_000).map(|_| a.unit()).sum::<f64>() / 1e4;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert_ne!(a.unit(), b.unit());
        assert!((0..1000).all(|_| b.below(3) < 3));
    }
}
