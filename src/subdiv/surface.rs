//! One mesh ready for evaluation: topology, control points in lattice units, and the plan of every face.

use super::bounds::{AskedGrid, GridExtents};
use super::edits::{EditSites, EditTree, EditedPatches, control_positions};
use super::eval::{Evaluator, Point, SampleKind, SurfaceSample, sample_regular};
use super::extent::{AskedPart, Extent, with_heights};
use super::kinds::plan_faces;
use super::local::RingWalker;
use super::parts::{Parts, across};
use super::plan::{NodeId, PlanLibrary};
use super::regular::ControlPoints;
use super::route::RouteWalker;
use super::rows::Width;
use super::rules::RuleSet;
use crate::error::Result;
use crate::ids::{FaceId, PatchId};
use crate::math::{DBounds, Plate, PointGrid};
use crate::mesh::ControlMesh;
use crate::topology::{FaceIndex, HalfEdges, Topology};
use glam::DVec3;
use std::sync::atomic::{AtomicU64, Ordering};

/// The integer grid that tessellated vertices are rounded to: `object = center + step * lattice`.
///
/// The step is a power of two and no control point is further than 2^22 steps from the centre, so that lattice points
/// are exact in f32, and rounding moves a vertex by less than 2^-22 of the mesh's half extent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lattice {
    /// Centre of the mesh in object space.
    pub center: DVec3,
    /// Size of a lattice cell in object space.
    pub step: f64,
}

impl Lattice {
    /// Largest lattice coordinate of a control point, as a power of two.
    const BITS: i32 = 22;

    /// The lattice for a mesh with these bounds.
    pub fn new(bounds: DBounds) -> Self {
        if bounds.is_empty() {
            return Self { center: DVec3::ZERO, step: 1.0 };
        }
        let center = bounds.center();
        let half = (bounds.max - center).max_element().max((center - bounds.min).max_element());
        // Where all vertices coincide, the unit is what f64 can tell apart there.
        let half = half.max(center.abs().max_element() * f64::EPSILON).max(1e-290);
        let exponent = half.log2().ceil() as i32 - Self::BITS;
        Self { center, step: 2f64.powi(exponent) }
    }

    /// From object space.
    pub fn from_object(&self, p: DVec3) -> DVec3 {
        (p - self.center) / self.step
    }

    /// To object space.
    pub fn to_object(&self, p: DVec3) -> DVec3 {
        self.center + self.step * p
    }
}

/// The plan of a quad whose ring is 3 x 3 quads without any tag.
pub(super) const REGULAR: NodeId = NodeId(u32::MAX);

/// In place of the plan of a face under hierarchical edits.
pub(super) const EDITED: NodeId = NodeId(u32::MAX - 1);

/// A mesh whose limit surface can be evaluated.
#[derive(Debug)]
pub struct Surface {
    /// Tells surfaces apart, so that nobody takes remembered points of one for another's.
    id: u64,
    topology: Topology,
    lattice: Lattice,
    control: Vec<[f32; 3]>,
    plans: PlanLibrary,
    plan_of_face: Vec<NodeId>,
    /// The patches of each face; `None` if every face is one patch.
    faces_of_patches: Option<FaceIndex>,
    edited: EditedPatches,
}

/// The points that decide one patch.
#[derive(Debug)]
pub struct PatchPoints {
    /// The surface and the patch.
    of: Option<(u64, PatchId)>,
    node: NodeId,
    control: ControlPoints,
    parts: Parts,
    /// The last polygon, and the points of its ring and refinement.
    polygon_face: Option<(u64, FaceId)>,
    polygon: Vec<Point>,
    walker: Walker,
}

/// Finds a ring's vertices.
#[derive(Debug, Default)]
struct Walker {
    by_route: RouteWalker,
    by_faces: RingWalker,
}

impl Walker {
    /// The vertices of the ring of the face of `first`, where its node's corner 0 lies.
    fn ring(&mut self, surface: &Surface, node: NodeId, first: u32) -> &[u32] {
        let (topology, store, route) = (&surface.topology, surface.plans.rows(), surface.plans.route(node));
        if route.is_empty() {
            return self.by_faces.sources(topology, first);
        }
        match store.widths() {
            Width::Narrow(indices) => self.by_route.follow(topology, first, store.list(route, indices)),
            Width::Wide(indices) => self.by_route.follow(topology, first, store.list(route, indices)),
        }
    }
}

