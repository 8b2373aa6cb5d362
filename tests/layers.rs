//! Modules know only what lies below them, as `notes/architecture.md` draws it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Bottom first: a module may use those before it.
const ORDER: [&str; 18] = [
    "ids", "error", "names", "parallel", "math", "mesh", "topology", "subdiv", "grid", "cache", "image", "scene",
    "render", "io", "report", "bench", "check", "cli",
];

/// Below it, and still none of its business.
const STRANGERS: [(&str, &[&str]); 3] = [
    ("cache", &["ids", "math", "mesh", "topology", "subdiv", "grid"]),
    ("grid", &["subdiv", "topology"]),
    ("image", &["cache", "grid", "subdiv"]),
];

/// Modules that the lines of a file name, comments aside.
fn used(file: &Path) -> BTreeSet<String> {
    let text = fs::read_to_string(file).unwrap();
    let code = text.lines().map(str::trim).filter(|line| !line.starts_with("//"));
    let rests = code.flat_map(|line| line.split("crate::").skip(1).map(str::to_owned).collect::<Vec<_>>());
    let name = |rest: String| {
        assert!(
            !rest.starts_with('{'),
            "{}: one `use crate::` for each module, so that this test sees them",
            file.display()
        );
        rest.chars().take_while(|c| c.is_ascii_lowercase() || *c == '_').collect::<String>()
    };
    rests.map(name).filter(|name| !name.is_empty()).collect()
}

/// The lines of a file without comments and without its unit tests, which come last.
fn code(text: &str) -> impl Iterator<Item = &str> {
    let end = text.find("#[cfg(test)]\nmod tests {").unwrap_or(text.len());
    text[..end].lines().filter(|line| !line.trim().starts_with("//"))
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

/// The files of each module, and the module.
fn modules() -> Vec<(String, Vec<PathBuf>)> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let entries = fs::read_dir(source).unwrap().map(|entry| entry.unwrap().path());
    let named = entries.map(|path| {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        (name, if path.is_dir() { files_below(&path) } else { vec![path] })
    });
    named.filter(|(name, _)| name != "lib" && name != "main").collect()
}

#[test]
fn modules_use_only_what_lies_below_them() {
    for (module, files) in modules() {
        let place = |name: &str| ORDER.iter().position(|m| *m == name);
        let own = place(&module).unwrap_or_else(|| panic!("{module} has no place in ORDER: give it one"));
        let strangers = STRANGERS.iter().find(|(name, _)| *name == module).map_or(&[][..], |(_, list)| list);
        for file in files {
            for name in used(&file).into_iter().filter(|name| *name != module) {
                let below = place(&name).is_some_and(|p| p < own) && !strangers.contains(&name.as_str());
                assert!(below, "{} uses {name}, which {module} must not know", file.display());
            }
        }
    }
}

#[test]
fn only_io_opens_files() {
    for (module, files) in modules().into_iter().filter(|(name, _)| name != "io") {
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            let is_test = file.file_stem().is_some_and(|name| name.to_str().unwrap().contains("tests"));
            let opens = code(&text).filter(|_| !is_test).find(|line| {
                ["fs::", "{fs", " fs,", "File::", "OpenOptions"]
                    .iter()
                    .any(|way| line.replace("refs::", "").contains(way))
            });
            assert_eq!(opens, None, "{} of {module} opens files", file.display());
        }
    }
}
