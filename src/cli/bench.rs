//! `lazytess bench`: ray rates by a recipe that other tracers follow too.

use super::camera::CameraArgs;
use super::input::EditArgs;
use super::outputs::check_outputs;
use super::progress::Progress;
use super::run_options::RunArgs;
use super::values::{count, fixed_rate, picture_size};
use super::{PICTURE, stdout};
use crate::bench::{Bench, BenchHit, BenchResult, BenchSettings, face_parameters};
use crate::cache::CacheStatistics;
use crate::error::Result;
use crate::ids::MeshId;
use crate::io::process::{Stopwatch, peak_resident_bytes, resident_bytes};
use crate::io::write::write_whole;
use crate::math::Hit;
use crate::mesh::ControlMesh;
use crate::scene::camera::Camera;
use crate::scene::description::CameraDescription;
use crate::scene::intersect::Intersector;
use crate::scene::rate::DicingRate;
use crate::scene::world::{GridCache, World, WorldMesh};
use clap::Args;
use glam::DAffine3;
use serde::Serialize;
use std::io::Write;
use std::path::PathBuf;

/// Measure rays a second: primary, ambient occlusion and diffuse rays
///
/// Camera, rays and hit file are those of a recipe for comparisons between tracers: 35 degree default camera, rays
/// through pixel centres, cosine-distributed secondary rays from hashed numbers. Rates are million rays a second.
#[derive(Args, Debug)]
pub struct BenchArgs {
    /// Control mesh
    #[arg(value_name = "MESH.obj")]
    mesh: PathBuf,
    /// Segments that every edge of a quad is cut into, 1 to 4096
    #[arg(long, value_name = "N", value_parser = fixed_rate, help_heading = PICTURE)]
    rate: u32,
    /// Picture size in pixels
    #[arg(long, default_value = "800x600", value_name = "WxH", value_parser = picture_size, help_heading = PICTURE)]
    size: [u32; 2],
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    edits: EditArgs,
    /// Which rays to measure
    #[arg(long, value_delimiter = ',', default_value = "primary,ao,diffuse", value_name = "LIST")]
    rays: Vec<RayKind>,
    /// Ambient occlusion rays at each hit
    #[arg(long, default_value_t = 8, value_name = "N", value_parser = clap::value_parser!(u32).range(..=4096))]
    ao: u32,
    /// Trace primary rays one by one, as given; else those of 4 x 2 pixels together
    #[arg(long)]
    one_by_one: bool,
    /// Hand secondary rays over N at a time, for the tracer to put into an order of its own; 0: one by one, as given
    #[arg(long, default_value_t = 0, value_name = "N")]
    batch: usize,
    /// Do not tell on which triangle secondary rays start, so that they are tested against all of the patch that they
    /// leave
    #[arg(long)]
    no_start: bool,
    /// Passes of each measurement
    #[arg(long, default_value_t = 5, value_name = "K", value_parser = count)]
    repeat: u32,
    #[command(flatten)]
    run: RunArgs,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
    /// Write the primary hits: 7 little-endian f32 a pixel, row by row: t, face, u, v, normal
    #[arg(long, value_name = "FILE")]
    hits: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, clap::ValueEnum)]
enum RayKind {
    Primary,
    Ao,
    Diffuse,
}

/// The printed object. Keys are those of the recipe's other programs, and the cache's counters.
#[derive(Serialize)]
struct Report {
    peer: String,
    mesh: String,
    rate: u32,
    threads: usize,
    faces: usize,
    verts: usize,
    triangles: u64,
    diag: f64,
    build_s: f64,
    build_cpu_s: f64,
    /// Bytes of grids and their trees, all that was built, by the triangles in them.
    bytes_per_tri: f64,
    resident_bytes: usize,
    resident_bytes_per_face: f64,
    width: u32,
    height: u32,
    eye: [f64; 3],
    /// Whether primary rays were traced one by one.
    one_by_one: bool,
    /// Secondary rays handed over at a time; 0: one by one.
    batch: usize,
    /// Whether secondary rays came with the triangle that they start above.
    tells_start: bool,
    #[serde(flatten)]
    result: BenchResult,
    rss_end_kb: i64,
    hwm_kb: u64,
    patches_touched: u64,
    cache: CacheStatistics,
}

