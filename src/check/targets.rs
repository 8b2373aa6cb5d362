//! Where rays are aimed: grid vertices and points between them, on seams, at vertices, inside patches.

use super::incidence::{Incidence, SideRun, edge_rate, edge_runs, inner_sides, place};
use super::outline::{Outline, TriangleSet, point};
use super::window::{Vertex, Window};
use crate::ids::{FaceId, PatchId};
use crate::mesh::shapes::noise::Random;
use crate::scene::world::WorldMesh;
use crate::subdiv::Dicer;
use crate::topology::HalfEdges;
use glam::DVec3;

/// Triangles around a target are looked up in wider and wider windows until they are this wide, in lattice steps: rays
/// from afar err by a dozen.
const WANTED_EXTENT: f64 = 256.0;

/// The widest window, in cells.
const MAX_MARGIN: u32 = 32;

/// A line between two grid vertices, or one of them, that no ray may pass, and the triangles around it.
#[derive(Clone, Debug)]
pub(super) struct Target {
    pub patch: PatchId,
    /// In lattice steps; equal for a grid vertex.
    pub ends: [DVec3; 2],
    pub outline: Outline,
    /// Where it is, for people.
    pub kind: &'static str,
}

/// Finds targets. Holds scratch memory: one for each thread.
pub(super) struct TargetFinder<'a> {
    mesh: &'a WorldMesh,
    incidence: &'a Incidence,
    patches: &'a [PatchId],
    dicer: Dicer,
    vertices: Vec<Vertex>,
    triangles: TriangleSet,
}

/// Cells around a place, and whether their triangles are to be turned over.
type Piece = (Window, bool);

impl<'a> TargetFinder<'a> {
    /// For a mesh with these visible patches.
    pub fn new(mesh: &'a WorldMesh, incidence: &'a Incidence, patches: &'a [PatchId]) -> Self {
        let (dicer, triangles) = (Dicer::default(), TriangleSet::default());
        Self { mesh, incidence, patches, dicer, vertices: Vec::new(), triangles }
    }

    /// A random target; `None` if the draw fell on a place that has none.
    pub fn draw(&mut self, random: &mut Random) -> Option<Target> {
        match random.below(8) {
            0..4 if self.incidence.n_edges() > 0 => self.on_edge(random),
            4 => self.at_vertex(random),
            5 if !self.incidence.polygons().is_empty() => self.in_polygon(random),
            _ => self.in_patch(random),
        }
    }

    fn on_edge(&mut self, random: &mut Random) -> Option<Target> {
        let incidence = self.incidence;
        let group = incidence.edge(random.below(incidence.n_edges()));
        let first = random.below(group.len());
        let second = (first + 1 + random.below(group.len() - 1)) % group.len();
        let [a, b] = [group[first], group[second]];
        let surface = self.mesh.surface();
        let rate = edge_rate(surface, a, |patch| self.mesh.patch_rates(patch));
        let ends = draw_segment(random, rate)?;
        // Faces that run along the edge in one direction have their surfaces turned against each other.
        let same = surface.topology().vertex(a) == surface.topology().vertex(b);
        let mesh = self.mesh;
        let pieces = move |margin: u32| {
            let of = |h: u32, is_turned: bool| {
                let runs = edge_runs(mesh.surface(), h, ends, rate).into_iter();
                runs.map(move |r| (Window::beside(mesh, r.run, margin), is_turned))
            };
            of(a, false).chain(of(b, same)).collect()
        };
        let run = edge_runs(surface, a, ends, rate)[0].run;
        let ends = self.run_ends(run);
        self.target("edge", run.patch, ends, pieces)
    }

    fn at_vertex(&mut self, random: &mut Random) -> Option<Target> {
        let incidence = self.incidence;
        let spokes = incidence.vertex(random.below(incidence.n_vertices()));
        let mesh = self.mesh;
        let corner = move |h: u32| {
            let (face, k, n) = place(mesh.surface(), h);
            if n == 4 { (mesh.surface().patch_of(face, 0), k as usize) } else { (mesh.surface().patch_of(face, k), 0) }
        };
        let (patch, k) = corner(spokes[0]);
        let point = self.corner_point(patch, k);
        let pieces = move |margin: u32| {
            let window = |&h: &u32| {
                let (patch, k) = corner(h);
                (Window::at_corner(mesh, patch, k, margin), false)
            };
            spokes.iter().map(window).collect()
        };
        self.target("vertex", patch, [point; 2], pieces)
    }

    fn in_polygon(&mut self, random: &mut Random) -> Option<Target> {
        let mesh = self.mesh;
        let face = self.incidence.polygons()[random.below(self.incidence.polygons().len())];
        let n = mesh.surface().face_size(face);
        if random.chance(0.25) {
            return self.at_centre(face, n);
        }
        let sides = inner_sides(mesh.surface(), face, random.below(n as usize) as u32);
        let rate = mesh.patch_rates(sides[0].0).sides[sides[0].1];
        let [from, to] = draw_segment(random, rate)?;
        let runs = sides.map(|(patch, side)| SideRun { patch, side, from, to });
        let ends = self.run_ends(runs[0]);
        let pieces = move |margin: u32| runs.map(|run| (Window::beside(mesh, run, margin), false)).to_vec();
        self.target("polygon", runs[0].patch, ends, pieces)
    }

