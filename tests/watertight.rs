//! Promise 3: no ray leaks. Neighbours share their border vertices to the bit, and rays aimed at edges and vertices
//! hit.
//!
//! Here every shape, open or closed, gets `LAZYTESS_LEAK_RAYS` rays, 25,000 if nothing is said, which makes more than a
//! million together; `tests/leaks.rs` sends many more at closed ones.

mod common;

use glam::DAffine3;
use lazytess::cache::CacheConfig;
use lazytess::check::{Incidence, LeakSettings, SeamReport, compare_seams, find_leaks};
use lazytess::ids::MeshId;
use lazytess::io::obj::read_obj;
use lazytess::math::LatticeGrid;
use lazytess::mesh::random::{random_edits, random_mesh};
use lazytess::mesh::{ControlMesh, shapes};
use lazytess::scene::intersect::Intersector;
use lazytess::scene::rate::DicingRate;
use lazytess::scene::world::{GridCache, World, WorldMesh};
use lazytess::subdiv::Dicer;
use std::ops::Range;
use std::sync::atomic::AtomicBool;

const THREADS: usize = 2;

fn world_mesh(mesh: &ControlMesh, rate: DicingRate) -> WorldMesh {
    WorldMesh::new(mesh.clone(), DAffine3::IDENTITY, rate, THREADS).unwrap()
}

fn seams(mesh: &WorldMesh) -> SeamReport {
    compare_seams(mesh, &Incidence::new(mesh.surface()), THREADS, &AtomicBool::new(false))
}

/// The corpus, and the shapes of the shared data where they are.
fn all_shapes() -> Vec<(String, ControlMesh)> {
    let mut shapes: Vec<_> = shapes::all().into_iter().map(|(name, mesh)| (name.to_owned(), mesh)).collect();
    if let Some(folder) = common::shared("meshes/opensubdiv") {
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        let mut files: Vec<_> = files.filter(|path| path.extension().is_some_and(|e| e == "obj")).collect();
        files.sort();
        shapes.extend(files.iter().map(|path| (path.display().to_string(), read_obj(path).unwrap().mesh)));
    }
    shapes
}

#[test]
fn borders_of_all_shapes_are_bit_identical_at_any_rates() {
    for (name, mesh) in all_shapes() {
        for rate in [DicingRate::Fixed(7), DicingRate::Random(1), DicingRate::Random(2)] {
            let report = seams(&world_mesh(&mesh, rate));
            assert_eq!(report.different, 0, "{name} at {rate:?}: {:?}", report.examples);
        }
    }
}

/// Of random meshes; `LAZYTESS_FUZZ=START..END` asks for others.
fn seeds() -> Range<u64> {
    let given = std::env::var("LAZYTESS_FUZZ").ok();
    let range = given.as_deref().and_then(|text| text.split_once(".."));
    range.map_or(0..150, |(a, b)| a.parse().expect("START..END")..b.parse().expect("START..END"))
}

#[test]
fn borders_of_random_meshes_are_bit_identical() {
    let mut points = 0;
    // Failed once: a hidden face spoke for an edge of many sheets; holes alone took passages of an edge apart.
    for seed in [2059, 2877].into_iter().chain(seeds()) {
        let mut mesh = random_mesh(seed);
        if seed % 3 == 0 {
            mesh.edits = random_edits(&mesh, seed);
        }
        let report = seams(&world_mesh(&mesh, DicingRate::Random(seed)));
        assert_eq!(report.different, 0, "random mesh {seed}: {:?}", report.examples);
        points += report.points;
    }
    assert!(points > 100_000, "{points}");
}

#[test]
fn an_edge_at_rate_1_meets_one_at_rate_1000() {
    let sides = |seed: u64| {
        let mesh = world_mesh(&shapes::torus(8, 6, 2.0, 0.75), DicingRate::Random(seed));
        let patches: Vec<_> = mesh.surface().visible_patches().map(|p| mesh.patch_rates(p).sides).collect();
        let is_steep =
            |s: &[u32; 4]| [[s[0], s[2]], [s[1], s[3]]].iter().any(|o| o.contains(&1) && o.iter().any(|&r| r > 900));
        (patches.iter().any(is_steep)).then_some(mesh)
    };
    let mesh = (0..100).find_map(sides).expect("random rates pair 1 with more than 900");
    assert_eq!(seams(&mesh).different, 0);
}

/// Pieces of 8 x 8 cells are diced one by one, the whole patch at once: they agree about every vertex, so pieces agree
/// with each other.
#[test]
fn pieces_of_a_patch_share_their_borders() {
    let edited = (0..60).map(|seed| {
        let mut mesh = random_mesh(seed);
        mesh.edits = random_edits(&mesh, seed);
        (format!("random mesh {seed}"), mesh)
    });
    for (name, mesh) in all_shapes().into_iter().chain(edited) {
        let mesh = world_mesh(&mesh, DicingRate::Fixed(20));
        let mut dicer = Dicer::default();
        let (mut whole, mut piece) = (LatticeGrid::default(), LatticeGrid::default());
        for patch in mesh.surface().visible_patches() {
            let rates = mesh.patch_rates(patch);
            dicer.dice(mesh.surface(), patch, &rates, [0, rates.n_u], [0, rates.n_v], &mut whole);
            for j0 in (0..rates.n_v).step_by(8) {
                for i0 in (0..rates.n_u).step_by(8) {
                    let (i1, j1) = ((i0 + 8).min(rates.n_u), (j0 + 8).min(rates.n_v));
                    dicer.dice(mesh.surface(), patch, &rates, [i0, i1], [j0, j1], &mut piece);
                    let mut vertices = piece.points();
                    for j in j0..=j1 {
                        for i in i0..=i1 {
                            let vertex = whole.point(i as usize, j as usize);
                            assert_eq!(Some(vertex), vertices.next(), "{name}, {patch:?}, cells from {i0}, {j0}");
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn no_ray_passes_a_border() {
    let per_shape = std::env::var("LAZYTESS_LEAK_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(25_000);
    let random = (seeds().start..).take(40).map(|seed| {
        let mut mesh = random_mesh(seed);
        if seed % 2 == 1 {
            mesh.edits = random_edits(&mesh, seed);
        }
        (format!("random mesh {seed}"), mesh)
    });
    let mut total = 0;
    for (k, (name, mesh)) in (0..).zip(all_shapes().into_iter().chain(random)) {
        let rate = if k % 4 == 0 { DicingRate::Fixed(8) } else { DicingRate::Random(k) };
        let world = World::new(vec![world_mesh(&mesh, rate)]);
        let mesh = world.mesh(MeshId(0));
        let cache = GridCache::new(&world, CacheConfig::with_bytes(64 << 20)).unwrap();
        let settings = LeakSettings { rays: per_shape, seed: k, threads: THREADS };
        let make_tracer = || Intersector::new(&world, &cache);
        let incidence = Incidence::new(mesh.surface());
        let report = find_leaks(mesh, &incidence, &settings, &AtomicBool::new(false), &|_| (), make_tracer);
        assert_eq!(report.leaks, 0, "{name} at {rate:?}: {:?}", report.examples);
        total += report.rays;
    }
    println!("{total} rays, no leak");
    assert!(total > 1_000_000 || per_shape < 25_000, "{total}");
}
