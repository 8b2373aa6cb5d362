//! `lazytess info`, `tessellate` and `bench`, driven as a user would.

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use lazytess::io::obj::read_obj;
use lazytess::io::obj_write::ObjWriter;
use lazytess::io::write::write_whole;
use lazytess::mesh::shapes;
use predicates::prelude::*;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let cube = shapes::crease_cube(2.0);
    write_whole(&folder.path().join("cube.obj"), |out| ObjWriter::new(out).mesh(&cube)).unwrap();
    let scene =
        "[[mesh]]\nfile = \"cube.obj\"\nrate = \"fixed:8\"\n[[mesh]]\nfile = \"cube.obj\"\nrate = \"fixed:16\"\n";
    fs::write(folder.path().join("two.toml"), scene).unwrap();
    folder
}

fn run(folder: &Path, line: &str) -> Assert {
    Command::cargo_bin("lazytess").unwrap().current_dir(folder).args(line.split_whitespace()).assert()
}

fn json(assert: &Assert) -> serde_json::Value {
    serde_json::from_slice(&assert.get_output().stdout).unwrap()
}

#[test]
fn info_tells_what_a_scene_needs() {
    let folder = folder();
    let told = json(&run(folder.path(), "info two.toml --json").success().stderr(""));
    assert_eq!((&told["meshes"], &told["faces"], &told["patches"]), (&2.into(), &12.into(), &12.into()));
    assert_eq!(told["valences"], serde_json::json!({"3": 16}));
    assert_eq!(told["full"]["triangles"], 6 * 2 * (64 + 256));
    assert_eq!(told["topology"]["creased_edges"], told["tags"]["creases"]);
    let resident = told["resident"]["total"].as_f64().unwrap();
    assert_eq!(told["resident"]["per_face"].as_f64().unwrap(), resident / 12.0);
    assert!(told["cache"]["bytes"].as_u64().unwrap() >= told["full"]["bytes"].as_u64().unwrap());
    let text = run(folder.path(), "info two.toml").success();
    text.stdout(predicate::str::contains("none is ever built twice"));
}

#[test]
fn info_at_another_rate_tells_another_tessellation() {
    let folder = folder();
    let triangles = |rate: &str| {
        let told = json(&run(folder.path(), &format!("info cube.obj --json --rate {rate}")).success());
        told["full"]["triangles"].as_u64().unwrap()
    };
    assert_eq!(triangles("fixed:1000"), 6 * 2 * 1000 * 1000);
    assert!(triangles("px:1") > 4 * triangles("px:4"));
}

#[test]
fn tessellation_is_closed_and_grouped_by_face() {
    let folder = folder();
    run(folder.path(), "tessellate cube.obj --rate 5 -o out.obj").success().stdout("").stderr("");
    let mesh = read_obj(&folder.path().join("out.obj")).unwrap().mesh;
    assert_eq!((mesh.positions.len(), mesh.n_faces()), (6 * 25 + 2, 6 * 50));
    let mut edges: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for face in mesh.faces() {
        for k in 0..3 {
            let (a, b) = (face[k].0, face[(k + 1) % 3].0);
            *edges.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
        }
    }
    assert!(edges.len() == 450 && edges.values().all(|n| *n == 0), "each edge has two faces, one each way");
    let text = fs::read_to_string(folder.path().join("out.obj")).unwrap();
    assert_eq!(text.lines().filter(|line| line.starts_with("g face_")).count(), 6);
}

#[test]
fn bench_prints_the_keys_of_the_recipe_and_writes_hits() {
    let folder = folder();
    let line = "bench cube.obj --rate 4 --size 24x16 --threads 2 --ao 2 --repeat 1 --json --hits hits.bin";
    let told = json(&run(folder.path(), line).success());
    for key in ["build_s", "first_pass_s", "bytes_per_tri", "rss_end_kb", "hwm_kb"] {
        assert!(told[key].is_number(), "{key} in {told}");
    }
    for pass in ["primary", "ao", "diffuse_tile_order", "diffuse_shuffled"] {
        for threads in ["t1", "tN"] {
            for key in ["median", "best", "cpu"] {
                assert!(told[pass][threads][key].as_f64().unwrap() > 0.0, "{pass} {threads} {key} in {told}");
            }
        }
    }
    assert_eq!(told["triangles"], 6 * 2 * 16);
    let hits = fs::read(folder.path().join("hits.bin")).unwrap();
    let pixels: Vec<f32> =
        hits.chunks_exact(28).map(|pixel| f32::from_le_bytes(pixel[..4].try_into().unwrap())).collect();
    assert_eq!(pixels.len(), 24 * 16);
    let n_hit = pixels.iter().filter(|t| **t >= 0.0 && t.is_finite()).count();
    assert_eq!(told["hits"], n_hit);
}

#[test]
fn bench_traces_primary_rays_together_or_one_by_one() {
    let folder = folder();
    let [together, alone] = ["", " --one-by-one"].map(|option| {
        let line =
            format!("bench cube.obj --rate 9 --size 101x75 --rays primary --repeat 1 --json --hits hits.bin{option}");
        let told = json(&run(folder.path(), &line).success());
        (fs::read(folder.path().join("hits.bin")).unwrap(), told["cache"]["lookups"].as_u64().unwrap())
    });
    assert!(together.0 == alone.0, "other hits");
    assert!(4 * together.1 < 3 * alone.1, "{} lookups together, {} one by one", together.1, alone.1);
}

#[test]
fn wrong_input_gets_a_sentence() {
    let folder = folder();
    let says = |line: &str, sentence: &str| {
        run(folder.path(), line).code(2).stdout("").stderr(predicate::str::contains(sentence));
    };
    says("info none.obj", "lazytess: cannot read none.obj");
    says("info cube.stl", "is neither a scene (.toml) nor a mesh (.obj)");
    says("tessellate none.obj --rate 2 -o out.obj", "lazytess: cannot read none.obj");
    says("tessellate cube.obj --rate 0 -o out.obj", "'0' is no rate");
    says("tessellate cube.obj --rate 2 -o no/out.obj", "no/out.obj: there is no folder no to write to");
    says("bench cube.obj --rate 5000", "'5000' is no rate");
    says("bench cube.obj --rate 2 --rays light", "light");
    says("bench none.obj --rate 2", "lazytess: cannot read none.obj");
    says("fold cube.obj", "unrecognized subcommand 'fold'");
    says("", "Usage: lazytess <COMMAND>");
}
