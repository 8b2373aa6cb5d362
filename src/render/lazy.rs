//! The lazy tracer as integrators see it: surface points from the limit surface and the triangle that was hit.
//!
//! # Where rays leave the surface
//! How far along a ray a hit lies is known to single precision of that distance: too little for far cameras. So the
//! position is not taken from the ray but from the triangle, as a weighted sum of its corners in double precision: the
//! camera's distance plays no part. A ray that leaves is told which triangle not to hit; what it could still hit by
//! mistake are that triangle's neighbours. Tests of triangles err by some 2^-21 of the distance from the ray's origin
//! to the edge that is tested (`LatticeRay` has the sums), here the triangle's own size, and by the rounding of world
//! coordinates. A start that is 2^-20 of the triangle's size before it, the **clearance**, and four times that away
//! from its edges is on the right side of every neighbour, those of a concave crease included unless it is sharper than
//! 14 degrees.

use super::tracer::{Built, SurfacePoint, Tracer};
use crate::math::{Hit, OnTriangle, PrimitiveRef, Ray};
use crate::scene::intersect::Intersector;
use crate::scene::world::WorldMesh;
use glam::DVec3;

/// How wrong a triangle's neighbours can seem from a point on it, as a share of its size.
const RELATIVE_ERROR: f64 = 1.0 / (1 << 20) as f64;

/// Steps by which the fraction of a ray's origin in lattice space is rounded, and a little.
const LATTICE_ERROR: f64 = 1.0 / (1 << 22) as f64;

/// What taking a point of world space to the lattice loses, relative to its coordinates.
const WORLD_ERROR: f64 = 8.0 * f64::EPSILON;

/// Distance from the triangle's edges, in clearances.
const EDGE_DISTANCE: f64 = 4.0;

impl Tracer for Intersector<'_> {
    fn surface_point(&mut self, ray: &Ray, hit: &Hit) -> SurfacePoint {
        let mesh = self.world().mesh(hit.primitive.mesh);
        let to_world = mesh.world_from_object_normal();
        let toward_viewer = -ray.direction.normalize();
        let limit = *to_world * self.limit_normal(hit);
        let triangle = *to_world * hit.normal_in_object;
        let geometric_normal = normalized(triangle).or(normalized(limit)).unwrap_or(toward_viewer);
        let shading_normal = match normalized(limit) {
            Some(n) if n.dot(geometric_normal) >= 0.0 => n,
            Some(n) => -n,
            None => geometric_normal,
        };
        let (position, clearance) = start(mesh, &hit.on_triangle, geometric_normal);
        SurfacePoint { position, geometric_normal, shading_normal, clearance }
    }

    fn patch_rate(&self, primitive: &PrimitiveRef) -> u32 {
        let rates = self.world().mesh(primitive.mesh).patch_rates(primitive.patch);
        rates.n_u.max(rates.n_v)
    }

    fn misses(&self) -> Built {
        Built { blocks: self.n_built(), bytes: self.bytes_built() }
    }
}

fn normalized(v: DVec3) -> Option<DVec3> {
    let largest = v.abs().max_element();
    if largest > 0.0 && largest.is_finite() { (v / largest).try_normalize() } else { None }
}

/// Where rays leave a triangle, in world space, and the clearance they need.
fn start(mesh: &WorldMesh, at: &OnTriangle, normal: DVec3) -> (DVec3, f64) {
    let (surface, to_world) = (mesh.surface(), mesh.world_from_object());
    let in_object = at.corners.map(|corner| surface.object_from_lattice(corner.as_dvec3()));
    let [a, b, c] = in_object.map(|corner| to_world.transform_point3(corner));
    let of_world = WORLD_ERROR * a.abs().max(b.abs()).max(c.abs()).max_element();
    let size = at.corners.iter().map(|p| (*p - at.corners[0]).abs().max_element()).fold(0.0, f32::max);
    let of_lattice = RELATIVE_ERROR * f64::from(size) + LATTICE_ERROR;
    // One step, in the worst direction: across the triangle, and along it.
    let m = to_world.matrix3 * surface.lattice().step;
    let across = (m.transpose() * normal).abs().element_sum();
    let along = (m.x_axis.length() + m.y_axis.length() + m.z_axis.length()).max(across);
    let [_, second, third] = off_the_edges([a, b, c], at.weights, EDGE_DISTANCE * (along * of_lattice + of_world));
    (a + second * (b - a) + third * (c - a), across * of_lattice + of_world)
}

