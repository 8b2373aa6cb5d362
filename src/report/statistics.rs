//! The statistics of a render as data.

use crate::cache::CacheStatistics;
use crate::render::{PixelCounts, RayCounts, RenderSettings, Rendered};
use crate::scene::costs::BuildCosts;
use crate::scene::departure::DepartureCounts;
use crate::scene::world::World;
use serde::Serialize;

/// Everything counted and timed during one render.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RenderStatistics {
    /// Version of the program.
    pub version: String,
    /// What was rendered: the path as the user gave it.
    pub input: String,
    /// Worker threads.
    pub threads: usize,
    /// The picture.
    pub picture: PictureReport,
    /// Rays by kind.
    pub rays: RayReport,
    /// Pixels traced and interpolated.
    pub groups: GroupReport,
    /// What was there to tessellate, and what was touched.
    pub geometry: GeometryReport,
    /// The tessellation cache.
    pub cache: CacheReport,
    /// Where blocks were built.
    pub costs: CostReport,
    /// Rays that leave a patch.
    pub departures: DepartureReport,
    /// Memory of the process.
    pub memory: MemoryReport,
    /// Time by phase.
    pub seconds: PhaseSeconds,
}

/// The picture that was asked for and how far it came.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct PictureReport {
    /// Columns of the whole picture.
    pub width: u32,
    /// Rows of the whole picture.
    pub height: u32,
    /// Pixels to render: all, or those of the crop window.
    pub pixels: usize,
    /// Pixels rendered; less than `pixels` after an interruption.
    pub pixels_done: usize,
    /// Samples per pixel.
    pub spp: u32,
    /// The integrator's name on the command line.
    pub integrator: String,
}

/// What pixel groups did.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct GroupReport {
    /// Name on the command line: off, thesis or adaptive.
    pub mode: String,
    /// Error aimed at, in display units.
    pub tolerance: f32,
    /// Pixels that rays were traced for.
    pub traced_pixels: u64,
    /// Pixels by why they were traced, or not.
    pub pixels: PixelCounts,
    /// Seconds to find out what might be seen where.
    pub prepare_seconds: f64,
    /// Seconds spent on tracing, summed over threads.
    pub trace_seconds: f64,
    /// Seconds spent on interpolating, summed over threads.
    pub interpolate_seconds: f64,
}

impl GroupReport {
    /// The report of a render with these settings.
    pub fn new(settings: &RenderSettings, rendered: &Rendered) -> Self {
        Self {
            mode: settings.groups.to_string(),
            tolerance: settings.tolerance,
            traced_pixels: rendered.pixels.traced(),
            pixels: rendered.pixels,
            prepare_seconds: rendered.seconds.prepare,
            trace_seconds: rendered.seconds.trace,
            interpolate_seconds: rendered.seconds.interpolate,
        }
    }
}

/// Rays by kind, and their sum.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RayReport {
    /// Number of rays of each kind.
    #[serde(flatten)]
    pub counts: RayCounts,
    /// Rays of all kinds.
    pub total: u64,
}

/// Sizes of the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct GeometryReport {
    /// Meshes.
    pub meshes: usize,
    /// Faces of all control meshes.
    pub control_faces: usize,
    /// Patches of all meshes.
    pub patches: usize,
    /// Patches of which some ray asked for a block.
    pub patches_touched: usize,
    /// Grid pieces built, rebuilt ones included.
    pub grids_built: u64,
    /// Bytes that stay for the whole render: control meshes, plans, bounds, top level, slots.
    pub resident_bytes: u64,
    /// Triangles of the full tessellation.
    pub full_triangles: u64,
    /// Bytes of the full tessellation with its hierarchy, estimated: in the cache's own format, with 3 bytes a
    /// coordinate.
    pub full_bytes: u64,
}

/// What is remembered of patches that rays leave, and the rays that it spared a walk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DepartureReport {
    /// Horizons and skylines found, rays that they let pass.
    #[serde(flatten)]
    pub counts: DepartureCounts,
    /// Bytes of the tables, beside `geometry.resident_bytes`.
    pub bytes: u64,
}

/// The cache's counters. `lookups = hits + private_hits + compulsory_misses + capacity_misses + other_misses`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct CacheReport {
    /// Size in bytes; `None` (null) if unbounded.
    pub capacity_bytes: Option<u64>,
    /// Blocks asked for.
    pub lookups: u64,
    /// Blocks that were there.
    pub hits: u64,
    /// Blocks that were not, but that the same thread had built for itself a little before.
    pub private_hits: u64,
    /// Hits per lookup, 0 to 1.
    pub hit_rate: f64,
    /// Misses of blocks that nobody had built before.
    pub compulsory_misses: u64,
    /// Misses of blocks that had been evicted.
    pub capacity_misses: u64,
    /// Misses while another thread built the block, or below a block that could not be kept.
    pub other_misses: u64,
    /// Blocks built for one thread, because they could not be kept.
    pub bypasses: u64,
    /// Those of them that found no place because a thread was still reading the oldest segment.
    pub bypasses_pinned: u64,
    /// Blocks that two threads built at the same time, so that one was thrown away. Threads never wait for each other.
    pub duplicate_builds: u64,
    /// Seconds that these cost, summed over threads.
    pub duplicate_seconds: f64,
    /// Blocks copied to a younger segment because they were still used.
    pub reinsertions: u64,
    /// Bytes of all blocks built.
    pub bytes_built: u64,
    /// Seconds spent building, summed over threads; estimated from a sample.
    pub build_seconds: f64,
    /// Times that a segment was emptied and filled again.
    pub segments_recycled: u64,
    /// Most bytes in use at once.
    pub peak_bytes: u64,
}

