//! One mesh in a world, ready to be traced.

use glam::{DAffine3, DVec3, Vec3};
use lazytess::cache::CacheConfig;
use lazytess::ids::MeshId;
use lazytess::mesh::ControlMesh;
use lazytess::render::{Appearance, RenderSettings, RunSettings, render};
use lazytess::scene::camera::Camera;
use lazytess::scene::description::{CameraDescription, Light, Material};
use lazytess::scene::intersect::Intersector;
use lazytess::scene::rate::DicingRate;
use lazytess::scene::world::{GridCache, World, WorldMesh};
use std::sync::atomic::AtomicBool;

/// A world of one mesh and its cache.
pub struct Traced {
    pub world: World,
    pub cache: GridCache,
}

impl Traced {
    pub fn new(mesh: &ControlMesh, world_from_object: DAffine3, rate: DicingRate) -> Self {
        let world = World::new(vec![WorldMesh::new(mesh.clone(), world_from_object, rate, 2).unwrap()]);
        let cache = GridCache::new(&world, CacheConfig::with_bytes(32 << 20)).unwrap();
        Self { world, cache }
    }

    pub fn mesh(&self) -> &WorldMesh {
        self.world.mesh(MeshId(0))
    }

    pub fn tracer(&self) -> Intersector<'_> {
        Intersector::new(&self.world, &self.cache)
    }

    /// A picture in a white material.
    pub fn picture(&self, camera: &CameraDescription, lights: Vec<Light>, settings: &RenderSettings) -> Vec<[f32; 3]> {
        let appearance = Appearance::new(vec![Material::default()], lights, Vec3::ZERO);
        let cancel = AtomicBool::new(false);
        let run = RunSettings::quiet(2, &cancel);
        render(&Camera::new(camera), &appearance, settings, &run, || self.tracer()).film.colors().to_vec()
    }
}

/// Looks from `eye` at `at`, both in object space, wherever the object stands.
pub fn camera(world_from_object: &DAffine3, eye: DVec3, at: DVec3, fov: f64) -> CameraDescription {
    let [eye, at] = [eye, at].map(|p| world_from_object.transform_point3(p));
    CameraDescription { eye, at, up: world_from_object.transform_vector3(DVec3::Y), fov }
}

/// The scales and offsets at which everything has to work. At offset 1e7 doubles have 2e-9 left.
pub fn placements() -> Vec<DAffine3> {
    let at = |scale: f64, offset: DVec3| DAffine3::from_translation(offset) * DAffine3::from_scale(DVec3::splat(scale));
    vec![at(1.0, DVec3::ZERO), at(1e-6, DVec3::ZERO), at(1e6, DVec3::ZERO), at(1.0, DVec3::new(1e7, -1e7, 1e7))]
}
