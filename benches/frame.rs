//! What does a frame of camera rays cost: cold, warm, with a cache of an eighth or a hundredth of what it touches, with
//! none? And what if everything is tessellated before it?
//!
//! `cargo bench --bench frame`

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use glam::{DAffine3, DVec2, DVec3};
use lazytess::cache::CacheConfig;
use lazytess::math::{Intersect, Ray};
use lazytess::mesh::{ControlMesh, shapes};
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

/// The knight from the chess scene: quads, creases and extraordinary vertices, in about 1600 faces.
fn knight() -> ControlMesh {
    shapes::scene_meshes().into_iter().find(|(name, _)| name.contains("knight")).expect("a shipped mesh").1
}

fn world() -> World {
    World::new(vec![WorldMesh::new(knight(), DAffine3::IDENTITY, DicingRate::Fixed(16), 1).expect("a sound mesh")])
}

/// Rays through the pixels, tile by tile.
fn rays(world: &World) -> Vec<Ray> {
    let bounds = world.meshes()[0].bounds_in_world();
    let eye = bounds.center() + 1.35 * (bounds.max - bounds.min).length() * DVec3::new(1.0, 0.6, 1.2).normalize();
    let camera = Camera::new(&CameraDescription { eye, at: bounds.center(), up: DVec3::Y, fov: 35.0 });
    let tiles = (0..SIZE[1] / TILE).flat_map(|y| (0..SIZE[0] / TILE).map(move |x| [x * TILE, y * TILE]));
    let pixels = tiles.flat_map(|[x, y]| (0..TILE * TILE).map(move |k| [x + k % TILE, y + k / TILE]));
    pixels.map(|[x, y]| camera.ray(DVec2::new(f64::from(x) + 0.5, f64::from(y) + 0.5), SIZE)).collect()
}

fn cache(world: &World, config: CacheConfig) -> GridCache {
    GridCache::new(world, config).expect("the memory is there")
}

fn trace(world: &World, cache: &GridCache, rays: &[Ray]) -> usize {
    let mut tracer = Intersector::new(world, cache);
    rays.iter().filter(|ray| black_box(tracer.closest(ray)).is_some()).count()
}

/// Bytes that the frame's blocks take.
fn touched(world: &World, rays: &[Ray]) -> usize {
    let cache = cache(world, CacheConfig::with_bytes(256 << 20));
    trace(world, &cache, rays);
    cache.segments().statistics().bytes_built as usize
}

/// Every block is built once.
#[divan::bench]
fn cold(bencher: Bencher) {
    let world = world();
    let rays = rays(&world);
    bencher
        .counter(ItemsCount::new(rays.len()))
        .with_inputs(|| cache(&world, CacheConfig::with_bytes(64 << 20)))
        .bench_refs(|cache| trace(&world, cache, &rays));
}

/// As [`cold`], but every block of every patch is built before the first ray.
#[divan::bench]
fn tessellated_before(bencher: Bencher) {
    let world = world();
    let rays = rays(&world);
    bencher
        .counter(ItemsCount::new(rays.len()))
        .with_inputs(|| cache(&world, CacheConfig::with_bytes(64 << 20)))
        .bench_refs(|cache| {
            Intersector::new(&world, cache).tessellate_everything();
            trace(&world, cache, &rays)
        });
}

/// Nothing is built.
#[divan::bench]
fn warm(bencher: Bencher) {
    let world = world();
    let rays = rays(&world);
    let cache = cache(&world, CacheConfig::with_bytes(64 << 20));
    trace(&world, &cache, &rays);
    bencher.counter(ItemsCount::new(rays.len())).bench_local(|| trace(&world, &cache, &rays));
}

/// The cache has one part in so many of the bytes that the frame touches; 0 is no cache.
#[divan::bench(args = [8, 100, 0])]
fn small_cache(bencher: Bencher, part: usize) {
    let world = world();
    let rays = rays(&world);
    let bytes = touched(&world, &rays).checked_div(part).unwrap_or(0);
    let cache = cache(&world, CacheConfig::with_bytes(bytes));
    trace(&world, &cache, &rays);
    bencher.counter(ItemsCount::new(rays.len())).bench_local(|| trace(&world, &cache, &rays));
}
