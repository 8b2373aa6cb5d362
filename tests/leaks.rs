//! Promise 3 on every closed shape: rays at borders, vertices and cells, none passes. Of the shared data's a million
//! each, of the project's own a twentieth of that.
//!
//! The long test, 10^8 rays in all, prints the table of `notes/accuracy.md`:
//! `LAZYTESS_LEAK_RAYS=5000000 cargo test --release --test leaks -- --nocapture`; with Embree's leaks beside, where
//! `EMBREE_PROBE` names the program `embree_probe`.

mod common;

use common::embree;
use common::traced::Traced;
use glam::{DAffine3, DVec3};
use lazytess::check::{Incidence, LeakSettings, find_leaks};
use lazytess::io::obj::read_obj;
use lazytess::mesh::{ControlMesh, shapes};
use lazytess::scene::rate::DicingRate;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

/// Rays for each shape.
const USUAL_RAYS: u64 = 1_000_000;

struct Column {
    name: &'static str,
    /// Tenths of the rays.
    share: u64,
    rate: DicingRate,
    place: DAffine3,
    /// The like of it for Embree.
    embree: [&'static str; 4],
}

fn columns() -> [Column; 5] {
    let random = |share, name, place, option, value| {
        let embree = ["--levels", "32", option, value];
        Column { name, share, rate: DicingRate::Random(1), place, embree }
    };
    let rate = DicingRate::Fixed(8);
    let embree = ["--rate", "8", "--scale", "1"];
    let scaled = |by: f64| DAffine3::from_scale(DVec3::splat(by));
    let moved = DAffine3::from_translation(DVec3::new(1e7, -1e7, 1e7));
    [
        Column { name: "rate 8", share: 4, rate, place: DAffine3::IDENTITY, embree },
        random(3, "random rates", DAffine3::IDENTITY, "--scale", "1"),
        random(1, "scaled by 1e-6", scaled(1e-6), "--scale", "1e-6"),
        random(1, "scaled by 1e6", scaled(1e6), "--scale", "1e6"),
        // In single precision the shapes themselves would not survive more.
        random(1, "moved by 1e7", moved, "--offset", "1e5,-1e5,1e5"),
    ]
}

/// Every shape without an open edge, by name.
fn closed_shapes() -> Vec<(PathBuf, ControlMesh)> {
    let folders = ["meshes/opensubdiv", "meshes/models"].into_iter().filter_map(common::shared);
    let files = folders.flat_map(|folder| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()));
    let mut files: Vec<PathBuf> = files.filter(|path| path.extension().is_some_and(|e| e == "obj")).collect();
    files.sort();
    let read = |path: PathBuf| {
        let mesh = read_obj(&path).unwrap().mesh;
        (path, mesh)
    };
    files.into_iter().map(read).filter(|(_, mesh)| is_closed(mesh)).collect()
}

fn is_closed(mesh: &ControlMesh) -> bool {
    let traced = Traced::new(mesh, DAffine3::IDENTITY, DicingRate::Fixed(1));
    Incidence::new(traced.mesh().surface()).n_open() == 0
}

#[test]
fn a_million_rays_at_every_closed_shape_leak_nothing() {
    let rays = std::env::var("LAZYTESS_LEAK_RAYS").ok().and_then(|n| n.parse().ok()).unwrap_or(USUAL_RAYS);
    let heads = columns().map(|column| format!("{}: leaks of {}", column.name, rays / 10 * column.share));
    println!("| shape | {} | Embree's share, in the same order |\n|---|---|---|---|---|---|---|", heads.join(" | "));
    for (name, mesh) in shapes::all_closed() {
        for column in columns() {
            assert_eq!(leaks(name, &mesh, &column, rays / 200 * column.share), 0, "{name}, {}", column.name);
        }
    }
    let mut n_shapes = 0;
    for (path, mesh) in closed_shapes() {
        let name = path.file_stem().unwrap().to_string_lossy();
        let leaks = columns().map(|column| leaks(&name, &mesh, &column, rays / 10 * column.share));
        n_shapes += 1;
        let embree = columns().map(|column| embree_share(&path, &column));
        println!("| {name} | {} | {} |", leaks.map(|n| n.to_string()).join(" | "), embree.join(", "));
        assert_eq!(leaks, [0; 5], "{name}");
    }
    println!("\n{n_shapes} shapes, {} rays", n_shapes * rays);
}

/// How many of so many rays passed; all of them must have found a target.
fn leaks(name: &str, mesh: &ControlMesh, column: &Column, rays: u64) -> u64 {
    let traced = Traced::new(mesh, column.place, column.rate);
    let settings = LeakSettings { rays, seed: 1, threads: 2 };
    let incidence = Incidence::new(traced.mesh().surface());
    let report = find_leaks(traced.mesh(), &incidence, &settings, &AtomicBool::new(false), &|_| (), || traced.tracer());
    report.examples.iter().for_each(|leak| println!("{name}, {}: {leak:?}", column.name));
    assert_eq!(report.rays, rays, "{name}, {}", column.name);
    report.leaks
}

/// The share of 200,000 rays aimed at edges between quads that Embree in its robust mode lets pass.
fn embree_share(path: &Path, column: &Column) -> String {
    let mut arguments = vec!["leaks", path.to_str().unwrap(), "--rays", "200000", "--flags", "robust"];
    arguments.extend(column.embree);
    embree::cell(&embree::probe(&arguments), |report| Some(report["leaks"].as_f64()? / report["rays"].as_f64()?))
}