impl BenchArgs {
    /// Measures and prints.
    pub fn run(&self) -> Result<()> {
        check_outputs(self.hits.as_deref(), [self.mesh.as_path()])?;
        let mesh = rounded_to_f32(self.edits.load_mesh(&self.mesh)?);
        let (faces, verts, bounds) = (mesh.n_faces(), mesh.positions.len(), mesh.bounds());
        let description = self.camera.apply(CameraDescription::framing(bounds))?;
        let camera = Camera::new(&description);
        let threads = self.run.threads();
        let settings = BenchSettings {
            size: self.size,
            threads,
            ao: self.ao,
            one_by_one: self.one_by_one,
            batch: self.batch,
            tells_start: !self.no_start,
            repeat: self.repeat as usize,
            passes: [RayKind::Primary, RayKind::Ao, RayKind::Diffuse].map(|k| self.rays.contains(&k)),
            diagonal: bounds.diagonal(),
        };
        let progress = Progress::new("passes", self.run.quiet);
        let show = |done, n| progress.set(done, n);
        let mut bench = Bench::new(&camera, settings, &show);
        let rss_before = resident_bytes().unwrap_or(0);
        let watch = Stopwatch::start();
        let rate = DicingRate::Fixed(self.rate);
        let world = World::new(vec![WorldMesh::new(mesh, DAffine3::IDENTITY, rate, threads)?]);
        let (build_s, build_cpu_s) = watch.seconds();
        let full = world.full_tessellation(threads);
        let cache = GridCache::new(&world, self.run.cache().config(full.most_bytes(), threads))?;
        let result = bench.run(|| Intersector::new(&world, &cache), |hit| bench_hit(&world, hit));
        let counters = cache.segments().statistics();
        let report = Report {
            peer: format!("lazytess {}", env!("CARGO_PKG_VERSION")),
            mesh: self.mesh.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned()),
            rate: self.rate,
            threads,
            faces,
            verts,
            triangles: full.triangles,
            diag: bounds.diagonal(),
            build_s,
            build_cpu_s,
            bytes_per_tri: counters.bytes_built as f64 / cache.triangles_built().max(1) as f64,
            resident_bytes: world.bytes() + cache.table_bytes(),
            resident_bytes_per_face: (world.bytes() + cache.table_bytes()) as f64 / faces.max(1) as f64,
            width: self.size[0],
            height: self.size[1],
            eye: description.eye.to_array(),
            one_by_one: self.one_by_one,
            batch: self.batch,
            tells_start: !self.no_start,
            result,
            rss_end_kb: (resident_bytes().unwrap_or(0) as i64 - rss_before as i64) / 1024,
            hwm_kb: peak_resident_bytes().unwrap_or(0) / 1024,
            patches_touched: cache.patches_touched(),
            cache: counters,
        };
        if let Some(path) = &self.hits {
            write_whole(path, |out| out.write_all(&bench.hit_bytes()))?;
        }
        progress.finish();
        self.print(&report)
    }

    fn print(&self, report: &Report) -> Result<()> {
        stdout::print(|out| {
            if self.json {
                serde_json::to_writer(&mut *out, report)?;
                return writeln!(out);
            }
            let r = &report.result;
            writeln!(out, "{}: {} faces, {} triangles in full", report.mesh, report.faces, report.triangles)?;
            writeln!(out, "built in {:.3} s, first frame {:.3} s", report.build_s, r.first_pass_s)?;
            let passes = [("primary", r.primary), ("ao", r.ao)];
            let diffuse = [("diffuse, tile order", r.diffuse_tile_order), ("diffuse, shuffled", r.diffuse_shuffled)];
            for (name, rates) in passes.into_iter().chain(diffuse) {
                if let Some(rates) = rates {
                    let (one, all) = (rates.t1.median, rates.tn.median);
                    writeln!(out, "{name:20} {one:8.3} Mrays/s on 1 thread, {all:8.3} on {}", report.threads)?;
                }
            }
            let c = &report.cache;
            writeln!(out, "cache: {} lookups, hit rate {:.4}, {} bytes built", c.lookups, c.hit_rate(), c.bytes_built)
        })
    }
}

/// As single-precision tracers see it.
fn rounded_to_f32(mut mesh: ControlMesh) -> ControlMesh {
    mesh.positions.iter_mut().for_each(|p| *p = p.as_vec3().as_dvec3());
    mesh
}

fn bench_hit(world: &World, hit: &Hit) -> BenchHit {
    let size = world.mesh(MeshId(0)).surface().face_size(hit.face);
    let [u, v] = face_parameters(size, hit);
    BenchHit { t: hit.t, face: hit.face.0, u, v, normal: hit.normal_in_object.as_vec3() }
}
