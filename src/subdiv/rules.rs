//! Catmull-Clark's weights: how points of one level follow from the level before, and where they end up.
//!
//! A **row** is a sparse list of (point, weight). The rules are those of OpenSubdiv: sharpness decides between the
//! masks for smooth, crease and corner vertices, and while it decays a vertex is a blend of the mask before and after.

use super::local::LocalMesh;
use crate::mesh::{CreaseMethod, TriangleRule};
use crate::topology::{HalfEdges, NONE, VertexTags};
use std::f64::consts::PI;

/// A weighted sum of points; points may repeat until [`merge`] adds them up.
pub type Row = Vec<(u32, f64)>;

/// The options of a mesh that change weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RuleSet {
    /// How sharpness decays.
    pub crease_method: CreaseMethod,
    /// Edge weights beside triangles.
    pub triangles: TriangleRule,
}

impl RuleSet {
    /// Whether rings keep the semi-sharp edges of vertices that are not corners of their target.
    pub fn keeps_outer_tags(&self) -> bool {
        self.crease_method == CreaseMethod::Chaikin
    }

    /// Whether all sharpness decays alike, so that rings are found by the keys of less sharp ones.
    pub fn lowers(&self) -> bool {
        self.crease_method == CreaseMethod::Uniform
    }

    /// Whether the node of a ring is also that of rings which are sharper by whole steps. Such a node is split, always.
    pub fn shares_sharper(&self, ring: &LocalMesh) -> bool {
        let least = ring.least_semi_sharp();
        self.lowers() && least > 1.0 && least.is_finite()
    }
}

/// Weight of each face point for an edge beside a triangle, with smooth triangles (OpenSubdiv).
const SMOOTH_TRIANGLE_WEIGHT: f64 = 0.470;

/// Adds up repeated points and drops zeros.
pub fn merge(mut row: Row) -> Row {
    row.sort_by_key(|e| e.0);
    row.dedup_by(|next, sum| {
        let is_same = next.0 == sum.0;
        if is_same {
            sum.1 += next.1;
        }
        is_same
    });
    row.retain(|e| e.1 != 0.0);
    row
}

fn scaled(row: &[(u32, f64)], s: f64) -> impl Iterator<Item = (u32, f64)> + '_ {
    row.iter().map(move |&(p, w)| (p, w * s))
}

/// Sharpness of a vertex after a step.
pub fn decay(s: f32) -> f32 {
    if s == f32::INFINITY {
        s
    } else if s > 1.0 {
        s - 1.0
    } else {
        0.0
    }
}

/// Sharpness after a step of the half, at a vertex with these semi-sharp edges, of one of them.
pub fn decay_edge(method: CreaseMethod, s: f32, semi_sharp_at_vertex: &[f32]) -> f32 {
    if s == f32::INFINITY || method == CreaseMethod::Uniform || s <= 0.0 {
        return decay(s);
    }
    let mut sum = 0.0f32;
    let mut n_others = 0u32;
    let mut skipped = false;
    for &other in semi_sharp_at_vertex {
        if other == s && !skipped {
            skipped = true;
        } else {
            sum += other;
            n_others += 1;
        }
    }
    let after = if n_others > 0 { 0.75 * s + 0.25 * (sum / n_others as f32) - 1.0 } else { s - 1.0 };
    after.max(0.0)
}

