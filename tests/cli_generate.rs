//! `lazytess generate`, driven as a user would.

use assert_cmd::Command;
use lazytess::io::obj::read_obj;
use predicates::prelude::*;
use std::path::Path;

fn generate(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("lazytess").unwrap();
    command.current_dir(folder).arg("generate").args(arguments).args(["-o", "out.obj"]).assert()
}

#[test]
fn meshes_of_any_size_have_about_the_faces_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    for kind in ["ground", "scan", "crowd"] {
        generate(folder.path(), &[kind, "--faces", "3k", "--seed", "7"]).success().stdout("").stderr("");
        let read = read_obj(&folder.path().join("out.obj")).unwrap();
        assert!(read.warnings.is_empty());
        assert!(read.mesh.n_faces().abs_diff(3000) < 300, "{kind}: {}", read.mesh.n_faces());
    }
}

#[test]
fn same_arguments_give_the_same_bytes_and_another_seed_others() {
    let folder = tempfile::tempdir().unwrap();
    let made = |seed| {
        generate(folder.path(), &["scan", "--faces", "500", "--seed", seed]).success();
        std::fs::read(folder.path().join("out.obj")).unwrap()
    };
    assert_eq!(made("1"), made("1"));
    assert_ne!(made("1"), made("2"));
}

#[test]
fn valence_is_what_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    for (kind, n_faces) in [("pole", 600), ("quad-pole", 300), ("globe", 1800), ("prism", 302), ("n-gon", 1)] {
        generate(folder.path(), &[kind, "--valence", "300"]).success();
        assert_eq!(read_obj(&folder.path().join("out.obj")).unwrap().mesh.n_faces(), n_faces, "{kind}");
    }
}

#[test]
fn file_says_how_it_was_made() {
    let folder = tempfile::tempdir().unwrap();
    generate(folder.path(), &["ground", "--faces", "16"]).success();
    let text = std::fs::read_to_string(folder.path().join("out.obj")).unwrap();
    assert!(text.starts_with("# made by: lazytess generate ground --faces 16\nv "), "{text}");
}

#[test]
fn wrong_arguments_get_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let says = |arguments: &[&str], sentence: &str| {
        generate(folder.path(), arguments).code(2).stdout("").stderr(predicate::str::contains(sentence));
    };
    says(&["chess-horse"], "there is no mesh 'chess-horse': choose one of ground");
    says(&["chess-pawn", "--faces", "9"], "--faces does not change a chess-pawn");
    says(&["ground", "--valence", "9"], "--valence does not change a ground");
    says(&["pole", "--valence", "2"], "choose 3 to 4096");
    says(&["crowd", "--faces", "0"], "'0' is no count");
    says(&["crowd", "--faces", "many"], "'many' is no count");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}
