//! Ambient occlusion: the cosine-weighted share of the sky that a point sees.

use super::Shader;
use super::interaction::Interaction;
use crate::render::rays::RayKind;
use crate::render::sampler::{Sampler, cosine_direction};
use crate::render::tracer::Tracer;
use glam::Vec3;

impl<'a, T: Tracer> Shader<'a, T> {
    /// Share of `ao_samples` rays about the limit normal that hit nothing, as a grey. Rays have no end, so closed rooms
    /// are black. A ray into the triangle itself counts as blocked.
    pub(super) fn ambient_occlusion(&mut self, x: &Interaction<'a>, sampler: Sampler) -> Vec3 {
        let n = self.settings.ao_samples;
        let free = (0..n).filter(|&i| self.sees_sky(x, sampler, i, n)).count();
        Vec3::splat(free as f32 / n as f32)
    }

    fn sees_sky(&mut self, x: &Interaction<'a>, sampler: Sampler, i: u32, n: u32) -> bool {
        let direction = cosine_direction(x.normal, sampler.point_of(0, i, n));
        if !x.is_above(direction) {
            return false;
        }
        self.rays.count(RayKind::Occlusion);
        !self.tracer.occluded(&x.leaving(direction))
    }
}
