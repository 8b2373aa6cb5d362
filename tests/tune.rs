//! `lazytess tune`: what it predicts is what happens.

use assert_cmd::Command;
use serde_json::Value;
use std::path::Path;

const PICTURE: [&str; 9] = ["--size", "160x120", "--rate", "fixed:24", "--spp", "2", "--integrator", "ao", "--quiet"];

fn lazytess(folder: &Path, arguments: &[&str]) -> Vec<u8> {
    let mut command = Command::cargo_bin("lazytess").unwrap();
    let done = command.current_dir(folder).args(arguments).args(PICTURE).args(["--threads", "1"]).assert().success();
    done.get_output().stdout.clone()
}

fn tune(folder: &Path, more: &[&str]) -> Value {
    let arguments = [&["tune", "ground.obj", "--json", "--ao-samples", "4"], more].concat();
    serde_json::from_slice(&lazytess(folder, &arguments)).unwrap()
}

fn folder_with_ground() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::cargo_bin("lazytess").unwrap();
    let arguments = ["generate", "ground", "--faces", "900", "--seed", "3", "-o", "ground.obj", "--quiet"];
    command.current_dir(folder.path()).args(arguments).assert().success();
    folder
}

/// The share of look-ups that built nothing. In a cache of a few dozen blocks a pin can leave no place for one, which
/// the thread then keeps for itself: that its look-ups find it there is counted apart, but the replay knows one memory
/// only.
fn share_found(cache: &Value) -> f64 {
    let count = |key: &str| cache[key].as_f64().unwrap();
    (count("hits") + count("private_hits")) / count("lookups")
}

#[test]
fn predicted_hit_rates_are_those_of_real_renders() {
    let folder = folder_with_ground();
    let tuning = tune(folder.path(), &["--svg", "curve.svg"]);
    assert!(std::fs::read_to_string(folder.path().join("curve.svg")).unwrap().contains("hit rate"));
    let curve = tuning["curve"].as_array().unwrap();
    for point in curve.iter().step_by(4) {
        let bytes = point["cache_bytes"].to_string();
        let arguments =
            ["render", "ground.obj", "-o", "g.png", "--stats", "s.json", "--ao-samples", "4", "--cache", &bytes];
        lazytess(folder.path(), &arguments);
        let real: Value = serde_json::from_slice(&std::fs::read(folder.path().join("s.json")).unwrap()).unwrap();
        let (real, predicted) = (share_found(&real["cache"]), point["hit_rate"].as_f64().unwrap());
        println!("{bytes} bytes: {predicted} predicted, {real} real");
        assert!((real - predicted).abs() < 0.01, "{bytes} bytes: {predicted} predicted, {real} real");
    }
}

#[test]
fn a_sample_predicts_nearly_what_the_whole_trace_does() {
    let folder = folder_with_ground();
    let whole = tune(folder.path(), &[]);
    let accesses = whole["accesses_replayed"].as_u64().unwrap();
    let sample = tune(folder.path(), &["--accesses", &(accesses / 3).to_string()]);
    assert!(sample["share_sampled"].as_f64().unwrap() < 0.5);
    let points = |tuning: &Value| tuning["curve"].as_array().unwrap().clone();
    for (whole, sample) in points(&whole).iter().zip(points(&sample)) {
        let difference = whole["hit_rate"].as_f64().unwrap() - sample["hit_rate"].as_f64().unwrap();
        println!("{} {difference}", whole["cache_bytes"]);
        assert!(difference.abs() < 0.05);
    }
}
