//! The skyline of a patch: of what is near all pieces are looked at, what is far is seen as the boxes of the tree over
//! patches.

use super::accel::LeafRef;
use super::builder::{Builder, PatchContext};
use super::pieces::{n_pieces, with_pieces};
use super::world::GridCache;
use crate::cache::{SlotId, Visit};
use crate::grid::{LatticeRay, SeenFrom, SkylineSheet, SkylineView};
use crate::math::Bounds;

/// Patches near one whose pieces are looked at for its skyline, at most.
const MOST_NEAR: usize = 64;

/// Pieces of each of them that are looked at, at most: a larger one is seen as its box.
const MOST_PIECES: usize = 64;

/// What is so far from a patch, as a share of the box around it, is near. Of bigguy's rays at 8 that were asked about,
/// 0.50, 0.58 and 0.63 cleared their skylines with a quarter, a half and the whole, of monsterfrog's 0.40, 0.50 and
/// 0.43 (where more than [`MOST_NEAR`] are near).
const NEAR: f32 = 0.5;

/// A box of several patches is seen as one if it raises the skyline by less than this many of its units. With 4, 16 and
/// 32 of them trex's rays clear 0.60, 0.58 and 0.52, and a skyline takes 90, 83 and 74 µs.
const LEAST_GAIN: f32 = 16.0;

/// Boxes that are opened, at most.
const MOST_OPENED: usize = 1024;

/// What is seen from a patch, on the side to which the ray leaves it, or from one of its parts; `None` if there is no
/// such side.
pub(super) fn view_from(
    of: PatchContext<'_>,
    seen_from: SeenFrom,
    ray: &LatticeRay,
    cache: &GridCache,
    builder: &mut Builder<'_>,
    visit: &Visit<'_>,
) -> Option<SkylineView> {
    let mut bounds = Bounds::EMPTY;
    let sheet = with_pieces(of, None, visit, builder, |pieces| {
        pieces.iter().for_each(|piece| bounds = bounds.union(piece.bounds()));
        SkylineSheet::new(pieces, ray, seen_from)
    });
    let mut sheet = sheet?;
    let table = cache.table(of.id);
    let mut near = leaves_near(of, bounds);
    near.retain(|leaf| {
        let of = PatchContext { patch: leaf.patch, ..of };
        if n_pieces(builder.cells_of(of)) > MOST_PIECES {
            return false;
        }
        let block = visit.peek(visit.root(table, SlotId(leaf.slot)));
        with_pieces(of, block, visit, builder, |pieces| sheet.add(pieces))
    });
    let mut view = sheet.view();
    if !view.is_shut() {
        look_around(of, &near, &mut view);
    }
    Some(view)
}

/// Leaves of other patches near the one within these bounds.
fn leaves_near(of: PatchContext<'_>, own: Bounds) -> Vec<LeafRef> {
    let around = own.expanded(NEAR * (own.max - own.min).max_element());
    let mut near = Vec::new();
    of.mesh.visit_boxes(|leaf, bounds| {
        let is_near = bounds.min.cmple(around.max).all() && bounds.max.cmpge(around.min).all();
        near.extend(leaf.filter(|leaf| is_near && leaf.patch != of.patch && near.len() < MOST_NEAR));
        is_near
    });
    near
}

/// Adds all patches but those that were near.
fn look_around(of: PatchContext<'_>, near: &[LeafRef], view: &mut SkylineView) {
    let mut n_opened = 0;
    let is_near = |leaf: LeafRef| leaf.patch == of.patch || near.iter().any(|near| near.slot == leaf.slot);
    of.mesh.visit_boxes(|leaf, bounds| {
        let sight = view.look(bounds);
        if sight.gain <= 0.0 || leaf.is_some_and(is_near) {
            return false;
        }
        let is_opened = leaf.is_none() && sight.gain >= LEAST_GAIN && n_opened < MOST_OPENED;
        n_opened += usize::from(is_opened);
        if !is_opened {
            view.see(&sight);
        }
        is_opened
    });
}

