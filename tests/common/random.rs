//! Random numbers and rays, the same in every run.

use glam::DVec3;
use lazytess::math::{DBounds, Ray};

/// xorshift64*: small, seeded, the same everywhere. The state must not be 0.
pub struct Random(pub u64);

impl Random {
    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 11) as f64 * 2f64.powi(-53)
    }

    /// Uniform in 0..n.
    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }

    /// Uniform in the cube of half-width 1.
    pub fn in_cube(&mut self) -> DVec3 {
        DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }

    /// From around the box, or from within, through it.
    pub fn ray(&mut self, bounds: DBounds) -> Ray {
        let half = 0.5 * (bounds.max - bounds.min);
        let [from, to] = [self.in_cube(), self.in_cube()].map(|p| bounds.center() + p * half);
        let away = if self.unit() < 0.3 { 0.0 } else { bounds.diagonal() * (1.0 + 9.0 * self.unit()) };
        let origin = from + self.in_cube().normalize_or(DVec3::X) * away;
        Ray::new(origin, (to - origin) * (0.01 + self.unit()))
    }
}
