//! Flags that decide what a picture shows: shared by the commands that render.

use super::PICTURE;
use super::camera::CameraArgs;
use super::input::EditArgs;
use super::job::RenderScene;
use super::values::{crop, depth, display_units, picture_size, samples};
use crate::error::{Error, Result};
use crate::render::{Aov, Groups, PixelRect, RenderSettings};
use crate::scene::description::{IntegratorKind, Rate, SceneDescription};
use clap::Args;

/// What was typed about the picture. Each goes before what the scene says.
#[derive(Args, Clone, Debug)]
pub struct PictureArgs {
    /// Width and height in pixels [default: the scene's, or 800x600]
    #[arg(long, value_name = "WxH", value_parser = picture_size, help_heading = PICTURE)]
    pub size: Option<[u32; 2]>,
    /// Samples per pixel [default: the scene's, or 4]
    #[arg(long, value_name = "N", value_parser = samples, help_heading = PICTURE)]
    pub spp: Option<u32>,
    /// whitted, ao, path, or debug:normal|patch|uv|rate|depth|miss [default: the scene's, or whitted]
    #[arg(long, value_name = "NAME", help_heading = PICTURE)]
    pub integrator: Option<IntegratorKind>,
    /// Dicing: pieces of about L pixels (px:L), or N pieces for each edge (fixed:N) [default: the scene's, or px:1]
    #[arg(long, value_name = "px:L|fixed:N", help_heading = PICTURE)]
    pub rate: Option<Rate>,
    /// Longest chain of reflections and refractions [default: the scene's, or 8]
    #[arg(long, value_name = "N", value_parser = depth, help_heading = PICTURE)]
    pub max_depth: Option<u32>,
    /// Occlusion rays per sample of the ao integrator [default: the scene's, or 16]
    #[arg(long, value_name = "N", value_parser = samples, help_heading = PICTURE)]
    pub ao_samples: Option<u32>,
    /// Seed of all random numbers
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = PICTURE)]
    pub seed: u32,
    /// Render only columns x0 to x1 - 1 and rows y0 to y1 - 1, with the values they have in the whole picture. What
    /// groups that they belong to need around them is traced, too: a small part is found faster with --groups off
    #[arg(long, value_name = "x0,x1,y0,y1", value_parser = crop, help_heading = PICTURE)]
    pub crop: Option<[u32; 4]>,
    /// Trace only the pixels that need it (adaptive), every pixel (off), or corners of patches (thesis, unchecked)
    #[arg(long, value_name = "adaptive|off|thesis", default_value_t = Groups::Adaptive, help_heading = PICTURE)]
    pub groups: Groups,
    /// Error that --groups adaptive aims at, in display units (0 to 1 after sRGB): at most 1 % of pixels are further
    /// off; reads like 0.02 or 5/255; 0: trace all
    #[arg(long, value_name = "E", default_value = "1/255", value_parser = display_units, help_heading = PICTURE)]
    pub tolerance: f32,
    /// The camera
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Hierarchical edits
    #[command(flatten)]
    pub edits: EditArgs,
}

impl PictureArgs {
    /// Samples per pixel when nobody says: the fewest that smooth edges.
    const DEFAULT_SPP: u32 = 4;

    /// The picture of a scene, without a limit on memory. `settings` are [`Self::settings`].
    pub fn of_scene<'a>(&self, scene: &'a SceneDescription, settings: &'a RenderSettings) -> RenderScene<'a> {
        RenderScene { scene, camera: self.camera, settings, edits: self.edits, memory: None }
    }

    /// What to render, with the scene's defaults where nothing was typed.
    pub fn settings(&self, scene: &SceneDescription, aovs: Vec<Aov>) -> Result<RenderSettings> {
        let size = self.size.or(scene.render.size).unwrap_or([800, 600]);
        let base = RenderSettings::of_size(size);
        Ok(RenderSettings {
            window: window(self.crop, size)?,
            spp: self.spp.or(scene.render.spp).unwrap_or(Self::DEFAULT_SPP),
            integrator: self.integrator.or(scene.render.integrator).unwrap_or(base.integrator),
            max_depth: self.max_depth.or(scene.render.max_depth).unwrap_or(base.max_depth),
            ao_samples: self.ao_samples.or(scene.render.ao_samples).unwrap_or(base.ao_samples),
            seed: self.seed,
            aovs,
            groups: self.groups,
            tolerance: self.tolerance,
            ..base
        })
    }
}

fn window(crop: Option<[u32; 4]>, size: [u32; 2]) -> Result<PixelRect> {
    let Some([x0, x1, y0, y1]) = crop else { return Ok(PixelRect::whole(size)) };
    let [width, height] = size;
    if x1 > width || y1 > height {
        let message = format!("--crop {x0},{x1},{y0},{y1} reaches outside the picture of {width}x{height} pixels");
        return Err(Error::input(message));
    }
    Ok(PixelRect { x0, y0, x1, y1 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct Typed {
        #[command(flatten)]
        picture: PictureArgs,
    }

    fn settings(line: &str, scene: &SceneDescription) -> Result<RenderSettings> {
        Typed::parse_from(format!("test {line}").split_whitespace()).picture.settings(scene, Vec::new())
    }

    #[test]
    fn typed_goes_before_the_scene_s_and_that_before_the_default() {
        let mut scene = SceneDescription::bare("a.obj".into());
        let default = settings("", &scene).unwrap();
        assert_eq!((default.size, default.spp, default.integrator), ([800, 600], 4, IntegratorKind::Whitted));
        scene.render.size = Some([64, 48]);
        scene.render.spp = Some(9);
        let typed = settings("--spp 2 --integrator ao --crop 0,10,8,48", &scene).unwrap();
        assert_eq!((typed.size, typed.spp, typed.integrator), ([64, 48], 2, IntegratorKind::Ao));
        assert_eq!(typed.window, PixelRect { x0: 0, y0: 8, x1: 10, y1: 48 });
    }

    #[test]
    fn window_outside_the_picture_is_a_sentence() {
        let scene = SceneDescription::bare("a.obj".into());
        let message = settings("--size 8x8 --crop 0,9,0,8", &scene).unwrap_err().to_string();
        assert_eq!(message, "--crop 0,9,0,8 reaches outside the picture of 8x8 pixels");
    }
}
