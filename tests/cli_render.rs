//! `lazytess render`, driven as a user would.

mod common;

use assert_cmd::Command;
use assert_cmd::assert::Assert;
use exr::prelude::{FlatSamples, read_all_flat_layers_from_file};
use lazytess::io::obj_write::ObjWriter;
use lazytess::io::picture::{RgbPicture, read_rgb};
use lazytess::io::write::write_whole;
use lazytess::mesh::shapes;
use predicates::prelude::*;
use std::fs;
use std::path::Path;

/// Shadows, a mirror, glass, a mirrored and a stretched mesh.
const SCENE: &str = r#"
background = [0.2, 0.3, 0.4]
[camera]
eye = [4, 3, 6]
at = [0, 0, 0]
[render]
size = [72, 54]
spp = 2
rate = "px:2"
[materials.mirror]
diffuse = 0.3
mirror = 0.6
[materials.glass]
glass = { ior = 1.5, transmit = 0.9 }
[[mesh]]
file = "torus.obj"
transform = { scale = [-1, 1, 1], rotate = [50, 0, 10] }
[[mesh]]
file = "cube.obj"
material = "mirror"
transform = { scale = [3, 0.2, 3], translate = [0, -2, 0] }
[[mesh]]
file = "cube.obj"
material = "glass"
rate = "fixed:9"
transform = { translate = [1.5, 0.5, 2] }
[[light]]
kind = "directional"
direction = [-1, -2, -1]
irradiance = 3
[[light]]
kind = "sky"
radiance = 0.3
"#;

/// A folder with `scene.toml` and its meshes.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("scene.toml"), SCENE).unwrap();
    for (name, mesh) in [("torus.obj", shapes::torus(8, 6, 2.0, 0.75)), ("cube.obj", shapes::crease_cube(1.5))] {
        write_whole(&folder.path().join(name), |out| ObjWriter::new(out).mesh(&mesh)).unwrap();
    }
    folder
}

fn render(folder: &Path, line: &str) -> Assert {
    let mut command = Command::cargo_bin("lazytess").unwrap();
    command.current_dir(folder).arg("render").args(line.split_whitespace()).assert()
}

/// The bytes of the picture that a quiet render writes.
fn bytes(folder: &Path, line: &str) -> Vec<u8> {
    render(folder, &format!("{line} --quiet")).success().stdout("").stderr("");
    fs::read(folder.join("out.exr")).unwrap()
}

fn stats(folder: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(folder.join("s.json")).unwrap()).unwrap()
}

#[test]
fn threads_and_caches_do_not_change_a_byte() {
    let folder = folder();
    for integrator in ["whitted", "ao --ao-samples 3", "path --max-depth 3", "debug:normal"] {
        let line =
            format!("scene.toml -o out.exr --size 40x30 --aov Z,N,mesh,patch,uv,samples --integrator {integrator}");
        let expected = bytes(folder.path(), &format!("{line} --cache unbounded --threads 1"));
        for run in [
            "--cache unbounded --threads 2",
            "--cache unbounded --threads 8",
            "--cache 0 --threads 2",
            "--cache 64K --threads 2",
            "--cache 64K --threads 8",
            "--cache 1M --threads 1",
            "",
        ] {
            assert!(bytes(folder.path(), &format!("{line} {run}")) == expected, "{integrator} {run}");
        }
    }
}

#[test]
fn a_window_has_the_pixels_of_the_whole() {
    let folder = folder();
    let picture = |arguments: &str| {
        render(folder.path(), &format!("scene.toml -o out.exr --quiet {arguments}")).success();
        read_rgb(&folder.path().join("out.exr")).unwrap()
    };
    let whole = picture("");
    let window = picture("--crop 13,50,20,41");
    assert_eq!((whole.width, whole.height, window.width, window.height), (72, 54, 37, 21));
    for (i, pixel) in window.pixels.iter().enumerate() {
        assert_eq!(*pixel, whole.pixels[(20 + i / 37) * 72 + 13 + i % 37], "pixel {i}");
    }
}

#[test]
fn another_seed_is_another_picture() {
    let folder = folder();
    let with_seed = |seed| bytes(folder.path(), &format!("scene.toml -o out.exr --integrator ao --seed {seed}"));
    assert!(with_seed(1) != with_seed(2));
    assert!(with_seed(1) == with_seed(1));
}

#[test]
fn exr_has_the_layers_asked_for_and_half_floats() {
    let folder = folder();
    let path = folder.path().join("out.exr");
    render(folder.path(), "scene.toml -o out.exr --quiet").success();
    assert_eq!(channels(&path), ["B half", "G half", "R half"]);
    render(folder.path(), "scene.toml -o out.exr --quiet --aov Z,N,mesh,patch,uv,samples,miss").success();
    let expected = [
        "B half",
        "G half",
        "N.X float",
        "N.Y float",
        "N.Z float",
        "R half",
        "Z float",
        "mesh uint",
        "miss uint",
        "patch uint",
        "samples uint",
        "uv.u float",
        "uv.v float",
    ];
    assert_eq!(channels(&path), expected);
}

