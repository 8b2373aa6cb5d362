//! `lazytess check`: is the mesh what it seems, and does its tessellation hold water?

use super::input::EditArgs;
use super::interrupt::cancel_on_interrupt;
use super::progress::Progress;
use super::run_options::RunArgs;
use super::stdout;
use super::values::{decimal_count, positive, vector};
use crate::check::{Incidence, LeakReport, LeakSettings, SeamReport, compare_seams, find_leaks};
use crate::error::{Error, ErrorKind, Result};
use crate::ids::MeshId;
use crate::mesh::ControlMesh;
use crate::scene::intersect::Intersector;
use crate::scene::rate::DicingRate;
use crate::scene::world::{GridCache, World, WorldMesh};
use crate::subdiv::MAX_RATE;
use clap::Args;
use glam::{DAffine3, DQuat, DVec3};
use serde::Serialize;
use std::io::{self, Write};
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, Ordering};

/// Report a mesh's topology and aim rays at its edges and vertices
///
/// Compares the border vertices of all neighbouring patches, then sends rays from both sides through random points of
/// shared edges, vertices and cell borders. One that passes is a leak. Open meshes are tested where patches meet; their
/// open edges are counted, and nothing is aimed at them. Exit code 1 says that there are leaks or unequal borders.
#[derive(Args, Clone, Debug)]
pub struct CheckArgs {
    /// mesh.obj
    pub mesh: PathBuf,
    /// Hierarchical edits
    #[command(flatten)]
    pub edits: EditArgs,
    /// How many rays to aim
    #[arg(long, value_name = "N", default_value = "1M", value_parser = decimal_count)]
    pub rays: u64,
    /// Pieces for each edge: the same for all, or random ones from 1 to 1000 that differ from edge to edge
    #[arg(long, value_name = "N|random:SEED", default_value = "8")]
    pub rate: CheckRate,
    /// Seed of targets and rays
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// Size at which the mesh stands in the world
    #[arg(long, value_name = "S", default_value_t = 1.0, value_parser = positive)]
    pub scale: f64,
    /// Where its origin stands in the world
    #[arg(long, value_name = "x,y,z", default_value = "0,0,0", value_parser = vector, allow_hyphen_values = true)]
    pub offset: DVec3,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Speed
    #[command(flatten)]
    pub run: RunArgs,
}

/// Rates of the edges under test.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum CheckRate {
    /// Every edge has this one, in 1..=4096.
    Fixed(u32),
    /// Every edge has its own, drawn with this seed.
    Random(u64),
}

/// What is printed.
#[derive(Serialize)]
struct Report {
    mesh: String,
    topology: TopologyReport,
    seams: SeamReport,
    rays: LeakReport,
    complete: bool,
}

#[derive(Serialize)]
struct TopologyReport {
    vertices: usize,
    unused_vertices: usize,
    faces: usize,
    quads: usize,
    largest_face: u32,
    patches: usize,
    closed: bool,
    shared_edges: usize,
    boundary_edges: usize,
    nonmanifold_edges: usize,
    nonmanifold_vertices: usize,
    hidden_faces: usize,
    creased_edges: usize,
    /// Fewest and most faces at a vertex.
    faces_at_vertex: [usize; 2],
}

impl CheckArgs {
    /// Checks, prints, and fails if something is wrong.
    pub fn run(&self) -> Result<()> {
        let cancel = cancel_on_interrupt()?;
        let threads = self.run.threads();
        let mesh = self.edits.load_mesh(&self.mesh)?;
        let description = DescribedMesh::of(&mesh);
        let world_from_object =
            DAffine3::from_scale_rotation_translation(DVec3::splat(self.scale), DQuat::IDENTITY, self.offset);
        let world = World::new(vec![WorldMesh::new(mesh, world_from_object, self.rate.dicing(), threads)?]);
        let incidence = Incidence::new(world.mesh(MeshId(0)).surface());
        let seams = compare_seams(world.mesh(MeshId(0)), &incidence, threads, &cancel);
        let rays = self.trace(&world, &incidence, threads, &cancel)?;
        let report = Report {
            mesh: self.mesh.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            topology: description.report(world.mesh(MeshId(0)), &incidence),
            seams,
            rays,
            complete: !cancel.load(Ordering::Relaxed),
        };
        self.print(&report)?;
        report.verdict()
    }

    fn trace(&self, world: &World, incidence: &Incidence, threads: usize, cancel: &AtomicBool) -> Result<LeakReport> {
        let most = world.full_tessellation(threads).most_bytes();
        let cache = GridCache::new(world, self.run.cache().config(most, threads))?;
        let progress = Progress::new("rays", self.run.quiet);
        let settings = LeakSettings { rays: self.rays, seed: self.seed, threads };
        let report = |done: u64| progress.set(done as usize, self.rays as usize);
        let make_tracer = || Intersector::new(world, &cache);
        let leaks = find_leaks(world.mesh(MeshId(0)), incidence, &settings, cancel, &report, make_tracer);
        progress.finish();
        Ok(leaks)
    }

