//! How lights reach a point.

use super::description::Light;
use glam::{DVec3, Vec3};

/// Light that arrives at a point from one direction, unless something is in the way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Incident {
    /// Unit vector from the point towards the light.
    pub to_light: DVec3,
    /// Distance to the light in world units; infinite for directional lights.
    pub distance: f64,
    /// Irradiance of a surface that faces the light.
    pub irradiance: Vec3,
}

impl Light {
    /// The most irradiance of a surface, in a channel; a point light may be as near as one likes.
    pub fn most_irradiance(&self) -> f32 {
        match self {
            Self::Point { .. } => f32::INFINITY,
            Self::Directional { irradiance, .. } => irradiance.max_element(),
            Self::Sky { .. } => 0.0,
        }
    }

    /// Light that arrives at `position`. `None` for a sky, which comes from everywhere, and at the place of a point
    /// light.
    pub fn incident(&self, position: DVec3) -> Option<Incident> {
        match *self {
            Self::Point { position: light, intensity } => {
                let offset = light - position;
                let distance = offset.length();
                let irradiance = intensity / (distance * distance) as f32;
                (distance > 0.0).then(|| Incident { to_light: offset / distance, distance, irradiance })
            }
            Self::Directional { direction, irradiance } => {
                Some(Incident { to_light: -direction, distance: f64::INFINITY, irradiance })
            }
            Self::Sky { .. } => None,
        }
    }
}

/// Radiance of all skies together.
pub fn sky_radiance(lights: &[Light]) -> Vec3 {
    let skies = lights.iter().map(|light| if let Light::Sky { radiance } = light { *radiance } else { Vec3::ZERO });
    skies.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn point_lights_fall_off_with_the_square_of_the_distance() {
        let light = Light::Point { position: DVec3::new(0.0, 3.0, 0.0), intensity: Vec3::splat(18.0) };
        let incident = light.incident(DVec3::ZERO).unwrap();
        assert_eq!(incident, Incident { to_light: DVec3::Y, distance: 3.0, irradiance: Vec3::splat(2.0) });
        assert_eq!(light.incident(DVec3::new(0.0, 3.0, 0.0)), None);
    }

    #[test]
    fn skies_add_up_and_have_no_direction() {
        let sky = Light::Sky { radiance: Vec3::splat(0.25) };
        assert_eq!(sky.incident(DVec3::ZERO), None);
        assert_eq!(sky_radiance(&[sky, sky]), Vec3::splat(0.5));
    }
}
