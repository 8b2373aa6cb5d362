//! Counting rays by what they are for.

use serde::Serialize;

/// What a ray is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RayKind {
    /// From the camera.
    Primary,
    /// Towards a light.
    Shadow,
    /// Mirrored by a mirror or a clear body.
    Reflection,
    /// Into or out of a clear body.
    Refraction,
    /// Of the `ao` integrator.
    Occlusion,
    /// Diffuse bounces of the `path` integrator.
    Diffuse,
}

/// Number of rays of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct RayCounts {
    /// From the camera.
    pub primary: u64,
    /// Towards lights; one that passes clear bodies counts once for each stretch.
    pub shadow: u64,
    /// Mirrored.
    pub reflection: u64,
    /// Refracted.
    pub refraction: u64,
    /// Ambient occlusion.
    pub occlusion: u64,
    /// Diffuse bounces.
    pub diffuse: u64,
}

impl RayCounts {
    /// Counts one ray.
    pub fn count(&mut self, kind: RayKind) {
        *match kind {
            RayKind::Primary => &mut self.primary,
            RayKind::Shadow => &mut self.shadow,
            RayKind::Reflection => &mut self.reflection,
            RayKind::Refraction => &mut self.refraction,
            RayKind::Occlusion => &mut self.occlusion,
            RayKind::Diffuse => &mut self.diffuse,
        } += 1;
    }

    /// Rays of all kinds.
    pub fn total(&self) -> u64 {
        self.primary + self.shadow + self.reflection + self.refraction + self.occlusion + self.diffuse
    }
}

impl std::ops::AddAssign for RayCounts {
    fn add_assign(&mut self, other: Self) {
        self.primary += other.primary;
        self.shadow += other.shadow;
        self.reflection += other.reflection;
        self.refraction += other.refraction;
        self.occlusion += other.occlusion;
        self.diffuse += other.diffuse;
    }
}
