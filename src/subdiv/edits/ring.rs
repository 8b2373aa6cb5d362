//! A ring with its points and the edits in its faces, and one step of it.

use super::trie::{EditTrie, TrieId};
use crate::ids::FaceId;
use crate::mesh::{Edit, EditKind, EditValue};
use crate::subdiv::draft::child_start;
use crate::subdiv::eval::Point;
use crate::subdiv::local::{Extracted, LocalMesh, extract_whole};
use crate::subdiv::rules::{self, Origin, Refined, Row, RuleSet};
use crate::subdiv::surface::Lattice;
use crate::topology::{HalfEdges, NONE, Topology};
use glam::DVec3;
use rustc_hash::FxHashMap;

/// What refining under edits needs to know.
pub(super) struct Context<'a> {
    pub trie: &'a EditTrie,
    pub edits: &'a [Edit],
    pub rules: RuleSet,
    /// The space of the points.
    pub lattice: Lattice,
    /// Whether rings keep the semi-sharp edges of their outer vertices.
    pub outer_tags: bool,
}

/// A face on the way to an edit, and its vertex 0 in the sense of edit paths.
#[derive(Clone, Copy)]
struct EditedFace {
    node: TrieId,
    vertex_0: u32,
}

/// A small mesh under edits. As a ring, it holds all faces at the target's corners, those of other sheets included.
///
/// Every edit that moves a point of the ring of a quarter lies in a child of one of these faces, for those children are
/// all faces at all the points of that ring. So a ring without pending edits stays without.
pub(super) struct EditedMesh {
    pub mesh: LocalMesh,
    pub points: Vec<Point>,
    /// One for each face.
    faces: Vec<Option<EditedFace>>,
    /// For each half-edge, its edge: equal for all sheets of a non-manifold edge, and for nothing else.
    edges: Vec<u32>,
}

impl EditedMesh {
    /// The ring of a base face.
    pub fn of_base(
        cx: &Context<'_>,
        topology: &Topology,
        face: FaceId,
        spokes: &FxHashMap<u32, Vec<u32>>,
        control_point: &dyn Fn(u32) -> Point,
    ) -> Self {
        let (first, _) = topology.face_corners(face.0);
        let x = extract_whole(topology, first, cx.outer_tags, |v| spokes.get(&v).cloned().unwrap_or_default());
        let faces = local_faces(topology, &x, |face| {
            let node = cx.trie.root(FaceId(face))?;
            Some(EditedFace { node, vertex_0: topology.face_corners(face).0 })
        });
        let edges = sources_of_half_edges(topology, &x).map(|h| topology.edge_id(h)).collect();
        EditedMesh { points: x.sources.iter().map(|&v| control_point(v)).collect(), mesh: x.mesh, faces, edges }
    }

    /// Whether an edit of a later step lies in one of the faces.
    pub fn is_pending(&self, trie: &EditTrie) -> bool {
        self.faces.iter().flatten().any(|f| trie.is_pending(f.node))
    }

    /// The rings of the target's quarters after a step, edits of that level applied.
    pub fn quarters(&self, cx: &Context<'_>) -> Vec<EditedMesh> {
        let Refined { mut mesh, origin } = rules::refine(&cx.rules, &self.mesh);
        let known = self.points_and_face_point();
        let points = origin.iter().map(|o| self.refined_point(&cx.rules, *o, &known)).collect();
        join_sheets(self, &origin, &mut mesh);
        let mut refined = EditedMesh { mesh, points, faces: self.child_faces(cx.trie), edges: self.child_edges() };
        refined.apply_edits(cx);
        let n = self.mesh.n_corners();
        (0..n).map(|k| refined.ring(child_start(n, k), cx.outer_tags)).collect()
    }

    /// Vertices that are no corners of the target move too, but no quarter's ring has them.
    fn refined_point(&self, rules: &RuleSet, origin: Origin, known: &[Point]) -> Point {
        let origin = match origin {
            Origin::Vertex(h) => {
                let v = self.mesh.vertex(h);
                match (0..self.mesh.n_corners()).find(|&k| self.mesh.vertex(k) == v) {
                    Some(corner) => Origin::Vertex(corner),
                    None => return self.points[v as usize],
                }
            }
            other => other,
        };
        weighted_sum(&rules::refined_row(rules, &self.mesh, origin), known)
    }

    /// What the columns of rows mean, see [`rules::refined_row`].
    fn points_and_face_point(&self) -> Vec<Point> {
        let n = self.mesh.n_corners();
        let share = 1.0 / f64::from(n);
        let corner = |h: u32| self.points[self.mesh.vertex(h) as usize] * share;
        let mean = (0..n).fold(Point::ZERO, |sum, h| sum + corner(h));
        self.points.iter().copied().chain([mean]).collect()
    }

    /// The faces after a step, one for each half-edge.
    fn child_faces(&self, trie: &EditTrie) -> Vec<Option<EditedFace>> {
        let child = |h: u32| {
            let EditedFace { node, vertex_0 } = self.faces[self.mesh.face(h) as usize]?;
            let (start, n) = self.mesh.face_corners(self.mesh.face(h));
            let k = (h - start + n - (vertex_0 - start)) % n;
            // Children of a quad run as it does: the parent's vertex k is the child's vertex k.
            let turn = if n == 4 { (4 - k) % 4 } else { 0 };
            Some(EditedFace { node: trie.child(node, k)?, vertex_0: 4 * h + turn })
        };
        (0..self.mesh.n_half_edges() as u32).map(child).collect()
    }

