//! `lazytess generate`: control meshes of this program's making, as OBJ.

use super::interrupt::{cancel_on_interrupt, unless_interrupted};
use super::outputs::{check_extension, check_outputs};
use super::progress::Progress;
use super::values::decimal_count;
use crate::error::{Error, Result};
use crate::ids::VertexId;
use crate::io::obj_write::{ObjWriter, write_obj};
use crate::mesh::shapes::{self, Crowd, Ground, NamedShape, Scan};
use crate::mesh::{ControlMesh, Corner, Crease, MeshSink};
use clap::Args;
use glam::DVec3;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Write a control mesh of this program's making as OBJ
///
/// Meshes of any size, made without holding them in memory: ground (mountains, quads only), scan (an irregular closed
/// mesh of quads and triangles), crowd (puppets, no two alike). Meshes with one vertex or face of any valence: pole,
/// quad-pole, globe, prism, n-gon. And by name every mesh of scenes/meshes (such as chess-knight) and every shape of
/// the test corpus; a name that does not exist lists them all. The same arguments give the same file on every machine.
#[derive(Args, Debug)]
pub struct GenerateArgs {
    /// What to make
    kind: String,
    /// File to write
    #[arg(short, long, value_name = "OUT.obj")]
    output: PathBuf,
    /// About how many faces (ground, scan, crowd); reads like 5000, 20k or 10M (decimal) [default: 10k]
    #[arg(long, value_name = "N", value_parser = decimal_count)]
    faces: Option<u64>,
    /// Which of the meshes of that kind (ground, scan, crowd) [default: 1]
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Edges at the middle vertex, or corners of the big face (pole, quad-pole, globe, prism, n-gon) [default: 8]
    #[arg(long, value_name = "N")]
    valence: Option<u32>,
    /// No progress bar
    #[arg(long, short)]
    quiet: bool,
}

/// As the help says.
const DEFAULT_FACES: u64 = 10_000;

/// Face corners are numbered in 31 bits; scans and crowds have up to five percent more faces than asked.
const MAX_FACES: u64 = 500_000_000;

/// Larger polygons and poles mean nothing that smaller ones do not.
const MAX_VALENCE: u32 = ControlMesh::MOST_CORNERS;

/// What to write, checked.
enum Job {
    Ground(Ground),
    Scan(Scan),
    Crowd(Crowd),
    Mesh(Box<ControlMesh>),
}

impl GenerateArgs {
    /// Writes the mesh.
    pub fn run(&self) -> Result<()> {
        check_extension(&self.output, "obj", "a mesh")?;
        check_outputs([self.output.as_path()], [])?;
        let job = self.job()?;
        let comment = format!("made by: lazytess generate {}", self.arguments());
        let progress = Progress::new("faces", self.quiet || matches!(job, Job::Mesh(_)));
        let cancel = cancel_on_interrupt()?;
        let written = write_obj(&self.output, |writer| {
            writer.comment(&comment)?;
            let n_faces = self.faces.unwrap_or(DEFAULT_FACES) as usize;
            let mut watched = Watched { writer, progress: &progress, cancel: &cancel, n_faces, done: 0 };
            match &job {
                Job::Ground(ground) => ground.write(&mut watched),
                Job::Scan(scan) => scan.write(&mut watched),
                Job::Crowd(crowd) => crowd.write(&mut watched),
                Job::Mesh(mesh) => watched.writer.mesh(mesh),
            }
        });
        progress.finish();
        unless_interrupted(written, &cancel, &self.output)
    }

    fn job(&self) -> Result<Job> {
        let sized = |job: fn(u64, u64) -> Job| self.sized(job);
        let valent = |shape: fn(u32) -> ControlMesh| self.valent(shape);
        match self.kind.as_str() {
            "ground" => sized(|faces, seed| Job::Ground(Ground { n: (faces as f64).sqrt().round() as u32, seed })),
            "scan" => sized(|faces, seed| Job::Scan(Scan::new(faces, seed))),
            "crowd" => sized(|faces, seed| Job::Crowd(Crowd::new(faces, seed))),
            "pole" => valent(shapes::pole),
            "quad-pole" => valent(shapes::quad_pole),
            "globe" => valent(|n| shapes::globe(n, 5)),
            "prism" => valent(shapes::prism),
            "n-gon" => valent(shapes::n_gon),
            name => self.named(name),
        }
    }

