//! Curves as SVG.

use super::tuning::Tuning;
use plotters::prelude::*;

/// Width and height of a plot in pixels.
const SIZE: (u32, u32) = (800, 480);

/// Hit rate and predicted time relative to an unbounded cache, against cache size.
///
/// # Errors
/// If the drawing library fails; it has no reason to, because nothing is written but text.
pub fn tuning_svg(tuning: &Tuning) -> Result<String, Box<dyn std::error::Error + Send + Sync>> {
    let mut svg = String::new();
    draw_tuning(tuning, &mut svg).map_err(|e| e.to_string())?;
    Ok(svg)
}

fn draw_tuning(tuning: &Tuning, svg: &mut String) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(svg, SIZE).into_drawing_area();
    area.fill(&WHITE)?;
    let mebibytes = |bytes: u64| bytes as f64 / (1 << 20) as f64;
    let sizes = tuning.curve.iter().map(|p| mebibytes(p.cache_bytes));
    let (low, high) = (sizes.clone().fold(f64::INFINITY, f64::min), sizes.fold(0.0, f64::max));
    let caption = format!("{}: what a byte of cache buys", tuning.input);
    let mut chart = ChartBuilder::on(&area)
        .caption(caption, ("sans-serif", 18))
        .margin(12)
        .x_label_area_size(40)
        .y_label_area_size(48)
        .build_cartesian_2d((low..high.max(2.0 * low)).log_scale(), 0.0..1.05)?;
    chart.configure_mesh().x_desc("cache, MiB").y_desc("1 is an unbounded cache").draw()?;
    let hit_rates = tuning.curve.iter().map(|p| (mebibytes(p.cache_bytes), p.hit_rate));
    chart
        .draw_series(LineSeries::new(hit_rates, BLUE.stroke_width(2)))?
        .label("hit rate")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], BLUE));
    let speeds = tuning.curve.iter().map(|p| (mebibytes(p.cache_bytes), tuning.unbounded_seconds / p.seconds));
    chart
        .draw_series(LineSeries::new(speeds, RED.stroke_width(2)))?
        .label("predicted speed")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], RED));
    let recommended = mebibytes(tuning.recommended_bytes).clamp(low, high);
    chart
        .draw_series(LineSeries::new([(recommended, 0.0), (recommended, 1.05)], BLACK.mix(0.5)))?
        .label("95 % of the speed")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 16, y)], BLACK.mix(0.5)));
    chart.configure_series_labels().border_style(BLACK.mix(0.2)).position(SeriesLabelPosition::LowerRight).draw()?;
    area.present()?;
    drop(chart);
    Ok(())
}
