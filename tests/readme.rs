//! What the pages for readers say is there.

use assert_cmd::Command;
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn help() -> String {
    let output = Command::cargo_bin("lazytess").unwrap().arg("--help").assert().success();
    String::from_utf8(output.get_output().stdout.clone()).unwrap()
}

#[test]
fn the_table_of_commands_is_that_of_the_program() {
    let readme = fs::read_to_string(root().join("README.md")).unwrap();
    let rows = readme.lines().filter_map(|line| line.strip_prefix("| `lazytess "));
    let told: BTreeSet<&str> = rows.map(|row| row.split_whitespace().next().unwrap()).collect();
    let help = help();
    let list = help.lines().skip_while(|line| *line != "Commands:").skip(1).take_while(|line| !line.is_empty());
    let known: BTreeSet<&str> = list.filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(told, &known - &BTreeSet::from(["help"]));
}

/// Markdown pages with the folder that their links start from.
fn pages() -> Vec<(PathBuf, String)> {
    let notes = ["notes", "notes/decisions"].map(|folder| fs::read_dir(root().join(folder)).unwrap());
    let paths = notes.into_iter().flatten().map(|entry| entry.unwrap().path());
    let markdown = paths.filter(|path| path.extension().is_some_and(|extension| extension == "md"));
    let all = markdown.chain([root().join("README.md")]);
    all.map(|path| (path.clone(), fs::read_to_string(path).unwrap())).collect()
}

#[test]
fn links_lead_somewhere() {
    for (path, text) in pages() {
        let targets = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
        for target in targets.filter(|target| !target.is_empty() && !target.starts_with("http")) {
            assert!(path.with_file_name(target).exists(), "{} links to {target}", path.display());
        }
    }
}

#[test]
fn files_named_are_there() {
    for (path, text) in pages() {
        let quoted = text.split('`').skip(1).step_by(2);
        let named =
            quoted.filter(|name| ["tests/", "src/", ".ci/", "scenes/", "benches/"].iter().any(|p| name.starts_with(p)));
        for name in named.filter(|name| !name.contains(['*', ' ', '<', ':'])) {
            assert!(root().join(name).exists(), "{} names {name}", path.display());
        }
    }
}