    fn sized(&self, job: fn(u64, u64) -> Job) -> Result<Job> {
        self.reject("valence", self.valence.is_some())?;
        let faces = self.faces.unwrap_or(DEFAULT_FACES);
        if faces == 0 || faces > MAX_FACES {
            return Err(Error::input(format!("--faces {faces} cannot be made: choose 1 to {MAX_FACES}")));
        }
        Ok(job(faces, self.seed.unwrap_or(1)))
    }

    fn valent(&self, shape: fn(u32) -> ControlMesh) -> Result<Job> {
        self.reject("faces", self.faces.is_some())?;
        self.reject("seed", self.seed.is_some())?;
        let valence = self.valence.unwrap_or(8);
        if !(3..=MAX_VALENCE).contains(&valence) {
            return Err(Error::input(format!("--valence {valence} cannot be made: choose 3 to {MAX_VALENCE}")));
        }
        Ok(Job::Mesh(Box::new(shape(valence))))
    }

    fn named(&self, name: &str) -> Result<Job> {
        let meshes: Vec<NamedShape> = shapes::scene_meshes().into_iter().chain(shapes::all()).collect();
        let names: Vec<_> = meshes.iter().map(|&(name, _)| name).collect();
        let unknown = || {
            let any = "ground, scan, crowd, pole, quad-pole, globe, prism, n-gon";
            Error::input(format!("there is no mesh '{name}': choose one of {any}, {}", names.join(", ")))
        };
        let i = names.iter().position(|&known| known == name).ok_or_else(unknown)?;
        self.reject("faces", self.faces.is_some())?;
        self.reject("seed", self.seed.is_some())?;
        self.reject("valence", self.valence.is_some())?;
        Ok(Job::Mesh(meshes.into_iter().nth(i).map(|(_, mesh)| Box::new(mesh)).unwrap_or_default()))
    }

    fn reject(&self, option: &str, given: bool) -> Result<()> {
        let kind = &self.kind;
        if given { Err(Error::input(format!("--{option} does not change a {kind}: leave it out"))) } else { Ok(()) }
    }

    /// The arguments that decide the file's content, as they could be typed again.
    fn arguments(&self) -> String {
        let option = |name, value: Option<u64>| value.map_or(String::new(), |value| format!(" --{name} {value}"));
        let valence = self.valence.map(u64::from);
        let options = [("faces", self.faces), ("seed", self.seed), ("valence", valence)];
        self.kind.clone() + &options.map(|(name, value)| option(name, value)).concat()
    }
}

/// A sink that moves the progress bar and listens for Ctrl-C.
struct Watched<'a, W> {
    writer: &'a mut ObjWriter<W>,
    progress: &'a Progress,
    cancel: &'a AtomicBool,
    n_faces: usize,
    done: usize,
}

impl<W: io::Write> MeshSink for Watched<'_, W> {
    fn vertex(&mut self, position: DVec3) -> io::Result<()> {
        if self.cancel.load(Ordering::Relaxed) {
            return Err(io::Error::other("interrupted"));
        }
        self.writer.vertex(position)
    }

    fn face(&mut self, corners: &[VertexId]) -> io::Result<()> {
        if self.cancel.load(Ordering::Relaxed) {
            return Err(io::Error::other("interrupted"));
        }
        self.done += 1;
        if self.done.is_multiple_of(10_000) {
            // Scans and crowds may end up with a few more faces than asked.
            self.progress.set(self.done.min(self.n_faces), self.n_faces);
        }
        self.writer.face(corners)
    }

    fn crease(&mut self, crease: Crease) -> io::Result<()> {
        self.writer.crease(crease)
    }

    fn corner(&mut self, corner: Corner) -> io::Result<()> {
        self.writer.corner(corner)
    }
}
