//! `lazytess tradeoff --thesis`: tables 5.1 to 5.3 of the thesis, in two readings.
//!
//! As published, a group shows one facet of the mesh subdivided `d` times, so groups shrink with depth until every
//! pixel is a corner. Here a group belongs to the patch of a base face, whatever it is diced into.

use super::input::settle_rates;
use super::job::{Prepared, RenderScene};
use super::stdout::print;
use super::tradeoff::{TradeoffArgs, share_above};
use crate::error::{Error, ErrorKind, Result};
use crate::io::process::Stopwatch;
use crate::render::item_buffer::ItemBuffer;
use crate::render::thesis::{Interpolation, render_thesis};
use crate::render::workers::Rendered;
use crate::render::{Film, Groups, RenderSettings, RunSettings};
use crate::scene::description::{Rate, SceneDescription};
use crate::scene::intersect::Intersector;
use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

/// Subdivision depths of the thesis.
const DEPTHS: [u32; 4] = [0, 1, 2, 3];

/// Tolerance of the adaptive groups beside them, in display units.
const TOLERANCE: f32 = 5.0 / 255.0;

/// Which groups a column of the tables is about.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Reading {
    Full,
    Facets,
    Patches,
    /// As `Patches`, with mean value coordinates instead of bilinear ones.
    MeanValue,
    Adaptive,
}

const READINGS: [(&str, Reading); 5] = [
    ("off", Reading::Full),
    ("facet groups (published)", Reading::Facets),
    ("patch groups", Reading::Patches),
    ("patch groups, mean value", Reading::MeanValue),
    ("adaptive, 5/255", Reading::Adaptive),
];

/// One render.
struct Measured {
    primary: u64,
    rays: u64,
    seconds: f64,
    trace: f64,
    interpolate: f64,
    above: f64,
}

/// Renders at all depths in all readings and prints the tables.
pub(super) fn print_tables(
    args: &TradeoffArgs,
    scene: &mut SceneDescription,
    settings: &RenderSettings,
    cancel: &AtomicBool,
) -> Result<()> {
    let mut columns = Vec::new();
    for depth in DEPTHS {
        settle_rates(scene, Some(Rate::Fixed(1 << depth)));
        let prepared = RenderScene { scene, camera: args.camera, settings, memory: None, edits: args.edits }
            .prepare(args.run.threads(), true)?;
        let mut full = None;
        let column: Result<Vec<Measured>> = READINGS
            .iter()
            .map(|&(_, reading)| measure(args, &prepared, settings, reading, depth, &mut full, cancel))
            .collect();
        columns.push(column?);
    }
    print(|out| {
        let mut table = |title: &str, cell: &dyn Fn(&Measured) -> String| {
            writeln!(out, "{title}\n\n| depth | {} |", DEPTHS.map(|d| d.to_string()).join(" | "))?;
            writeln!(out, "|{}", "---|".repeat(1 + DEPTHS.len()))?;
            for (k, (name, _)) in READINGS.iter().enumerate() {
                let cells: Vec<_> = columns.iter().map(|column| cell(&column[k])).collect();
                writeln!(out, "| {name} | {} |", cells.join(" | "))?;
            }
            writeln!(out)
        };
        table("Table 5.1: camera rays cast (rays of all kinds)", &|m| format!("{} ({})", m.primary, m.rays))?;
        table("Table 5.2: seconds of rendering, by the clock", &|m| format!("{:.3}", m.seconds))?;
        table("Table 5.3: seconds of interpolating / of tracing, over all threads", &|m| {
            format!("{:.3} / {:.3}", m.interpolate, m.trace)
        })?;
        table("Error: percent of pixels that differ from off by more than 5/255", &|m| {
            format!("{:.3}", 100.0 * m.above)
        })
    })
}

fn measure(
    args: &TradeoffArgs,
    prepared: &Prepared<'_>,
    settings: &RenderSettings,
    reading: Reading,
    depth: u32,
    full: &mut Option<Film>,
    cancel: &AtomicBool,
) -> Result<Measured> {
    let watch = Stopwatch::start();
    let rendered = render(args, prepared, settings, reading, depth, cancel)?;
    let (seconds, cpu) = watch.seconds();
    if cancel.load(Ordering::Relaxed) {
        return Err(Error::new(ErrorKind::Interrupted, "interrupted: a table is of no use in part".to_owned()));
    }
    let full = full.get_or_insert_with(|| rendered.film.clone());
    let trace = if reading == Reading::Full { cpu } else { rendered.seconds.trace };
    Ok(Measured {
        primary: rendered.rays.primary,
        rays: rendered.rays.total(),
        seconds,
        trace,
        interpolate: rendered.seconds.interpolate,
        above: share_above(full, &rendered.film, TOLERANCE),
    })
}

fn render(
    args: &TradeoffArgs,
    prepared: &Prepared<'_>,
    settings: &RenderSettings,
    reading: Reading,
    depth: u32,
    cancel: &AtomicBool,
) -> Result<Rendered> {
    let threads = args.run.threads();
    let cache = prepared.cache(args.run.cache(), threads)?;
    let as_groups = |groups| {
        let settings = RenderSettings { groups, tolerance: TOLERANCE, ..settings.clone() };
        prepared.render_as(&settings, &cache, threads, true, cancel)
    };
    let (facets, how) = match reading {
        Reading::Full => return as_groups(Groups::Off),
        Reading::Adaptive => return as_groups(Groups::Adaptive),
        Reading::Facets => (1 << depth, Interpolation::Bilinear),
        Reading::Patches => (1, Interpolation::Bilinear),
        Reading::MeanValue => (1, Interpolation::MeanValue),
    };
    let items = ItemBuffer::new(&prepared.world, &prepared.camera, settings, facets, threads)?;
    let run = RunSettings::quiet(threads, cancel);
    let make_tracer = || Intersector::new(&prepared.world, &cache);
    Ok(render_thesis(&prepared.camera, &prepared.appearance(), settings, &run, &items, how, make_tracer))
}