#[cfg(test)]
mod tests {
    use super::super::intersect::Intersector;
    use super::super::rate::DicingRate;
    use super::super::tessellate::{PatchGrid, triangles};
    use super::super::world::{World, WorldMesh};
    use super::*;
    use crate::cache::CacheConfig;
    use crate::grid::{PartSkyline, SeenFrom, Skyline, TriangleId};
    use crate::ids::{MeshId, PatchId, VertexId};
    use crate::math::simd::{Kernel, Portable, Task, run};
    use crate::math::{Intersect, PrimitiveRef, Ray};
    use crate::mesh::random::random_mesh;
    use crate::mesh::shapes::noise::hash;
    use crate::mesh::{ControlMesh, Crease, shapes};
    use glam::{DAffine3, DVec3, IVec3};

    /// Numbers that look random.
    struct Random(u64);

    impl Random {
        /// Uniform in [0, 1).
        fn unit(&mut self) -> f64 {
            self.0 += 1;
            (hash(self.0, 0, 0) >> 11) as f64 * 2f64.powi(-53)
        }

        fn below(&mut self, n: usize) -> usize {
            (self.unit() * n as f64) as usize
        }

        fn in_cube(&mut self) -> DVec3 {
            DVec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
        }
    }

    /// Whether the skyline of the patch, or of the part, says that a ray meets nothing.
    #[derive(Clone, Copy)]
    struct Cleared {
        patch: [u64; Skyline::WORDS],
        part: Option<[u64; PartSkyline::WORDS]>,
        direction: DVec3,
        cell: [u16; 2],
        lift: f32,
    }

    impl Task for Cleared {
        type Output = [bool; 2];

        #[inline(always)]
        fn run<K: Kernel>(self, k: K) -> [bool; 2] {
            let Self { patch, part, direction: DVec3 { x, y, z }, cell, lift } = self;
            let direction = k.load4(&[x, y, z, 0.0]);
            let by_part = match part {
                Some(part) => PartSkyline::is_cleared_by(k, direction, cell, lift, |word| part[word]),
                None => false,
            };
            [Skyline::is_cleared_by(k, direction, cell, lift, |word| patch[word]), by_part]
        }
    }

    /// What was tried: rays, those that were cleared by the skyline of the patch and by that of the part, and those
    /// that met nothing.
    #[derive(Default, Debug)]
    struct Tally {
        n: usize,
        cleared: [usize; 2],
        open: usize,
    }

