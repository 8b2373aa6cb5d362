//! `lazytess tune`: how large the cache should be.

use super::input::{files_of, load_scene, settle_rates};
use super::interrupt::cancel_on_interrupt;
use super::outputs::check_outputs;
use super::picture::PictureArgs;
use super::run_options::RunArgs;
use super::stdout;
use super::values::{CacheSize, decimal_count};
use crate::cache::TraceLog;
use crate::error::{Error, ErrorKind, Result};
use crate::io::process::Stopwatch;
use crate::io::write::write_whole;
use crate::report::plot::tuning_svg;
use crate::report::{RecordedRender, Tuning};
use crate::scene::description::SceneDescription;
use clap::Args;
use std::io::Write;
use std::path::PathBuf;

/// Accesses that a replay needs to tell anything.
const LEAST_ACCESSES: u64 = 1000;

/// Find out how large the cache should be
///
/// Renders once, records which tessellated blocks rays ask for, and replays that for many cache sizes: hit rate,
/// predicted time and re-tessellations against size, beside those of caches that drop what was unused longest or know
/// the future. Ends with the smallest size that costs at most 5 % of the speed of an unbounded cache.
#[derive(Args, Clone, Debug)]
pub struct TuneArgs {
    /// scene.toml or mesh.obj
    pub input: PathBuf,
    /// Print one JSON object
    #[arg(long)]
    pub json: bool,
    /// Write the curve as a plot
    #[arg(long, value_name = "FILE.svg")]
    pub svg: Option<PathBuf>,
    /// Accesses to keep, 8 bytes each, a thousand at least; a render with more is sampled
    #[arg(long, value_name = "N", default_value = "4M", value_parser = decimal_count)]
    pub accesses: u64,
    /// The picture
    #[command(flatten)]
    pub picture: PictureArgs,
    /// Speed
    #[command(flatten)]
    pub run: RunArgs,
}

impl TuneArgs {
    /// Renders, replays and tells.
    pub fn run(self) -> Result<()> {
        let scene = load_scene(&self.input)?;
        check_outputs(self.svg.as_deref(), files_of(&self.input, &scene))?;
        let tuning = self.tuning(scene)?;
        if let Some(path) = &self.svg {
            let svg = tuning_svg(&tuning).map_err(|e| Error::input(format!("the plot cannot be drawn: {e}")))?;
            write_whole(path, |out| out.write_all(svg.as_bytes()))?;
        }
        stdout::print(|out| {
            if self.json {
                serde_json::to_writer_pretty(&mut *out, &tuning)?;
                return writeln!(out);
            }
            write!(out, "{tuning}")
        })
    }

    fn tuning(&self, mut scene: SceneDescription) -> Result<Tuning> {
        settle_rates(&mut scene, self.picture.rate);
        let settings = self.picture.settings(&scene, Vec::new())?;
        let cancel = cancel_on_interrupt()?;
        let (threads, quiet) = (self.run.threads(), self.run.quiet);
        let render = self.picture.of_scene(&scene, &settings);
        let prepared = render.prepare(threads, quiet)?;
        let size = self.run.cache();
        let mut cache = prepared.cache(size, threads)?;
        cache.record(TraceLog::new(self.accesses.max(LEAST_ACCESSES) as usize));
        let watch = Stopwatch::start();
        let rendered = prepared.render(&cache, threads, quiet, &cancel)?;
        let seconds = watch.seconds().0;
        if !rendered.complete {
            return Err(Error::new(ErrorKind::Interrupted, "interrupted: nothing is known of the rest of the picture"));
        }
        let recorded = RecordedRender {
            trace: cache.trace().expect("it was told to record"),
            counters: cache.segments().statistics(),
            capacity: match size {
                CacheSize::Bytes(bytes) => bytes,
                CacheSize::Unbounded => cache.segments().capacity() as u64,
            },
            seconds,
            threads,
        };
        Ok(Tuning::new(self.input.display().to_string(), &recorded))
    }
}
