//! From boxes in lattice units to rectangles on the picture.

use crate::math::Bounds;
use crate::scene::camera::Camera;
use crate::scene::world::WorldMesh;
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// Depth that boxes are clipped at, in distances between the eye and what it looks at: nothing nearer is taken into
/// account.
const NEAR: f64 = 1e-7;

/// A mesh as a camera sees it.
pub(super) struct MeshView {
    view_from_lattice: DAffine3,
    view_from_lattice_normal: DMat3,
}

/// What a box covers on the picture.
#[derive(Clone, Copy)]
pub(super) struct ScreenBox {
    /// In pixels.
    pub min: DVec2,
    /// In pixels.
    pub max: DVec2,
    /// Nearest depth along the camera's forward direction.
    pub nearest: f64,
}

impl MeshView {
    pub fn new(mesh: &WorldMesh, camera: &Camera) -> Self {
        let view = |p: DVec3| {
            let object = mesh.surface().object_from_lattice(p);
            camera.view_from_world(mesh.world_from_object().transform_point3(object))
        };
        let origin = view(DVec3::ZERO);
        let axes = DVec3::AXES.map(|axis| view(axis) - origin);
        let normals = DVec3::AXES.map(|axis| camera.view_from_world_vector(*mesh.world_from_object_normal() * axis));
        Self {
            view_from_lattice: DAffine3::from_mat3_translation(DMat3::from_cols(axes[0], axes[1], axes[2]), origin),
            view_from_lattice_normal: DMat3::from_cols(normals[0], normals[1], normals[2]),
        }
    }

    /// Cosine between a normal and the direction to the eye, both of a point in lattice units; NaN without a normal.
    pub fn cosine(&self, position: DVec3, normal: DVec3) -> f64 {
        let to_eye = -self.view_from_lattice.transform_point3(position);
        (self.view_from_lattice_normal * normal).normalize().dot(to_eye.normalize())
    }

    /// `None` if all of the box lies behind the eye.
    pub fn project(&self, b: &Bounds, camera: &Camera, size: [u32; 2]) -> Option<ScreenBox> {
        let near = NEAR * camera.focus_distance();
        let (min, extent) = (b.min.as_dvec3(), (b.max - b.min).as_dvec3());
        let first = self.view_from_lattice.transform_point3(min);
        let m = &self.view_from_lattice.matrix3;
        let [x, y, z] = [m.x_axis * extent.x, m.y_axis * extent.y, m.z_axis * extent.z];
        let corners = [first, first + x, first + y, first + x + y].map(|p| [p, p + z]);
        let corner = |k: usize| corners[k & 3][k >> 2];
        let mut screen = ScreenBox::EMPTY;
        let mut n_before = 0;
        for p in (0..8).map(corner).filter(|p| p.z >= near) {
            screen.grow(camera.raster_from_view(p, size), p.z);
            n_before += 1;
        }
        for (k, axis) in (0..8).flat_map(|k| [1, 2, 4].map(|axis| (k, axis))).filter(|_| n_before % 8 != 0) {
            let (a, b) = (corner(k), corner(k | axis));
            if (a.z >= near) != (b.z >= near) {
                let on_plane = a.lerp(b, (near - a.z) / (b.z - a.z));
                screen.grow(camera.raster_from_view(DVec3 { z: near, ..on_plane }, size), near);
            }
        }
        (n_before > 0).then_some(screen)
    }
}

impl ScreenBox {
    const EMPTY: Self =
        Self { min: DVec2::splat(f64::INFINITY), max: DVec2::splat(f64::NEG_INFINITY), nearest: f64::INFINITY };

    fn grow(&mut self, p: DVec2, depth: f64) {
        self.min = self.min.min(p);
        self.max = self.max.max(p);
        self.nearest = self.nearest.min(depth);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::scene::description::CameraDescription;
    use crate::scene::rate::DicingRate;
    use glam::Vec3;

    #[test]
    fn points_of_a_box_are_seen_within_its_rectangle() {
        let mesh =
            WorldMesh::new(shapes::all().remove(0).1, DAffine3::from_translation(DVec3::X), DicingRate::Fixed(1), 1)
                .unwrap();
        let b = Bounds { min: Vec3::splat(-4e6), max: Vec3::new(1e6, 5e6, 3e6) };
        for eye in [DVec3::new(3.0, 4.0, 9.0), DVec3::new(1.1, 0.1, -0.2), DVec3::new(1.0, -0.9, 1.5)] {
            let camera = CameraDescription { eye, at: DVec3::new(1.0, 0.3, 0.2), up: DVec3::Y, fov: 50.0 };
            let camera = Camera::new(&camera);
            let view = MeshView::new(&mesh, &camera);
            let screen = view.project(&b, &camera, [100, 80]).unwrap();
            for k in 0..1000 {
                let t = Vec3::new((k % 10) as f32, (k / 10 % 10) as f32, (k / 100) as f32) / 9.0;
                let p = view.view_from_lattice.transform_point3((b.min + t * (b.max - b.min)).as_dvec3());
                let raster = camera.raster_from_view(p, [100, 80]);
                let inside = raster.cmpge(screen.min - 1e-6).all() && raster.cmple(screen.max + 1e-6).all();
                assert!(p.z < 1e-3 || inside && p.z >= screen.nearest - 1e-9, "{p} at {raster}");
            }
        }
    }
}
