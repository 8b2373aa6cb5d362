//! What does a frame of camera rays cost: cold, warm, with a cache of an eighth or a hundredth of what it touches, with
//! none? And what if everything is tessellated before it?
//!
//! `cargo bench --bench frame`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::{DAffine3, DVec2, DVec3};
use lazytess::cache::CacheConfig;
use lazytess::grid::PACKET;
use lazytess::math::Intersect;
use lazytess::mesh::{ControlMesh, shapes};
use lazytess::render::tiles::{PACKET_SIZE, PixelRect};
use lazytess::scene::camera::Camera;
use lazytess::scene::description::CameraDescription;
use lazytess::scene::intersect::Intersector;
use lazytess::scene::rate::DicingRate;
use lazytess::scene::world::{GridCache, World, WorldMesh};

const SIZE: [u32; 2] = [320, 240];
const TILE: u32 = 16;

fn main() {
    divan::main();
}

/// The knight from the chess scene: quads, creases and extraordinary vertices, in 282 faces.
fn knight() -> ControlMesh {
    shapes::scene_meshes().into_iter().find(|(name, _)| name.contains("knight")).expect("a shipped mesh").1
}

fn world() -> World {
    World::new(vec![WorldMesh::new(knight(), DAffine3::IDENTITY, DicingRate::Fixed(16), 1).expect("a sound mesh")])
}

/// A frame of camera rays, as a renderer hands them over: tile by tile, those of a few pixels together.
struct Frame {
    camera: Camera,
    tiles: Vec<Tile>,
}

struct Tile {
    rect: PixelRect,
    /// Block by block.
    directions: Vec<DVec3>,
}

fn frame(world: &World) -> Frame {
    let bounds = world.meshes()[0].bounds_in_world();
    let eye = bounds.center() + 1.35 * (bounds.max - bounds.min).length() * DVec3::new(1.0, 0.6, 1.2).normalize();
    let camera = Camera::new(&CameraDescription { eye, at: bounds.center(), up: DVec3::Y, fov: 35.0 });
    let direction = |[x, y]: [u32; 2]| camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), SIZE).direction;
    let tile = |rect: PixelRect| {
        let directions = rect.blocks(PACKET_SIZE).flat_map(PixelRect::pixels).map(direction).collect();
        Tile { rect, directions }
    };
    Frame { tiles: PixelRect::whole(SIZE).blocks([TILE; 2]).map(tile).collect(), camera }
}

impl Frame {
    fn n_rays(&self) -> ItemsCount {
        ItemsCount::new(PixelRect::whole(SIZE).n_pixels())
    }
}

fn cache(world: &World, config: CacheConfig) -> GridCache {
    GridCache::new(world, config).expect("the memory is there")
}

fn trace(world: &World, cache: &GridCache, frame: &Frame) -> usize {
    let mut tracer = Intersector::new(world, cache);
    let (mut hits, mut n_hits) = ([None; PACKET], 0);
    for Tile { rect, directions } in &frame.tiles {
        tracer.aim(&frame.camera.bundle(rect.corners(), SIZE));
        for directions in directions.chunks_exact(PACKET) {
            tracer.closest_from(frame.camera.eye(), directions, &mut hits);
            n_hits += black_box(&hits).iter().flatten().count();
        }
    }
    n_hits
}

/// Bytes that the frame's blocks take.
fn touched(world: &World, frame: &Frame) -> usize {
    let cache = cache(world, CacheConfig::with_bytes(256 << 20));
    trace(world, &cache, frame);
    cache.segments().statistics().bytes_built as usize
}

/// Every block is built once.
#[divan::bench]
fn cold(bencher: Bencher) {
    let world = world();
    let frame = frame(&world);
    bencher
        .counter(frame.n_rays())
        .with_inputs(|| cache(&world, CacheConfig::with_bytes(64 << 20)))
        .bench_refs(|cache| trace(&world, cache, &frame));
}

/// As [`cold`], but every block of every patch is built before the first ray.
#[divan::bench]
fn tessellated_before(bencher: Bencher) {
    let world = world();
    let frame = frame(&world);
    bencher.counter(frame.n_rays()).with_inputs(|| cache(&world, CacheConfig::with_bytes(64 << 20))).bench_refs(
        |cache| {
            Intersector::new(&world, cache).tessellate_everything();
            trace(&world, cache, &frame)
        },
    );
}

/// Nothing is built.
#[divan::bench]
fn warm(bencher: Bencher) {
    let world = world();
    let frame = frame(&world);
    let cache = cache(&world, CacheConfig::with_bytes(64 << 20));
    trace(&world, &cache, &frame);
    bencher.counter(frame.n_rays()).bench_local(|| trace(&world, &cache, &frame));
}

/// The cache has one part in so many of the bytes that the frame touches; 0 is no cache.
#[divan::bench(args = [8, 100, 0])]
fn small_cache(bencher: Bencher, part: usize) {
    let world = world();
    let frame = frame(&world);
    let bytes = touched(&world, &frame).checked_div(part).unwrap_or(0);
    let cache = cache(&world, CacheConfig::with_bytes(bytes));
    trace(&world, &cache, &frame);
    bencher.counter(frame.n_rays()).bench_local(|| trace(&world, &cache, &frame));
}