/// A vertex's tags after a step, as its child inherits them.
pub fn decay_tags(method: CreaseMethod, tags: &VertexTags) -> VertexTags {
    let mut semi_sharp: Vec<f32> =
        tags.semi_sharp.iter().map(|&s| decay_edge(method, s, &tags.semi_sharp)).filter(|&s| s > 0.0).collect();
    semi_sharp.sort_by(f32::total_cmp);
    VertexTags { sharpness: decay(tags.sharpness), semi_sharp, ..*tags }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Mask {
    Smooth,
    Crease,
    Corner,
}

fn mask(sharpness: f32, n_sharp: usize) -> Mask {
    match n_sharp {
        _ if sharpness > 0.0 => Mask::Corner,
        0 | 1 => Mask::Smooth,
        2 => Mask::Crease,
        _ => Mask::Corner,
    }
}

/// Adds the mean of a face's vertices, times a weight.
///
/// That of a polygon that is the target counts as a point itself, the one after the ring's points: written out, it
/// would make the rows of a polygon's quarters as long as the polygon has corners.
fn add_face_point(row: &mut Row, mesh: &LocalMesh, face: u32, weight: f64) {
    if face == 0 && mesh.n_corners() != 4 {
        row.push((mesh.n_vertices() as u32, weight));
    } else {
        let (start, n) = mesh.face_corners(face);
        let each = 1.0 / f64::from(n) * weight;
        row.extend((start..start + n).map(|h| (mesh.vertex[h as usize], each)));
    }
}

fn mean(mesh: &LocalMesh, face: u32) -> Row {
    let (start, n) = mesh.face_corners(face);
    (start..start + n).map(|h| (mesh.vertex[h as usize], 1.0 / f64::from(n))).collect()
}

/// Sharpness of the two halves of an edge after a step: at the start of `h` and at its end.
pub fn halves(rules: &RuleSet, mesh: &LocalMesh, h: u32) -> [f32; 2] {
    let s = mesh.edge_sharpness(h);
    let at = |v: u32| decay_edge(rules.crease_method, s, &mesh.tags[v as usize].semi_sharp);
    [at(mesh.vertex(h)), at(mesh.vertex(mesh.next(h)))]
}

/// The new point of an edge.
pub fn edge_point(rules: &RuleSet, mesh: &LocalMesh, h: u32) -> Row {
    let ends = [mesh.vertex(h), mesh.vertex(mesh.next(h))];
    let s = mesh.edge_sharpness(h);
    if s == f32::INFINITY || (s > 0.0 && halves(rules, mesh, h).iter().all(|&half| half > 0.0)) {
        return merge(ends.map(|v| (v, 0.5)).to_vec());
    }
    let faces = [mesh.face(h), mesh.face(mesh.twin(h))];
    let sizes = faces.map(|f| mesh.face_corners(f).1);
    let weight = match rules.triangles {
        TriangleRule::Smooth if sizes.contains(&3) => {
            let of = |n| if n == 3 { SMOOTH_TRIANGLE_WEIGHT } else { 0.25 };
            0.5 * (of(sizes[0]) + of(sizes[1]))
        }
        _ => 0.25,
    };
    let blend = 1.0 - f64::from(s);
    let of_end = 0.5 * (f64::from(s) + blend * (1.0 - 2.0 * weight));
    let mut row = Row::with_capacity(2 + sizes[0] as usize + sizes[1] as usize);
    row.extend(ends.map(|v| (v, of_end)));
    faces.into_iter().for_each(|f| add_face_point(&mut row, mesh, f, blend * weight));
    merge(row)
}

/// The new position of the target's corner `h`.
pub fn vertex_point(rules: &RuleSet, mesh: &LocalMesh, h: u32) -> Row {
    let v = mesh.vertex(h);
    let tags = mesh.tags_at(h);
    let after = decay_tags(rules.crease_method, tags);
    let mask_before = mask(tags.sharpness, tags.n_sharp());
    let mask_after = mask(after.sharpness, after.n_sharp());
    let fan = mesh.fan(h);
    let edges = mesh.fan_edges(&fan);
    let row_of = |mask: Mask, is_sharp: &dyn Fn(u32) -> bool| -> Row {
        match mask {
            Mask::Corner => vec![(v, 1.0)],
            Mask::Crease => {
                let ends = crease_ends(mesh, h, &edges, is_sharp);
                std::iter::once((v, 0.75)).chain(ends.into_iter().map(|end| (end, 0.125))).collect()
            }
            Mask::Smooth => smooth_vertex(mesh, v, &fan.spokes, &edges),
        }
    };
    let before = row_of(mask_before, &|e| mesh.edge_sharpness(e) > 0.0);
    if mask_before == Mask::Smooth {
        return before;
    }
    if mask_before == mask_after {
        return merge(before);
    }
    let decayed = |e: u32| decay_edge(rules.crease_method, mesh.edge_sharpness(e), &tags.semi_sharp);
    let after_row = row_of(mask_after, &|e| decayed(e) > 0.0);
    let w = transition_weight(rules, tags, &after);
    let mut row: Row = scaled(&before, w).collect();
    row.extend(scaled(&after_row, 1.0 - w));
    merge(row)
}

/// The far ends of a crease vertex's two sharp edges.
fn crease_ends(mesh: &LocalMesh, h: u32, edges: &[(u32, u32)], is_sharp: &dyn Fn(u32) -> bool) -> Vec<u32> {
    match mesh.crease_ends(h) {
        Some(ends) => ends.to_vec(),
        None => edges.iter().filter(|e| is_sharp(e.0)).map(|e| e.1).collect(),
    }
}

/// The mean, at most 1, of the sharpness values that decay to nothing in this step.
fn transition_weight(rules: &RuleSet, tags: &VertexTags, after: &VertexTags) -> f64 {
    let mut sum = 0.0f32;
    let mut n = 0u32;
    if tags.sharpness > 0.0 && after.sharpness == 0.0 {
        sum += tags.sharpness;
        n += 1;
    }
    for &s in &tags.semi_sharp {
        let vanishes = match rules.crease_method {
            CreaseMethod::Uniform => s <= 1.0,
            CreaseMethod::Chaikin => decay_edge(rules.crease_method, s, &tags.semi_sharp) <= 0.0,
        };
        if vanishes {
            sum += s;
            n += 1;
        }
    }
    if n == 0 { 0.0 } else { f64::from((sum / n as f32).min(1.0)) }
}

fn smooth_vertex(mesh: &LocalMesh, v: u32, spokes: &[u32], edges: &[(u32, u32)]) -> Row {
    let n = spokes.len() as f64;
    let mut row = Row::with_capacity(1 + 5 * spokes.len());
    row.push((v, (n - 2.0) / n));
    row.extend(edges.iter().map(|e| (e.1, 1.0 / (n * n))));
    spokes.iter().for_each(|&h| add_face_point(&mut row, mesh, mesh.face(h), 1.0 / (n * n)));
    merge(row)
}

/// What is known of the limit at a corner of the target.
#[derive(Clone, Debug, PartialEq)]
pub enum CornerLimit {
    /// The surface is regular there.
    Regular,
    /// Semi-sharp or beside a polygon: ask the corner's quarter.
    Descend,
    /// The limit is this row.
    Position(Row),
    /// The limit is the first row; the others are the tangents along the corner's outgoing edge of the target and along
    /// the next one counter-clockwise. Only their directions are meaningful.
    Smooth(Row, [Row; 2]),
    /// No closed form (a dart with an infinitely sharp edge, a smooth vertex of valence 2): iterate the step.
    Iterate,
}

/// The limit at corner `h` of the target, if the ring decides it.
pub fn corner_limit(mesh: &LocalMesh, h: u32) -> CornerLimit {
    let v = mesh.vertex(h);
    let tags = mesh.tags_at(h);
    let fan = mesh.fan(h);
    let all_quads = fan.spokes.iter().all(|&s| mesh.face_corners(mesh.face(s)).1 == 4);
    if all_quads && is_regular_corner(mesh, h) {
        return CornerLimit::Regular;
    }
    if is_corner_forever(tags) {
        return CornerLimit::Position(vec![(v, 1.0)]);
    }
    if tags.sharpness > 0.0 || !tags.semi_sharp.is_empty() {
        return CornerLimit::Descend;
    }
    if !all_quads {
        return CornerLimit::Descend;
    }
    let edges = mesh.fan_edges(&fan);
    match (tags.n_infinite, fan.spokes.len()) {
        (2, _) => {
            let ends = crease_ends(mesh, h, &edges, &|e| mesh.edge_sharpness(e) > 0.0);
            let ends = ends.into_iter().map(|end| (end, 1.0 / 6.0));
            CornerLimit::Position(merge(std::iter::once((v, 4.0 / 6.0)).chain(ends).collect()))
        }
        (0, n) if n >= 3 => {
            let at = fan.spokes.iter().position(|&s| s == h).expect("the fan holds its own spoke");
            let mut spokes = fan.spokes.clone();
            spokes.rotate_left(at);
            smooth_limit(mesh, v, &spokes)
        }
        _ => CornerLimit::Iterate,
    }
}

fn smooth_limit(mesh: &LocalMesh, v: u32, spokes: &[u32]) -> CornerLimit {
    let n = spokes.len() as f64;
    let edge = |i: usize| mesh.vertex(mesh.next(spokes[i % spokes.len()]));
    let diagonal = |i: usize| mesh.vertex(mesh.next(mesh.next(spokes[i % spokes.len()])));
    let scale = 1.0 / (n * (n + 5.0));
    let mut position: Row = vec![(v, n * n * scale)];
    let t = 2.0 * PI / n;
    let r = (5.0 + t.cos() + (t / 2.0).cos() * (18.0 + 2.0 * t.cos()).sqrt()) / 16.0;
    let mut tangents = [Row::new(), Row::new()];
    for i in 0..spokes.len() {
        position.push((edge(i), 4.0 * scale));
        position.push((diagonal(i), scale));
        for (k, tangent) in tangents.iter_mut().enumerate() {
            let a = (i as f64 - k as f64) * t;
            tangent.push((edge(i), 4.0 * a.cos()));
            tangent.push((diagonal(i), (a.cos() + (a + t).cos()) / (4.0 * r - 1.0)));
        }
    }
    CornerLimit::Smooth(merge(position), tangents.map(merge))
}

/// The 16 bicubic B-spline control points of a regular ring, `[j][i]` with the target's corner 0 at `[1][1]`, corner 1
/// at `[1][2]`; or `None` if the ring is not regular.
pub fn regular_rows(mesh: &LocalMesh) -> Option<[[Row; 4]; 4]> {
    if !mesh.all_quads() || !(0..4).all(|h| is_regular_corner(mesh, h)) {
        return None;
    }
    let mut grid = ControlGrid::default();
    for k in 0..4 {
        grid.set(k, 0, 0, mesh.vertex(k));
        if !is_sharp(mesh, k) {
            // The face across edge k: its half-edge along the edge runs from corner k+1 to corner k.
            let across = mesh.twin(k);
            let left = mesh.next(mesh.next(across));
            grid.set(k, 0, -1, mesh.vertex(left));
            grid.set(k, 1, -1, mesh.vertex(mesh.next(left)));
            if !is_sharp(mesh, mesh.prev(k)) {
                let diagonal = mesh.twin(mesh.next(across));
                grid.set(k, -1, -1, mesh.vertex(mesh.prev(diagonal)));
            }
        }
    }
    grid.extrapolate([0, 1, 2, 3].map(|k| is_sharp(mesh, k)));
    Some(grid.rows.map(|row| row.map(|p| p.expect("every control point is given or extrapolated"))))
}

fn is_sharp(mesh: &LocalMesh, h: u32) -> bool {
    mesh.edge_sharpness(h) == f32::INFINITY
}

/// Whether the corner mask holds at every level to come.
fn is_corner_forever(tags: &VertexTags) -> bool {
    tags.sharpness == f32::INFINITY || tags.n_infinite > 2
}

/// Whether the fan's borders are the two sharp edges of its vertex; at a fin, one edge may be both borders.
fn is_bounded_by_crease(mesh: &LocalMesh, h: u32) -> bool {
    mesh.crease_ends(h).is_none_or(|ends| {
        let edges = mesh.fan_edges(&mesh.fan(h));
        ends.iter().all(|end| edges.iter().any(|e| e.1 == *end && mesh.edge_sharpness(e.0) == f32::INFINITY))
    })
}

fn is_regular_corner(mesh: &LocalMesh, h: u32) -> bool {
    let tags = mesh.tags_at(h);
    match mesh.fan_size(h) {
        (1, false) => is_corner_forever(tags),
        (2, false) => {
            let smooth_else = tags.sharpness == 0.0 && tags.n_infinite == 2 && tags.semi_sharp.is_empty();
            smooth_else && is_bounded_by_crease(mesh, h)
        }
        (4, true) => tags.sharpness == 0.0 && tags.n_infinite == 0 && tags.semi_sharp.is_empty(),
        _ => false,
    }
}

#[derive(Default)]
struct ControlGrid {
    rows: [[Option<Row>; 4]; 4],
}

impl ControlGrid {
    /// Sets the point at (x, y) in the frame that has corner `k` of the target as origin and edge `k` as x axis.
    fn set(&mut self, k: u32, x: i32, y: i32, vertex: u32) {
        let (i, j) = match k {
            0 => (1 + x, 1 + y),
            1 => (2 - y, 1 + x),
            2 => (2 - x, 2 - y),
            _ => (1 + y, 2 - x),
        };
        self.rows[j as usize][i as usize] = Some(vec![(vertex, 1.0)]);
    }

    /// Points beyond sharp edges mirror those before: P(-1) = 2 P(0) - P(1). `sharp` tells of each edge.
    fn extrapolate(&mut self, sharp: [bool; 4]) {
        let mirror = |near: &Option<Row>, far: &Option<Row>| -> Option<Row> {
            Some(merge(scaled(near.as_ref()?, 2.0).chain(scaled(far.as_ref()?, -1.0)).collect()))
        };
        for _ in 0..2 {
            for k in 0..4 {
                for (edge, beyond, near, far) in [(0, 0, 1, 2), (2, 3, 2, 1)] {
                    if sharp[edge] && self.rows[beyond][k].is_none() {
                        self.rows[beyond][k] = mirror(&self.rows[near][k], &self.rows[far][k]);
                    }
                }
                for (edge, beyond, near, far) in [(3, 0, 1, 2), (1, 3, 2, 1)] {
                    if sharp[edge] && self.rows[k][beyond].is_none() {
                        self.rows[k][beyond] = mirror(&self.rows[k][near], &self.rows[k][far]);
                    }
                }
            }
        }
    }
}

/// The refined ring mesh: all quads, vertices numbered old vertices, then edges, then faces.
pub struct Refined {
    /// Half-edges `4h..4h+4` form the quad at the start of half-edge `h`: corner, edge `h`, face, edge `prev(h)`.
    pub mesh: LocalMesh,
    /// For each vertex of `mesh`, the half-edge, edge or face it comes from.
    pub origin: Vec<Origin>,
}

/// As [`Refined`], worked out where it is asked.
pub struct RefinedView<'a> {
    rules: RuleSet,
    ring: &'a LocalMesh,
    /// See [`Refined`].
    pub origin: Vec<Origin>,
    /// The vertex in the middle of each half-edge.
    edge_vertex: Vec<u32>,
    /// The vertex in the middle of face 0.
    first_face: u32,
    /// See [`LocalMesh`].
    fins: Vec<(u32, [u32; 2])>,
}