fn channels(path: &Path) -> Vec<String> {
    let image = read_all_flat_layers_from_file(path).unwrap();
    assert_eq!(image.layer_data.len(), 1);
    let list = image.layer_data[0].channel_data.list.iter();
    let kind = |samples: &FlatSamples| match samples {
        FlatSamples::F16(_) => "half",
        FlatSamples::F32(_) => "float",
        FlatSamples::U32(_) => "uint",
    };
    list.map(|channel| format!("{} {}", channel.name, kind(&channel.sample_data))).collect()
}

#[test]
fn layers_tell_what_is_seen() {
    let folder = folder();
    render(
        folder.path(),
        "cube.obj -o out.exr --size 20x20 --aov Z,N,patch,samples --rate fixed:4 --groups off --quiet",
    )
    .success();
    let image = read_all_flat_layers_from_file(folder.path().join("out.exr")).unwrap();
    let channel = |name: &str, pixel: usize| {
        let list = &image.layer_data[0].channel_data.list;
        let channel = list.iter().find(|channel| channel.name.to_string() == name).unwrap();
        channel.sample_data.value_by_flat_index(pixel).to_f32()
    };
    let (corner, middle) = (0, 10 * 20 + 10);
    assert_eq!((channel("Z", corner), channel("N.X", corner)), (f32::INFINITY, 0.0));
    assert!(channel("Z", middle) > 1.0 && channel("Z", middle) < 100.0);
    let squares = ["N.X", "N.Y", "N.Z"].map(|name| channel(name, middle).powi(2));
    assert!((squares.iter().sum::<f32>() - 1.0).abs() < 1e-5);
    assert!(channel("patch", middle) < 6.0 && channel("samples", corner) == 4.0);
}

#[test]
fn what_was_built_for_all_pixels_is_what_the_cache_has_built() {
    let folder = folder();
    render(folder.path(), "scene.toml -o out.exr --aov miss,build --cache 8K --threads 2 --groups off --stats s.json")
        .success();
    let (image, s) = (read_all_flat_layers_from_file(folder.path().join("out.exr")).unwrap(), stats(folder.path()));
    let sum = |name: &str| {
        let list = &image.layer_data[0].channel_data.list;
        let channel = list.iter().find(|channel| channel.name.to_string() == name).unwrap();
        channel.sample_data.values_as_f32().map(f64::from).sum::<f64>()
    };
    let number = |path: &str| s.pointer(path).and_then(|v| v.as_f64()).unwrap();
    let misses = ["compulsory", "capacity", "other"].map(|cause| number(&format!("/cache/{cause}_misses")));
    assert_eq!(sum("miss"), misses.iter().sum::<f64>());
    assert_eq!(sum("build"), number("/cache/bytes_built"));
}

#[test]
fn png_is_the_exr_s_colours_in_srgb() {
    let folder = folder();
    render(folder.path(), "scene.toml -o out.exr --quiet").success();
    render(folder.path(), "scene.toml -o out.png --quiet").success();
    let [exr, png] = ["out.exr", "out.png"].map(|name| read_rgb(&folder.path().join(name)).unwrap());
    let encoded = |picture: &RgbPicture| {
        let values = picture.pixels.iter().flatten();
        values.map(|&v| lazytess::image::display::display_value(v)).collect::<Vec<f32>>()
    };
    let differences = encoded(&exr).into_iter().zip(encoded(&png)).map(|(a, b)| (a - b).abs());
    // Half a step of 8 bits, and the rounding of halfs.
    assert!(differences.fold(0.0, f32::max) < 0.75 / 255.0);
}

#[test]
fn statistics_add_up() {
    let folder = folder();
    for (cache, capacity) in [("unbounded", serde_json::Value::Null), ("64K", 65_536.into()), ("0", 0.into())] {
        let line = format!("scene.toml -o out.png --stats s.json --threads 2 --groups off --cache {cache}");
        render(folder.path(), &line).success().stdout("").stderr(predicate::str::contains("lookups hit"));
        let s = stats(folder.path());
        let n = |path: &str| s.pointer(path).and_then(|v| v.as_u64()).unwrap_or_else(|| panic!("{path} in {s}"));
        assert_eq!(s["cache"]["capacity_bytes"], capacity);
        let misses = n("/cache/compulsory_misses") + n("/cache/capacity_misses") + n("/cache/other_misses");
        assert_eq!(n("/cache/lookups"), n("/cache/hits") + n("/cache/private_hits") + misses);
        assert_eq!((n("/picture/pixels"), n("/picture/pixels_done"), n("/rays/primary")), (3888, 3888, 7776));
        assert_eq!((n("/geometry/meshes"), n("/geometry/control_faces"), n("/threads")), (3, 60, 2));
        assert!(n("/geometry/patches_touched") > 0 && n("/geometry/patches_touched") <= n("/geometry/patches"));
        assert!(n("/rays/shadow") > 0 && n("/rays/reflection") > 0 && n("/rays/refraction") > 0);
        assert!(n("/geometry/full_triangles") > 1000 && n("/memory/peak_resident_bytes") > 1 << 20);
        assert!(cache == "unbounded" || n("/cache/peak_bytes") <= n("/cache/capacity_bytes"), "{s}");
        assert!(cache != "unbounded" || n("/cache/capacity_misses") == 0, "{s}");
    }
}

