//! Whitted's integrator: local light at every surface, and the rays that mirrors and glass ask for.

use super::Shader;
use super::interaction::Interaction;
use crate::math::Ray;
use crate::render::rays::RayKind;
use crate::render::tracer::Tracer;
use crate::scene::description::Glass;
use glam::{DVec3, Vec3};

/// Rays that add less than this share to a pixel are not traced: of radiance 1 it is a third of an 8-bit step where
/// sRGB is steepest.
const MIN_WEIGHT: f32 = 1e-4;

/// A ray that is still to be traced.
pub(super) struct PendingRay {
    kind: RayKind,
    ray: Ray,
    /// Share of its radiance that reaches the pixel.
    weight: Vec3,
    /// Number of mirrored or refracted rays from the camera to this one, itself included.
    depth: u32,
}

impl<'a, T: Tracer> Shader<'a, T> {
    /// Ambient, diffuse and specular light at `first` and whatever is seen in it by reflection and refraction.
    pub(super) fn whitted(&mut self, first: &Interaction<'a>) -> Vec3 {
        debug_assert!(self.pending.is_empty());
        self.trail.begin();
        let mut radiance = self.local_light(first);
        self.trail.end_first(radiance);
        self.push_secondary(first, Vec3::ONE, 1);
        while let Some(PendingRay { kind, ray, weight, depth }) = self.pending.pop() {
            let Some(x) = self.closest(kind, &ray) else {
                radiance += weight * self.appearance.background;
                continue;
            };
            self.trail.note_mirrored(weight, x.normal);
            radiance += weight * self.local_light(&x);
            self.push_secondary(&x, weight, depth + 1);
        }
        radiance
    }

    /// Light of the skies, unshadowed, and of the other lights.
    fn local_light(&mut self, x: &Interaction<'a>) -> Vec3 {
        let ambient = if x.material.glass.is_some() { Vec3::ZERO } else { x.albedo() * self.appearance.sky };
        ambient + self.direct_light(x)
    }

    fn push_secondary(&mut self, x: &Interaction<'a>, weight: Vec3, depth: u32) {
        match x.material.glass {
            Some(glass) => self.push_glass(x, glass, weight, depth),
            None => self.push(RayKind::Reflection, x, x.mirrored(), weight * x.material.mirror, depth),
        }
    }

    fn push_glass(&mut self, x: &Interaction<'a>, glass: Glass, weight: Vec3, depth: u32) {
        let interface = x.interface(glass.ior);
        let reflectance = interface.reflectance as f32;
        self.push(RayKind::Reflection, x, x.mirrored(), weight * reflectance, depth);
        if let Some(direction) = interface.refracted {
            self.push(RayKind::Refraction, x, direction, weight * (1.0 - reflectance) * glass.transmit, depth);
        }
    }

    fn push(&mut self, kind: RayKind, x: &Interaction<'a>, direction: DVec3, weight: Vec3, depth: u32) {
        if depth <= self.settings.max_depth && weight.max_element() >= MIN_WEIGHT {
            self.pending.push(PendingRay { kind, ray: x.leaving(direction), weight, depth });
        }
    }
}