    /// Asks for skylines of some of the mesh's patches, and traces rays that leave them.
    fn leave(name: &str, mesh: ControlMesh, rate: DicingRate, random: &mut Random, tally: &mut Tally) {
        let turned = DAffine3::from_rotation_y(0.4) * DAffine3::from_scale(DVec3::splat(30.0));
        let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let place = [DAffine3::IDENTITY, turned, mirrored][random.below(3)];
        let world = World::new(vec![WorldMesh::new(mesh, place, rate, 1).unwrap()]);
        let cache = GridCache::new(&world, CacheConfig::with_bytes(16 << 20)).unwrap();
        let mesh = &world.meshes()[0];
        let patches: Vec<PatchId> = mesh.surface().visible_patches().collect();
        for _ in 0..4.min(patches.len()) {
            let patch = patches[random.below(patches.len())];
            let rates = mesh.patch_rates(patch);
            if rates.n_u.max(rates.n_v) > 32 {
                continue;
            }
            let of = PatchContext { id: MeshId(0), mesh, patch };
            let mut grid = PatchGrid::default();
            grid.dice(mesh, patch, &rates);
            let all: Vec<[DVec3; 3]> =
                triangles(&rates).map(|t| t.map(|v| IVec3::from_array(grid.vertices[v]).as_dvec3())).collect();
            for side in [1.0, -1.0] {
                let mut found = None;
                let mut of_parts: [Option<PartSkyline>; 16] = [None; 16];
                for _ in 0..150 {
                    let k = random.below(all.len());
                    let [a, b, c] = all[k];
                    let normal = side * (b - a).cross(c - a).normalize_or_zero();
                    if normal == DVec3::ZERO {
                        continue;
                    }
                    let cell = k / 2;
                    let [i, j] = [cell % rates.n_u as usize, cell / rates.n_u as usize];
                    let half = (k % 2) as u32;
                    let direction = random.in_cube() + random.below(3) as f64 * normal;
                    let direction = direction * direction.dot(normal).signum();
                    let view = |seen_from| {
                        let id = TriangleId::new(patch, i as u32, j as u32, half);
                        let ray = LatticeRay::new(a, direction, f32::INFINITY, id);
                        let (mut builder, mut pin) = (Builder::default(), cache.segments().pin());
                        view_from(of, seen_from, &ray, &cache, &mut builder, &pin.visit())
                    };
                    // From what a renderer's rays start above to the most that is allowed for.
                    let lift = 2f64.powf(-8.0 + 27.0 * random.unit());
                    let skyline = *found
                        .get_or_insert_with(|| view(SeenFrom::Patch).map_or(Skyline::NONE, |view| view.skyline()));
                    let cell = [i as u16, j as u16];
                    let number = skyline.part(cell) as usize;
                    let of_part = of_parts[number].or_else(|| {
                        let seen_from = SeenFrom::Part { number, lift: 4.0 * lift as f32 };
                        view(seen_from).map(|view| view.part_skyline())
                    });
                    of_parts[number] = of_part;
                    let (u, v) = (random.unit(), random.unit());
                    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
                    // Off the edges: above the surface, not where it is not known what is above.
                    let (u, v) = (0.01 + 0.97 * u, 0.01 + 0.97 * v);
                    let origin = a + u * (b - a) + v * (c - a) + lift * normal;
                    let (words, part) = (skyline.to_words(), of_part.map(PartSkyline::to_words));
                    let ask = Cleared { patch: words, part, direction, cell, lift: 1.001 * lift as f32 };
                    let lattice_from_world = mesh.lattice_from_world().inverse();
                    let from = PrimitiveRef { mesh: MeshId(0), patch, cell, half: half as u8 };
                    let ray = Ray::new(
                        lattice_from_world.transform_point3(origin),
                        lattice_from_world.transform_vector3(direction),
                    );
                    let are_cleared = run(ask);
                    assert_eq!(ask.run(Portable), are_cleared, "kernels agree");
                    assert_eq!(
                        run(Cleared { lift: f32::INFINITY, ..ask }),
                        [false; 2],
                        "no lift is allowed for as large"
                    );
                    let hit = Intersector::new(&world, &cache).closest(&Ray { from: Some(from), ..ray });
                    assert!(
                        are_cleared == [false; 2] || hit.is_none(),
                        "{name}, {rate:?}, {patch}, {cell:?}, {are_cleared:?}: {ray:?} meets {hit:?}"
                    );
                    tally.n += 1;
                    (0..2).for_each(|by| tally.cleared[by] += usize::from(are_cleared[by]));
                    tally.open += usize::from(hit.is_none());
                }
            }
        }
    }

    /// A sheet with sharp valleys and ridges.
    fn folded(height: f64) -> ControlMesh {
        const N: u32 = 8;
        let mut mesh = shapes::plane(N, 6);
        for (k, p) in mesh.positions.iter_mut().enumerate() {
            p.y = height * f64::from(k as u32 % (N + 1) % 2);
        }
        let edges = (0..6 * (N + 1)).map(|v| [v, v + N + 1].map(VertexId));
        mesh.creases = edges.map(|edge| Crease { edge, sharpness: f32::INFINITY }).collect();
        mesh
    }

    #[test]
    fn rays_above_a_skyline_meet_nothing() {
        let (mut random, mut tally) = (Random(0x5c1_11e5), Tally::default());
        for k in 0..30 {
            let rate = DicingRate::Fixed([4, 8, 16][k % 3]);
            leave("folded", folded(0.1 * k as f64), rate, &mut random, &mut tally);
        }
        for (name, mesh) in shapes::all() {
            for rate in [3, 8, 19].map(DicingRate::Fixed) {
                leave(name, mesh.clone(), rate, &mut random, &mut tally);
            }
            leave(name, mesh.clone(), DicingRate::Random(7), &mut random, &mut tally);
        }
        for seed in 0..60 {
            leave("random", random_mesh(seed), DicingRate::Fixed(1 + seed as u32 % 12), &mut random, &mut tally);
        }
        assert!(tally.cleared[0] > tally.open / 15 && tally.cleared[1] > tally.open / 4, "{tally:?}");
    }
}