#[test]
fn rays_are_the_same_whatever_the_cache() {
    let folder = folder();
    let rays = |cache: &str| {
        render(folder.path(), &format!("scene.toml -o out.png --stats s.json --quiet --cache {cache}")).success();
        stats(folder.path())["rays"].clone()
    };
    assert_eq!(rays("0"), rays("unbounded"));
}

#[test]
fn a_bare_mesh_renders_with_defaults() {
    let folder = folder();
    render(folder.path(), "torus.obj -o out.png --size 40x30").success().stderr(predicate::str::contains("40 x 30"));
    let picture = read_rgb(&folder.path().join("out.png")).unwrap();
    let background = picture.pixels[0];
    assert!(picture.pixels.iter().filter(|&&pixel| pixel != background).count() > 200);
}

#[test]
fn mistakes_are_sentences_with_exit_code_two() {
    let folder = folder();
    let path = folder.path();
    fs::write(path.join("bad.obj"), "v 0 0 0\nv 1 0 0\nf 1 2 3\n").unwrap();
    fs::write(path.join("key.toml"), "[[mesh]]\nfile = \"cube.obj\"\ncolour = 3\n").unwrap();
    fs::write(path.join("absent.toml"), "[[mesh]]\nfile = \"no.obj\"\n").unwrap();
    fs::write(path.join("flat.toml"), "[[mesh]]\nfile = \"cube.obj\"\ntransform = { scale = [1, 0, 1] }\n").unwrap();
    fs::create_dir(path.join("taken.png")).unwrap();
    let says = |line: &str, sentence: &str| {
        render(path, line).code(2).stdout("").stderr(predicate::str::contains(sentence));
    };
    says("none.obj -o a.png", "lazytess: cannot read none.obj: No such file");
    says("cube.ply -o a.png", "lazytess: cube.ply: is neither a scene (.toml) nor a mesh (.obj)");
    says("bad.obj -o a.png", "lazytess: bad.obj:3: ");
    says("key.toml -o a.png", "lazytess: key.toml:3: ");
    says("absent.toml -o a.png", "no.obj");
    says("flat.toml -o a.png", "lazytess: flat.toml:3: ");
    says("cube.obj -o a.jpg", "lazytess: a.jpg: a picture's name should end in .exr or .png");
    says("cube.obj -o no/a.png", "there is no folder no to write to");
    says("cube.obj -o a.png --stats no/s.json", "there is no folder no to write to");
    says("cube.obj -o taken.png --size 2x2", "lazytess: taken.png: is a folder");
    says("cube.obj -o a.png --aov Z", "lazytess: a.png: --aov needs an EXR file");
    says("cube.obj -o a.png --size 8x8 --crop 0,9,0,8", "lazytess: --crop 0,9,0,8 reaches outside the picture");
    says("cube.obj -o a.png --eye 0,9,0 --at 0,0,0", "choose another up");
    says("cube.obj -o a.png --fov 180", "field of view");
    says("cube.obj -o a.png --size 0x8", "'0x8' is no picture size");
    says("cube.obj -o a.png --cache lots", "'lots' is no size");
    says("cube.obj -o a.png --threads 0", "'0' is no number of threads");
    says("cube.obj -o a.png --rate 8", "px:");
    says("cube.obj -o a.png --integrator phong", "whitted");
    says("cube.obj -o a.png --cache 1M --memory 1G", "cannot be used with");
    says("cube.obj", "--output");
    let files = fs::read_dir(path).unwrap().filter(|entry| {
        let name = entry.as_ref().unwrap().file_name().into_string().unwrap();
        name.ends_with(".png") && name != "taken.png" || name.starts_with('.')
    });
    assert_eq!(files.count(), 0, "no picture appears and no temporary file stays");
}

#[test]
fn help_tells_flags_that_change_the_picture_from_those_that_do_not() {
    let folder = folder();
    let help = render(folder.path(), "--help").success().stderr("");
    let text = String::from_utf8(help.get_output().stdout.clone()).unwrap();
    let (picture, speed) = (text.find("(these change it)").unwrap(), text.find("(these never change it)").unwrap());
    let place = |flag: &str| text.find(flag).unwrap_or_else(|| panic!("{flag} in {text}"));
    assert!(place("--rate <") > picture && place("--rate <") < speed, "{text}");
    assert!(place("--cache <") > speed && place("--threads <") > speed, "{text}");
}

#[test]
fn the_shipped_scenes_render() {
    let scenes = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let folder = tempfile::tempdir().unwrap();
    let mut n = 0;
    for entry in fs::read_dir(scenes).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "toml") {
            let line = format!("{} -o out.png --size 32x18 --spp 1", path.display());
            render(folder.path(), &line).success().stderr(predicate::str::contains("warning").not());
            n += 1;
        }
    }
    assert!(n > 0);
}