/// Where a refined vertex comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// A vertex, by a half-edge that starts there.
    Vertex(u32),
    /// An edge, by one of its half-edges.
    Edge(u32),
    /// A face.
    Face(u32),
    /// The middle of a fin's sharp edge, by its ends.
    Middle([u32; 2]),
    /// A vertex without half-edges, which no refined point needs.
    Nothing,
}

impl<'a> RefinedView<'a> {
    /// The topology and sharpness of a ring after one step.
    pub fn new(rules: RuleSet, ring: &'a LocalMesh) -> Self {
        let n = ring.n_half_edges() as u32;
        let mut origin: Vec<Origin> = Vec::with_capacity(ring.n_vertices() + n as usize + ring.n_faces());
        origin.resize(ring.n_vertices(), Origin::Nothing);
        for h in (0..n).rev() {
            origin[ring.vertex(h) as usize] = Origin::Vertex(h);
        }
        let mut edge_vertex = vec![NONE; n as usize];
        for h in 0..n {
            let twin = ring.twin(h);
            edge_vertex[h as usize] = if twin != NONE && twin < h {
                edge_vertex[twin as usize]
            } else {
                origin.push(Origin::Edge(h));
                origin.len() as u32 - 1
            };
        }
        let first_face = origin.len() as u32;
        origin.extend((0..ring.n_faces() as u32).map(Origin::Face));
        let fins = ring
            .fins
            .iter()
            .map(|&(v, ends)| (v, ends.map(|end| fin_edge_vertex(ring, v, end, &edge_vertex, &mut origin))));
        let fins = fins.collect();
        Self { rules, ring, origin, edge_vertex, first_face, fins }
    }