/// Weights of the three corners, changed so that the point is that far from every edge, or in the middle between edges
/// where the triangle is too thin.
fn off_the_edges([a, b, c]: [DVec3; 3], [second, third]: [f32; 2], distance: f64) -> [f64; 3] {
    let double_area = (b - a).cross(c - a).length();
    let weights = [1.0 - f64::from(second) - f64::from(third), f64::from(second), f64::from(third)];
    let opposite = [c - b, a - c, b - a].map(DVec3::length);
    let raised: [f64; 3] = std::array::from_fn(|k| {
        // A weight is the distance from the opposite edge over the triangle's height there.
        let least = 2.0 * distance * opposite[k] / double_area;
        weights[k].max(if least < 0.25 { least } else { 0.25 })
    });
    raised.map(|weight| weight / raised.iter().sum::<f64>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::CacheConfig;
    use crate::math::Intersect;
    use crate::scene::rate::DicingRate;
    use crate::scene::world::{GridCache, World};
    use glam::DAffine3;

    /// Faces that are counter-clockwise seen from outside are so in a mirror, too.
    #[test]
    fn normals_of_mirrored_meshes_point_outwards() {
        let shapes = crate::mesh::shapes::all();
        let (_, cube) = &shapes.iter().find(|(name, _)| *name == "cube").expect("a cube");
        for scale in [[2.0, 1.0, 1.0], [-2.0, 1.0, 1.0], [-1.0, -1.0, 3.0], [-1.0, -1.0, -1.0]] {
            let place = DAffine3::from_scale(DVec3::from_array(scale));
            let world = World::new(vec![WorldMesh::new(cube.clone(), place, DicingRate::Fixed(4), 1).unwrap()]);
            let cache = GridCache::new(&world, CacheConfig::with_bytes(1 << 20)).unwrap();
            let mut tracer = Intersector::new(&world, &cache);
            let center = world.meshes()[0].bounds_in_world().center();
            for toward in [DVec3::new(0.3, 0.2, 1.0), DVec3::new(-1.0, 0.1, 0.2), DVec3::new(0.1, -0.8, 0.3)] {
                let ray = Ray::new(center - 50.0 * toward, toward);
                let hit = tracer.closest(&ray).expect("a hit");
                let point = tracer.surface_point(&ray, &hit);
                assert!(
                    point.geometric_normal.dot(toward) < 0.0 && point.shading_normal.dot(toward) < 0.0,
                    "{scale:?}"
                );
            }
        }
    }

    const TRIANGLE: [DVec3; 3] = [DVec3::ZERO, DVec3::new(4.0, 0.0, 0.0), DVec3::new(0.0, 3.0, 0.0)];

    #[test]
    fn weights_inside_stay_and_those_on_edges_move_in() {
        let [_, s, t] = off_the_edges(TRIANGLE, [0.25, 0.25], 1e-3);
        assert!((s - 0.25).abs() < 1e-15 && (t - 0.25).abs() < 1e-15);
        for weights in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.5], [0.5, 0.0], [-1e-3, 0.5]] {
            let w = off_the_edges(TRIANGLE, weights, 1e-3);
            let p = w[1] * TRIANGLE[1] + w[2] * TRIANGLE[2];
            let from_hypotenuse = (12.0 - 3.0 * p.x - 4.0 * p.y) / 5.0;
            assert!(p.x.min(p.y).min(from_hypotenuse) > 1e-3, "{weights:?}: {p}");
        }
    }

    #[test]
    fn triangles_without_area_give_finite_weights() {
        for c in [DVec3::ZERO, DVec3::X] {
            let w = off_the_edges([DVec3::ZERO, DVec3::X, c], [0.5, 0.5], 1e-3);
            assert!((w.iter().sum::<f64>() - 1.0).abs() < 1e-12 && w.iter().all(|w| *w >= 0.0), "{w:?}");
        }
    }
}