impl PatchPoints {
    /// The control points, if the patch is regular.
    fn regular_control(&self) -> Option<&ControlPoints> {
        match self.node {
            REGULAR => Some(&self.control),
            EDITED => None,
            _ => self.parts.control(0),
        }
    }
}

impl Default for PatchPoints {
    fn default() -> Self {
        Self {
            of: None,
            node: REGULAR,
            control: [Point::ZERO; 16],
            parts: Parts::default(),
            polygon_face: None,
            polygon: Vec::new(),
            walker: Walker::default(),
        }
    }
}

static SURFACES: AtomicU64 = AtomicU64::new(0);

impl Surface {
    /// Prepares a mesh, on `n_threads` threads.
    pub fn new(mesh: &ControlMesh, n_threads: usize) -> Result<Self> {
        Self::prepare(mesh, n_threads, &|_| Ok(()))
    }

    /// As [`new`](Self::new); `planned` is told now and then which share of the plans is made, and ends it by an error:
    /// nobody can tell before how much memory they take.
    pub fn prepare(mesh: &ControlMesh, n_threads: usize, planned: &dyn Fn(f64) -> Result<()>) -> Result<Self> {
        let n_threads = n_threads.max(1);
        let topology = Topology::new(mesh, n_threads);
        let rules = RuleSet { crease_method: mesh.crease_method, triangles: mesh.triangles };
        let sites = EditSites::new(&mesh.edits, &topology);
        let (plans, plan_of_face) = plan_faces(&topology, rules, n_threads, &sites, planned)?;
        let n_patches = |n: u32| if n == 4 { 1 } else { n };
        let patches = || FaceIndex::mixed(mesh.face_sizes.iter().map(|&n| n_patches(n)));
        let faces_of_patches = (!topology.all_quads()).then(patches);
        let lattice = Lattice { center: DVec3::ZERO, step: 1.0 };
        let (control, edited) = (Vec::new(), EditedPatches::default());
        let id = SURFACES.fetch_add(1, Ordering::Relaxed);
        let mut surface = Self { id, topology, lattice, control, plans, plan_of_face, faces_of_patches, edited };
        surface.place(mesh, &sites)?;
        surface.plans.seal();
        Ok(surface)
    }

    /// Chooses the lattice and puts control points and edits on it.
    fn place(&mut self, mesh: &ControlMesh, sites: &EditSites) -> Result<()> {
        let positions = control_positions(mesh);
        let mut bounds: DBounds = mesh.face_vertices.iter().map(|v| positions[v.idx()]).collect();
        if !sites.is_empty() {
            // Where edits lead is known once they have been made, in object space for now.
            let point = |v: u32| point(positions[v as usize]);
            bounds = bounds.union(self.edit(mesh, sites, &point)?.bounds());
        }
        self.lattice = Lattice::new(bounds);
        self.control = positions.iter().map(|p| self.lattice.from_object(*p).as_vec3().to_array()).collect();
        let control = std::mem::take(&mut self.control);
        self.edited = self.edit(mesh, sites, &|v| lattice_point(&control, v))?;
        self.control = control;
        Ok(())
    }

    fn edit(
        &mut self,
        mesh: &ControlMesh,
        sites: &EditSites,
        control_point: &dyn Fn(u32) -> Point,
    ) -> Result<EditedPatches> {
        let faces_of_patches = self.faces_of_patches.as_ref();
        let patch_of = |face, sub| patch_of(faces_of_patches, face, sub);
        EditedPatches::new(mesh, &self.topology, sites, &mut self.plans, self.lattice, control_point, patch_of)
    }

    /// Half-edges and tags.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// The plan library.
    pub fn plans(&self) -> &PlanLibrary {
        &self.plans
    }

    /// The vertex lattice.
    pub fn lattice(&self) -> Lattice {
        self.lattice
    }

    /// Number of patch ids, those of hidden faces included.
    pub fn n_patches(&self) -> usize {
        self.faces_of_patches.as_ref().map_or(self.topology.n_faces(), FaceIndex::n_things)
    }

    /// The face of a patch and which of its sub-quads it is.
    #[inline]
    pub fn face_of(&self, patch: PatchId) -> (FaceId, u32) {
        match &self.faces_of_patches {
            None => (FaceId(patch.0), 0),
            Some(index) => (FaceId(index.face(patch.0)), index.place(patch.0)),
        }
    }

    /// The patch of a face's sub-quad.
    pub fn patch_of(&self, face: FaceId, sub: u32) -> PatchId {
        patch_of(self.faces_of_patches.as_ref(), face, sub)
    }

