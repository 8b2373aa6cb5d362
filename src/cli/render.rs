//! `lazytess render`: a scene or mesh becomes a picture.

use super::input::{EditArgs, files_of, load_scene, settle_rates};
use super::interrupt::cancel_on_interrupt;
use super::job::{Prepared, RenderScene};
use super::outputs::check_outputs;
use super::picture::PictureArgs;
use super::run_options::{MemoryArgs, RunArgs};
use super::values::{ByteSize, CacheSize};
use super::{PICTURE, camera::CameraArgs, output};
use crate::error::{Error, ErrorKind, Result};
use crate::io::process::{Stopwatch, peak_resident_bytes};
use crate::io::write::write_whole;
use crate::render::workers::Rendered;
use crate::render::{Aov, RenderSettings};
use crate::report::{
    CacheReport, CostReport, DepartureReport, GeometryReport, GroupReport, MemoryReport, PictureReport, RayReport,
    RenderStatistics,
};
use crate::scene::description::SceneDescription;
use crate::scene::world::GridCache;
use clap::Args;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;

/// Render a scene or a mesh
///
/// A bare mesh gets a camera that frames it, a key light and a neutral material. Ctrl-C stops, writes what is done and
/// exits with 130. Statistics go to stderr in words and with --stats to a file as JSON.
#[derive(Args, Clone, Debug)]
pub struct RenderArgs {
    /// scene.toml or mesh.obj
    pub input: PathBuf,
    /// Picture to write: .exr (linear, 16-bit half, layers) or .png (8-bit sRGB)
    #[arg(short, long, value_name = "OUT.exr|OUT.png")]
    pub output: PathBuf,
    /// Further layers of the EXR file: Z, N, mesh, patch, uv, samples, miss, build, group, reason, error. The last
    /// three get pictures beside a PNG; miss and build show the cache at work and depend on it
    #[arg(long, value_name = "LIST", value_delimiter = ',', help_heading = PICTURE)]
    pub aov: Vec<Aov>,
    /// Write the statistics as JSON
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    /// The picture
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Speed
    #[command(flatten)]
    pub run: RunArgs,
    /// Memory
    #[command(flatten)]
    pub memory: MemoryArgs,
}

/// File formats of pictures.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PictureFormat {
    /// OpenEXR.
    Exr,
    /// PNG.
    Png,
}

/// A render, resolved and checked; no mesh has been read.
#[derive(Clone, Debug)]
pub struct RenderJob {
    /// Camera, meshes (each with its rate), lights.
    pub scene: SceneDescription,
    /// Replaces parts of the scene's or default camera.
    pub camera: CameraArgs,
    /// What to render.
    pub settings: RenderSettings,
    /// How meshes are read.
    pub edits: EditArgs,
    /// Where the picture goes.
    pub output: PathBuf,
    /// As what.
    pub format: PictureFormat,
    /// Where the statistics go.
    pub stats: Option<PathBuf>,
    /// Bytes for tessellated patches, unless `memory` decides.
    pub cache: CacheSize,
    /// Bytes for everything.
    pub memory: Option<u64>,
    /// Worker threads.
    pub threads: usize,
    /// Neither bar nor summary.
    pub quiet: bool,
}

impl PictureFormat {
    /// By the file's extension.
    pub fn of(path: &Path) -> Result<Self> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("exr") => Ok(Self::Exr),
            Some("png") => Ok(Self::Png),
            _ => Err(Error::input("a picture's name should end in .exr or .png").at(path, None)),
        }
    }
}

impl RenderArgs {
    /// Reads the scene file and settles everything that was left open.
    pub fn job(self) -> Result<RenderJob> {
        let format = PictureFormat::of(&self.output)?;
        if format == PictureFormat::Png && !self.aov.iter().all(|&aov| output::is_drawn(aov)) {
            let message = "--aov needs an EXR file: beside a PNG lie pictures of group, reason and error only";
            return Err(Error::input(message).at(&self.output, None));
        }
        if let Some(twice) = (1..self.aov.len()).find(|&i| self.aov[..i].contains(&self.aov[i])) {
            return Err(Error::input(format!("--aov names {} twice", self.aov[twice])));
        }
        let mut scene = load_scene(&self.input)?;
        let pictures = output::files(&self.output, format, &self.aov);
        let outputs = pictures.iter().map(PathBuf::as_path).chain(self.stats.as_deref());
        check_outputs(outputs, files_of(&self.input, &scene))?;
        settle_rates(&mut scene, self.picture.rate);
        Ok(RenderJob {
            settings: self.picture.settings(&scene, self.aov)?,
            scene,
            camera: self.picture.camera,
            edits: self.picture.edits,
            output: self.output,
            format,
            stats: self.stats,
            cache: self.run.cache(),
            memory: self.memory.memory.map(|ByteSize(bytes)| bytes),
            threads: self.run.threads(),
            quiet: self.run.quiet,
        })
    }
}

impl RenderArgs {
    /// Renders and writes.
    pub fn run(self) -> Result<()> {
        let input = self.input.display().to_string();
        self.job()?.run(&input)
    }
}

