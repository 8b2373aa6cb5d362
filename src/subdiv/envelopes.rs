//! Boxes and plates of patches and of parts that are not tessellated: they hold every lattice vertex that dicing would
//! give.

use super::bounds::{AskedGrid, GridExtents};
use super::dice::{Dicer, LATTICE_SHIFT};
use super::extent::{AskedPart, Extent, PartExtent};
use super::rates::{PatchRates, snapped};
use super::regular::MOST_PARTS;
use super::surface::Surface;
use crate::ids::PatchId;
use crate::math::simd::{self, Kernel, Task};
use crate::math::{Bounds, Envelope, Plate};
use glam::Vec3;

/// Equal parts of a patch's cells, side by side.
#[derive(Clone, Copy, Debug)]
pub struct EqualParts {
    /// The first cell along u and v.
    pub from: [u32; 2],
    /// Parts along u and v.
    pub n: [u32; 2],
    /// Cells along a side of each.
    pub side: u32,
}

/// Cells of a patch of which is asked what holds them.
#[derive(Clone, Copy, Debug)]
pub struct AskedCells<'a> {
    /// Of the patch.
    pub rates: &'a PatchRates,
    /// Columns, from the first to before the last.
    pub i: [u32; 2],
    /// Rows.
    pub j: [u32; 2],
    /// Splits towards irregular corners: more of them make it tighter.
    pub depth: u32,
}

impl AskedCells<'_> {
    /// Their parameters along u and v.
    fn ranges(&self) -> [[f64; 2]; 2] {
        [range(self.i, self.rates.n_u), range(self.j, self.rates.n_v)]
    }
}

impl Dicer {
    /// What holds every lattice vertex [`dice`](Self::dice) would give for these cells, without dicing. The plate is
    /// across the normal in the middle of the cells.
    pub fn envelope(&mut self, surface: &Surface, patch: PatchId, cells: AskedCells<'_>) -> Envelope {
        let lane = self.load(surface, patch);
        let [u, v] = cells.ranges();
        let normal = surface.normal_of_part(&mut self.points[lane], &mut self.evaluator, u, v);
        in_lattice(normal, &self.extent(surface, patch, cells, normal))
    }

    /// The box of [`envelope`](Self::envelope) alone.
    pub fn bounds(&mut self, surface: &Surface, patch: PatchId, cells: AskedCells<'_>) -> Bounds {
        to_lattice_box(&self.extent(surface, patch, cells, [0; 3]))
    }

    /// How far cells reach, and how high along a normal, where sides move their vertices to, too.
    fn extent(&mut self, surface: &Surface, patch: PatchId, cells: AskedCells<'_>, normal: [i8; 3]) -> Extent {
        let AskedCells { rates, i, j, depth } = cells;
        let lane = self.load(surface, patch);
        let points = &mut self.points[lane];
        let mut extent =
            surface.extent(points, &mut self.evaluator, AskedPart { range: cells.ranges(), normal, depth });
        let snap = |[a, b]: [u32; 2], n: u32, r: u32| range([snapped(a, n, r), snapped(b, n, r)], r);
        for side in 0..4 {
            let (touches, n, along) = match side {
                0 => (j[0] == 0, rates.n_u, i),
                1 => (i[1] == rates.n_u, rates.n_v, j),
                2 => (j[1] == rates.n_v, rates.n_u, i),
                _ => (i[0] == 0, rates.n_v, j),
            };
            let rate = rates.sides[side];
            let (own, t) = (range(along, n), snap(along, n, rate));
            // What of the side lies within the cells' own parameters is in their box already.
            if touches && (t[0] < own[0] || t[1] > own[1]) {
                let t = [if t[0] < own[0] { t[0] } else { own[1] }, if t[1] > own[1] { t[1] } else { own[0] }];
                let range = match side {
                    0 => [t, [0.0; 2]],
                    1 => [[1.0; 2], t],
                    2 => [t, [1.0; 2]],
                    _ => [[0.0; 2], t],
                };
                let asked = AskedPart { range, normal, depth };
                extent = extent.union(surface.extent(points, &mut self.evaluator, asked));
            }
        }
        extent
    }

    /// Appends the [envelopes](Self::envelope) of equal parts, if they can be found together: where a square of two or
    /// four parts a side has no side that is coarser than its cells. Returns whether that is so.
    pub fn envelopes_of_parts(
        &mut self,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        parts: EqualParts,
        depth: u32,
        out: &mut Vec<Envelope>,
    ) -> bool {
        let EqualParts { from, n, side } = parts;
        let cells = [rates.n_u, rates.n_v];
        let is_plain = (0..4).all(|k| rates.sides[k] == cells[k % 2]);
        let is_whole = (0..2).all(|k| from[k] + n[k] * side <= cells[k]);
        if !is_plain || !is_whole || n[0] != n[1] || ![2, 4].contains(&n[0]) {
            return false;
        }
        let lane = self.load(surface, patch);
        let rectangle = [0, 1].map(|k| range([from[k], from[k] + n[k] * side], cells[k]));
        let asked = AskedGrid { range: rectangle, side: n[0] as usize, depth };
        let mut extents = [PartExtent::EMPTY; MOST_PARTS * MOST_PARTS];
        if !surface.grid_of_parts(&mut self.points[lane], &mut self.evaluator, asked, &mut extents) {
            return false;
        }
        simd::run(LatticeEnvelopes { extents: &extents, n: asked.side, out });
        true
    }

