//! The way of a ray into a mesh's lattice space, and a quick look whether it may come near the mesh at all.

use crate::grid::PACKET;
use crate::math::simd::Kernel;
use crate::math::{DBounds, Ray};
use glam::{DAffine3, DVec3};

/// The transform and the box that every ray at a mesh meets first, as four lanes: x, y, z and one to spare.
#[derive(Clone, Copy, Debug)]
pub struct Entrance {
    /// Columns of `lattice_from_world`, the translation last.
    columns: [[f64; 4]; 4],
    /// Low and high corner in lattice units; whatever the spare lane of a ray, it is inside.
    reach: [[f64; 4]; 2],
}

impl Entrance {
    /// For a mesh within `reach`, in lattice units.
    pub fn new(lattice_from_world: &DAffine3, reach: DBounds) -> Self {
        let to = lattice_from_world;
        let [x, y, z] = [to.matrix3.x_axis, to.matrix3.y_axis, to.matrix3.z_axis];
        Self {
            columns: [x, y, z, to.translation].map(|c| [c.x, c.y, c.z, 0.0]),
            reach: [(reach.min, -1.0), (reach.max, 1.0)].map(|(p, spare)| [p.x, p.y, p.z, spare]),
        }
    }

    /// Origin and direction of the ray in lattice space, in lanes 0 to 2: the lengths of t stay.
    #[inline(always)]
    pub fn ray<K: Kernel>(&self, k: K, ray: &Ray) -> [K::D; 2] {
        let [x, y, z, translation] = &self.columns;
        let (x, y, z) = (k.load4(x), k.load4(y), k.load4(z));
        // Components one by one: whoever made the ray has just written them one by one, and a wider load would wait for
        // that.
        let origin = k.add4(turned(k, [x, y, z], ray.origin), k.load4(translation));
        [origin, turned(k, [x, y, z], ray.direction)]
    }

    /// Directions of rays in lattice space, as [`Self::ray`] has them: x, y and z of each.
    #[inline(always)]
    pub fn directions<K: Kernel>(&self, k: K, rays: &[DVec3; PACKET]) -> [[f64; PACKET]; 3] {
        let [x, y, z, _] = &self.columns;
        let columns = [k.load4(x), k.load4(y), k.load4(z)];
        let mut directions = [[0.0; PACKET]; 3];
        for first in (0..PACKET).step_by(4) {
            let [a, b] = [turned(k, columns, rays[first]), turned(k, columns, rays[first + 1])];
            let [c, d] = [turned(k, columns, rays[first + 2]), turned(k, columns, rays[first + 3])];
            let [x, y, z, _] = k.transpose4([a, b, c, d]);
            directions[0][first..first + 4].copy_from_slice(&k.store4(x));
            directions[1][first..first + 4].copy_from_slice(&k.store4(y));
            directions[2][first..first + 4].copy_from_slice(&k.store4(z));
        }
        directions
    }

    /// Whether such a ray comes within reach.
    ///
    /// A ray within a plane of the box gives 0 * infinity on that axis; the comparisons pass over it.
    #[inline(always)]
    pub fn is_in_reach<K: Kernel>(&self, k: K, [origin, direction]: [K::D; 2]) -> bool {
        let inverse = k.div4(k.splat4(1.0), direction);
        let a = k.mul4(k.sub4(k.load4(&self.reach[0]), origin), inverse);
        let b = k.mul4(k.sub4(k.load4(&self.reach[1]), origin), inverse);
        let (low, high) = (k.store4(k.min4(a, b)), k.store4(k.max4(a, b)));
        let enter = later(low[2], later(low[1], later(low[0], 0.0)));
        let leave = sooner(high[2], sooner(high[1], sooner(high[0], f64::INFINITY)));
        enter <= leave * (1.0 + 1e-9)
    }
}

/// The vector in another basis.
#[inline(always)]
fn turned<K: Kernel>(k: K, [x, y, z]: [K::D; 3], v: DVec3) -> K::D {
    let xy = k.add4(k.mul4(x, k.splat4(v.x)), k.mul4(y, k.splat4(v.y)));
    k.add4(xy, k.mul4(z, k.splat4(v.z)))
}

#[inline(always)]
fn later(t: f64, than: f64) -> f64 {
    if t > than { t } else { than }
}

#[inline(always)]
fn sooner(t: f64, than: f64) -> f64 {
    if t < than { t } else { than }
}
