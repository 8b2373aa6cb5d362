//! Promise 8: bad input gets a sentence. No panic, hang or unbounded allocation on any byte sequence.
//!
//! Seeded mutations of valid files go through the readers. A panic fails the test with the seed in its message; run
//! that case alone by setting the loop to it.

mod common;

use lazytess::io::obj::parse_obj;
use lazytess::io::scene_file::parse_scene;
use std::path::Path;
use std::time::{Duration, Instant};

/// Files that use every statement of the format.
const OBJ_SEEDS: [&str; 3] = [
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 1\nf 1/1 2/2 3/1 4/2\nf -4/-1 -3/-1 -2/-2\n\
     t crease 2/1/0 0 1 2.5\nt corner 1/1/0 3 10\nt hole 1/0/0 0\nt interpolateboundary 1/0/0 1\n",
    "o a\nv 0.5 -1e3 .25 1\nv 1 2 3 .1 .2 .3\nv 9 8 7\nvn 0 0 1\nusemtl m\ng b c\nf 1//1 \\\n 2//1 3//1\ns off\n\
     t creasemethod 0/0/1 chaikin\nt smoothtriangles 0/0/1 smooth\nt facevaryinginterpolateboundary 1/0/0 2\n",
    "v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3 4\r\n# caf\u{e9}\r\n\
     t vertexedit 8/8/6 3 0 1 2 3 0 3 0 0 0 1 10 1 0 0 5 add P value set P sharpness\r\n\
     t edgeedit 4/1/3 3 0 1 2 2 add P sharpness\r\nt faceedit 3/0/1 2 0 1 hole\r\n",
];

/// Scenes that use every key.
const SCENE_SEEDS: [&str; 2] = [
    "background = 0.5\n[camera]\neye = [0, 1, 5]\nat = [0, 0, 0]\nup = [0, 1, 0]\nfov = 40\n[render]\nsize = [64, 48]\n\
     spp = 4\nintegrator = \"ao\"\nrate = \"px:1\"\nmax_depth = 3\nao_samples = 8\n[materials.a]\n\
     checker = { even = 0.1, odd = \"#ff8800\", size = 2.5 }\nspecular = [0, 0.5, 1]\nshininess = 10\nmirror = 0.1\n\
     [[mesh]]\nfile = \"a.obj\"\nmaterial = \"a\"\nrate = \"fixed:4\"\n\
     transform = { scale = [1, 2, 3], rotate = [10, 20, 30], translate = [1, 1, 1] }\n",
    "[materials.g]\ndiffuse = 0.2\nglass = { ior = 1.5, transmit = 1 }\n[[mesh]]\nfile = \"b.obj\"\nmaterial = \"g\"\n\
     transform = { rotate = { axis = [0, 1, 0], degrees = 45 }, scale = 2 }\n[[mesh]]\nfile = \"c.obj\"\n\
     transform = { matrix = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]] }\n\
     [[light]]\nkind = \"point\"\nposition = [1, 2, 3]\nintensity = 4\n[[light]]\nkind = \"sky\"\nradiance = 0.5\n\
     [[light]]\nkind = \"directional\"\ndirection = [0, -1, 0]\nirradiance = 3\n",
];

/// What mutations like to insert.
const NASTY: [&[u8]; 16] = [
    b"\0",
    b"\xff\xfe",
    b"\\\n",
    b"\r\n",
    b"-",
    b"/",
    b"//",
    b"nan",
    b"inf",
    b"1e999",
    b"-0",
    b"2147483648",
    b"18446744073709551616",
    b"999999999999999999",
    b"\nf ",
    b"\nt crease 9/9/9 ",
];

/// xorshift64*: small, seeded, the same everywhere.
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_f491_4f6c_dd1d) >> 33) as usize % n.max(1)
    }
}

/// One to eight random changes: a byte, an insertion, a deletion, a copied stretch, a cut.
fn mutate(text: &mut Vec<u8>, random: &mut Random) {
    for _ in 0..=random.below(8) {
        let at = random.below(text.len());
        let end = (at + 1 + random.below(12)).min(text.len());
        match random.below(5) {
            0 if at < text.len() => text[at] = random.below(256) as u8,
            1 => drop(text.splice(at..at, NASTY[random.below(NASTY.len())].iter().copied())),
            2 => drop(text.drain(at..end)),
            3 => {
                let stretch = text[at..end].to_vec();
                let to = random.below(text.len());
                drop(text.splice(to..to, stretch));
            }
            _ => text.truncate(text.len() - random.below(text.len().min(20))),
        }
    }
}

fn fuzz(seeds: &[&str], n_cases: u64, read: impl Fn(&[u8])) {
    let start = Instant::now();
    for case in 1..=n_cases {
        let mut random = Random(case.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut text = seeds[random.below(seeds.len())].as_bytes().to_vec();
        mutate(&mut text, &mut random);
        let outcome = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| read(&text)));
        assert!(outcome.is_ok(), "case {case} panics; its input is {:?}", String::from_utf8_lossy(&text));
    }
    assert!(start.elapsed() < Duration::from_secs(60), "{n_cases} small files took {:?}", start.elapsed());
}

#[test]
fn mutated_obj_never_panics_and_errors_are_sentences() {
    let path = Path::new("fuzz.obj");
    fuzz(&OBJ_SEEDS, 200_000, |text| match parse_obj(text, path) {
        Ok(obj) => obj.mesh.validate().expect("what the reader lets through is valid"),
        Err(e) => assert!(e.to_string().contains("fuzz.obj"), "{e}"),
    });
}

#[test]
fn mutated_scene_never_panics_and_errors_are_sentences() {
    let path = Path::new("fuzz.toml");
    fuzz(&SCENE_SEEDS, 20_000, |text| {
        let text = String::from_utf8_lossy(text);
        match parse_scene(&text, path) {
            Ok(scene) => assert!(scene.meshes.iter().all(|m| m.world_from_object.inverse().is_finite()), "{text}"),
            Err(e) => assert!(e.to_string().starts_with("fuzz.toml:"), "{e}"),
        }
    });
}

#[test]
fn every_shared_mesh_is_read_without_warning() {
    for folder in ["meshes/opensubdiv", "meshes/models"] {
        let Some(folder) = common::shared(folder) else { return };
        for file in std::fs::read_dir(folder).unwrap() {
            let path = file.unwrap().path();
            if path.extension().is_some_and(|e| e == "obj") {
                let obj = lazytess::io::obj::read_obj(&path).unwrap();
                assert_eq!(obj.warnings, [""; 0], "{}", path.display());
                check_against_manifest(&path, &obj.mesh);
            }
        }
    }
}

/// The manifest's columns are: shape, vertices, faces, max_face_size, ...
fn check_against_manifest(path: &Path, mesh: &lazytess::mesh::ControlMesh) {
    let manifest = std::fs::read_to_string(path.with_file_name("manifest.csv")).unwrap();
    let shape = path.file_stem().unwrap().to_str().unwrap();
    let Some(line) = manifest.lines().find(|line| line.split(',').next() == Some(shape)) else { return };
    let facts: Vec<&str> = line.split(',').collect();
    let largest = mesh.face_sizes.iter().max().unwrap();
    let found = [mesh.positions.len(), mesh.n_faces(), *largest as usize].map(|n| n.to_string());
    assert_eq!(found, facts[1..4], "{shape}");
}
