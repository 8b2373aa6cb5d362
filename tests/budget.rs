//! Promise 1: the whole process stays within `--memory`, and too small a budget is refused with one that would do.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

fn lazytess(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("lazytess").unwrap().current_dir(folder).args(arguments).assert()
}

fn folder_with_ground(faces: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    lazytess(folder.path(), &["generate", "ground", "--faces", faces, "-o", "ground.obj", "--quiet"]).success();
    folder
}

const RENDER: [&str; 13] = [
    "render",
    "ground.obj",
    "-o",
    "g.exr",
    "--size",
    "240x180",
    "--rate",
    "fixed:32",
    "--integrator",
    "ao",
    "--quiet",
    "--threads",
    "2",
];

/// Renders within the budget and returns the statistics.
fn render_within(folder: &Path, budget: &str) -> Value {
    lazytess(folder, &[&RENDER[..], &["--stats", "s.json", "--memory", budget]].concat()).success();
    serde_json::from_slice(&std::fs::read(folder.join("s.json")).unwrap()).unwrap()
}

#[test]
fn the_whole_process_stays_within_its_budget() {
    let folder = folder_with_ground("40k");
    for megabytes in [64, 96] {
        let statistics = render_within(folder.path(), &format!("{megabytes}M"));
        let budget = f64::from(megabytes << 20);
        let peak = statistics["memory"]["peak_resident_bytes"].as_f64().unwrap();
        assert!(peak <= 1.05 * budget, "{peak} of {budget}");
        // The budget is used, not just kept.
        let (used, capacity) = (&statistics["cache"]["peak_bytes"], &statistics["cache"]["capacity_bytes"]);
        assert!(capacity.as_f64().unwrap() > 0.3 * budget, "{capacity}");
        assert!(used.as_f64().unwrap() > 0.9 * capacity.as_f64().unwrap(), "{used} of {capacity}");
    }
}

/// The size that a refusal names.
fn named_by(refusal: &str) -> String {
    let size = refusal.split("; ").nth(1).and_then(|rest| rest.split_whitespace().next()).expect("a size is named");
    assert!(size.ends_with('M'), "{refusal}");
    size.to_owned()
}

/// The first budget that is accepted if what a refusal names is tried next, and the number of refusals: what plans take
/// is known only when they are made, so that the size named first may be refused in its turn.
fn first_accepted(budget: &str, render: impl Fn(&str) -> assert_cmd::assert::Assert) -> (String, usize) {
    let mut named = budget.to_owned();
    for n_refusals in 0..10 {
        let output = render(&named).get_output().clone();
        if output.status.success() {
            return (named, n_refusals);
        }
        assert_eq!(output.status.code(), Some(2));
        named = named_by(&String::from_utf8(output.stderr).unwrap());
    }
    panic!("{named} is refused like nine before it")
}

#[test]
fn too_small_a_budget_is_refused_with_one_that_does() {
    let folder = folder_with_ground("40k");
    let refused = |budget: &str| {
        let refusal = lazytess(folder.path(), &[&RENDER[..], &["--memory", budget]].concat()).code(2);
        String::from_utf8(refusal.get_output().stderr.clone()).unwrap()
    };
    let named = named_by(&refused("12M"));
    assert!(!folder.path().join("g.exr").exists(), "refused before anything is rendered");
    let statistics = render_within(folder.path(), &named);
    let budget = named.trim_end_matches('M').parse::<f64>().unwrap() * f64::from(1 << 20);
    assert!(statistics["memory"]["peak_resident_bytes"].as_f64().unwrap() <= 1.05 * budget);
    assert!(refused("1M").contains("of the file fill it; all of it takes"));
}

/// Layers are what such a picture's memory goes to, and encoders have a part of them in several forms.
#[test]
fn writing_all_layers_is_within_the_smallest_budget() {
    for [width, height] in [[800, 600], [320, 240]] {
        let size = format!("{width}x{height}");
        let film = 65.0 * f64::from(width * height);
        let [budget, peak] = smallest_budget_and_peak(&size);
        assert!(peak <= 1.05 * budget, "{peak} of {budget} at {size}");
        // The film once, a tile of it in four forms, and the program.
        assert!(budget < film + 65.0 * 4.0 * 65536.0 + f64::from(25 << 20), "{budget} at {size}");
    }
}