    /// Whether the patch has a surface, or parts of one.
    pub fn is_visible(&self, patch: PatchId) -> bool {
        !self.topology.is_hidden(self.face_of(patch).0) && !self.edited.hide(patch)
    }

    /// What hierarchical edits made of patches: holes in them, above all.
    pub fn edited(&self) -> &EditedPatches {
        &self.edited
    }

    /// Patches that have a surface.
    pub fn visible_patches(&self) -> impl Iterator<Item = PatchId> {
        (0..self.n_patches() as u32).map(PatchId).filter(|&p| self.is_visible(p))
    }

    /// First corner of a face, counted over all faces, and number of corners.
    pub fn face_corners(&self, face: FaceId) -> (u32, u32) {
        self.topology.face_corners(face.0)
    }

    /// Number of corners of a face.
    pub fn face_size(&self, face: FaceId) -> u32 {
        self.topology.face_corners(face.0).1
    }

    /// A control point in lattice units.
    #[inline]
    pub fn control_point(&self, vertex: u32) -> Point {
        lattice_point(&self.control, vertex)
    }

    /// Bytes of the control points.
    pub fn control_bytes(&self) -> usize {
        12 * self.control.len()
    }

    /// Bytes held, the plan library included.
    pub fn bytes(&self) -> usize {
        self.topology.bytes()
            + self.control_bytes()
            + self.plans.bytes()
            + 4 * self.plan_of_face.len()
            + self.faces_of_patches.as_ref().map_or(0, FaceIndex::bytes)
            + self.edited.bytes()
    }

    /// Fetches what decides a patch, unless `points` holds it already.
    #[inline]
    pub fn load(&self, patch: PatchId, points: &mut PatchPoints) {
        if points.of != Some((self.id, patch)) {
            self.fetch(patch, points);
        }
    }

    fn fetch(&self, patch: PatchId, points: &mut PatchPoints) {
        points.of = Some((self.id, patch));
        let (face, sub) = self.face_of(patch);
        let (first, size) = self.topology.face_corners(face.0);
        points.node = self.plan_of_face[face.idx()];
        if points.node == REGULAR {
            for (point, vertex) in points.control.iter_mut().zip(regular_ring(&self.topology, first)) {
                *point = self.control_point(vertex);
            }
            return;
        }
        if points.node == EDITED {
            return;
        }
        if size == 4 {
            let sources = points.walker.ring(self, points.node, first + points.node.turn());
            points.parts.new_ring().extend(sources.iter().map(|&v| self.control_point(v)));
        } else {
            self.load_polygon(face, points);
            let parent = &points.polygon;
            let ring = points.parts.new_ring();
            points.node = Evaluator::child_ring(&self.plans, points.node, parent, sub as usize, ring);
        }
        points.parts.begin(&self.plans, points.node);
    }

    /// Refines a polygon, unless it is the last one: its patches, which it may have many of, are often loaded in a row.
    fn load_polygon(&self, face: FaceId, points: &mut PatchPoints) {
        if points.polygon_face == Some((self.id, face)) {
            return;
        }
        points.polygon_face = Some((self.id, face));
        let (first, _) = self.topology.face_corners(face.0);
        let sources = points.walker.ring(self, points.node, first);
        points.polygon.clear();
        points.polygon.extend(sources.iter().map(|&v| self.control_point(v)));
        Evaluator::refine_polygon(&self.plans, points.node, &mut points.polygon);
    }

    /// The quadtree of a patch under edits.
    fn tree(&self, points: &PatchPoints) -> Option<&EditTree> {
        let (_, patch) = points.of.filter(|_| points.node == EDITED)?;
        Some(self.edited.tree(patch))
    }

    /// Positions on a tensor grid of parameters, in lattice units; see `Evaluator::grid`.
    pub fn grid(
        &self,
        points: &mut PatchPoints,
        evaluator: &mut Evaluator,
        cells: Option<[u32; 2]>,
        us: impl IntoIterator<Item = f64>,
        vs: impl IntoIterator<Item = f64>,
        out: &mut PointGrid,
    ) {
        if points.node == REGULAR {
            evaluator.regular_grid(&points.control, us, vs, out);
        } else if let Some(tree) = self.tree(points) {
            evaluator.edited_grid(&self.plans, tree, us, vs, out);
        } else {
            evaluator.grid(&self.plans, &mut points.parts, cells, us, vs, out);
        }
    }