    /// The vertex in the middle of a face of the ring.
    pub fn face_vertex(&self, face: u32) -> u32 {
        self.first_face + face
    }
}

impl HalfEdges for RefinedView<'_> {
    #[inline]
    fn vertex(&self, h: u32) -> u32 {
        let before = h / 4;
        match h % 4 {
            0 => self.ring.vertex(before),
            1 => self.edge_vertex[before as usize],
            2 => self.first_face + self.ring.face(before),
            _ => self.edge_vertex[self.ring.prev(before) as usize],
        }
    }

    #[inline]
    fn twin(&self, h: u32) -> u32 {
        let before = h / 4;
        match h % 4 {
            0 => match self.ring.twin(before) {
                NONE => NONE,
                across => 4 * self.ring.next(across) + 3,
            },
            1 => 4 * self.ring.next(before) + 2,
            2 => 4 * self.ring.prev(before) + 1,
            _ => match self.ring.twin(self.ring.prev(before)) {
                NONE => NONE,
                across => 4 * across,
            },
        }
    }

    #[inline]
    fn face(&self, h: u32) -> u32 {
        h / 4
    }

    #[inline]
    fn face_corners(&self, face: u32) -> (u32, u32) {
        (4 * face, 4)
    }

    #[inline]
    fn corners_at(&self, h: u32) -> (u32, u32) {
        (h & !3, 4)
    }

    #[inline]
    fn next(&self, h: u32) -> u32 {
        h & !3 | (h + 1) & 3
    }

    #[inline]
    fn prev(&self, h: u32) -> u32 {
        h & !3 | h.wrapping_sub(1) & 3
    }

    fn edge_sharpness(&self, h: u32) -> f32 {
        if self.twin(h) == NONE {
            return f32::INFINITY;
        }
        match h % 4 {
            0 => halves(&self.rules, self.ring, h / 4)[0],
            3 => halves(&self.rules, self.ring, self.ring.prev(h / 4))[1],
            _ => 0.0,
        }
    }

    fn vertex_tags(&self, h: u32) -> VertexTags {
        refined_tags(&self.rules, self.ring, self.origin[self.vertex(h) as usize])
    }

    fn is_plain(&self, h: u32) -> bool {
        match self.origin[self.vertex(h) as usize] {
            Origin::Face(_) => true,
            Origin::Edge(e) => {
                let is_smooth = |s: f32| s == 0.0 || (s.is_finite() && halves(&self.rules, self.ring, e) == [0.0; 2]);
                self.ring.twin(e) == NONE || is_smooth(self.ring.edge_sharpness(e))
            }
            Origin::Vertex(e) => {
                let tags = self.ring.tags_at(e);
                if tags.is_smooth() {
                    self.ring.is_plain(e)
                } else {
                    let after = decay_tags(self.rules.crease_method, tags);
                    after.is_smooth() && after.n_infinite == 0
                }
            }
            Origin::Middle(_) | Origin::Nothing => false,
        }
    }

    fn n_infinite(&self, h: u32) -> u32 {
        match self.origin[self.vertex(h) as usize] {
            Origin::Vertex(e) => self.ring.tags_at(e).n_infinite,
            Origin::Edge(e) if self.ring.edge_sharpness(e) == f32::INFINITY => 2,
            _ => 0,
        }
    }

    fn crease_ends(&self, h: u32) -> Option<[u32; 2]> {
        let v = self.vertex(h);
        self.fins.iter().find(|fin| fin.0 == v).map(|fin| fin.1)
    }
}