    /// As [`envelope`](Self::envelope) for a whole patch at any rates.
    pub fn patch_envelope(&mut self, surface: &Surface, patch: PatchId, depth: u32) -> Envelope {
        let lane = self.load(surface, patch);
        let (points, evaluator, whole) = (&mut self.points[lane], &mut self.evaluator, [0.0, 1.0]);
        let normal = surface.normal_of_part(points, evaluator, whole, whole);
        in_lattice(normal, &surface.extent(points, evaluator, AskedPart::whole(normal, depth)))
    }
}

/// The parameters of cells.
fn range([a, b]: [u32; 2], n: u32) -> [f64; 2] {
    [f64::from(a) / f64::from(n), f64::from(b) / f64::from(n)]
}

/// What vertices of a surface that reaches so far lie in.
fn in_lattice(normal: [i8; 3], extent: &Extent) -> Envelope {
    Envelope { bounds: to_lattice_box(extent), plate: to_lattice_plate(normal, extent) }
}

/// Appends what vertices of `n` x `n` parts lie in.
struct LatticeEnvelopes<'a> {
    extents: &'a GridExtents,
    n: usize,
    out: &'a mut Vec<Envelope>,
}

impl Task for LatticeEnvelopes<'_> {
    type Output = ();
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) {
        let Self { extents, n, out } = self;
        for row in extents.chunks_exact(MOST_PARTS).take(n) {
            for PartExtent { extent, normal } in &row[..n] {
                let bounds = LatticeBox { extent }.run(k);
                out.push(Envelope { bounds, plate: to_lattice_plate(*normal, extent) });
            }
        }
    }
}

/// By how much rounding moves a coordinate at most, and a little for evaluation errors.
const ROUNDED: f64 = 0.51;

/// Rounds outwards to lattice points, by what rounding a vertex can move it and a little for evaluation errors. The
/// result is exact in f32, since lattice coordinates stay below 2^24.
fn to_lattice_box(extent: &Extent) -> Bounds {
    simd::run(LatticeBox { extent })
}

struct LatticeBox<'a> {
    extent: &'a Extent,
}

impl Task for LatticeBox<'_> {
    type Output = Bounds;
    #[inline(always)]
    fn run<K: Kernel>(self, k: K) -> Bounds {
        let Extent { low, high } = self.extent;
        let low = k.add4(k.load4(&low.0), k.splat4(LATTICE_SHIFT - ROUNDED));
        // What is to be rounded up is rounded down beyond zero.
        let high = k.sub4(k.sub4(k.splat4(-0.0), k.load4(&high.0)), k.splat4(LATTICE_SHIFT + ROUNDED));
        let (low, high) = (k.store4(k.floor4(low)), k.store4(k.floor4(high)));
        Bounds {
            min: Vec3::new(low[0] as f32, low[1] as f32, low[2] as f32),
            max: Vec3::new(-high[0] as f32, -high[1] as f32, -high[2] as f32),
        }
    }
}

