//! What of a sample varies smoothly over a surface, and what decides where it does not: the matter of interpolation.
//!
//! A [`Probe`] is a sample with its **smooth** parts: normal, inverse depth (linear over the picture on a plane), light
//! that came by reflection or refraction. Its **trail** tells which way the light took: lights that were blocked,
//! meshes that secondary rays hit, and where on their patterns. Between probes with the same trail, where what mirrors
//! show is not turned too far, the smooth parts can be interpolated and shaded again, without a ray.

use super::{Sample, Shader};
use crate::ids::MeshId;
use crate::math::{Hit, Ray};
use crate::render::sampler::Sampler;
use crate::render::settings::Appearance;
use crate::render::tracer::Tracer;
use crate::scene::camera::Camera;
use crate::scene::description::Albedo;
use glam::{DVec3, Vec3};

/// Radiance by reflection, at most, of a point that a pixel may miss. When pixels of all mirrors were settled as
/// readily as others (`samples`), four of 100 pictures of mirrors of 0.5 and 0.9 lost one glint more, and chess lost
/// one on its board, which reflects
/// 0.07 of lights as bright as 16; of those below this, none of 100 lost any.
const MOST_UNSEEN: f32 = 0.25;

/// A sample and what can be interpolated of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Probe {
    pub sample: Sample,
    /// `None` if nothing was hit.
    pub smooth: Option<Smooth>,
}

impl Probe {
    /// Equal for samples that show the same mesh in light that took the same way.
    pub(in crate::render) fn trail(&self) -> Option<(MeshId, u64)> {
        self.smooth.map(|smooth| (smooth.mesh, smooth.signature))
    }
}

/// The smooth parts of a sample of a surface, and its trail.
#[derive(Clone, Copy, Debug)]
pub(in crate::render) struct Smooth {
    pub mesh: MeshId,
    /// Whether the side was seen that the mesh calls outside.
    pub outside: bool,
    /// Unit normal on the side that was seen.
    pub normal: Vec3,
    /// One over the depth along the camera's forward direction.
    pub inverse_depth: f32,
    /// Radiance that did not come from a light directly.
    pub secondary: Vec3,
    pub lights: LightMasks,
    /// Equal for samples whose secondary rays hit the same meshes, on the same cube of a pattern, and had the same
    /// lights.
    pub signature: u64,
    /// Unit normals of what is seen by reflection and refraction, each times the share of its light that reaches the
    /// eye.
    pub mirrored_normal: Vec3,
}

/// Lights by number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(in crate::render) struct LightMasks {
    pub lit: u64,
    pub blocked: u64,
}

impl std::ops::BitOr for LightMasks {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        Self { lit: self.lit | other.lit, blocked: self.blocked | other.blocked }
    }
}

impl LightMasks {
    /// Lights a mask has room for.
    pub const CAPACITY: usize = 64;

    /// Whether some light is both seen and not.
    pub fn is_mixed(self) -> bool {
        self.lit & self.blocked != 0
    }
}

/// What became of a light at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum LightState {
    Lit,
    Blocked,
    /// The surface is turned away from it, and so continuously dark.
    FacesAway,
}

/// Notes of one sample's way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Trail {
    lights: LightMasks,
    first_lights: LightMasks,
    first_local: Vec3,
    signature: u64,
    mirrored_normal: Vec3,
}

impl Trail {
    /// Starts at a surface that the camera sees.
    pub fn begin(&mut self) {
        *self = Self::default();
    }

    /// Direct light of that surface is complete.
    pub fn end_first(&mut self, local: Vec3) {
        *self = Self { first_lights: self.lights, first_local: local, ..Self::default() };
    }

    pub fn note_hit(&mut self, hit: Option<&Hit>) {
        self.mix(hit.map_or(u64::MAX, |hit| u64::from(hit.primitive.mesh.0)));
    }

    /// Where a pattern was seen: the edges of its cubes are as sharp as those of meshes.
    pub fn note_cube(&mut self, cube: DVec3) {
        if cube != DVec3::ZERO {
            cube.to_array().into_iter().for_each(|x| self.mix(x.to_bits()));
        }
    }

