//! From a described scene to a picture: what all commands that render have in common.

use super::camera::CameraArgs;
use super::input::EditArgs;
use super::progress::Progress;
use super::values::CacheSize;
use crate::error::{Error, ErrorKind, Result};
use crate::io::obj::ReadOptions;
use crate::io::process::{self, Stopwatch};
use crate::mesh::ControlMesh;
use crate::render::Film;
use crate::render::adaptive::render_adaptive;
use crate::render::budget::{RenderNeeds, too_small_for};
use crate::render::item_buffer::ItemBuffer;
use crate::render::settings::{self, Appearance, Groups, RenderSettings, RunSettings};
use crate::render::thesis::{Interpolation, render_thesis};
use crate::render::workers::{Rendered, render};
use crate::report::PhaseSeconds;
use crate::scene::camera::Camera;
use crate::scene::compile::{camera_of, compile};
use crate::scene::description::SceneDescription;
use crate::scene::intersect::Intersector;
use crate::scene::world::{GridCache, World, WorldMesh};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Bytes that stay resident after meshes have been prepared besides what was made: code that ran for the first time,
/// and what the allocator keeps for each thread. 3 MiB were seen with 2 threads.
const PREPARING_LEAVES: u64 = 4 << 20;

/// A scene whose meshes have not been read.
pub struct RenderScene<'a> {
    /// Camera, meshes (each with its rate), lights.
    pub scene: &'a SceneDescription,
    /// Replaces parts of the scene's or default camera.
    pub camera: CameraArgs,
    /// What to render.
    pub settings: &'a RenderSettings,
    /// How meshes are read.
    pub edits: EditArgs,
    /// Bytes that the whole process may have resident.
    pub memory: Option<u64>,
}

/// A scene ready to be traced.
pub struct Prepared<'a> {
    scene: &'a SceneDescription,
    settings: &'a RenderSettings,
    /// Geometry.
    pub world: World,
    /// Point of view.
    pub camera: Camera,
    /// Faces of all control meshes.
    pub control_faces: usize,
    /// Time so far.
    pub seconds: PhaseSeconds,
}

impl<'a> RenderScene<'a> {
    /// Reads the meshes and prepares them.
    pub fn prepare(self, threads: usize, quiet: bool) -> Result<Prepared<'a>> {
        let watch = Stopwatch::start();
        let meshes = self.read_meshes(threads, quiet)?;
        let control_faces = meshes.iter().map(ControlMesh::n_faces).sum();
        let mut seconds = PhaseSeconds { load: watch.seconds().into(), ..Default::default() };
        let watch = Stopwatch::start();
        self.check_film()?;
        self.check_budget(&meshes, threads)?;
        let (world, camera) = self.compile(meshes, threads, quiet)?;
        seconds.prepare = watch.seconds().into();
        Ok(Prepared { scene: self.scene, settings: self.settings, world, camera, control_faces, seconds })
    }

    /// Refuses a picture that the machine has no memory for.
    fn check_film(&self) -> Result<()> {
        let film = Film::n_bytes(self.settings.window, &self.settings.aovs) as u64;
        match process::available_bytes() {
            Some(available) if film > available => {
                let [film, available] = [film, available].map(|bytes| bytes.div_ceil(1 << 20));
                let message =
                    format!("the picture takes {film} MiB, {available} are available: make it smaller, or use --crop");
                Err(Error::new(ErrorKind::Budget, message))
            }
            _ => Ok(()),
        }
    }

    /// Refuses a budget that preparing and tracing these meshes would certainly exceed, whatever their plans take.
    fn check_budget(&self, meshes: &[ControlMesh], threads: usize) -> Result<()> {
        let Some(budget) = self.memory else { return Ok(()) };
        process::give_back_freed_memory();
        let mut held = process::resident_bytes().unwrap_or(0);
        let (mut peak, mut tables) =
            (held, GridCache::departure_bytes_for(meshes.iter().map(WorldMesh::n_patches_of).sum()));
        for mesh in meshes {
            let build = WorldMesh::build_bytes(mesh);
            held = held.saturating_sub(mesh.bytes() as u64);
            peak = peak.max(held + build.peak as u64);
            held += build.resident as u64;
            tables += build.tables;
        }
        let needs = RenderNeeds::new(held + PREPARING_LEAVES, tables, 0, self.settings, threads);
        let (what, least) = match needs.smallest_budget() {
            holding if holding > peak => ("hold the scene, the picture and what threads need", holding),
            _ => ("prepare the meshes", peak),
        };
        if least > budget { Err(too_small_for(what, budget, least)) } else { Ok(()) }
    }

    /// Prepares meshes that have been read, and the camera that frames them.
    pub fn compile(&self, meshes: Vec<ControlMesh>, threads: usize, quiet: bool) -> Result<(World, Camera)> {
        let camera = Camera::new(&self.camera.apply(camera_of(self.scene, &meshes, self.settings.size))?);
        let n_faces = meshes.iter().map(ControlMesh::n_faces).sum();
        let progress = Progress::new("faces prepared", quiet);
        let height = self.settings.size[1];
        let at_start = process::resident_bytes().unwrap_or(0);
        let planned = |share: f64| self.check_plans(share, at_start);
        let world = compile(self.scene, meshes, &camera, height, threads, &|k| progress.set(k, n_faces), &planned)?;
        progress.finish();
        self.warn_of_idle_tags(&world);
        Ok((world, camera))
    }

    /// Refuses the budget once the plans of a mesh, of which that share is made, exceed it.
    fn check_plans(&self, share: f64, at_start: u64) -> Result<()> {
        let Some(budget) = self.memory else { return Ok(()) };
        let resident = process::resident_bytes().unwrap_or(0);
        if resident <= budget {
            return Ok(());
        }
        let grown = resident.saturating_sub(at_start) as f64;
        Err(too_small_for("plan how irregular faces are split", budget, at_start + (grown / share) as u64))
    }

    /// Who counts vertices from 1 in a tag, which counts them from 0, creases nothing.
    fn warn_of_idle_tags(&self, world: &World) {
        for (mesh, description) in world.meshes().iter().zip(&self.scene.meshes) {
            let (n, file) = (mesh.surface().topology().idle_creases(), description.file.display());
            if n > 0 {
                let tags = if n == 1 { "1 crease tag names".to_owned() } else { format!("{n} crease tags name") };
                eprintln!("lazytess: warning: {file}: {tags} vertices that share no edge; tags count from 0");
            }
        }
    }

    /// Reads all meshes.
    pub fn read_meshes(&self, threads: usize, quiet: bool) -> Result<Vec<ControlMesh>> {
        let files: Vec<&Path> = self.scene.meshes.iter().map(|m| m.file.as_path()).collect();
        let sizes: Vec<u64> = files.iter().map(|file| file.metadata().map_or(0, |m| m.len())).collect();
        let (progress, total) = (Progress::new("MB of meshes read", quiet), megabytes(sizes.iter().sum()));
        let mut read_before = 0;
        let read = files.iter().zip(&sizes).map(|(file, size)| {
            let before = read_before;
            read_before += size;
            let report = |n_read| progress.set(megabytes(before + n_read), total);
            let limit = self.memory.unwrap_or(u64::MAX);
            self.edits.load_mesh_with(file, &ReadOptions { limit, n_threads: threads, progress: &report })
        });
        let meshes = read.collect();
        progress.finish();
        meshes
    }
}

