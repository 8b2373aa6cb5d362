//! What a scene file says, as plain data: camera, meshes, materials, lights, defaults.
//!
//! A [`SceneDescription`] is made by `io::scene_file` from `scene.toml`, or by [`SceneDescription::bare`] from a single
//! mesh. Everything in it has been checked: numbers are finite, transforms can be inverted, materials are resolved.
//! Files are named but not opened; compiling a description opens them.
//!
//! Units: lengths are world units, angles degrees, colours linear RGB with Rec. 709 primaries. A white Lambert surface
//! (diffuse 1) that faces a directional light of irradiance π has radiance 1, and so has one under a sky of radiance 1.

use crate::names::{by_name, name_of};
use crate::subdiv::MAX_RATE;
use glam::{DAffine3, DVec3, Vec3};
use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

/// A scene before any mesh is read.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneDescription {
    /// Where the picture is taken from; `None` frames the meshes with the default camera.
    pub camera: Option<CameraDescription>,
    /// Defaults that the command line may override.
    pub render: RenderDefaults,
    /// Radiance of rays that leave the scene; it lights nothing (a [`Light::Sky`] does).
    pub background: Vec3,
    /// Meshes in file order: position `i` is `MeshId(i)`.
    pub meshes: Vec<MeshDescription>,
    /// Lights in file order.
    pub lights: Vec<Light>,
}

/// A pinhole camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraDescription {
    /// Position of the pinhole.
    pub eye: DVec3,
    /// The point in the middle of the picture; differs from `eye`.
    pub at: DVec3,
    /// A direction that points up in the picture; not parallel to `at - eye`.
    pub up: DVec3,
    /// Vertical field of view in degrees, in (0, 180).
    pub fov: f64,
}

/// Samples of a pixel, and occlusion rays of a sample, at most: more would not be seen, and could hardly be waited for.
pub const MOST_SAMPLES: u32 = 65536;

/// Longest chain of reflections and refractions: between two mirrors a longer one never ends, either.
pub const MOST_DEPTH: u32 = 1024;

/// `[render]`: what the scene's author suggests. `None` leaves it to the command line and its defaults.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderDefaults {
    /// Width and height in pixels, each in 1..=65536.
    pub size: Option<[u32; 2]>,
    /// Samples per pixel, at least 1.
    pub spp: Option<u32>,
    /// How light is gathered.
    pub integrator: Option<IntegratorKind>,
    /// Dicing rate of meshes that name none; by default `px:1`.
    pub rate: Option<Rate>,
    /// Longest chain of reflections and refractions.
    pub max_depth: Option<u32>,
    /// Occlusion rays per sample of the `ao` integrator.
    pub ao_samples: Option<u32>,
}

/// One `[[mesh]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct MeshDescription {
    /// The OBJ file; relative paths have been resolved against the scene file's folder.
    pub file: PathBuf,
    /// Invertible and finite.
    pub world_from_object: DAffine3,
    /// How the surface looks.
    pub material: Material,
    /// Dicing rate of this mesh; `None` takes the scene's. The command line's goes before both.
    pub rate: Option<Rate>,
}

/// How finely patches are diced.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rate {
    /// `fixed:N`: every edge of a quad face is cut into N, in 1..=4096.
    Fixed(u32),
    /// `px:L`: edges are cut so that a piece is about L pixels long, L > 0, seen from the dicing camera.
    Pixels(f64),
}

/// Which renderer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum IntegratorKind {
    /// Ambient, diffuse, specular, hard shadows, mirror, refraction.
    Whitted,
    /// Ambient occlusion.
    Ao,
    /// Path tracing.
    Path,
    /// A false-colour picture.
    Debug(DebugView),
}

/// What a `debug:NAME` picture shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DebugView {
    /// Shading normal, from -1..1 to 0..1.
    Normal,
    /// A colour for each patch.
    Patch,
    /// Patch parameters as red and green.
    Uv,
    /// Dicing rate.
    Rate,
    /// Distance from the camera.
    Depth,
    /// Where the cache missed.
    Miss,
}

/// A surface's appearance: the sum of a diffuse, a glossy, a mirror and a transparent part.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name in the scene file, for messages.
    pub name: String,
    /// Diffuse albedo, 0..1 per channel.
    pub diffuse: Albedo,
    /// Colour of highlights of lights, 0..1 per channel.
    pub specular: Vec3,
    /// Blinn-Phong exponent of `specular`, > 0.
    pub shininess: f32,
    /// Share of light mirrored, 0..1 per channel.
    pub mirror: Vec3,
    /// Clear glass instead of an opaque body.
    pub glass: Option<Glass>,
}

/// A clear dielectric body; Fresnel's equations split light between reflection and refraction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Index of refraction inside relative to outside, > 0.
    pub ior: f32,
    /// Share of refracted light that passes a surface, 0..1 per channel.
    pub transmit: Vec3,
}

/// A diffuse colour, constant or patterned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Albedo {
    /// The same everywhere.
    Constant(Vec3),
    /// Two colours that alternate in cubes of world space with edges of length `size`, one corner at the origin.
    Checker {
        /// Colour of the cube whose corner is the origin, towards (1, 1, 1).
        even: Vec3,
        /// Colour of its neighbours.
        odd: Vec3,
        /// Edge length in world units, > 0.
        size: f64,
    },
}

