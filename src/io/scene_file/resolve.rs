//! From tables to a scene description: paths, transforms, materials by name.

use super::tables::{
    CameraTable, GlassTable, LightTable, MaterialTable, MeshTable, RenderTable, SceneTables, TransformTable,
};
use super::values::{Colour, Number, Share};
use crate::scene::description::{
    Albedo, CameraDescription, Glass, Light, MOST_DEPTH, MOST_SAMPLES, Material, MeshDescription, RenderDefaults,
    SceneDescription,
};
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4, Vec3};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Columns of a transform whose directions span less than this are as good as dependent: the inverse is noise.
const MIN_RELATIVE_DETERMINANT: f64 = 1e-12;

/// What is wrong, and where in the text.
pub struct Mistake {
    pub message: String,
    pub offset: Option<usize>,
}

type Result<T> = std::result::Result<T, Mistake>;

fn mistake<T>(place: &Spanned<T>, message: impl Into<String>) -> Mistake {
    Mistake { message: message.into(), offset: Some(place.span().start) }
}

/// `folder` is what mesh files are relative to.
pub fn resolve(tables: SceneTables, folder: &Path) -> Result<SceneDescription> {
    if tables.mesh.is_empty() {
        let message = "the scene has no meshes: add a [[mesh]] with file = \"...\"".to_owned();
        return Err(Mistake { message, offset: None });
    }
    let materials = tables.materials.into_iter().map(|(name, table)| Ok((name.clone(), material(name, table)?)));
    let materials = materials.collect::<Result<BTreeMap<_, _>>>()?;
    let meshes = tables.mesh.into_iter().map(|table| mesh(table.into_inner(), folder, &materials));
    let meshes = meshes.collect::<Result<Vec<_>>>()?;
    let bare = SceneDescription::bare(PathBuf::new());
    let lights = tables.light.into_iter().map(light).collect::<Result<Vec<_>>>()?;
    Ok(SceneDescription {
        camera: tables.camera.map(camera).transpose()?,
        render: render(tables.render)?,
        background: tables.background.map_or(bare.background, |colour| colour.0),
        meshes,
        lights: if lights.is_empty() { bare.lights } else { lights },
    })
}

fn camera(table: Spanned<CameraTable>) -> Result<CameraDescription> {
    let CameraTable { eye, at, up, fov } = table.get_ref();
    let camera = CameraDescription {
        eye: eye.0,
        at: at.0,
        up: up.as_ref().map_or(DVec3::Y, |up| up.0),
        fov: fov.as_ref().map_or(CameraDescription::DEFAULT_FOV, |fov| fov.0),
    };
    camera.validate().map_err(|message| mistake(&table, message))?;
    Ok(camera)
}

fn render(table: RenderTable) -> Result<RenderDefaults> {
    if let Some(size) = table.size.as_ref().filter(|size| size.get_ref().iter().any(|n| !(1..=65536).contains(n))) {
        return Err(mistake(size, "a picture's width and height should be in 1..65536"));
    }
    for count in [&table.spp, &table.ao_samples].into_iter().flatten() {
        if !(1..=MOST_SAMPLES).contains(count.get_ref()) {
            return Err(mistake(count, format!("a number of samples should be in 1..{MOST_SAMPLES}")));
        }
    }
    if let Some(depth) = table.max_depth.as_ref().filter(|depth| *depth.get_ref() > MOST_DEPTH) {
        return Err(mistake(depth, format!("a chain of reflections has at most {MOST_DEPTH} links")));
    }
    Ok(RenderDefaults {
        size: table.size.map(Spanned::into_inner),
        spp: table.spp.map(Spanned::into_inner),
        integrator: table.integrator,
        rate: table.rate,
        max_depth: table.max_depth.map(Spanned::into_inner),
        ao_samples: table.ao_samples.map(Spanned::into_inner),
    })
}

fn material(name: String, table: MaterialTable) -> Result<Material> {
    let neutral = Material::default();
    let or_zero = |share: Option<Share>| share.map_or(Vec3::ZERO, |share| share.0);
    // A mirror or glass without a stated body colour has none; anything else is the neutral grey.
    let clear = table.mirror.is_some() || table.glass.is_some();
    let has_body = table.diffuse.is_some() || table.checker.is_some() || table.mirror.is_some();
    let diffuse = match (table.diffuse, table.checker) {
        (Some(_), Some(checker)) => return Err(mistake(&checker, "a material has diffuse or checker, not both")),
        (Some(diffuse), None) => Albedo::Constant(diffuse.0),
        (None, Some(checker)) => {
            let checker = checker.into_inner();
            Albedo::Checker { even: checker.even.0, odd: checker.odd.0, size: checker.size.0 }
        }
        (None, None) if clear => Albedo::Constant(Vec3::ZERO),
        (None, None) => neutral.diffuse,
    };
    let glass = table.glass.map(|table| glass(table, has_body)).transpose()?;
    Ok(Material {
        name,
        diffuse,
        specular: or_zero(table.specular),
        shininess: table.shininess.map_or(neutral.shininess, |shininess| shininess.0 as f32),
        mirror: or_zero(table.mirror),
        glass,
    })
}

