//! Border vertices of neighbouring patches, compared to the bit.

use super::incidence::{EdgeRun, Incidence, SideRun, edge_rate, edge_runs, inner_sides};
use super::window::{Vertex, Window};
use crate::ids::FaceId;
use crate::parallel::on_threads;
use crate::scene::world::WorldMesh;
use crate::subdiv::Dicer;
use crate::subdiv::snapped;
use parking_lot::Mutex;
use serde::Serialize;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What a comparison found.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SeamReport {
    /// Seams between two patches or more.
    pub seams: u64,
    /// Points that were compared, once for each side after the first.
    pub points: u64,
    /// Points at which a side has other bits than the first.
    pub different: u64,
    /// Some of these, in words.
    pub examples: Vec<String>,
}

/// Examples that are kept.
const MAX_EXAMPLES: usize = 10;

/// Seams that a thread compares before it asks for more.
const SEAMS_PER_TASK: usize = 64;

/// Compares all seams of a mesh on `n_threads` threads, until `cancel` is set.
pub fn compare_seams(mesh: &WorldMesh, incidence: &Incidence, n_threads: usize, cancel: &AtomicBool) -> SeamReport {
    let n_edges = incidence.n_edges();
    let n = n_edges + incidence.polygons().len();
    let next = AtomicUsize::new(0);
    let total = Mutex::new(SeamReport::default());
    let work = || {
        let mut comparer =
            Comparer { mesh, dicer: Dicer::default(), vertices: Vec::new(), report: SeamReport::default() };
        while !cancel.load(Ordering::Relaxed) {
            let start = next.fetch_add(SEAMS_PER_TASK, Ordering::Relaxed);
            if start >= n {
                break;
            }
            for seam in start..(start + SEAMS_PER_TASK).min(n) {
                if seam < n_edges {
                    comparer.edge(incidence.edge(seam));
                } else {
                    comparer.polygon(incidence.polygons()[seam - n_edges]);
                }
            }
        }
        total.lock().add(comparer.report);
    };
    on_threads(n_threads, work);
    let mut report = total.into_inner();
    report.examples.sort();
    report.examples.truncate(MAX_EXAMPLES);
    report
}

impl SeamReport {
    fn add(&mut self, other: Self) {
        self.seams += other.seams;
        self.points += other.points;
        self.different += other.different;
        self.examples.extend(other.examples);
    }
}

struct Comparer<'a> {
    mesh: &'a WorldMesh,
    dicer: Dicer,
    vertices: Vec<Vertex>,
    report: SeamReport,
}

impl Comparer<'_> {
    fn edge(&mut self, half_edges: &[u32]) {
        let surface = self.mesh.surface();
        let rate = edge_rate(surface, half_edges[0], |patch| self.mesh.patch_rates(patch));
        let first = self.edge_points(half_edges[0], rate);
        self.report.seams += 1;
        for &h in &half_edges[1..] {
            let other = self.edge_points(h, rate);
            self.compare(&first, &other, || format!("half-edges {} and {h}", half_edges[0]));
        }
    }

    /// The points of an edge from its smaller vertex, as the patches of `h`'s face dice them.
    fn edge_points(&mut self, h: u32, rate: u32) -> Vec<Vec<Vertex>> {
        let mut points = vec![Vec::new(); rate as usize + 1];
        for EdgeRun { run, first, is_backward } in edge_runs(self.mesh.surface(), h, [0, rate], rate) {
            for (k, vertices) in (0..).zip(self.points(run)) {
                let at = if is_backward { first - k } else { first + k };
                points[at as usize].extend(vertices);
            }
        }
        points
    }

    fn polygon(&mut self, face: FaceId) {
        let surface = self.mesh.surface();
        for k in 0..surface.face_size(face) {
            let whole = inner_sides(surface, face, k).map(|(patch, side)| {
                let rate = self.mesh.patch_rates(patch).sides[side];
                SideRun { patch, side, from: 0, to: rate }
            });
            let [first, other] = whole.map(|run| self.points(run));
            self.report.seams += 1;
            self.compare(&first, &other, || format!("the inner sides of edge {k} of face {face}"));
        }
    }

    /// For every point of a run, the grid vertices that lie there.
    fn points(&mut self, run: SideRun) -> Vec<Vec<Vertex>> {
        let window = Window::border(self.mesh, run);
        window.dice(self.mesh, &mut self.dicer, &mut self.vertices);
        let along_u = run.side == 0 || run.side == 2;
        let (n, first) = if along_u { (window.rates.n_u, window.i[0]) } else { (window.rates.n_v, window.j[0]) };
        let mut points = vec![Vec::new(); (run.to - run.from) as usize + 1];
        for (k, &vertex) in self.vertices.iter().enumerate() {
            points[(snapped(first + k as u32, n, window.rates.sides[run.side]) - run.from) as usize].push(vertex);
        }
        points
    }

    fn compare(&mut self, first: &[Vec<Vertex>], other: &[Vec<Vertex>], which: impl Fn() -> String) {
        if first.len() != other.len() {
            self.differ(|| format!("{}: {} points and {}", which(), first.len(), other.len()));
            return;
        }
        for (k, (a, b)) in first.iter().zip(other).enumerate() {
            self.report.points += 1;
            let Some(&vertex) = a.first() else {
                self.differ(|| format!("{}: nobody has point {k}", which()));
                continue;
            };
            if let Some(odd) = a.iter().chain(b).find(|v| **v != vertex) {
                self.differ(|| format!("{}: point {k} of {} is {vertex:?} and {odd:?}", which(), first.len() - 1));
            } else if b.is_empty() {
                self.differ(|| format!("{}: one side alone has point {k}", which()));
            }
        }
    }

    fn differ(&mut self, words: impl Fn() -> String) {
        self.report.different += 1;
        if self.report.examples.len() < MAX_EXAMPLES {
            self.report.examples.push(words());
        }
    }
}
