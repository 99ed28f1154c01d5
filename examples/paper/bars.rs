//! Bars in groups, their length logarithmic.

use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

/// What is drawn.
pub struct Bars {
    pub title: &'static str,
    pub groups: Vec<&'static str>,
    pub names: Vec<&'static str>,
    /// `[group][name]`
    pub values: Vec<Vec<f64>>,
}

const COLORS: [RGBColor; 5] = [
    RGBColor(150, 150, 150),
    RGBColor(140, 60, 140),
    RGBColor(45, 95, 168),
    RGBColor(47, 125, 79),
    RGBColor(214, 110, 20),
];
/// Width of a group, of its place.
const WIDTH: f64 = 0.8;

/// Writes an SVG.
pub fn draw(file: &Path, bars: &Bars) -> Result<(), Box<dyn Error>> {
    let area = SVGBackend::new(file, (820, 400)).into_drawing_area();
    area.fill(&WHITE)?;
    let all = || bars.values.iter().flatten().copied();
    let low = 0.5 * all().fold(f64::MAX, f64::min);
    // The legend lies above them.
    let high = 40.0 * all().fold(f64::MIN, f64::max);
    let groups = bars.groups.len();
    let mut chart = ChartBuilder::on(&area)
        .margin(8)
        .caption(bars.title, ("sans-serif", 15))
        .x_label_area_size(28)
        .y_label_area_size(52)
        .build_cartesian_2d(0.0..groups as f64, (low..high).log_scale())?;
    // Marks lie at the halves; a group's name is in its middle.
    let name = |x: &f64| match (x.fract() - 0.5).abs() < 1e-6 {
        true => bars.groups[*x as usize].to_string(),
        false => String::new(),
    };
    chart
        .configure_mesh()
        .disable_x_mesh()
        .x_labels(2 * groups + 1)
        .x_label_formatter(&name)
        .y_label_formatter(&|y| format!("{y}"))
        .light_line_style(TRANSPARENT)
        .draw()?;
    let width = WIDTH / bars.names.len() as f64;
    for (k, (label, color)) in bars.names.iter().zip(COLORS).enumerate() {
        let bar = |(group, values): (usize, &Vec<f64>)| {
            let left = group as f64 + 0.5 * (1.0 - WIDTH) + k as f64 * width;
            Rectangle::new(
                [(left, low), (left + 0.9 * width, values[k])],
                color.filled(),
            )
        };
        chart
            .draw_series(bars.values.iter().enumerate().map(bar))?
            .label(*label)
            .legend(move |(x, y)| Rectangle::new([(x, y - 4), (x + 12, y + 4)], color.filled()));
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .border_style(BLACK.mix(0.3))
        .background_style(WHITE)
        .draw()?;
    area.present()?;
    Ok(())
}