/// One `[[light]]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Light {
    /// Shines from a point in all directions.
    Point {
        /// World position.
        position: DVec3,
        /// Radiant intensity: the irradiance at distance d is `intensity / d²`.
        intensity: Vec3,
    },
    /// Shines from infinitely far away.
    Directional {
        /// Unit vector along which light travels.
        direction: DVec3,
        /// Irradiance of a surface that faces the light.
        irradiance: Vec3,
    },
    /// The same light from every direction; the ambient term of `whitted`.
    Sky {
        /// Radiance.
        radiance: Vec3,
    },
}

impl CameraDescription {
    /// Vertical field of view in degrees of cameras that state none.
    pub const DEFAULT_FOV: f64 = 35.0;

    /// Checks what the fields promise; the message says what to change.
    pub fn validate(&self) -> Result<(), String> {
        let Self { eye, at, up, fov } = *self;
        if !(eye.is_finite() && at.is_finite() && up.is_finite()) {
            return Err("the camera has a coordinate that is not a finite number".to_owned());
        }
        if !(fov > 0.0 && fov < 180.0) {
            return Err(format!("the field of view is {fov} degrees: write a value between 0 and 180"));
        }
        let Some(forward) = (at - eye).try_normalize() else {
            return Err("the camera's eye and at are the same point: move one".to_owned());
        };
        if up == DVec3::ZERO {
            return Err("the camera's up direction is zero: choose another".to_owned());
        }
        let sideways = up.try_normalize().map_or(0.0, |up| forward.cross(up).length());
        if sideways < 1e-9 {
            return Err("the camera looks along its up direction: choose another up".to_owned());
        }
        Ok(())
    }
}

impl SceneDescription {
    /// The scene of a bare mesh: default camera, a key light with a weak sky, a neutral material.
    pub fn bare(mesh_file: PathBuf) -> Self {
        let key = Light::Directional {
            direction: DVec3::new(-0.45, -0.8, -0.55).normalize(),
            irradiance: Vec3::splat(0.8 * std::f32::consts::PI),
        };
        let mesh = MeshDescription {
            file: mesh_file,
            world_from_object: DAffine3::IDENTITY,
            material: Material::default(),
            rate: None,
        };
        Self {
            camera: None,
            render: RenderDefaults::default(),
            background: Vec3::splat(0.05),
            meshes: vec![mesh],
            lights: vec![key, Light::Sky { radiance: Vec3::splat(0.2) }],
        }
    }
}

impl Default for Material {
    /// Neutral: a light grey with a soft highlight.
    fn default() -> Self {
        Self {
            name: "default".to_owned(),
            diffuse: Albedo::Constant(Vec3::splat(0.7)),
            specular: Vec3::splat(0.08),
            shininess: 40.0,
            mirror: Vec3::ZERO,
            glass: None,
        }
    }
}

impl FromStr for Rate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is no dicing rate: write fixed:N with N in 1..{MAX_RATE}, or px:L with L > 0");
        match text.split_once(':') {
            Some(("fixed", n)) => match n.parse() {
                Ok(n @ 1..=MAX_RATE) => Ok(Self::Fixed(n)),
                _ => Err(wrong()),
            },
            Some(("px", l)) => match l.parse::<f64>() {
                Ok(l) if l.is_finite() && l > 0.0 => Ok(Self::Pixels(l)),
                _ => Err(wrong()),
            },
            _ => Err(wrong()),
        }
    }
}

impl IntegratorKind {
    /// Every integrator with its name on the command line.
    pub const ALL: [(&'static str, Self); 9] = [
        ("whitted", Self::Whitted),
        ("ao", Self::Ao),
        ("path", Self::Path),
        ("debug:normal", Self::Debug(DebugView::Normal)),
        ("debug:patch", Self::Debug(DebugView::Patch)),
        ("debug:uv", Self::Debug(DebugView::Uv)),
        ("debug:rate", Self::Debug(DebugView::Rate)),
        ("debug:depth", Self::Debug(DebugView::Depth)),
        ("debug:miss", Self::Debug(DebugView::Miss)),
    ];
}

impl fmt::Display for Rate {
    /// As it is typed.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(n) => write!(f, "fixed:{n}"),
            Self::Pixels(length) => write!(f, "px:{length}"),
        }
    }
}

impl fmt::Display for IntegratorKind {
    /// Its name on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(name_of(&Self::ALL, self))
    }
}

impl FromStr for IntegratorKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        by_name("integrator", &Self::ALL, text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_read_and_bad_ones_explained() {
        assert_eq!("fixed:16".parse(), Ok(Rate::Fixed(16)));
        assert_eq!("px:0.5".parse(), Ok(Rate::Pixels(0.5)));
        for bad in ["", "16", "fixed:", "fixed:0", "fixed:4097", "fixed:-1", "px:0", "px:nan", "px:inf", "py:1"] {
            assert!(bad.parse::<Rate>().unwrap_err().contains("no dicing rate"), "{bad}");
        }
    }

    #[test]
    fn every_integrator_is_known_by_its_name() {
        for (name, kind) in IntegratorKind::ALL {
            assert_eq!(name.parse(), Ok(kind));
        }
        assert!("debug:nothing".parse::<IntegratorKind>().unwrap_err().contains("choose from whitted"));
    }
}
