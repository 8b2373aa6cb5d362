//! `lazytess tradeoff`: what accuracy costs.

use super::input::{EditArgs, files_of, load_scene, settle_rates};
use super::interrupt::cancel_on_interrupt;
use super::job::{Prepared, RenderScene};
use super::outputs::check_outputs;
use super::picture::PictureArgs;
use super::progress::Progress;
use super::run_options::RunArgs;
use super::stdout::print;
use super::thesis_tables::print_tables;
use super::values::{display_units, picture_size, samples};
use super::{PICTURE, camera::CameraArgs};
use crate::error::{Error, ErrorKind, Result};
use crate::image::difference::DifferenceMap;
use crate::image::{LinearImage, compare};
use crate::io::process::Stopwatch;
use crate::io::write::write_whole;
use crate::render::{Film, Groups, RenderSettings};
use crate::report::{Tradeoff, TradeoffRun};
use crate::scene::description::{IntegratorKind, Rate, SceneDescription};
use clap::Args;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Measure what accuracy costs: sweep tolerance, rate and grouping
///
/// Renders the scene in full at the first rate, which is the reference, then with the published grouping and with
/// adaptive grouping at every tolerance, at every rate. Prints a table of rays, grids, seconds and errors.
#[derive(Args, Debug)]
pub struct TradeoffArgs {
    /// scene.toml or mesh.obj
    pub input: PathBuf,
    /// Tolerances of adaptive groups, in display units
    #[arg(long, value_delimiter = ',', default_value = "1/255,2/255,5/255,10/255", value_name = "LIST",
          value_parser = display_units, help_heading = PICTURE)]
    pub tolerances: Vec<f32>,
    /// Dicing rates, the finest first: errors are measured against the full render at the first [default: the scene's]
    #[arg(long, value_delimiter = ',', value_name = "LIST", help_heading = PICTURE)]
    pub rates: Vec<Rate>,
    /// Which ways of grouping to try
    #[arg(long, value_delimiter = ',', default_value = "off,thesis,adaptive", value_name = "LIST",
          help_heading = PICTURE)]
    pub groups: Vec<Groups>,
    /// Width and height in pixels [default: the scene's, or 800x600]
    #[arg(long, value_name = "WxH", value_parser = picture_size, help_heading = PICTURE)]
    pub size: Option<[u32; 2]>,
    /// Samples per pixel [default: the scene's, or 4, as `render` takes; 1 with --thesis]
    #[arg(long, value_name = "N", value_parser = samples, help_heading = PICTURE)]
    pub spp: Option<u32>,
    /// Integrator [default: the scene's, or whitted]
    #[arg(long, value_name = "NAME", help_heading = PICTURE)]
    pub integrator: Option<IntegratorKind>,
    /// Print the thesis's tables 5.1 to 5.3 instead: rays and times at subdivision depths 0 to 3, in both readings
    #[arg(long, conflicts_with_all = ["rates", "tolerances", "groups", "json", "svg"])]
    pub thesis: bool,
    /// Write the sweep as JSON
    #[arg(long, value_name = "FILE.json")]
    pub json: Option<PathBuf>,
    /// Plot error against rays
    #[arg(long, value_name = "FILE.svg")]
    pub svg: Option<PathBuf>,
    /// The camera
    #[command(flatten)]
    pub camera: CameraArgs,
    /// Hierarchical edits
    #[command(flatten)]
    pub edits: EditArgs,
    /// Speed
    #[command(flatten)]
    pub run: RunArgs,
}

impl TradeoffArgs {
    /// Measures and prints.
    pub fn run(&self) -> Result<()> {
        let cancel = cancel_on_interrupt()?;
        let mut scene = load_scene(&self.input)?;
        check_outputs(self.json.as_deref().into_iter().chain(self.svg.as_deref()), files_of(&self.input, &scene))?;
        let settings = self.settings(&scene)?;
        if self.thesis {
            return print_tables(self, &mut scene, &settings, &cancel);
        }
        let tradeoff = self.sweep(&mut scene, &settings, &cancel)?;
        print(|out| write!(out, "{tradeoff}"))?;
        if let Some(path) = &self.json {
            write_whole(path, |out| out.write_all(tradeoff.to_json().as_bytes()))?;
        }
        if let Some(path) = &self.svg {
            write_whole(path, |out| out.write_all(tradeoff.to_svg().as_bytes()))?;
        }
        Ok(())
    }