    /// The edges after a step: halves of an edge are told apart by their vertex, and those of one that leads back to
    /// its vertex, which has one sheet only, by their order.
    fn child_edges(&self) -> Vec<u32> {
        let mut numbers = FxHashMap::default();
        let mut number = |key: (u32, u32)| {
            let next = numbers.len() as u32;
            *numbers.entry(key).or_insert(next)
        };
        let mut edges = Vec::with_capacity(4 * self.mesh.n_half_edges());
        for h in 0..self.mesh.n_half_edges() as u32 {
            let before = self.mesh.prev(h);
            let leads_back = self.mesh.vertex(before) == self.mesh.vertex(h);
            let end = if leads_back { NONE } else { self.mesh.vertex(h) };
            edges.push(number((self.edges[h as usize], self.mesh.vertex(h))));
            edges.extend([1, 2].map(|k| number((NONE, 4 * h + k))));
            edges.push(number((self.edges[before as usize], end)));
        }
        edges
    }

    /// Applies the edits of this level, in file order.
    fn apply_edits(&mut self, cx: &Context<'_>) {
        let of_face = |f: &EditedFace| cx.trie.edits(f.node).iter().map(|&i| (i, f.vertex_0)).collect::<Vec<_>>();
        let mut edits: Vec<(u32, u32)> = self.faces.iter().flatten().flat_map(of_face).collect();
        edits.sort_unstable();
        for (i, vertex_0) in edits {
            let edit = &cx.edits[i as usize];
            let start = vertex_0 - vertex_0 % 4;
            let h = start + (vertex_0 - start + edit.element().unwrap_or(0)) % 4;
            match edit.kind {
                EditKind::Vertex => self.edit_vertex(h, &edit.value, &cx.lattice),
                EditKind::Edge => self.edit_edge(h, &edit.value),
                EditKind::Face => {}
            }
        }
    }

    fn edit_vertex(&mut self, h: u32, value: &EditValue, lattice: &Lattice) {
        let v = self.mesh.vertex(h) as usize;
        let point = |p: DVec3| Point::new(p.x, p.y, p.z);
        match *value {
            EditValue::AddPosition(p) => self.points[v] = self.points[v] + point(p / lattice.step),
            EditValue::SetPosition(p) => self.points[v] = point(lattice.from_object(p)),
            _ => {
                let tags = &mut self.mesh.tags[v];
                if !tags.is_pinned {
                    tags.sharpness = value.edited_sharpness(tags.sharpness);
                }
            }
        }
    }

    fn edit_edge(&mut self, h: u32, value: &EditValue) {
        let twin = self.mesh.twin(h);
        if twin == NONE {
            return;
        }
        let before = self.mesh.edge_sharpness(h);
        let after = value.edited_sharpness(before);
        for h in [h, twin] {
            self.mesh.sharpness[h as usize] = after;
            let v = self.mesh.vertex(h) as usize;
            self.mesh.tags[v].replace_edge(before, after);
        }
    }

    /// The ring of the face of `first`.
    fn ring(&self, first: u32, outer_tags: bool) -> EditedMesh {
        let n = self.mesh.n_half_edges() as u32;
        let spokes = |v: u32| (0..n).filter(|&h| self.mesh.vertex(h) == v).collect();
        let x = extract_whole(&self.mesh, first, outer_tags, spokes);
        let faces = local_faces(&self.mesh, &x, |face| self.faces[face as usize]);
        let edges = sources_of_half_edges(&self.mesh, &x).map(|h| self.edges[h as usize]).collect();
        EditedMesh { points: x.sources.iter().map(|&v| self.points[v as usize]).collect(), mesh: x.mesh, faces, edges }
    }
}

/// The edited faces of a ring, given those of the mesh it was cut from.
fn local_faces<M: HalfEdges>(
    source: &M,
    x: &Extracted,
    of_source: impl Fn(u32) -> Option<EditedFace>,
) -> Vec<Option<EditedFace>> {
    let local = |(&start, &local_start): (&u32, &u32)| {
        let face = source.face(start);
        let EditedFace { node, vertex_0 } = of_source(face)?;
        let (_, n) = source.face_corners(face);
        Some(EditedFace { node, vertex_0: local_start + (vertex_0 + n - start) % n })
    };
    x.starts.iter().zip(&x.mesh.face_start).map(local).collect()
}

/// The half-edges of the mesh that a ring was cut from, in the ring's order.
fn sources_of_half_edges<M: HalfEdges>(source: &M, x: &Extracted) -> impl Iterator<Item = u32> {
    x.starts.iter().flat_map(move |&start| {
        let (_, n) = source.face_corners(source.face(start));
        std::iter::successors(Some(start), move |&h| Some(source.next(h))).take(n as usize)
    })
}

/// Makes the middles of a non-manifold edge, of which refining gives every face its own, one vertex again: edits of it
/// in one face concern them all.
fn join_sheets(before: &EditedMesh, origin: &[Origin], refined: &mut LocalMesh) {
    let mut known: FxHashMap<u32, u32> = FxHashMap::default();
    let mut joined: Vec<u32> = (0..origin.len() as u32).collect();
    for (v, origin) in origin.iter().enumerate() {
        let Origin::Edge(h) = *origin else { continue };
        joined[v] = *known.entry(before.edges[h as usize]).or_insert(v as u32);
    }
    let ends = refined.fins.iter_mut().flat_map(|fin| &mut fin.1);
    refined.vertex.iter_mut().chain(ends).for_each(|v| *v = joined[*v as usize]);
}

fn weighted_sum(row: &Row, points: &[Point]) -> Point {
    row.iter().fold(Point::ZERO, |sum, &(p, w)| sum + points[p as usize] * w)
}
