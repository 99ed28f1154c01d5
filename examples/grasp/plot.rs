//! Naive against optimised, drawn.

use crate::hold::{COIN_TURN, COIN_Y, COLUMN, FINGERS};
use hydrograd::simulate::Rollout;
use plotters::coord::Shift;
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

/// What is drawn of a rollout against time, one panel each.
type Reading = fn(&[f64]) -> f64;

const PANELS: [(&str, Reading); 4] = [
    ("column, m", |q| q[COLUMN]),
    ("opening of the fingers, m", |q| {
        q[FINGERS[1]] - q[FINGERS[0]]
    }),
    ("coin along the fingers, m (tips at 1.6)", |q| {
        q[COIN_Y] - q[COLUMN]
    }),
    ("turn of the coin, rad (flat at 1.57)", |q| q[COIN_TURN]),
];

/// Writes an SVG.
pub fn draw(file: &Path, curves: &[(&str, &Rollout)]) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(file, (820, 560)).into_drawing_area();
    area.fill(&WHITE)?;
    for (k, (part, (title, reading))) in area.split_evenly((2, 2)).iter().zip(PANELS).enumerate() {
        // Where nothing runs through the legend.
        panel(part, title, curves, reading, k == 1)?;
    }
    area.present()?;
    Ok(())
}

fn panel(
    area: &DrawingArea<SVGBackend, Shift>,
    title: &str,
    curves: &[(&str, &Rollout)],
    reading: Reading,
    legend: bool,
) -> Result<(), Box<dyn Error>> {
    let points = |rollout: &Rollout| -> Vec<(f64, f64)> {
        let samples = rollout.samples().iter();
        samples.map(|s| (s.time, reading(s.q.as_slice()))).collect()
    };
    let all: Vec<(f64, f64)> = curves.iter().flat_map(|(_, r)| points(r)).collect();
    let end = all.iter().map(|p| p.0).fold(0.0, f64::max);
    let (low, high) = all
        .iter()
        .fold((f64::MAX, f64::MIN), |(l, h), p| (l.min(p.1), h.max(p.1)));
    let margin = 0.08 * (high - low).max(1e-6);
    let mut chart = ChartBuilder::on(area)
        .margin(8)
        .caption(title, ("sans-serif", 15))
        .x_label_area_size(28)
        .y_label_area_size(44)
        .build_cartesian_2d(0.0..end, low - margin..high + margin)?;
    chart
        .configure_mesh()
        .x_desc("time, s")
        .light_line_style(TRANSPARENT)
        .draw()?;
    for ((name, rollout), color) in curves.iter().zip([RED, BLUE]) {
        chart
            .draw_series(LineSeries::new(points(rollout), color.stroke_width(2)))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2)));
    }
    if legend {
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .border_style(BLACK.mix(0.3))
            .background_style(WHITE)
            .draw()?;
    }
    Ok(())
}
