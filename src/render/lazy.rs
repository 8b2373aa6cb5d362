//! The lazy tracer as integrators see it: surface points from the limit surface and the triangle that was hit.

use super::tracer::{SurfacePoint, Tracer};
use crate::math::{Hit, PrimitiveRef, Ray};
use crate::scene::intersect::Intersector;
use crate::scene::world::WorldMesh;
use glam::{DVec3, Vec2};

/// Errors of a hit's distance and of a ray's origin in lattice space, both f32, relative to the distance.
const RELATIVE_ERROR: f64 = 1.0 / (1 << 21) as f64;

/// Lattice steps that rounding to the lattice and f32 arithmetic near it can move a point.
const LATTICE_ERROR: f64 = 4.0;

impl Tracer for Intersector<'_> {
    fn surface_point(&mut self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let mesh = self.world().mesh(hit.primitive.mesh);
        let to_world = mesh.world_from_object_normal();
        let toward_viewer = -ray.direction.normalize();
        let limit = *to_world * self.limit_normal(hit);
        let triangle = *to_world * hit.normal_in_object.as_dvec3();
        let geometric_normal = normalized(triangle).or(normalized(limit)).unwrap_or(toward_viewer);
        let shading_normal = match normalized(limit) {
            Some(n) if n.dot(geometric_normal) >= 0.0 => n,
            Some(n) => -n,
            None => geometric_normal,
        };
        let travelled = f64::from(hit.t) * ray.direction;
        let step = mesh.surface().lattice().step * largest_scale(mesh);
        SurfacePoint {
            position: ray.origin + travelled,
            geometric_normal,
            shading_normal,
            tex_coord: tex_coord(mesh, hit),
            error: RELATIVE_ERROR * travelled.length() + LATTICE_ERROR * step,
        }
    }

    fn patch_rate(&self, primitive: &PrimitiveRef) -> u32 {
        let rates = self.world().mesh(primitive.mesh).patch_rates(primitive.patch);
        rates.n_u.max(rates.n_v)
    }

    fn misses(&self) -> u64 {
        self.n_built()
    }
}

fn normalized(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).try_normalize() } else { None }
}

fn largest_scale(mesh: &WorldMesh) -> f64 {
    let m = mesh.world_from_object().matrix3;
    m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length())
}

/// Bilinear over a quad; over a polygon's sub-quad between its corner, the middles of its sides and its centre.
fn tex_coord(mesh: &WorldMesh, hit: &Hit) -> Option<Vec2> {
    let tex_coords = mesh.tex_coords()?;
    let surface = mesh.surface();
    let (first, n) = surface.face_corners(hit.face);
    let corner = |k: u32| tex_coords.values[tex_coords.indices[(first + k % n) as usize] as usize];
    let quad = if n == 4 {
        [corner(0), corner(1), corner(2), corner(3)]
    } else {
        let center = (0..n).map(corner).sum::<Vec2>() / n as f32;
        let [own, after, before] = [corner(hit.sub), corner(hit.sub + 1), corner(hit.sub + n - 1)];
        [own, 0.5 * (own + after), center, 0.5 * (own + before)]
    };
    let bottom = quad[0].lerp(quad[1], hit.u);
    let top = quad[3].lerp(quad[2], hit.u);
    Some(bottom.lerp(top, hit.v))
}
