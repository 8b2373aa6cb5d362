//! A path tracer for the materials and lights that scenes have.
//!
//! Point and directional lights are sampled at every surface (nothing else can find them), with the same shadows as
//! `whitted`; the sky is met by diffuse bounces that leave the scene. The expected picture is the solution of the
//! rendering equation up to `max_depth` bounces, save for caustics of point and directional lights.

use super::Shader;
use super::interaction::Interaction;
use crate::math::Ray;
use crate::render::rays::RayKind;
use crate::render::sampler::{Sampler, cosine_direction};
use crate::render::tracer::Tracer;
use crate::scene::description::Glass;
use glam::{DVec2, Vec3};

/// Bounces before Russian roulette may end a path.
const SURE_BOUNCES: u32 = 3;

/// Where a path goes on.
struct Step {
    kind: RayKind,
    ray: Ray,
    /// Share of the next surface's radiance that goes on towards the eye, over the probability of the step.
    weight: Vec3,
    /// Radiance of the ray if it leaves the scene.
    beyond: Vec3,
}

impl<'a, T: Tracer> Shader<'a, T> {
    /// An unbiased estimate of the radiance of `x` towards the eye.
    pub(super) fn path(&mut self, mut x: Interaction<'a>, sampler: Sampler) -> Vec3 {
        let mut radiance = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        for bounce in 0..=self.settings.max_depth {
            radiance += throughput * self.direct_light(&x);
            if bounce == self.settings.max_depth {
                break;
            }
            let choice = sampler.point(2 * bounce);
            let Some(step) = self.step(&x, choice.x, sampler.point(2 * bounce + 1)) else {
                break;
            };
            throughput *= step.weight;
            let survival = if bounce < SURE_BOUNCES { 1.0 } else { throughput.max_element().min(1.0) };
            if choice.y >= f64::from(survival) {
                break;
            }
            throughput /= survival;
            let Some(next) = self.closest(step.kind, &step.ray) else {
                radiance += throughput * step.beyond;
                break;
            };
            x = next;
        }
        radiance
    }

    /// Chooses among the ways that light can have come, by `choice` in [0,1).
    fn step(&self, x: &Interaction<'a>, choice: f64, point: DVec2) -> Option<Step> {
        if let Some(glass) = x.material.glass {
            return Some(self.step_glass(x, glass, choice));
        }
        let (albedo, mirror) = (x.albedo(), x.material.mirror);
        let (p_albedo, p_mirror) = (albedo.max_element(), mirror.max_element());
        let p_diffuse = p_albedo / (p_albedo + p_mirror);
        if choice < f64::from(p_diffuse) {
            let direction = cosine_direction(x.normal, point);
            let (ray, weight) = (x.leaving(direction), albedo / p_diffuse);
            x.is_above(direction).then_some(Step { kind: RayKind::Diffuse, ray, weight, beyond: self.appearance.sky })
        } else if p_mirror > 0.0 {
            Some(self.step_mirrored(x, mirror / (1.0 - p_diffuse)))
        } else {
            None
        }
    }

    fn step_mirrored(&self, x: &Interaction<'a>, weight: Vec3) -> Step {
        let ray = x.leaving(x.mirrored());
        Step { kind: RayKind::Reflection, ray, weight, beyond: self.appearance.background }
    }

    fn step_glass(&self, x: &Interaction<'a>, glass: Glass, choice: f64) -> Step {
        let interface = x.interface(glass.ior);
        match interface.refracted {
            Some(direction) if choice >= interface.reflectance => Step {
                kind: RayKind::Refraction,
                ray: x.leaving(direction),
                weight: glass.transmit,
                beyond: self.appearance.background,
            },
            _ => self.step_mirrored(x, Vec3::ONE),
        }
    }
}
