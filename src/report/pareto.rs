//! The plot of a sweep: error against rays, with the front that no run beats.

use super::tradeoff::{Tradeoff, TradeoffRun};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use std::error::Error;

/// Colours of the ways of grouping, readable by most colour-blind people (Okabe and Ito 2008).
const COLORS: [(&str, RGBColor); 3] =
    [("off", RGBColor(0, 0, 0)), ("thesis", RGBColor(213, 94, 0)), ("adaptive", RGBColor(0, 114, 178))];

impl Tradeoff {
    /// An SVG picture: rays to the right (logarithmic), the 99th percentile of differences upwards.
    pub fn to_svg(&self) -> String {
        let mut svg = String::new();
        self.draw(&mut svg).expect("drawing into a string does not fail");
        svg
    }

    fn draw(&self, svg: &mut String) -> Result<(), Box<dyn Error>> {
        let root = SVGBackend::with_string(svg, (960, 600)).into_drawing_area();
        root.fill(&WHITE)?;
        let rays = |run: &TradeoffRun| run.rays.max(1) as f64;
        let fewest = self.runs.iter().map(rays).fold(f64::INFINITY, f64::min);
        let most = self.runs.iter().map(rays).fold(1.0, f64::max);
        let worst = self.runs.iter().map(TradeoffRun::p99).fold(1.0 / 255.0, f64::max);
        let title = format!("{}, {} x {}: error against rays", self.input, self.width, self.height);
        let mut chart = ChartBuilder::on(&root)
            .caption(title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(60)
            .build_cartesian_2d((0.7 * fewest..1.6 * most).log_scale(), -0.02 * worst..1.1 * worst)?;
        chart
            .configure_mesh()
            .x_desc("rays")
            .y_desc("99th percentile of differences, display units")
            .x_label_formatter(&|rays| axis_label(*rays))
            .draw()?;
        let front = self.pareto_front().into_iter().map(|run| (rays(run), run.p99()));
        chart.draw_series(LineSeries::new(front, RGBColor(150, 150, 150)))?;
        for (name, color) in COLORS {
            let runs: Vec<_> = self.runs.iter().filter(|run| run.groups == name).collect();
            let points = runs.iter().map(|run| Circle::new((rays(run), run.p99()), 4, color.filled()));
            chart.draw_series(points)?;
        }
        for Label { text, place: [x, y], is_left } in self.labels(LINE * worst) {
            let (side, x) = if is_left { (HPos::Right, x / BESIDE) } else { (HPos::Left, x * BESIDE) };
            let style = ("sans-serif", 11).into_text_style(&root).pos(Pos::new(side, VPos::Center));
            chart.draw_series(std::iter::once(Text::new(text, (x, y), style)))?;
        }
        root.present()?;
        Ok(())
    }

    /// One label for all runs at one place; those of places near each other lie on lines of their own, `line` apart.
    fn labels(&self, line: f64) -> Vec<Label> {
        let mut runs: Vec<&TradeoffRun> = self.runs.iter().collect();
        runs.sort_by(|a, b| a.p99().total_cmp(&b.p99()).then(a.rays.cmp(&b.rays)));
        let most = runs.iter().map(|run| run.rays).max().unwrap_or(1) as f64;
        let mut labels: Vec<Label> = Vec::new();
        for same in runs.chunk_by(|a, b| (a.rays, a.p99()) == (b.rays, b.p99())) {
            let text = same.iter().map(|run| run.label()).collect::<Vec<_>>().join("; ");
            let [x, mut y] = [same[0].rays.max(1) as f64, same[0].p99()];
            for other in labels.iter().filter(|other| (x / other.place[0]).ln().abs() < NEAR.ln()) {
                y = y.max(other.place[1] + line);
            }
            labels.push(Label { text, place: [x, y], is_left: x > 0.3 * most });
        }
        labels
    }
}

/// What is written beside a point.
struct Label {
    text: String,
    place: [f64; 2],
    /// Left of it, because it lies at the right.
    is_left: bool,
}

/// Between lines of labels, as a share of the vertical axis.
const LINE: f64 = 0.026;

/// From a point to its label, as a factor.
const BESIDE: f64 = 1.03;

/// Labels of points that are less than this factor apart would cover each other.
const NEAR: f64 = 1.6;

/// The numbers that have room along a logarithmic axis: one, two, three, five and seven times a power of ten.
fn axis_label(value: f64) -> String {
    let written = format!("{value:.0}");
    let has_room = ['1', '2', '3', '5', '7']
        .iter()
        .any(|&digit| written.starts_with(digit) && written[1..].bytes().all(|b| b == b'0'));
    if has_room { written } else { String::new() }
}
