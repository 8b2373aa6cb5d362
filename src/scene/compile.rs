//! From a description and its meshes to a world and a camera.

use super::camera::Camera;
use super::description::{Rate, SceneDescription};
use super::rate::DicingRate;
use super::world::{Watch, World, WorldMesh};
use crate::error::Result;
use crate::math::DBounds;
use crate::mesh::ControlMesh;
use crate::scene::description::CameraDescription;

/// The camera of a description: its own, or one that frames all meshes in pictures of this size. `meshes[i]` belongs to
/// `description.meshes[i]`.
pub fn camera_of(description: &SceneDescription, meshes: &[ControlMesh], size: [u32; 2]) -> CameraDescription {
    let framed = || {
        let boxes = description.meshes.iter().zip(meshes).map(|(d, mesh)| {
            let corners = mesh.bounds().corners();
            corners.map(|p| d.world_from_object.transform_point3(p)).collect::<DBounds>()
        });
        CameraDescription::framing(boxes.fold(DBounds::EMPTY, DBounds::union)).for_pictures_of(size)
    };
    description.camera.unwrap_or_else(framed)
}

/// Prepares all meshes for tracing. Every mesh of the description must have its rate; pixels are those of a picture
/// `height` pixels high seen through `camera`. `progress` is called with a number of control faces that are as good as
/// ready, `planned` with a share of the plans of one of the meshes ([`Watch::planned`]).
pub fn compile(
    description: &SceneDescription,
    meshes: Vec<ControlMesh>,
    camera: &Camera,
    height: u32,
    n_threads: usize,
    progress: &(dyn Fn(usize) + Sync),
    planned: &dyn Fn(f64) -> Result<()>,
) -> Result<World> {
    let mut compiled = Vec::with_capacity(meshes.len());
    let mut n_before = 0;
    for (mesh_description, mesh) in description.meshes.iter().zip(meshes) {
        let rate = DicingRate::new(mesh_description.rate.unwrap_or(Rate::Pixels(1.0)), camera, height);
        let (before, n_faces) = (n_before, mesh.n_faces());
        let report = |share: f64| progress(before + (share * n_faces as f64) as usize);
        let watch = Watch { progress: &report, planned };
        compiled.push(WorldMesh::from_description(mesh_description, mesh, rate, n_threads, &watch)?);
        n_before += n_faces;
    }
    Ok(World::new(compiled))
}