fn megabytes(bytes: u64) -> usize {
    bytes.div_ceil(1_000_000) as usize
}

impl Prepared<'_> {
    /// An empty cache of that size.
    pub fn cache(&self, size: CacheSize, threads: usize) -> Result<GridCache> {
        let most = match size {
            CacheSize::Unbounded => self.world.full_tessellation(threads).most_bytes(),
            CacheSize::Bytes(_) => 0,
        };
        GridCache::new(&self.world, size.config(most, threads))
    }

    /// Bytes of what is remembered of patches that rays leave.
    pub fn departure_bytes(&self) -> usize {
        GridCache::departure_bytes_for(self.world.meshes().iter().map(|mesh| mesh.surface().n_patches()).sum())
    }

    /// The cache that a budget for the whole process leaves room for.
    ///
    /// # Errors
    /// If it leaves none; the message names the smallest budget that would do.
    pub fn cache_within(&self, budget: u64, threads: usize) -> Result<CacheSize> {
        process::give_back_freed_memory();
        let resident = process::resident_bytes().unwrap_or(self.world.bytes() as u64);
        let tables = GridCache::table_bytes_for(&self.world) + self.departure_bytes();
        let needs = RenderNeeds::new(resident, tables, self.world.largest_ring(), self.settings, threads);
        Ok(CacheSize::Bytes(needs.cache_bytes(budget)?))
    }

    /// Renders, with a progress bar where one can be seen.
    pub fn render(&self, cache: &GridCache, threads: usize, quiet: bool, cancel: &AtomicBool) -> Result<Rendered> {
        self.render_as(self.settings, cache, threads, quiet, cancel)
    }

    /// As [`render`](Self::render) with other settings, but the size that the scene was prepared for.
    pub fn render_as(
        &self,
        settings: &RenderSettings,
        cache: &GridCache,
        threads: usize,
        quiet: bool,
        cancel: &AtomicBool,
    ) -> Result<Rendered> {
        let appearance = self.appearance();
        let progress = Progress::new("pixels", quiet);
        let report = |p: settings::Progress| progress.set(p.done, p.total);
        let run = RunSettings { progress: &report, ..RunSettings::quiet(threads, cancel) };
        let make_tracer = || Intersector::new(&self.world, cache);
        let camera = &self.camera;
        let rendered = match settings.groups {
            Groups::Off => render(camera, &appearance, settings, &run, make_tracer),
            Groups::Adaptive => render_adaptive(&self.world, camera, &appearance, settings, &run, make_tracer),
            Groups::Thesis => {
                let watch = Instant::now();
                let items = ItemBuffer::new(&self.world, camera, settings, 1, threads)?;
                let rasterise = watch.elapsed().as_secs_f64();
                let how = Interpolation::Bilinear;
                let mut rendered = render_thesis(camera, &appearance, settings, &run, &items, how, make_tracer);
                rendered.seconds.prepare += rasterise;
                rendered
            }
        };
        progress.finish();
        Ok(rendered)
    }

    /// Materials and lights.
    pub fn appearance(&self) -> Appearance {
        let materials = self.scene.meshes.iter().map(|m| m.material.clone()).collect();
        Appearance::new(materials, self.scene.lights.clone(), self.scene.background)
    }
}
