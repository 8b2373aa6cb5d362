//! Light that comes straight from the lights, with hard shadows.

use super::Shader;
use super::interaction::Interaction;
use super::smooth::LightState;
use crate::math::Ray;
use crate::render::rays::RayKind;
use crate::render::tracer::Tracer;
use crate::scene::description::Light;
use crate::scene::light::Incident;
use glam::{DVec3, Vec3};

/// Surfaces of clear bodies that light may pass on its way; behind more of them it is dark.
const MAX_CLEAR_SURFACES: u32 = 32;

impl<'a, T: Tracer> Shader<'a, T> {
    /// Radiance towards the eye of light from point and directional lights.
    pub(super) fn direct_light(&mut self, x: &Interaction<'a>) -> Vec3 {
        let albedo = x.albedo();
        let appearance = self.appearance;
        let lights = appearance.lights.iter().enumerate();
        lights.map(|(i, light)| self.light_from(i, light, x, albedo)).sum()
    }

    fn light_from(&mut self, number: usize, light: &Light, x: &Interaction<'a>, albedo: Vec3) -> Vec3 {
        let Some(incident) = light.incident(x.point.position) else {
            return Vec3::ZERO;
        };
        let reflected = reflect(x, albedo, incident.to_light) * incident.irradiance;
        if reflected == Vec3::ZERO || !x.is_above(incident.to_light) {
            self.trail.note_light(number, LightState::FacesAway);
            return Vec3::ZERO;
        }
        let visibility = self.visibility(x, &incident);
        let is_blocked = visibility == Vec3::ZERO;
        self.trail.note_light(number, if is_blocked { LightState::Blocked } else { LightState::Lit });
        reflected * visibility
    }

    /// Share of a light that arrives, per channel.
    fn visibility(&mut self, x: &Interaction<'a>, incident: &Incident) -> Vec3 {
        let ray = Ray { t_max: incident.distance as f32, ..x.leaving(incident.to_light) };
        if self.appearance.any_glass {
            return self.transmittance(ray);
        }
        self.rays.count(RayKind::Shadow);
        if self.tracer.occluded(&ray) { Vec3::ZERO } else { Vec3::ONE }
    }

    /// Light passes clear bodies in a straight line, weakened at each surface as refracted light would be: their
    /// shadows are bright but hold no caustics.
    fn transmittance(&mut self, mut ray: Ray) -> Vec3 {
        let mut share = Vec3::ONE;
        for _ in 0..MAX_CLEAR_SURFACES {
            let Some(x) = self.closest(RayKind::Shadow, &ray) else {
                return share;
            };
            let Some(glass) = x.material.glass else {
                return Vec3::ZERO;
            };
            // Straight through, so as seen from outside on both surfaces: inside, a refracted ray would be less
            // oblique.
            let reflectance = Interaction { outside: true, ..x }.interface(glass.ior).reflectance;
            share *= glass.transmit * (1.0 - reflectance) as f32;
            ray = Ray { t_max: ray.t_max - x.hit.t, ..x.leaving(ray.direction) };
        }
        Vec3::ZERO
    }
}

fn reflect(x: &Interaction<'_>, albedo: Vec3, to_light: DVec3) -> Vec3 {
    x.material.reflect_light(albedo, x.normal.as_vec3(), to_light.as_vec3(), x.to_eye.as_vec3())
}
