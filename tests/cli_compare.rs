//! `lazytess compare`, driven as a user would.

use assert_cmd::Command;
use lazytess::io::picture::read_rgb;
use lazytess::io::png::write_png;
use predicates::prelude::*;
use std::path::Path;

/// Writes `a.png`, grey, and `b.png`, the same with one white pixel.
fn pictures(folder: &Path) {
    let mut pixels = vec![[0.5; 3]; 40 * 30];
    write_png(&folder.join("a.png"), 40, pixels.iter().copied()).unwrap();
    pixels[15 * 40 + 20] = [1.0; 3];
    write_png(&folder.join("b.png"), 40, pixels).unwrap();
}

fn compare(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    Command::cargo_bin("lazytess").unwrap().current_dir(folder).arg("compare").args(arguments).assert()
}

fn json(assert: &assert_cmd::assert::Assert) -> serde_json::Value {
    serde_json::from_slice(&assert.get_output().stdout).unwrap()
}

#[test]
fn equal_pictures_are_within_zero() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let figures = json(&compare(folder.path(), &["a.png", "a.png", "--max", "0"]).success().stderr(""));
    assert_eq!((&figures["max"], &figures["psnr"], &figures["ssimulacra2"]), (&0.0.into(), &().into(), &100.0.into()));
}

#[test]
fn a_pixel_beyond_the_limit_exits_with_one_and_says_how_many() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    let sentence = predicate::str::contains("0.083 % of all pixels differ by more than 0.1");
    let figures = json(&compare(folder.path(), &["a.png", "b.png", "--max", "0.1"]).code(1).stderr(sentence));
    assert!((figures["max"].as_f64().unwrap() - 127.0 / 255.0).abs() < 1e-6);
    assert_eq!(figures["p99"], 0.0);
    compare(folder.path(), &["a.png", "b.png", "--max", "128/255"]).success();
    compare(folder.path(), &["a.png", "b.png"]).success();
    // What B lacks is missed, not what it adds.
    assert_eq!(figures["missed_objects"], 0);
    let reversed = json(&compare(folder.path(), &["b.png", "a.png"]).success());
    assert_eq!(reversed["missed_objects"], 1);
}

#[test]
fn the_heat_map_is_yellow_where_the_pictures_differ() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    compare(folder.path(), &["a.png", "b.png", "--diff", "d.png"]).success();
    let map = read_rgb(&folder.path().join("d.png")).unwrap();
    let [red, green, blue] = map.pixels[15 * 40 + 20];
    assert!((map.width, map.height) == (40, 30) && red > 0.9 && green > 0.7 && blue < 0.1);
    assert!(map.pixels[0][0] < 0.1, "no difference is dark");
}

#[test]
fn wrong_input_gets_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    pictures(folder.path());
    write_png(&folder.path().join("small.png"), 4, [[0.5; 3]; 8]).unwrap();
    std::fs::write(folder.path().join("text.png"), "no picture").unwrap();
    let says = |arguments: &[&str], sentence: &str| {
        compare(folder.path(), arguments).code(2).stdout("").stderr(predicate::str::contains(sentence));
    };
    says(&["a.png", "none.png"], "none.png");
    says(&["a.png", "text.png"], "neither an EXR nor a PNG");
    says(&["a.png", "small.png"], "different sizes, 40 x 30 and 4 x 2");
    says(&["a.png", "b.png", "--max", "much"], "'much' is no difference");
}