    /// Position and tangents in lattice units.
    pub fn sample(&self, points: &mut PatchPoints, evaluator: &mut Evaluator, u: f64, v: f64) -> SurfaceSample {
        if points.node == REGULAR {
            sample_regular(&points.control, u, v)
        } else if let Some(tree) = self.tree(points) {
            evaluator.edited_sample(&self.plans, tree, u, v)
        } else {
            evaluator.sample_parts(&self.plans, &mut points.parts, [u, v])
        }
    }

    /// The limit normal in lattice (and so object) space, along du x dv; zero where there is none.
    pub fn normal(&self, points: &mut PatchPoints, evaluator: &mut Evaluator, u: f64, v: f64) -> DVec3 {
        let sample = self.sample(points, evaluator, u, v);
        if sample.kind == SampleKind::PositionOnly { DVec3::ZERO } else { sample.du.cross(sample.dv) }
    }

    /// The normal to measure the heights of part of a patch along: across its limit corners or those of its control
    /// points, or the limit normal in the middle of what is no whole patch.
    pub fn normal_of_part(
        &self,
        points: &mut PatchPoints,
        evaluator: &mut Evaluator,
        u: [f64; 2],
        v: [f64; 2],
    ) -> [i8; 3] {
        let is_whole = [u, v] == [[0.0, 1.0]; 2] && points.node != EDITED;
        Plate::normal_along(if !is_whole {
            self.normal(points, evaluator, 0.5 * (u[0] + u[1]), 0.5 * (v[0] + v[1]))
        } else if let Some(control) = points.regular_control() {
            across(limit_corners(control).map(Point::to_vec))
        } else {
            points.parts.normal(0)
        })
    }

    /// How far part of a patch reaches, in lattice units, and how high along a normal; see `Evaluator::parts_bounds`.
    pub fn extent(&self, points: &mut PatchPoints, evaluator: &mut Evaluator, asked: AskedPart) -> Extent {
        if points.node == REGULAR {
            evaluator.regular_extent(&with_heights(&points.control, asked.normal), asked.range)
        } else if let Some(tree) = self.tree(points) {
            evaluator.edited_bounds(&self.plans, tree, asked)
        } else {
            evaluator.parts_bounds(&self.plans, &mut points.parts, asked)
        }
    }
}

impl Surface {
    /// How far equal parts of a rectangle of parameters reach, in lattice units, where that can be had together; see
    /// `Evaluator::grid_of_parts`. Returns whether it can.
    pub(super) fn grid_of_parts(
        &self,
        points: &mut PatchPoints,
        evaluator: &mut Evaluator,
        asked: AskedGrid,
        out: &mut GridExtents,
    ) -> bool {
        if points.node == REGULAR {
            evaluator.regular_grid_of_parts(&points.control, asked, out);
            return true;
        }
        points.node != EDITED && evaluator.grid_of_parts(&self.plans, &mut points.parts, asked, out)
    }
}

fn point(p: DVec3) -> Point {
    Point::new(p.x, p.y, p.z)
}

fn lattice_point(control: &[[f32; 3]], vertex: u32) -> Point {
    let [x, y, z] = control[vertex as usize];
    Point::new(f64::from(x), f64::from(y), f64::from(z))
}

fn patch_of(faces_of_patches: Option<&FaceIndex>, face: FaceId, sub: u32) -> PatchId {
    PatchId(faces_of_patches.map_or(face.0, |index| index.corners(face.0).0) + sub)
}

/// 36 times the corners of a regular patch, counter-clockwise.
fn limit_corners(control: &ControlPoints) -> [Point; 4] {
    let along_v = |i: usize, j: usize| control[4 * j + i] + control[4 * j + 4 + i] * 4.0 + control[4 * j + 8 + i];
    let corner = |i: usize, j: usize| along_v(i, j) + along_v(i + 1, j) * 4.0 + along_v(i + 2, j);
    [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]
}

/// Where in a regular ring the vertices at corner `k` go: itself, then across its edge and on counter-clockwise.
const CORNER_PLACES: [[u8; 4]; 4] = [[5, 1, 2, 0], [6, 7, 11, 3], [10, 14, 13, 15], [9, 8, 4, 12]];

