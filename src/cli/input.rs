//! A scene or a mesh, as the first argument of most commands.

use super::PICTURE;
use super::run_options::RunArgs;
use crate::error::{Error, Result};
use crate::io::obj::{ReadOptions, read_obj_with};
use crate::io::scene_file::read_scene;
use crate::mesh::ControlMesh;
use crate::scene::description::{Rate, SceneDescription};
use clap::Args;
use std::path::Path;

/// Whether hierarchical edits count.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct EditArgs {
    /// Leave out hierarchical edits (t vertexedit, t edgeedit, t faceedit), as OpenSubdiv 3 does
    #[arg(long, help_heading = PICTURE)]
    pub no_edits: bool,
}

impl EditArgs {
    /// Reads a mesh and tells its warnings on stderr.
    pub fn load_mesh(self, path: &Path) -> Result<ControlMesh> {
        let n_threads = RunArgs::available_threads();
        self.load_mesh_with(path, &ReadOptions { limit: u64::MAX, n_threads, progress: &|_| () })
    }

    /// As [`load_mesh`](Self::load_mesh), with a say in how.
    pub fn load_mesh_with(self, path: &Path, options: &ReadOptions<'_>) -> Result<ControlMesh> {
        let mut mesh = load_mesh(path, options)?;
        if self.no_edits {
            mesh.edits.clear();
        }
        Ok(mesh)
    }
}

/// Reads `scene.toml`, or makes the bare scene of `mesh.obj`.
pub fn load_scene(path: &Path) -> Result<SceneDescription> {
    let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
    match extension.as_deref() {
        Some("toml") => read_scene(path),
        Some("obj") => Ok(SceneDescription::bare(path.to_owned())),
        _ => Err(Error::input("is neither a scene (.toml) nor a mesh (.obj)").at(path, None)),
    }
}

fn load_mesh(path: &Path, options: &ReadOptions<'_>) -> Result<ControlMesh> {
    let obj = read_obj_with(path, options)?;
    obj.warnings.iter().for_each(|warning| eprintln!("lazytess: warning: {warning}"));
    Ok(obj.mesh)
}

/// The files that a scene or a bare mesh is read from.
pub fn files_of<'a>(path: &'a Path, scene: &'a SceneDescription) -> impl Iterator<Item = &'a Path> {
    std::iter::once(path).chain(scene.meshes.iter().map(|mesh| mesh.file.as_path()))
}

/// Gives every mesh its rate: what was typed, else its own, else the scene's, else `px:1`.
pub fn settle_rates(scene: &mut SceneDescription, typed: Option<Rate>) {
    let default = scene.render.rate.unwrap_or(Rate::Pixels(1.0));
    scene.meshes.iter_mut().for_each(|mesh| mesh.rate = Some(typed.or(mesh.rate).unwrap_or(default)));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn typed_rate_goes_before_the_mesh_s_and_that_before_the_scene_s() {
        let mut scene = SceneDescription::bare("a.obj".into());
        let settled = |scene: &mut SceneDescription, typed| {
            settle_rates(scene, typed);
            scene.meshes[0].rate
        };
        assert_eq!(settled(&mut scene.clone(), None), Some(Rate::Pixels(1.0)));
        scene.render.rate = Some(Rate::Fixed(2));
        assert_eq!(settled(&mut scene.clone(), None), Some(Rate::Fixed(2)));
        scene.meshes[0].rate = Some(Rate::Fixed(3));
        assert_eq!(settled(&mut scene.clone(), None), Some(Rate::Fixed(3)));
        assert_eq!(settled(&mut scene, Some(Rate::Fixed(4))), Some(Rate::Fixed(4)));
    }

    #[test]
    fn input_is_told_apart_by_its_extension() {
        assert_eq!(load_scene(Path::new("a.OBJ")).unwrap(), SceneDescription::bare("a.OBJ".into()));
        let message = load_scene(Path::new("a.stl")).unwrap_err().to_string();
        assert_eq!(message, "a.stl: is neither a scene (.toml) nor a mesh (.obj)");
    }
}