/// The plate of what reaches so far, for vertices.
#[inline(always)]
fn to_lattice_plate(normal: [i8; 3], extent: &Extent) -> Plate {
    let [x, y, z] = [i32::from(normal[0]), i32::from(normal[1]), i32::from(normal[2])];
    let (shift, moved) = (LATTICE_SHIFT * f64::from(x + y + z), ROUNDED * f64::from(x.abs() + y.abs() + z.abs()));
    Plate::around(normal, extent.low.0[3] + shift - moved, extent.high.0[3] + shift + moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::LatticeGrid;
    use crate::mesh::random::random_mesh;
    use crate::mesh::{ControlMesh, shapes};
    use crate::subdiv::refine::tests::edits::{edited_cube, edited_tetrahedron};
    use glam::DVec3;

    fn meshes() -> impl Iterator<Item = ControlMesh> {
        let shapes = shapes::all().into_iter().map(|(_, mesh)| mesh);
        shapes.chain([edited_cube(), edited_tetrahedron()]).chain((0..60).map(random_mesh))
    }

    /// Boxes and plates of whole patches hold what is diced at any rate, and parts' boxes what of it is theirs.
    #[test]
    fn what_is_diced_lies_in_boxes_and_plates() {
        let (mut dicer, mut n) = (Dicer::default(), 0);
        for mesh in meshes() {
            let surface = Surface::new(&mesh, 1).unwrap();
            for patch in surface.visible_patches() {
                let whole = dicer.patch_envelope(&surface, patch, 3);
                let rates = surface.uniform_rates(patch, 1 + patch.0 % 9);
                let cells = [[0, rates.n_u], [0, rates.n_v]];
                n += check(&mut dicer, &surface, patch, &rates, cells, whole);
                assert_eq!(whole, dicer.patch_envelope(&surface, patch, 3));
                let part = AskedCells { rates: &rates, i: cells[0], j: cells[1], depth: 0 };
                let part = dicer.envelope(&surface, patch, part);
                check(&mut dicer, &surface, patch, &rates, cells, part);
            }
        }
        assert!(n > 30_000, "{n} vertices");
    }

    /// Checks that the vertices of these cells lie in the envelope; returns how many there are.
    fn check(
        dicer: &mut Dicer,
        surface: &Surface,
        patch: PatchId,
        rates: &PatchRates,
        cells: [[u32; 2]; 2],
        e: Envelope,
    ) -> usize {
        let mut grid = LatticeGrid::default();
        dicer.dice(surface, patch, rates, cells[0], cells[1], &mut grid);
        for p in grid.points().map(|p| DVec3::from_array(p.map(f64::from))) {
            let (height, b) = (Plate::height(e.plate.normal, p), e.bounds);
            assert!((f64::from(e.plate.low)..=f64::from(e.plate.high)).contains(&height), "{patch:?} {cells:?} {e:?}");
            assert!((b.min.as_dvec3().cmple(p) & p.cmple(b.max.as_dvec3())).all(), "{patch:?} {cells:?} {e:?} {p}");
        }
        grid.points().count()
    }

    /// Parts alone, at sides that move their vertices, and parts that are found together, each by its own normal.
    #[test]
    fn what_is_diced_of_parts_lies_in_their_envelopes() {
        let (mut dicer, mut together, mut n, mut n_without) = (Dicer::default(), Vec::new(), [0; 2], 0);
        for mesh in meshes() {
            let surface = Surface::new(&mesh, 1).unwrap();
            for patch in surface.visible_patches() {
                let rates = PatchRates::new([0, 1, 2, 3].map(|side| [8, 3, 1, 5][(patch.idx() / (side + 1)) % 4]), 1);
                let cut = |n: u32| [[0, n.div_ceil(2)], [n / 2, n]];
                for (i, j) in cut(rates.n_u).into_iter().flat_map(|i| cut(rates.n_v).map(|j| (i, j))) {
                    let alone = dicer.envelope(&surface, patch, AskedCells { rates: &rates, i, j, depth: 2 });
                    check(&mut dicer, &surface, patch, &rates, [i, j], alone);
                    n[0] += 1;
                }
                let rates = PatchRates::new([8; 4], 1);
                for side in [4, 2] {
                    together.clear();
                    let children = 8 / side;
                    let parts = EqualParts { from: [0, 0], n: [children; 2], side };
                    if !dicer.envelopes_of_parts(&surface, patch, &rates, parts, 2, &mut together) {
                        continue;
                    }
                    for (part, e) in (0..).zip(&together) {
                        let cells = [part % children, part / children].map(|k| [side * k, side * (k + 1)]);
                        check(&mut dicer, &surface, patch, &rates, cells, *e);
                        n_without += usize::from(e.plate.normal == [0; 3]);
                        n[1] += 1;
                    }
                }
            }
        }
        assert!(n[0] > 5_000 && n[1] > 20_000 && 20 * n_without < n[1], "{n:?} parts, {n_without} without a normal");
    }

    /// A plane that is no axis's: its patches are as thick as rounding makes them, and their boxes are cubes.
    #[test]
    fn plates_of_a_plane_are_thin() {
        let at = |k: usize| DVec3::new((k % 6) as f64, (k / 6) as f64, 0.0);
        let turned = |p: DVec3| glam::DQuat::from_axis_angle(DVec3::new(1.0, 2.0, 0.5).normalize(), 0.8) * p;
        let faces: Vec<Vec<u32>> = (0..25).map(|k| k / 5 * 6 + k % 5).map(|a| vec![a, a + 1, a + 7, a + 6]).collect();
        let mesh = ControlMesh::from_polygons((0..36).map(at).map(turned).collect(), &faces).unwrap();
        let surface = Surface::new(&mesh, 1).unwrap();
        for patch in surface.visible_patches() {
            let Envelope { bounds, plate } = Dicer::default().patch_envelope(&surface, patch, 3);
            // Normals are rounded to a hundredth.
            let width = Plate::height(plate.normal.map(i8::abs), (bounds.max - bounds.min).as_dvec3());
            let thickness = f64::from(plate.high - plate.low);
            assert!(0.0 < thickness && thickness < 0.02 * width, "{patch:?}: {thickness} of {width}");
        }
    }
}