    fn at_centre(&mut self, face: FaceId, n: u32) -> Option<Target> {
        let mesh = self.mesh;
        let patch = mesh.surface().patch_of(face, 0);
        let point = self.corner_point(patch, 2);
        let window = move |k: u32, margin: u32| Window::at_corner(mesh, mesh.surface().patch_of(face, k), 2, margin);
        let pieces = move |margin: u32| (0..n).map(|k| (window(k, margin), false)).collect();
        self.target("centre", patch, [point; 2], pieces)
    }

    /// A vertex, grid line or diagonal inside a patch; every other one lies on the border of a piece of 8 cells.
    fn in_patch(&mut self, random: &mut Random) -> Option<Target> {
        let mesh = self.mesh;
        let patch = self.patches[random.below(self.patches.len())];
        let rates = mesh.patch_rates(patch);
        let coordinate = |random: &mut Random, n: u32| {
            let at = random.below(n as usize + 1) as u32;
            if random.chance(0.5) { at - at % 8 } else { at }
        };
        let (i, j) = (coordinate(random, rates.n_u), coordinate(random, rates.n_v));
        // From (i, j) to itself, along u, along v, or along the diagonal.
        let (to_i, from_j, to_j) = [(i, j, j), (i + 1, j, j), (i, j, j + 1), (i + 1, j + 1, j)][random.below(4)];
        let is_inside = |from: u32, to: u32, n: u32| to <= n && (from != to || (0 < from && to < n));
        if !is_inside(i, to_i, rates.n_u) || !is_inside(from_j.min(to_j), from_j.max(to_j), rates.n_v) {
            return None;
        }
        let vertex = |(i, j)| point(self.vertex(Window::around(mesh, patch, [i; 2], [j; 2], 0)));
        let ends = [(i, from_j), (to_i, to_j)].map(vertex);
        let (rows, columns) = ([from_j.min(to_j), from_j.max(to_j)], [i, to_i]);
        self.target("inside", patch, ends, move |margin| {
            vec![(Window::around(mesh, patch, columns, rows, margin), false)]
        })
    }

    /// The only vertex of a window without cells.
    fn vertex(&mut self, window: Window) -> Vertex {
        window.dice(self.mesh, &mut self.dicer, &mut self.vertices);
        self.vertices[0]
    }

    fn corner_point(&mut self, patch: PatchId, corner: usize) -> DVec3 {
        let side = if corner == 0 || corner == 3 { 3 } else { 1 };
        let at = if corner < 2 { 0 } else { self.mesh.patch_rates(patch).sides[side] };
        let run = SideRun { patch, side, from: at, to: at };
        point(self.vertex(Window::border(self.mesh, run)))
    }

    /// The ends of a run of one or two border vertices.
    fn run_ends(&mut self, run: SideRun) -> [DVec3; 2] {
        [run.from, run.to].map(|at| point(self.vertex(Window::border(self.mesh, SideRun { from: at, to: at, ..run }))))
    }

    fn target(
        &mut self,
        kind: &'static str,
        patch: PatchId,
        ends: [DVec3; 2],
        pieces: impl Fn(u32) -> Vec<Piece>,
    ) -> Option<Target> {
        let mut margin = 1;
        loop {
            self.triangles.clear();
            for (window, is_turned) in pieces(margin) {
                if window.has_hole(self.mesh) {
                    return None;
                }
                window.dice(self.mesh, &mut self.dicer, &mut self.vertices);
                let triangles = &mut self.triangles;
                window.triangles(&self.vertices, |triangle| triangles.add(triangle, is_turned));
            }
            if self.triangles.extent() >= WANTED_EXTENT || margin >= MAX_MARGIN {
                return Some(Target { patch, ends, outline: self.triangles.outline(), kind });
            }
            margin *= 2;
        }
    }
}

/// A point of an edge cut into `rate`, other than its ends, or two points next to each other.
fn draw_segment(random: &mut Random, rate: u32) -> Option<[u32; 2]> {
    if random.chance(0.25) {
        let at = random.below(rate as usize) as u32;
        (at > 0).then_some([at; 2])
    } else {
        let at = random.below(rate as usize) as u32;
        Some([at, at + 1])
    }
}

impl Target {
    /// A point between the ends, sometimes the middle, an end or very near to one.
    pub fn point(&self, random: &mut Random) -> DVec3 {
        let t = match random.below(8) {
            0 => [0.0, 0.5, 1.0][random.below(3)],
            1 => 1e-6 * random.unit(),
            2 => 1.0 - 1e-6 * random.unit(),
            _ => random.unit(),
        };
        self.ends[0].lerp(self.ends[1], t)
    }
}
