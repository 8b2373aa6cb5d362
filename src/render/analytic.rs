//! A tracer for tests whose answers are known in closed form: spheres and one-sided floors, each a mesh of one patch.

use super::tracer::{Built, SurfacePoint, Tracer};
use crate::ids::{FaceId, MeshId, PatchId};
use crate::math::{Hit, Intersect, OnTriangle, PrimitiveRef, Ray};
use glam::DVec3;

/// A surface with a formula.
#[derive(Clone, Copy)]
pub enum Shape {
    /// Centre and radius; a negative radius turns the normal inwards.
    Sphere(DVec3, f64),
    /// The plane at this height, facing up.
    Floor(f64),
}

/// `MeshId(i)` is `shapes[i]`.
#[derive(Clone)]
pub struct AnalyticTracer {
    pub shapes: Vec<Shape>,
}

impl Shape {
    /// Nearest parameter t > `start` at which the ray meets the surface.
    fn meet(self, ray: &Ray, start: f64) -> Option<f64> {
        match self {
            Self::Floor(y) => Some((y - ray.origin.y) / ray.direction.y).filter(|&t| t > start),
            Self::Sphere(centre, radius) => {
                let (o, d) = (ray.origin - centre, ray.direction);
                let (a, b, c) = (d.length_squared(), o.dot(d), o.length_squared() - radius * radius);
                let root = (b * b - a * c).max(-0.0).sqrt();
                let missed = b * b < a * c;
                [(-b - root) / a, (-b + root) / a].into_iter().find(|&t| !missed && t > start)
            }
        }
    }

    fn normal(self, position: DVec3) -> DVec3 {
        match self {
            Self::Floor(_) => DVec3::Y,
            Self::Sphere(centre, radius) => (position - centre) / radius,
        }
    }
}

impl Intersect for AnalyticTracer {
    fn closest(&mut self, ray: &Ray) -> Option<Hit> {
        let meet = |(i, shape): (usize, &Shape)| {
            // A curved surface may meet again the ray that leaves it, but not near where it left.
            let from = ray.from.is_some_and(|p| p.mesh.idx() == i);
            shape.meet(ray, if from { 1e-7 } else { 0.0 }).map(|t| (i, t))
        };
        let nearest = self.shapes.iter().enumerate().filter_map(meet).min_by(|a, b| a.1.total_cmp(&b.1));
        let (i, t) = nearest.filter(|&(_, t)| t <= f64::from(ray.t_max))?;
        let primitive = PrimitiveRef { mesh: MeshId::from(i), patch: PatchId(0), cell: [0; 2], half: 0 };
        let normal_in_object = self.shapes[i].normal(ray.origin + t * ray.direction);
        let (face, on_triangle) = (FaceId(0), OnTriangle::default());
        Some(Hit { t: t as f32, primitive, face, sub: 0, u: 0.5, v: 0.5, normal_in_object, on_triangle })
    }

    fn occluded(&mut self, ray: &Ray) -> bool {
        self.closest(ray).is_some()
    }
}

impl Tracer for AnalyticTracer {
    fn surface_point(&mut self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let shape = self.shapes[hit.primitive.mesh.idx()];
        let start = if ray.from.is_some() { 1e-7 } else { 0.0 };
        let t = shape.meet(ray, start).unwrap_or(f64::from(hit.t));
        let position = ray.origin + t * ray.direction;
        let normal = shape.normal(position).normalize();
        SurfacePoint { position, geometric_normal: normal, shading_normal: normal, clearance: 1e-9 }
    }

    fn patch_rate(&self, _: &PrimitiveRef) -> u32 {
        64
    }

    fn misses(&self) -> Built {
        Built::default()
    }
}