/// Bytes: the first budget that is accepted for a picture of all layers, and what was resident at most.
fn smallest_budget_and_peak(size: &str) -> [f64; 2] {
    let folder = folder_with_ground("1k");
    let layers = "Z,N,mesh,patch,uv,samples,miss,build,group,reason,error";
    let options = ["render", "ground.obj", "-o", "g.exr", "--size", size, "--spp", "1", "--aov", layers];
    let render = |budget: &str| {
        lazytess(folder.path(), &[&options[..], &["--quiet", "--stats", "s.json", "--memory", budget]].concat())
    };
    let (named, _) = first_accepted("4M", render);
    let statistics: Value = serde_json::from_slice(&std::fs::read(folder.path().join("s.json")).unwrap()).unwrap();
    let budget = named.trim_end_matches('M').parse::<f64>().unwrap() * f64::from(1 << 20);
    [budget, statistics["memory"]["peak_resident_bytes"].as_f64().unwrap()]
}

#[test]
fn plans_and_large_rings_are_within_the_budget_too() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("creased.obj"), creased_grid(60)).unwrap();
    lazytess(folder.path(), &["generate", "n-gon", "--valence", "500", "-o", "n-gon.obj", "--quiet"]).success();
    for mesh in ["creased.obj", "n-gon.obj"] {
        let render = |budget: &str| {
            let options = ["render", mesh, "-o", "m.png", "--size", "60x40", "--threads", "2", "--quiet"];
            lazytess(folder.path(), &[&options[..], &["--stats", "m.json", "--memory", budget]].concat())
        };
        let (named, n_refusals) = first_accepted("16M", render);
        assert!((1..4).contains(&n_refusals), "{mesh}: {n_refusals} refusals");
        let statistics: Value = serde_json::from_slice(&std::fs::read(folder.path().join("m.json")).unwrap()).unwrap();
        let budget = named.trim_end_matches('M').parse::<f64>().unwrap() * f64::from(1 << 20);
        let peak = statistics["memory"]["peak_resident_bytes"].as_f64().unwrap();
        assert!(peak <= 1.05 * budget, "{mesh}: {peak} of {budget}");
    }
}

/// A plane of n x n quads, all of whose edges are semi-sharp, each in its own way: no two rings are equal.
fn creased_grid(n: usize) -> String {
    let number = |i: usize, j: usize| j * (n + 1) + i;
    let mut text = String::new();
    for (j, i) in (0..=n).flat_map(|j| (0..=n).map(move |i| (j, i))) {
        text += &format!("v {i} {} {j}\n", (i * j) % 7);
    }
    for (j, i) in (0..n).flat_map(|j| (0..n).map(move |i| (j, i))) {
        let corners =
            [number(i, j), number(i, j + 1), number(i + 1, j + 1), number(i + 1, j)].map(|v| (v + 1).to_string());
        text += &format!("f {}\n", corners.join(" "));
        let sharpness = |k: usize| 0.1 + ((k * 7919) % 4999) as f64 / 1000.0;
        let along = [(number(i + 1, j), 2 * number(i, j)), (number(i, j + 1), 2 * number(i, j) + 1)];
        for (end, k) in along {
            text += &format!("t crease 2/1/0 {} {end} {}\n", number(i, j), sharpness(k));
        }
    }
    text
}

/// Bytes of address space that are mapped and hardly ever resident: program and libraries, stacks of threads.
#[cfg(target_os = "linux")]
const MAPPED_ONLY: u64 = 40 << 20;

#[cfg(target_os = "linux")]
#[test]
fn a_render_gets_by_under_a_hard_limit_of_its_budget() {
    let folder = folder_with_ground("10k");
    for megabytes in [32u64, 48, 96] {
        let limit = ((megabytes << 20) * 105 / 100 + MAPPED_ONLY) >> 10;
        let render = RENDER.join(" ");
        let program = env!("CARGO_BIN_EXE_lazytess");
        let line = format!("ulimit -v {limit}; exec {program} {render} --memory {megabytes}M");
        // Arenas for threads would map 64 MiB each in advance.
        let mut shell = Command::new("sh");
        shell.env("MALLOC_ARENA_MAX", "1").current_dir(folder.path()).args(["-c", &line]).assert().success();
    }
}