/// The 16 vertices around an untagged quad with regular corners, u fastest.
fn regular_ring(topology: &Topology, first: u32) -> [u32; 16] {
    let mut out = [0; 16];
    for (h, places) in (first..).zip(CORNER_PLACES) {
        // All faces are quads, so that their half-edges are found by their first ones.
        let across = topology.twin(h);
        let start = topology.corners_at(across).0;
        let left = (across - start) ^ 2;
        let diagonal = topology.twin(start + (across - start + 1) % 4);
        let beyond = topology.corners_at(diagonal).0;
        let vertices = [
            topology.vertex(h),
            topology.vertex(start + left),
            topology.vertex(start + (left + 1) % 4),
            topology.vertex(beyond + (diagonal - beyond + 3) % 4),
        ];
        for (place, vertex) in places.into_iter().zip(vertices) {
            out[usize::from(place)] = vertex;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::random::random_mesh;
    use crate::mesh::shapes;
    use crate::topology::NONE;

    /// As [`regular_ring`], checked on the way: the 16 vertices around an untagged quad with regular corners, u
    /// fastest, by plain hops; `None` for other faces.
    fn slow_regular_ring(topology: &Topology, first: u32) -> Option<[u32; 16]> {
        if topology.corners_at(first).1 != 4 {
            return None;
        }
        let mut out = [0; 16];
        for k in 0..4u32 {
            let h = first + k;
            let v = topology.vertex(h);
            let across = topology.twin(h);
            if across == NONE || topology.is_tagged(v) || !is_quad(topology, across) {
                return None;
            }
            let diagonal = topology.twin(topology.next(across));
            let is_valence_two = diagonal == topology.prev(h);
            if diagonal == NONE || is_valence_two || !is_quad(topology, diagonal) {
                return None;
            }
            // Valence 4: going on around the corner arrives in the face across the previous edge.
            let beyond = topology.twin(topology.next(diagonal));
            let before = topology.twin(topology.prev(h));
            if beyond == NONE || before == NONE || topology.next(beyond) != before {
                return None;
            }
            let left = topology.next(topology.next(across));
            let mut set = |x: i32, y: i32, vertex: u32| {
                let (i, j) = match k {
                    0 => (1 + x, 1 + y),
                    1 => (2 - y, 1 + x),
                    2 => (2 - x, 2 - y),
                    _ => (1 + y, 2 - x),
                };
                out[(4 * j + i) as usize] = vertex;
            };
            set(0, 0, v);
            set(0, -1, topology.vertex(left));
            set(1, -1, topology.vertex(topology.next(left)));
            set(-1, -1, topology.vertex(topology.prev(diagonal)));
        }
        Some(out)
    }

    fn is_quad(topology: &Topology, h: u32) -> bool {
        topology.corners_at(h).1 == 4
    }

    #[test]
    fn regular_rings_are_those_of_faces_that_look_so() {
        let (mut n_regular, mut walker) = (0, RingWalker::default());
        for mesh in shapes::all().into_iter().map(|(_, mesh)| mesh).chain((0..100).map(random_mesh)) {
            let topology = Topology::new(&mesh, 1);
            for face in 0..topology.n_faces() as u32 {
                let first = topology.face_corners(face).0;
                let ring = slow_regular_ring(&topology, first);
                assert_eq!(walker.look(&topology, first).is_regular, ring.is_some());
                if let Some(ring) = ring {
                    assert_eq!(regular_ring(&topology, first), ring);
                    n_regular += 1;
                }
            }
        }
        assert!(n_regular > 100, "{n_regular} faces were regular");
    }

    /// Which parts are known depends on what was asked before, and pictures must not.
    #[test]
    fn samples_of_known_parts_are_those_of_a_fresh_walk() {
        let (mut points, mut evaluator, mut n_irregular) = (PatchPoints::default(), Evaluator::default(), 0);
        for (name, mesh) in shapes::all() {
            let surface = Surface::new(&mesh, 1).unwrap();
            for patch in surface.visible_patches() {
                surface.load(patch, &mut points);
                if [REGULAR, EDITED].contains(&points.node) {
                    continue;
                }
                n_irregular += 1;
                let ring = points.parts.points(0).to_vec();
                let eighths = (0..81).map(|k| [k % 9, k / 9].map(|i| f64::from(i) / 8.0));
                let beside = eighths.clone().map(|place| place.map(|t| 0.999 * t));
                for place in eighths.chain(beside) {
                    let sample = evaluator.sample_parts(&surface.plans, &mut points.parts, place);
                    let expected = match points.parts.control(0) {
                        Some(control) => sample_regular(control, place[0], place[1]),
                        None => evaluator.sample_part(&surface.plans, points.parts.node(0), &ring, place, 0),
                    };
                    assert_eq!(sample, expected, "{name}, {patch:?}, {place:?}");
                }
            }
        }
        assert!(n_irregular > 100, "{n_irregular} irregular patches");
    }
}
