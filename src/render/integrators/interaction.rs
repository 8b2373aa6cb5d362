//! A hit made ready for shading.

use crate::math::{Hit, Ray};
use crate::render::film::FirstHit;
use crate::render::tracer::SurfacePoint;
use crate::scene::camera::Camera;
use crate::scene::description::Material;
use crate::scene::material::Interface;
use glam::{DVec3, Vec3};

/// A ray and the surface it met, with normals turned towards the ray's origin.
#[derive(Clone, Copy)]
pub(super) struct Interaction<'a> {
    pub hit: Hit,
    pub point: SurfacePoint,
    pub material: &'a Material,
    /// Unit vector back along the ray.
    pub to_eye: DVec3,
    /// Unit normal of the triangle on the ray's side.
    pub geometric_normal: DVec3,
    /// Unit normal of the limit surface on the same side of the triangle.
    pub normal: DVec3,
    /// Whether the ray came from outside of the body.
    pub outside: bool,
}

impl<'a> Interaction<'a> {
    pub fn new(ray: &Ray, hit: Hit, point: SurfacePoint, material: &'a Material) -> Self {
        let to_eye = -ray.direction.normalize();
        let outside = to_eye.dot(point.geometric_normal) >= 0.0;
        let geometric_normal = if outside { point.geometric_normal } else { -point.geometric_normal };
        let same_side = point.shading_normal.dot(geometric_normal) >= 0.0;
        let normal = if same_side { point.shading_normal } else { -point.shading_normal };
        Self { hit, point, material, to_eye, geometric_normal, normal, outside }
    }

    /// Diffuse albedo at the point.
    pub fn albedo(&self) -> Vec3 {
        self.material.diffuse.at(self.point.position)
    }

    /// A ray that leaves the surface along `direction`.
    pub fn leaving(&self, direction: DVec3) -> Ray {
        let side =
            if direction.dot(self.geometric_normal) >= 0.0 { self.point.clearance } else { -self.point.clearance };
        let origin = self.point.position + side * self.geometric_normal;
        // A triangle without area has no normal that the origin could have been moved along.
        let has_normal = self.hit.normal_in_object != DVec3::ZERO;
        let above = has_normal.then_some(self.point.clearance as f32);
        Ray { from: Some(self.hit.primitive), above, ..Ray::new(origin, direction) }
    }

    /// Whether `direction` leaves to the side that the ray came from.
    pub fn is_above(&self, direction: DVec3) -> bool {
        direction.dot(self.geometric_normal) > 0.0
    }

    /// The mirrored direction. Near silhouettes the limit normal may mirror into the triangle; the triangle's own
    /// normal is used then.
    pub fn mirrored(&self) -> DVec3 {
        let about = |normal: DVec3| 2.0 * self.to_eye.dot(normal) * normal - self.to_eye;
        let direction = about(self.normal);
        if self.is_above(direction) { direction } else { about(self.geometric_normal) }
    }

    /// The surface as a boundary between clear media, `ior` being that of the body relative to its surroundings.
    pub fn interface(&self, ior: f32) -> Interface {
        let eta = if self.outside { f64::from(ior) } else { 1.0 / f64::from(ior) };
        // A limit normal that faces away from the ray is as good as edge-on.
        let normal = if self.normal.dot(self.to_eye) > 0.0 { self.normal } else { self.geometric_normal };
        let interface = Interface::new(-self.to_eye, normal, eta);
        // Likewise a refracted ray has to leave to the far side of the triangle.
        match interface.refracted {
            Some(direction) if self.is_above(direction) => Interface::new(-self.to_eye, self.geometric_normal, eta),
            _ => interface,
        }
    }

    /// What a film wants to know of a camera ray's hit.
    pub fn first_hit(&self, camera: &Camera) -> FirstHit {
        FirstHit {
            depth: (self.point.position - camera.eye()).dot(camera.forward()) as f32,
            normal: self.point.shading_normal.as_vec3().to_array(),
            mesh: self.hit.primitive.mesh.0,
            patch: self.hit.primitive.patch.0,
            uv: [self.hit.u, self.hit.v],
        }
    }
}