/// The topology and sharpness of a ring after one step, written down.
pub fn refine(rules: &RuleSet, mesh: &LocalMesh) -> Refined {
    let view = RefinedView::new(*rules, mesh);
    let n = 4 * mesh.n_half_edges() as u32;
    let out = LocalMesh {
        face_start: (0..=n).step_by(4).collect(),
        vertex: (0..n).map(|h| view.vertex(h)).collect(),
        face: (0..n).map(|h| view.face(h)).collect(),
        twin: (0..n).map(|h| view.twin(h)).collect(),
        sharpness: (0..n).map(|h| view.edge_sharpness(h)).collect(),
        tags: view.origin.iter().map(|o| refined_tags(rules, mesh, *o)).collect(),
        fins: view.fins,
    };
    Refined { mesh: out, origin: view.origin }
}

/// The refined vertex in the middle of a fin's sharp edge: that of a half-edge if there is one, else one of its own.
///
/// Every sheet has its own. Those at the target's corner come first: its fan is regular if they are its borders.
fn fin_edge_vertex(mesh: &LocalMesh, v: u32, end: u32, edge_vertex: &[u32], origin: &mut Vec<Origin>) -> u32 {
    let joins = |h: &u32| {
        let ends = [mesh.vertex(*h), mesh.vertex(mesh.next(*h))];
        mesh.edge_sharpness(*h) == f32::INFINITY && (ends == [v, end] || ends == [end, v])
    };
    let corner = (0..mesh.n_corners()).find(|&k| mesh.vertex(k) == v);
    let at_corner = corner.into_iter().flat_map(|k| mesh.fan_edges(&mesh.fan(k))).map(|edge| edge.0);
    at_corner.chain(0..mesh.n_half_edges() as u32).find(joins).map_or_else(
        || {
            origin.push(Origin::Middle([v, end]));
            origin.len() as u32 - 1
        },
        |h| edge_vertex[h as usize],
    )
}