    /// What a secondary ray of this weight hit.
    pub fn note_mirrored(&mut self, weight: Vec3, normal: DVec3) {
        self.mirrored_normal += weight.max_element() * normal.as_vec3();
    }

    pub fn note_light(&mut self, number: usize, state: LightState) {
        let bit = 1 << (number % LightMasks::CAPACITY);
        match state {
            LightState::Lit => self.lights.lit |= bit,
            LightState::Blocked => self.lights.blocked |= bit,
            LightState::FacesAway => {}
        }
        self.mix(2 * number as u64 + u64::from(state == LightState::Blocked));
    }

    fn mix(&mut self, value: u64) {
        self.signature = (self.signature ^ value).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29);
    }
}

impl<T: Tracer> Shader<'_, T> {
    /// As [`samples`](Self::samples), with what can be interpolated. For the `whitted` integrator.
    pub(in crate::render) fn probes(
        &mut self,
        camera: &Camera,
        rays: impl Iterator<Item = (Ray, Sampler)>,
        mut take: impl FnMut(&Self, Probe),
    ) {
        self.trace_together(camera, rays, |shader, sample, hit| {
            let smooth = hit.map(|x| Smooth {
                mesh: x.hit.primitive.mesh,
                outside: x.outside,
                normal: x.normal.as_vec3(),
                inverse_depth: 1.0 / sample.first.depth,
                secondary: sample.radiance - shader.trail.first_local,
                lights: shader.trail.first_lights,
                signature: shader.trail.signature,
                mirrored_normal: shader.trail.mirrored_normal,
            });
            take(shader, Probe { sample, smooth });
        });
    }
}

/// A point of an opaque surface, ready to be shaded without a ray.
pub(in crate::render) struct SmoothPoint {
    pub mesh: MeshId,
    pub position: DVec3,
    /// Unit vector.
    pub normal: Vec3,
    /// Unit vector.
    pub to_eye: Vec3,
    /// Lights that something blocks, by number.
    pub blocked: u64,
}

impl Appearance {
    /// Whether direct light can be computed again from a normal and the lights that are seen.
    pub(in crate::render) fn can_reshade(&self) -> bool {
        !self.any_glass && self.lights.len() <= LightMasks::CAPACITY
    }

    /// Whether nothing bright can be seen in a mesh's reflections: in mirrors and glass, things and lights may be as
    /// small as points.
    pub(in crate::render) fn reflects_little(&self, mesh: MeshId) -> bool {
        let material = &self.materials[mesh.idx()];
        let share = material.mirror.max_element();
        material.glass.is_none() && (share == 0.0 || share * self.brightest <= MOST_UNSEEN)
    }

    /// Whether a mesh's colour changes faster than pixels may notice.
    pub(in crate::render) fn is_patterned(&self, mesh: MeshId) -> bool {
        matches!(self.materials[mesh.idx()].diffuse, Albedo::Checker { .. })
    }

    /// Whether a mesh has one colour all along a short way through world space.
    pub(in crate::render) fn has_one_color(&self, mesh: MeshId, from: DVec3, to: DVec3) -> bool {
        let diffuse = self.materials[mesh.idx()].diffuse;
        diffuse.cube_at(from) == diffuse.cube_at(to)
    }

    /// Radiance of direct light and skies.
    pub(in crate::render) fn local_radiance(&self, point: &SmoothPoint) -> Vec3 {
        let material = &self.materials[point.mesh.idx()];
        let albedo = material.diffuse.at(point.position);
        let mut radiance = albedo * self.sky;
        for (i, light) in self.lights.iter().enumerate() {
            if point.blocked >> i & 1 != 0 {
                continue;
            }
            if let Some(incident) = light.incident(point.position) {
                let to_light = incident.to_light.as_vec3();
                radiance += material.reflect_light(albedo, point.normal, to_light, point.to_eye) * incident.irradiance;
            }
        }
        radiance
    }
}
