//! Camera flags: they replace parts of the scene's camera, or of the default one.

use super::PICTURE;
use super::values::{field_of_view, vector};
use crate::error::{Error, Result};
use crate::scene::description::CameraDescription;
use clap::Args;
use glam::DVec3;

/// What was typed about the camera.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct CameraArgs {
    /// Where the camera stands [default: the scene's, or a view that frames all meshes]
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, help_heading = PICTURE)]
    pub eye: Option<DVec3>,
    /// The point in the middle of the picture
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, help_heading = PICTURE)]
    pub at: Option<DVec3>,
    /// The direction that points up in the picture
    #[arg(long, value_name = "X,Y,Z", value_parser = vector, allow_hyphen_values = true, help_heading = PICTURE)]
    pub up: Option<DVec3>,
    /// Vertical field of view in degrees
    #[arg(long, value_name = "DEGREES", value_parser = field_of_view, help_heading = PICTURE)]
    pub fov: Option<f64>,
}

impl CameraArgs {
    /// `base` with the parts that were typed.
    pub fn apply(self, base: CameraDescription) -> Result<CameraDescription> {
        let camera = CameraDescription {
            eye: self.eye.unwrap_or(base.eye),
            at: self.at.unwrap_or(base.at),
            up: self.up.unwrap_or(base.up),
            fov: self.fov.unwrap_or(base.fov),
        };
        camera.validate().map_err(Error::input)?;
        Ok(camera)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASE: CameraDescription = CameraDescription { eye: DVec3::Z, at: DVec3::ZERO, up: DVec3::Y, fov: 35.0 };

    #[test]
    fn typed_parts_replace_the_scene_s() {
        let typed = CameraArgs { eye: Some(DVec3::X), fov: Some(50.0), ..Default::default() };
        let expected = CameraDescription { eye: DVec3::X, fov: 50.0, ..BASE };
        assert_eq!(typed.apply(BASE).unwrap(), expected);
    }

    #[test]
    fn impossible_camera_is_a_sentence() {
        let typed = CameraArgs { eye: Some(DVec3::Y), ..Default::default() };
        assert!(typed.apply(BASE).unwrap_err().to_string().contains("choose another up"));
        let typed = CameraArgs { fov: Some(f64::NAN), ..Default::default() };
        assert!(typed.apply(BASE).unwrap_err().to_string().contains("field of view"));
    }
}
