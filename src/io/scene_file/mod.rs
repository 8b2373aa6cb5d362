//! `scene.toml`: camera, meshes, materials, lights.
//!
//! The format is described for users in `notes/scene-format.md`. Reading goes in two steps: serde fills **tables** that
//! have the shape of the file, and whose values check themselves (finite numbers, colours, rates), so that an error
//! knows its line; then the tables are resolved into a [`SceneDescription`] (paths, transforms, names of materials).
//!
//! ```
//! use lazytess::io::scene_file::parse_scene;
//! let text = r##"
//!     [[mesh]]
//!     file = "pawn.obj"
//!     transform = { translate = [0, 1, 0], rotate = { axis = [0, 1, 0], degrees = 30 }, scale = 2 }
//!     material = "wax"
//!     [materials.wax]
//!     diffuse = "#ffcc88"
//! "##;
//! let scene = parse_scene(text, "scenes/chess.toml".as_ref())?;
//! assert_eq!(scene.meshes[0].file, std::path::Path::new("scenes/pawn.obj"));
//! # Ok::<(), lazytess::Error>(())
//! ```

mod resolve;
mod tables;
mod values;

use crate::error::{Error, Result};
use crate::scene::description::SceneDescription;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Largest scene file in bytes; a hundred thousand meshes fit.
const MAX_BYTES: u64 = 1 << 26;

/// Reads a scene and makes sure that its mesh files exist.
pub fn read_scene(path: &Path) -> Result<SceneDescription> {
    let text = read_text(path)?;
    let parsed = parse(&text, path)?;
    for (mesh, &offset) in parsed.scene.meshes.iter().zip(&parsed.mesh_offsets) {
        if !mesh.file.exists() {
            let message = format!("the mesh file {} does not exist", mesh.file.display());
            return Err(Error::input(message).at(path, Some(line_of(&text, offset))));
        }
    }
    Ok(parsed.scene)
}

/// Reads the text of a scene; `path` is for messages and for the folder that mesh files are relative to.
pub fn parse_scene(text: &str, path: &Path) -> Result<SceneDescription> {
    parse(text, path).map(|parsed| parsed.scene)
}

struct Parsed {
    scene: SceneDescription,
    /// Where in the text each mesh's file is named.
    mesh_offsets: Vec<usize>,
}

fn parse(text: &str, path: &Path) -> Result<Parsed> {
    let place = |offset: usize| line_of(text, offset);
    let tables: tables::SceneTables = toml::from_str(text).map_err(|e| {
        let message = e.message().lines().collect::<Vec<_>>().join("; ");
        Error::input(message).at(path, e.span().map(|span| place(span.start)))
    })?;
    let mesh_offsets = tables.mesh.iter().map(|mesh| mesh.get_ref().file.span().start).collect();
    let scene = resolve::resolve(tables, path.parent().unwrap_or(Path::new("")))
        .map_err(|e| Error::input(e.message).at(path, e.offset.map(place)))?;
    Ok(Parsed { scene, mesh_offsets })
}

fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())].iter().filter(|&&b| b == b'\n').count()
}

fn read_text(path: &Path) -> Result<String> {
    let failed = |e| Error::io("read", path, e);
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(failed)?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(Error::input(format!("is larger than {MAX_BYTES} bytes: is this a scene?")).at(path, None));
    }
    String::from_utf8(bytes).map_err(|e| {
        let line = e.as_bytes()[..e.utf8_error().valid_up_to()].iter().filter(|&&b| b == b'\n').count() + 1;
        Error::input("this is no UTF-8 text: save the scene as UTF-8").at(path, Some(line))
    })
}

#[cfg(test)]
mod tests;
