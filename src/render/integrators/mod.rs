//! Integrators: from a camera ray to the radiance it brings back.
//!
//! A [`Shader`] is a thread's tracer with the scene's appearance and the thread's scratch. Every integrator is a method
//! of it in a file of its own; they share an **interaction** (a hit made ready for shading) and direct light.
//!
//! # Conventions
//! * Opaque surfaces are two-sided: normals are turned towards the ray. Which side of a clear body a ray meets is told
//!   by the geometric normal, so clear bodies must be closed and their faces counter-clockwise from outside.
//! * A ray that leaves a surface starts off it by the hit's own clearance, along the geometric normal on the side it
//!   leaves to, and names the triangle it leaves: there is no epsilon to choose.
//! * A chain of reflections, refractions or bounces ends after `max_depth` rays; what it would have brought is lost.
//!
//! Whitted, "An improved illumination model for shaded display", CACM 1980; Kajiya, "The rendering equation", 1986.

mod ambient_occlusion;
mod debug;
mod direct;
mod interaction;
mod path;
mod smooth;
mod whitted;

use super::film::FirstHit;
use super::rays::{RayCounts, RayKind};
use super::sampler::Sampler;
use super::settings::{Appearance, RenderSettings};
use super::tiles::PixelRect;
use super::tracer::{Built, Tracer};
use crate::grid::PACKET;
use crate::math::{Hit, Ray};
use crate::scene::camera::Camera;
use crate::scene::description::IntegratorKind;
use glam::{DVec3, Vec3};
use interaction::Interaction;
use smooth::Trail;
pub(super) use smooth::{LightMasks, Probe, Smooth, SmoothPoint};
use whitted::PendingRay;

/// What one camera ray brings back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Linear RGB.
    pub radiance: Vec3,
    /// What the ray hit.
    pub first: FirstHit,
}

/// A thread's means of turning rays into radiance.
pub struct Shader<'a, T> {
    tracer: &'a mut T,
    appearance: &'a Appearance,
    settings: &'a RenderSettings,
    rays: RayCounts,
    pending: Vec<PendingRay>,
    trail: Trail,
}

impl<'a, T: Tracer> Shader<'a, T> {
    /// A shader that asks `tracer`.
    pub fn new(tracer: &'a mut T, appearance: &'a Appearance, settings: &'a RenderSettings) -> Self {
        Self { tracer, appearance, settings, rays: RayCounts::default(), pending: Vec::new(), trail: Trail::default() }
    }

    /// Rays traced so far.
    pub fn rays(&self) -> RayCounts {
        self.rays
    }

    /// Blocks that the tracer has built so far.
    pub fn misses(&self) -> Built {
        self.tracer.misses()
    }

    /// Announces that many of the next camera rays go through a part of the picture.
    pub(super) fn aim(&mut self, camera: &Camera, part: PixelRect) {
        self.tracer.aim(&camera.bundle(part.corners(), self.settings.size));
    }

    /// Traces a ray of `camera` and gathers light by the integrator of the settings.
    pub fn sample(&mut self, camera: &Camera, ray: Ray, sampler: Sampler) -> Sample {
        self.trace(camera, ray, sampler).0
    }

    /// The same of several rays, one after the other; those of a packet are traced together before that.
    pub(super) fn samples(
        &mut self,
        camera: &Camera,
        rays: impl IntoIterator<Item = (Ray, Sampler)>,
        mut take: impl FnMut(Sample),
    ) {
        self.trace_together(camera, rays.into_iter(), |_, sample, _| take(sample));
    }

    fn trace_together(
        &mut self,
        camera: &Camera,
        mut rays: impl Iterator<Item = (Ray, Sampler)>,
        mut take: impl FnMut(&Self, Sample, Option<Interaction<'a>>),
    ) {
        let most = if self.settings.shows_misses() { 1 } else { PACKET };
        loop {
            let (mut packet, mut directions, mut hits) = ([None; PACKET], [DVec3::ZERO; PACKET], [None; PACKET]);
            let mut n = 0;
            for (ray, sampler) in rays.by_ref().take(most) {
                (packet[n], directions[n]) = (Some((ray, sampler)), ray.direction);
                n += 1;
            }
            if n == 0 {
                return;
            }
            let misses_before = self.misses();
            self.tracer.closest_from(camera.eye(), &directions[..n], &mut hits[..n]);
            for ((ray, sampler), hit) in packet.iter().flatten().zip(hits) {
                let (sample, hit) = self.shade(camera, ray, hit, *sampler, misses_before);
                take(self, sample, hit);
            }
        }
    }

    fn trace(&mut self, camera: &Camera, ray: Ray, sampler: Sampler) -> (Sample, Option<Interaction<'a>>) {
        let misses_before = self.misses();
        let hit = self.tracer.closest(&ray);
        self.shade(camera, &ray, hit, sampler, misses_before)
    }

    /// Gathers light along a camera ray, of which it is known what it hits.
    fn shade(
        &mut self,
        camera: &Camera,
        ray: &Ray,
        hit: Option<Hit>,
        sampler: Sampler,
        misses_before: Built,
    ) -> (Sample, Option<Interaction<'a>>) {
        let hit = self.interaction(RayKind::Primary, ray, hit);
        let radiance = match (&hit, self.settings.integrator) {
            (None, _) => self.appearance.background,
            (Some(x), IntegratorKind::Whitted) => self.whitted(x),
            (Some(x), IntegratorKind::Ao) => self.ambient_occlusion(x, sampler),
            (Some(x), IntegratorKind::Path) => self.path(*x, sampler),
            (Some(x), IntegratorKind::Debug(view)) => self.debug_color(view, x, camera, misses_before),
        };
        (Sample { radiance, first: hit.map_or(FirstHit::NONE, |x| x.first_hit(camera)) }, hit)
    }

    fn closest(&mut self, kind: RayKind, ray: &Ray) -> Option<Interaction<'a>> {
        let hit = self.tracer.closest(ray);
        self.interaction(kind, ray, hit)
    }

    /// Takes note of a ray that was traced and makes its hit ready for shading.
    fn interaction(&mut self, kind: RayKind, ray: &Ray, hit: Option<Hit>) -> Option<Interaction<'a>> {
        self.rays.count(kind);
        self.trail.note_hit(hit.as_ref());
        let hit = hit?;
        let point = self.tracer.surface_point(ray, &hit);
        let material = &self.appearance.materials[hit.primitive.mesh.idx()];
        if kind != RayKind::Shadow {
            self.trail.note_cube(material.diffuse.cube_at(point.position));
        }
        Some(Interaction::new(ray, hit, point, material))
    }
}

#[cfg(test)]
mod tests;