    fn settings(&self, scene: &SceneDescription) -> Result<RenderSettings> {
        let picture = PictureArgs {
            size: self.size,
            // The published algorithm has one.
            spp: self.spp.or(self.thesis.then_some(1)),
            integrator: self.integrator,
            rate: None,
            max_depth: None,
            ao_samples: None,
            seed: 0,
            crop: None,
            groups: Groups::Off,
            tolerance: 0.0,
            camera: self.camera,
            edits: self.edits,
        };
        picture.settings(scene, Vec::new())
    }

    /// Every render's grouping and tolerance, the full one first.
    fn ways(&self) -> Vec<(Groups, f32)> {
        let tolerances = |groups: &Groups| match groups {
            Groups::Adaptive => self.tolerances.clone(),
            Groups::Off | Groups::Thesis => vec![0.0],
        };
        let others = self.groups.iter().filter(|groups| **groups != Groups::Off);
        let grouped = others.flat_map(|groups| tolerances(groups).into_iter().map(|tolerance| (*groups, tolerance)));
        std::iter::once((Groups::Off, 0.0)).chain(grouped).collect()
    }

    fn sweep(&self, scene: &mut SceneDescription, settings: &RenderSettings, cancel: &AtomicBool) -> Result<Tradeoff> {
        let rates: Vec<Option<Rate>> =
            if self.rates.is_empty() { vec![None] } else { self.rates.iter().copied().map(Some).collect() };
        let (ways, mut runs, mut reference) = (self.ways(), Vec::new(), None);
        let progress = Progress::new("renders", self.run.quiet);
        let total = rates.len() * ways.len();
        for rate in rates {
            settle_rates(scene, rate);
            let threads = self.run.threads();
            let prepared = RenderScene { scene, camera: self.camera, settings, memory: None, edits: self.edits }
                .prepare(threads, true)?;
            let mut full = None;
            for &(groups, tolerance) in &ways {
                progress.set(runs.len(), total);
                let settings = RenderSettings { groups, tolerance, ..settings.clone() };
                let (mut run, film) = self.measure(&prepared, &settings, cancel)?;
                let full = full.get_or_insert_with(|| film.clone());
                run.rate = rate.map_or_else(|| "scene's".to_owned(), |rate| rate.to_string());
                run.share_above_tolerance = share_above(full, &film, tolerance);
                run.error = reference.as_ref().map(|reference| error(reference, &film)).transpose()?;
                reference.get_or_insert(film);
                runs.push(run);
            }
        }
        progress.finish();
        Ok(Tradeoff {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            input: self.input.display().to_string(),
            width: settings.size[0],
            height: settings.size[1],
            spp: settings.spp,
            threads: self.run.threads(),
            runs,
        })
    }

    fn measure(
        &self,
        prepared: &Prepared<'_>,
        settings: &RenderSettings,
        cancel: &AtomicBool,
    ) -> Result<(TradeoffRun, Film)> {
        let threads = self.run.threads();
        let cache = prepared.cache(self.run.cache(), threads)?;
        let watch = Stopwatch::start();
        let rendered = prepared.render_as(settings, &cache, threads, true, cancel)?;
        let (wall_seconds, cpu_seconds) = watch.seconds();
        if cancel.load(Ordering::Relaxed) {
            return Err(Error::new(ErrorKind::Interrupted, "interrupted: a sweep is of no use in part".to_owned()));
        }
        let run = TradeoffRun {
            groups: settings.groups.to_string(),
            tolerance: settings.tolerance,
            rate: String::new(),
            rays: rendered.rays.total(),
            primary_rays: rendered.rays.primary,
            traced_pixels: rendered.pixels.traced(),
            grids: cache.pieces_built(),
            bytes: cache.segments().statistics().bytes_built,
            wall_seconds,
            cpu_seconds,
            error: None,
            share_above_tolerance: 0.0,
        };
        Ok((run, rendered.film))
    }
}

fn image(film: &Film) -> Result<LinearImage<'_>> {
    LinearImage::new(film.window().width() as usize, film.colors())
}

fn error(reference: &Film, film: &Film) -> Result<crate::image::Comparison> {
    Ok(compare(image(reference)?, image(film)?)?.0)
}

/// Share of pixels that differ by more than `tolerance` display units.
pub(super) fn share_above(full: &Film, film: &Film, tolerance: f32) -> f64 {
    let display = |film: &Film| image(film).map(|image| image.to_display()).unwrap_or_default();
    let (a, b) = (display(full), display(film));
    DifferenceMap::new(film.window().width() as usize, &a, &b).share_above(tolerance)
}