fn refined_tags(rules: &RuleSet, mesh: &LocalMesh, origin: Origin) -> VertexTags {
    match origin {
        Origin::Vertex(h) => decay_tags(rules.crease_method, mesh.tags_at(h)),
        Origin::Face(_) | Origin::Middle(_) | Origin::Nothing => VertexTags::default(),
        Origin::Edge(h) if mesh.edge_sharpness(h) == f32::INFINITY => {
            VertexTags { n_infinite: 2, ..Default::default() }
        }
        Origin::Edge(h) => {
            let mut semi_sharp: Vec<f32> = halves(rules, mesh, h).into_iter().filter(|&s| s > 0.0).collect();
            semi_sharp.sort_by(f32::total_cmp);
            VertexTags { semi_sharp, ..Default::default() }
        }
    }
}

/// The row of a refined vertex; vertices must be corners of the target. The column after the ring's points is the face
/// point of a target that is a polygon.
pub fn refined_row(rules: &RuleSet, mesh: &LocalMesh, origin: Origin) -> Row {
    match origin {
        Origin::Vertex(h) => vertex_point(rules, mesh, h),
        Origin::Edge(h) => edge_point(rules, mesh, h),
        Origin::Face(f) => merge(mean(mesh, f)),
        Origin::Middle([a, b]) => merge(vec![(a, 0.5), (b, 0.5)]),
        Origin::Nothing => Row::new(),
    }
}