impl CacheReport {
    /// The report of a cache with `capacity_bytes` (`None`: unbounded) and these counters.
    pub fn new(capacity_bytes: Option<u64>, counters: &CacheStatistics) -> Self {
        Self {
            capacity_bytes,
            lookups: counters.lookups,
            hits: counters.hits,
            private_hits: counters.private_hits,
            hit_rate: counters.hit_rate(),
            compulsory_misses: counters.compulsory_misses,
            capacity_misses: counters.capacity_misses,
            other_misses: counters.misses() - counters.compulsory_misses - counters.capacity_misses,
            bypasses: counters.bypasses(),
            bypasses_pinned: counters.bypassed_pinned,
            duplicate_builds: counters.builds_discarded,
            duplicate_seconds: counters.time_lost.as_secs_f64(),
            reinsertions: counters.reinsertions,
            bytes_built: counters.bytes_built,
            build_seconds: counters.build_time.as_secs_f64(),
            segments_recycled: counters.segments_recycled,
            peak_bytes: counters.peak_bytes,
        }
    }
}

/// The meshes and patches that most blocks were built for, most first; at most ten of each.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct CostReport {
    /// Meshes.
    pub meshes: Vec<MeshCost>,
    /// Patches. Where very many patches were built, their numbers may be a little low.
    pub patches: Vec<FaceCost>,
}

/// Blocks built for a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeshCost {
    /// Its place in the scene file, from 0.
    pub mesh: u32,
    /// Blocks built, rebuilt ones counted again.
    pub blocks: u64,
}

/// Blocks built for a patch.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FaceCost {
    /// Its mesh's place in the scene file, from 0.
    pub mesh: u32,
    /// Its face's place in the mesh file, from 0.
    pub face: u32,
    /// Which sub-quad of the face it is; 0 for a quad.
    pub sub: u32,
    /// Blocks built, rebuilt ones counted again.
    pub blocks: u64,
}

impl CostReport {
    /// Entries of each list.
    const MOST: usize = 10;

    /// The costliest meshes and patches of `world`.
    pub fn new(world: &World, costs: &BuildCosts) -> Self {
        let meshes =
            costs.costliest_meshes(Self::MOST).into_iter().map(|(mesh, blocks)| MeshCost { mesh: mesh.0, blocks });
        let patches = costs.costliest_patches(Self::MOST).into_iter().map(|cost| {
            let (face, sub) = world.mesh(cost.mesh).surface().face_of(cost.patch);
            FaceCost { mesh: cost.mesh.0, face: face.0, sub, blocks: cost.blocks }
        });
        Self { meshes: meshes.collect(), patches: patches.collect() }
    }
}

/// Memory of the process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MemoryReport {
    /// Bytes allowed by `--memory`; `None` (null) without it.
    pub budget_bytes: Option<u64>,
    /// Most bytes ever resident; `None` (null) where the system does not tell.
    pub peak_resident_bytes: Option<u64>,
}

/// A duration twice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Seconds {
    /// By the clock on the wall.
    pub wall: f64,
    /// Processor time, summed over threads.
    pub cpu: f64,
}

impl From<(f64, f64)> for Seconds {
    /// From wall and processor seconds.
    fn from((wall, cpu): (f64, f64)) -> Self {
        Self { wall, cpu }
    }
}

/// Time by phase; the phases follow one another.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PhaseSeconds {
    /// Reading and checking files.
    pub load: Seconds,
    /// Topology, plans, rates, bounds, top level.
    pub prepare: Seconds,
    /// Tracing and shading.
    pub render: Seconds,
    /// Writing pictures.
    pub write: Seconds,
}

impl PhaseSeconds {
    /// All phases together.
    pub fn total(&self) -> Seconds {
        let phases = [self.load, self.prepare, self.render, self.write];
        phases.iter().fold(Seconds::default(), |sum, s| Seconds { wall: sum.wall + s.wall, cpu: sum.cpu + s.cpu })
    }
}

impl From<RayCounts> for RayReport {
    fn from(counts: RayCounts) -> Self {
        Self { counts, total: counts.total() }
    }
}

impl RenderStatistics {
    /// The statistics as one JSON object, on several lines, with a line end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("plain numbers and strings have a JSON form");
        text.push('\n');
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;
    use std::collections::BTreeSet;

    /// `a.b.c` for every value that is no object.
    fn keys(prefix: &str, value: &Value, found: &mut BTreeSet<String>) {
        match value {
            Value::Object(members) => members.iter().for_each(|(key, value)| {
                let path = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                keys(&path, value, found);
            }),
            _ => _ = found.insert(prefix.to_owned()),
        }
    }

    #[test]
    fn json_keys_are_those_of_the_notes() {
        let json = serde_json::from_str(&RenderStatistics::default().to_json()).unwrap();
        let mut written = BTreeSet::new();
        keys("", &json, &mut written);
        let notes = include_str!("../../notes/statistics.md");
        let rows = notes.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next());
        let documented: BTreeSet<String> = rows.map(str::to_owned).collect();
        assert_eq!(written, documented);
    }

    #[test]
    fn cache_misses_add_up() {
        let counters = CacheStatistics {
            lookups: 100,
            hits: 90,
            compulsory_misses: 4,
            capacity_misses: 3,
            concurrent_misses: 2,
            bypassed_parent_misses: 1,
            ..Default::default()
        };
        let report = CacheReport::new(Some(1024), &counters);
        assert_eq!((report.hit_rate, report.other_misses), (0.9, 3));
    }
}
