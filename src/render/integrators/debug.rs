//! The false-colour pictures one debugs with. Their colours are linear RGB like any other.

use super::Shader;
use super::interaction::Interaction;
use crate::image::color_map::viridis;
use crate::render::sampler::{hash2, pcg};
use crate::render::tracer::{Built, Tracer};
use crate::scene::camera::Camera;
use crate::scene::description::DebugView;
use crate::subdiv::MAX_RATE;
use glam::Vec3;

impl<'a, T: Tracer> Shader<'a, T> {
    /// The colour of a camera ray's hit; `misses_before` is what the tracer counted before the ray.
    pub(super) fn debug_color(
        &self,
        view: DebugView,
        x: &Interaction<'a>,
        camera: &Camera,
        misses_before: Built,
    ) -> Vec3 {
        match view {
            DebugView::Normal => 0.5 * (x.point.shading_normal.as_vec3() + Vec3::ONE),
            DebugView::Patch => id_color(hash2(x.hit.primitive.mesh.0, x.hit.primitive.patch.0)),
            DebugView::Uv => Vec3::new(x.hit.u, x.hit.v, 0.0),
            DebugView::Rate => logarithmic(self.tracer.patch_rate(&x.hit.primitive) as f32, MAX_RATE as f32),
            DebugView::Depth => depth_color(x, camera),
            // 255 misses for one ray is far beyond what the depth of the trees allows.
            DebugView::Miss => logarithmic((self.misses() - misses_before).blocks as f32 + 1.0, 256.0),
        }
    }
}

/// A bright colour that tells neighbours apart: three independent bytes, none below a quarter.
fn id_color(hash: u32) -> Vec3 {
    let channel = |i| 0.25 + 0.75 * (pcg(hash ^ i) >> 24) as f32 / 255.0;
    Vec3::new(channel(1), channel(2), channel(3))
}

/// From dark blue at 1 to yellow at `max`, by the logarithm.
fn logarithmic(value: f32, max: f32) -> Vec3 {
    viridis(value.max(1.0).ln() / max.ln())
}

/// White at the eye, mid-grey at the distance the camera looks at, black far away.
fn depth_color(x: &Interaction<'_>, camera: &Camera) -> Vec3 {
    let distance = (x.point.position - camera.eye()).length();
    Vec3::splat((camera.focus_distance() / (camera.focus_distance() + distance)) as f32)
}
