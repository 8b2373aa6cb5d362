//! What accuracy costs: renders of one scene that differ in tolerance, rate and grouping, as data and as a table.

use crate::image::Comparison;
use serde::Serialize;
use std::fmt::{self, Display, Formatter};

/// One render of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TradeoffRun {
    /// Which pixels were traced: off, thesis or adaptive.
    pub groups: String,
    /// Error aimed at, in display units; 0 unless `groups` is adaptive.
    pub tolerance: f32,
    /// Dicing rate.
    pub rate: String,
    /// Rays of all kinds.
    pub rays: u64,
    /// Rays from the camera.
    pub primary_rays: u64,
    /// Pixels that rays were traced for.
    pub traced_pixels: u64,
    /// Grid pieces built.
    pub grids: u64,
    /// Bytes of blocks built.
    pub bytes: u64,
    /// Seconds of rendering by the clock, groups included.
    pub wall_seconds: f64,
    /// Processor seconds of the same, over all threads.
    pub cpu_seconds: f64,
    /// How far the picture is from the full render at the first rate; `None` (null) for that render itself.
    pub error: Option<Comparison>,
    /// Share of pixels, 0 to 1, that differ by more than the tolerance from the full render at the same rate.
    pub share_above_tolerance: f64,
}

/// A sweep.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Tradeoff {
    /// Version of the program.
    pub version: String,
    /// The scene or mesh, as given.
    pub input: String,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Samples per pixel.
    pub spp: u32,
    /// Worker threads.
    pub threads: usize,
    /// The renders, the full one at the first rate first.
    pub runs: Vec<TradeoffRun>,
}

impl TradeoffRun {
    /// The 99th percentile of differences; 0 for the reference.
    pub fn p99(&self) -> f64 {
        self.error.as_ref().map_or(0.0, |e| f64::from(e.p99))
    }

    /// What to call it in a plot.
    pub fn label(&self) -> String {
        match self.groups.as_str() {
            "adaptive" => format!("adaptive {}/255, {}", 255.0 * self.tolerance, self.rate),
            groups => format!("{groups}, {}", self.rate),
        }
    }
}

impl Tradeoff {
    /// The sweep as one JSON object, on several lines, with a line end.
    pub fn to_json(&self) -> String {
        let mut text = serde_json::to_string_pretty(self).expect("plain numbers and strings have a JSON form");
        text.push('\n');
        text
    }

    /// Runs that no other run beats both in rays and in the 99th percentile of differences, by rising rays.
    pub fn pareto_front(&self) -> Vec<&TradeoffRun> {
        let mut runs: Vec<&TradeoffRun> = self.runs.iter().collect();
        runs.sort_by(|a, b| a.rays.cmp(&b.rays).then(a.p99().total_cmp(&b.p99())));
        let mut best = f64::INFINITY;
        runs.retain(|run| {
            let is_better = run.p99() < best;
            best = best.min(run.p99());
            is_better
        });
        runs
    }
}

const HEADINGS: [&str; 15] = [
    "groups",
    "tolerance",
    "rate",
    "rays",
    "grids",
    "MiB",
    "seconds",
    "cpu",
    "max",
    "p99",
    "above",
    "ssim2",
    "cvvdp",
    "worst tile",
    "missed",
];

impl Display for Tradeoff {
    /// A Markdown table, a line for each run. `above` is the share of pixels beyond the tolerance from the full render
    /// at the same rate, in percent; `worst tile` the mean difference of the 32 x 32 pixels where it is largest.
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "| {} |", HEADINGS.join(" | "))?;
        writeln!(f, "|{}", "---|".repeat(HEADINGS.len()))?;
        self.runs.iter().try_for_each(|run| write_row(f, run))
    }
}

fn write_row(f: &mut Formatter<'_>, run: &TradeoffRun) -> fmt::Result {
    let tolerance = if run.tolerance > 0.0 { format!("{:.3}/255", 255.0 * run.tolerance) } else { "-".to_owned() };
    write!(f, "| {} | {tolerance} | {} | {} | {} ", run.groups, run.rate, run.rays, run.grids)?;
    let mebibytes = run.bytes as f64 / f64::from(1 << 20);
    write!(f, "| {mebibytes:.1} | {:.2} | {:.2} ", run.wall_seconds, run.cpu_seconds)?;
    let Some(e) = &run.error else { return writeln!(f, "| 0 | 0 | 0 | 100 | 10 | 0 | 0 |") };
    let score = |score: Option<f64>, digits: usize| score.map_or("-".to_owned(), |s| format!("{s:.digits$}"));
    let (ssimulacra2, vdp) = (score(e.ssimulacra2, 1), score(e.color_video_vdp, 2));
    let above = 100.0 * run.share_above_tolerance;
    write!(f, "| {:.4} | {:.4} | {above:.3} | {ssimulacra2} | {vdp} ", e.max, e.p99)?;
    writeln!(f, "| {:.4} | {} |", e.worst_tile.mean, e.missed_objects)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::{LinearImage, compare};

    fn run(groups: &str, rays: u64, difference: f32) -> TradeoffRun {
        let (a, b) = (vec![[0.0; 3]; 64], vec![[difference; 3]; 64]);
        let image = |pixels| LinearImage::new(8, pixels).unwrap();
        TradeoffRun {
            groups: groups.to_owned(),
            tolerance: 0.0,
            rate: "px:1".to_owned(),
            rays,
            primary_rays: rays,
            traced_pixels: 64,
            grids: 3,
            bytes: 1 << 20,
            wall_seconds: 1.0,
            cpu_seconds: 2.0,
            error: (difference > 0.0).then(|| compare(image(&a), image(&b)).unwrap().0),
            share_above_tolerance: 0.0,
        }
    }

    fn sweep() -> Tradeoff {
        Tradeoff {
            version: String::new(),
            input: String::new(),
            width: 8,
            height: 8,
            spp: 1,
            threads: 1,
            runs: vec![
                run("off", 100, 0.0),
                run("adaptive", 20, 0.01),
                run("thesis", 30, 0.5),
                run("adaptive", 10, 0.3),
            ],
        }
    }

    #[test]
    fn the_front_leaves_out_what_is_beaten() {
        let sweep = sweep();
        assert_eq!(sweep.pareto_front().iter().map(|run| run.rays).collect::<Vec<_>>(), [10, 20, 100]);
    }

    #[test]
    fn the_table_has_a_row_for_each_run() {
        let table = sweep().to_string();
        assert_eq!(table.lines().count(), 6);
        let n_columns = |line: &str| line.matches('|').count();
        assert!(table.lines().all(|line| n_columns(line) == HEADINGS.len() + 1), "{table}");
    }
}