/// `has_body`: whether the material gives back light by itself.
fn glass(table: Spanned<GlassTable>, has_body: bool) -> Result<Glass> {
    if has_body {
        return Err(mistake(&table, "glass has neither diffuse nor checker nor mirror: leave out one or the other"));
    }
    let GlassTable { ior, transmit } = table.into_inner();
    Ok(Glass { ior: ior.0 as f32, transmit: transmit.map_or(Vec3::ONE, |share| share.0) })
}

fn mesh(table: MeshTable, folder: &Path, materials: &BTreeMap<String, Material>) -> Result<MeshDescription> {
    if table.file.get_ref().is_empty() {
        return Err(mistake(&table.file, "the mesh needs the name of a file"));
    }
    let material = match &table.material {
        None => Material::default(),
        Some(name) => materials.get(name.get_ref()).cloned().ok_or_else(|| {
            let known: Vec<_> = materials.keys().map(String::as_str).collect();
            let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
            mistake(name, format!("material '{}' is not defined; [materials] has {known}", name.get_ref()))
        })?,
    };
    Ok(MeshDescription {
        file: folder.join(table.file.get_ref()),
        world_from_object: table.transform.map_or(Ok(DAffine3::IDENTITY), transform)?,
        material,
        rate: table.rate,
    })
}

fn transform(table: Spanned<TransformTable>) -> Result<DAffine3> {
    let TransformTable { scale, rotate, translate, matrix } = table.get_ref();
    let world_from_object = match matrix {
        Some(_) if scale.is_some() || rotate.is_some() || translate.is_some() => {
            return Err(mistake(&table, "a transform has matrix, or scale, rotate and translate, not both"));
        }
        Some(rows) => affine_from_rows(rows).map_err(|message| mistake(&table, message))?,
        None => DAffine3::from_scale_rotation_translation(
            scale.as_ref().map_or(DVec3::ONE, |scale| scale.0),
            rotate.as_ref().map_or(DQuat::IDENTITY, |rotation| rotation.0),
            translate.as_ref().map_or(DVec3::ZERO, |point| point.0),
        ),
    };
    if is_singular(world_from_object) {
        let message = "the transform is singular: it flattens the mesh and cannot be undone. Check scale and matrix";
        return Err(mistake(&table, message));
    }
    Ok(world_from_object)
}

fn affine_from_rows(rows: &[[Number; 4]; 4]) -> std::result::Result<DAffine3, &'static str> {
    let row = |r: usize| DVec4::from_array([0, 1, 2, 3].map(|c: usize| rows[r][c].0));
    if row(3) != DVec4::W {
        return Err("the last row of matrix should be [0, 0, 0, 1]: rows are listed, and points are columns");
    }
    Ok(DAffine3::from_mat4(DMat4::from_cols(row(0), row(1), row(2), row(3)).transpose()))
}

fn is_singular(world_from_object: DAffine3) -> bool {
    let columns = world_from_object.matrix3;
    let unit = |column: DVec3| column / column.length();
    let relative = DMat3::from_cols(unit(columns.x_axis), unit(columns.y_axis), unit(columns.z_axis)).determinant();
    // Written so that NaN, from a column of zeros, is singular.
    !(relative.abs() > MIN_RELATIVE_DETERMINANT && world_from_object.inverse().is_finite())
}

fn light(table: Spanned<LightTable>) -> Result<Light> {
    let LightTable { kind, position, intensity, direction, irradiance, radiance } = table.get_ref();
    let needs = |fields: &str| mistake(&table, format!("a {} light has {fields}, and nothing else", kind.get_ref()));
    let colour = |c: &Colour| c.0;
    match kind.get_ref().as_str() {
        "point" => match (position, intensity, direction, irradiance, radiance) {
            (Some(p), Some(i), None, None, None) => Ok(Light::Point { position: p.0, intensity: colour(i) }),
            _ => Err(needs("position and intensity")),
        },
        "directional" => match (position, intensity, direction, irradiance, radiance) {
            (None, None, Some(d), Some(e), None) => Ok(Light::Directional { direction: d.0, irradiance: colour(e) }),
            _ => Err(needs("direction and irradiance")),
        },
        "sky" => match (position, intensity, direction, irradiance, radiance) {
            (None, None, None, None, Some(l)) => Ok(Light::Sky { radiance: colour(l) }),
            _ => Err(needs("radiance")),
        },
        other => Err(mistake(kind, format!("light kind '{other}' does not exist: write point, directional or sky"))),
    }
}