    fn print(&self, report: &Report) -> Result<()> {
        stdout::print(|out| {
            if self.json {
                serde_json::to_writer(&mut *out, report)?;
                return writeln!(out);
            }
            report.write(out)
        })
    }
}

/// What is known of a control mesh before it becomes a world.
struct DescribedMesh {
    vertices: usize,
    quads: usize,
    largest_face: u32,
}

impl DescribedMesh {
    fn of(mesh: &ControlMesh) -> Self {
        Self {
            vertices: mesh.positions.len(),
            quads: mesh.face_sizes.iter().filter(|&&n| n == 4).count(),
            largest_face: mesh.face_sizes.iter().copied().max().unwrap_or(0),
        }
    }

    fn report(&self, mesh: &WorldMesh, incidence: &Incidence) -> TopologyReport {
        let surface = mesh.surface();
        let counts = surface.topology().counts();
        let at_vertex = (0..incidence.n_vertices()).map(|v| incidence.vertex(v).len());
        TopologyReport {
            vertices: self.vertices,
            unused_vertices: self.vertices - incidence.n_vertices(),
            faces: surface.topology().n_faces(),
            quads: self.quads,
            largest_face: self.largest_face,
            patches: mesh.n_leaves(),
            closed: mesh.n_leaves() > 0 && incidence.n_open() == 0,
            shared_edges: incidence.n_edges(),
            boundary_edges: incidence.n_open(),
            nonmanifold_edges: counts.nonmanifold_edges,
            nonmanifold_vertices: counts.nonmanifold_vertices,
            hidden_faces: counts.hidden_faces,
            creased_edges: counts.creased_edges,
            faces_at_vertex: [at_vertex.clone().min().unwrap_or(0), at_vertex.max().unwrap_or(0)],
        }
    }
}

impl Report {
    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let t = &self.topology;
        let closed = if t.closed { "closed" } else { "open" };
        writeln!(out, "{}: {} faces ({} quads), {} patches, {closed}", self.mesh, t.faces, t.quads, t.patches)?;
        let [fewest, most] = t.faces_at_vertex;
        writeln!(out, "vertices: {}, {} unused, {fewest} to {most} faces at one", t.vertices, t.unused_vertices)?;
        writeln!(out, "edges: {} shared, {} with one face", t.shared_edges, t.boundary_edges)?;
        writeln!(out, "non-manifold: {} edges, {} vertices", t.nonmanifold_edges, t.nonmanifold_vertices)?;
        writeln!(out, "tags: {} creased edges, {} faces without surface", t.creased_edges, t.hidden_faces)?;
        let s = &self.seams;
        writeln!(out, "borders: {} points of {} seams compared, {} differ", s.points, s.seams, s.different)?;
        s.examples.iter().try_for_each(|example| writeln!(out, "  {example}"))?;
        let r = &self.rays;
        writeln!(out, "rays: {} at {} targets, {} leaks, {} hit nothing", r.rays, r.targets, r.leaks, r.hit_nothing)?;
        writeln!(out, "not aimed: {} rays, at targets seen edge-on or too small for single precision", r.unfit)?;
        for leak in &r.examples {
            let [x, y, z] = leak.origin;
            let [dx, dy, dz] = leak.direction;
            writeln!(out, "  {} of patch {}: from {x},{y},{z} along {dx},{dy},{dz}", leak.target, leak.patch)?;
        }
        Ok(())
    }

    fn verdict(&self) -> Result<()> {
        let (leaks, different) = (self.rays.leaks, self.seams.different);
        if leaks + different > 0 {
            let message = format!("{leaks} rays passed and {different} border points differ: please report the mesh");
            return Err(Error::new(ErrorKind::Check, message));
        }
        if self.complete && self.rays.rays == 0 && self.rays.unfit > 0 {
            let message = "no ray could be aimed: the mesh is too flat, or too far away for its size";
            return Err(Error::new(ErrorKind::Check, message.to_owned()));
        }
        if !self.complete {
            let message = format!("interrupted after {} rays without a leak", self.rays.rays);
            return Err(Error::new(ErrorKind::Interrupted, message));
        }
        Ok(())
    }
}

impl CheckRate {
    fn dicing(self) -> DicingRate {
        match self {
            Self::Fixed(n) => DicingRate::Fixed(n),
            Self::Random(seed) => DicingRate::Random(seed),
        }
    }
}

impl FromStr for CheckRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let rate = match text.strip_prefix("random:") {
            Some(seed) => seed.parse().ok().map(Self::Random),
            None => text.parse().ok().filter(|n| (1..=MAX_RATE).contains(n)).map(Self::Fixed),
        };
        rate.ok_or_else(|| format!("'{text}' is no rate: write N in 1..{MAX_RATE}, or random:SEED"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_fixed_or_random() {
        assert_eq!("16".parse(), Ok(CheckRate::Fixed(16)));
        assert_eq!("random:7".parse(), Ok(CheckRate::Random(7)));
        for bad in ["", "0", "4097", "random", "random:", "random:-1", "fixed:3"] {
            assert!(bad.parse::<CheckRate>().unwrap_err().contains("is no rate"), "{bad}");
        }
    }
}
