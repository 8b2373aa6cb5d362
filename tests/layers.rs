//! Modules know only what lies below them, as `notes/architecture.md` draws it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Bottom first: a module may use those before it.
const ORDER: [&str; 17] = [
    "ids", "error", "parallel", "math", "mesh", "topology", "subdiv", "grid", "cache", "image", "scene", "render",
    "io", "report", "bench", "check", "cli",
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
    let names = code.flat_map(|line| line.split("crate::").skip(1).map(str::to_owned).collect::<Vec<_>>());
    let names = names.map(|rest| rest.chars().take_while(|c| c.is_ascii_lowercase() || *c == '_').collect::<String>());
    names.filter(|name| !name.is_empty()).collect()
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
fn only_io_and_the_command_line_open_files() {
    for (module, files) in modules().into_iter().filter(|(name, _)| name != "io" && name != "cli") {
        for file in files {
            let text = fs::read_to_string(&file).unwrap();
            let code = text.lines().take_while(|line| !line.contains("#[cfg(test)]"));
            let opens = code.filter(|line| !line.trim().starts_with("//")).find(|line| line.contains("std::fs"));
            assert_eq!(opens, None, "{} of {module} opens files", file.display());
        }
    }
}
