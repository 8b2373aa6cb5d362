//! The tables of a scene file, as serde fills them.

use super::values::{Colour, Direction, Number, Point, Positive, Rotation, Scale, Share, parsed};
use crate::scene::description::{IntegratorKind, Rate};
use serde::Deserialize;
use std::collections::BTreeMap;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneTables {
    pub background: Option<Colour>,
    pub camera: Option<Spanned<CameraTable>>,
    #[serde(default)]
    pub render: RenderTable,
    #[serde(default)]
    pub materials: BTreeMap<String, MaterialTable>,
    #[serde(default)]
    pub mesh: Vec<Spanned<MeshTable>>,
    #[serde(default)]
    pub light: Vec<Spanned<LightTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    pub eye: Point,
    pub at: Point,
    pub up: Option<Direction>,
    pub fov: Option<Number>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct RenderTable {
    pub size: Option<Spanned<[u32; 2]>>,
    pub spp: Option<Spanned<u32>>,
    #[serde(default, deserialize_with = "parsed")]
    pub integrator: Option<IntegratorKind>,
    #[serde(default, deserialize_with = "parsed")]
    pub rate: Option<Rate>,
    pub max_depth: Option<Spanned<u32>>,
    pub ao_samples: Option<Spanned<u32>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialTable {
    pub diffuse: Option<Share>,
    pub checker: Option<Spanned<CheckerTable>>,
    pub specular: Option<Share>,
    pub shininess: Option<Positive>,
    pub mirror: Option<Share>,
    pub glass: Option<Spanned<GlassTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CheckerTable {
    pub even: Share,
    pub odd: Share,
    pub size: Positive,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GlassTable {
    pub ior: Positive,
    pub transmit: Option<Share>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshTable {
    pub file: Spanned<String>,
    pub transform: Option<Spanned<TransformTable>>,
    pub material: Option<Spanned<String>>,
    #[serde(default, deserialize_with = "parsed")]
    pub rate: Option<Rate>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransformTable {
    pub scale: Option<Scale>,
    pub rotate: Option<Rotation>,
    pub translate: Option<Point>,
    pub matrix: Option<[[Number; 4]; 4]>,
}

/// All kinds in one table: an enum would lose the lines of its fields.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightTable {
    pub kind: Spanned<String>,
    pub position: Option<Point>,
    pub intensity: Option<Colour>,
    pub direction: Option<Direction>,
    pub irradiance: Option<Colour>,
    pub radiance: Option<Colour>,
}