impl RenderJob {
    fn run(self, input: &str) -> Result<()> {
        let cancel = cancel_on_interrupt()?;
        let scene = RenderScene {
            scene: &self.scene,
            camera: self.camera,
            settings: &self.settings,
            edits: self.edits,
            memory: self.memory,
        };
        let mut prepared = scene.prepare(self.threads, self.quiet)?;
        let size = self.memory.map_or(Ok(self.cache), |budget| prepared.cache_within(budget, self.threads))?;
        let cache = prepared.cache(size, self.threads)?;
        let watch = Stopwatch::start();
        let rendered = prepared.render(&cache, self.threads, self.quiet, &cancel)?;
        prepared.seconds.render = watch.seconds().into();
        if rendered.film.n_done() == 0 {
            let message = format!("interrupted before the first pixel: {} is as it was", self.output.display());
            return Err(Error::new(ErrorKind::Interrupted, message));
        }
        let is_reported = !self.quiet || self.stats.is_some();
        let statistics = is_reported.then(|| self.statistics(input, &prepared, size, &cache, &rendered));
        // Writing needs memory, too, and the budget counts on this.
        drop(cache);
        let watch = Stopwatch::start();
        output::write_film(&self.output, self.format, &rendered.film, self.settings.size)?;
        if let Some(mut statistics) = statistics {
            statistics.seconds.write = watch.seconds().into();
            statistics.memory.peak_resident_bytes = peak_resident_bytes();
            self.report(&statistics)?;
        }
        if cancel.load(Ordering::Relaxed) && !rendered.complete {
            let (done, all) = (rendered.film.n_done(), self.settings.window.n_pixels());
            let message = format!("interrupted: {done} of {all} pixels are done and in {}", self.output.display());
            return Err(Error::new(ErrorKind::Interrupted, message));
        }
        Ok(())
    }

    fn report(&self, statistics: &RenderStatistics) -> Result<()> {
        if let Some(path) = &self.stats {
            let json = statistics.to_json();
            write_whole(path, |out| out.write_all(json.as_bytes()))?;
        }
        if !self.quiet {
            eprint!("{statistics}");
        }
        Ok(())
    }

    fn statistics(
        &self,
        input: &str,
        prepared: &Prepared<'_>,
        size: CacheSize,
        cache: &GridCache,
        rendered: &Rendered,
    ) -> RenderStatistics {
        let full = prepared.world.full_tessellation(self.threads);
        let capacity = match size {
            CacheSize::Bytes(bytes) => Some(bytes),
            CacheSize::Unbounded => None,
        };
        RenderStatistics {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            input: input.to_owned(),
            threads: self.threads,
            picture: PictureReport {
                width: self.settings.size[0],
                height: self.settings.size[1],
                pixels: self.settings.window.n_pixels(),
                pixels_done: rendered.film.n_done(),
                spp: self.settings.spp,
                integrator: self.settings.integrator.to_string(),
            },
            groups: GroupReport::new(&self.settings, rendered),
            rays: RayReport { counts: rendered.rays, total: rendered.rays.total() },
            geometry: GeometryReport {
                meshes: prepared.world.meshes().len(),
                control_faces: prepared.control_faces,
                patches: prepared.world.n_patches(),
                patches_touched: cache.patches_touched() as usize,
                grids_built: cache.pieces_built(),
                resident_bytes: (prepared.world.bytes() + cache.table_bytes()) as u64,
                full_triangles: full.triangles,
                full_bytes: full.bytes,
            },
            cache: CacheReport::new(capacity, &cache.segments().statistics()),
            costs: CostReport::new(&prepared.world, &cache.costs()),
            departures: DepartureReport { counts: cache.departure_counts(), bytes: prepared.departure_bytes() as u64 },
            memory: MemoryReport { budget_bytes: self.memory, peak_resident_bytes: None },
            seconds: prepared.seconds,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        render: RenderArgs,
    }

    fn job(line: &str) -> std::result::Result<RenderJob, String> {
        let typed = Typed::try_parse_from(format!("test {line}").split_whitespace()).map_err(|e| e.to_string())?;
        typed.render.job().map_err(|e| e.to_string())
    }

    #[test]
    fn every_flag_of_the_contract_is_understood() {
        let line = "m.obj -o out.exr --size 64x48 --spp 2 --integrator debug:uv --rate fixed:8 --cache 16M --threads 3 \
                    --crop 1,2,3,4 --eye 1,2,-3 --at -1,0,0 --up 0,0,1 --fov 40 --aov Z,N --stats s.json --quiet";
        let job = job(line).unwrap();
        assert_eq!((job.cache, job.threads, job.quiet), (CacheSize::Bytes(16 << 20), 3, true));
        assert_eq!(job.settings.aovs, [Aov::Depth, Aov::Normal]);
        assert_eq!(job.scene.meshes[0].rate, "fixed:8".parse().ok());
        assert_eq!(job.camera.eye.map(|eye| eye.z), Some(-3.0));
    }

    #[test]
    fn mistakes_are_told_before_work_begins() {
        let cases = [
            ("m.obj -o out.jpg", "out.jpg: a picture's name should end in .exr or .png"),
            ("m.obj -o out.png --aov Z", "out.png: --aov needs an EXR file"),
            ("m.obj -o no/such/out.png", "no/such/out.png: there is no folder no/such to write to"),
            ("m.ply -o out.png", "m.ply: is neither a scene (.toml) nor a mesh (.obj)"),
            ("none.toml -o out.png", "cannot read none.toml"),
            ("m.obj -o a.png --cache 1M --memory 1G", "error: the argument '--cache <SIZE|unbounded>' cannot be used"),
            ("m.obj -o a.png --aov W", "error: invalid value 'W' for '--aov <LIST>'"),
            ("m.obj -o a.png --threads 0", "error: invalid value '0' for '--threads <N>'"),
            ("m.obj", "error: the following required arguments were not provided"),
        ];
        for (line, expected) in cases {
            let message = job(line).unwrap_err();
            assert!(message.starts_with(expected), "{line}: {message}");
        }
    }
}
