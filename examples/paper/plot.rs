//! Curves, a panel each quantity.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use std::error::Error;
use std::path::Path;

/// A curve with its name.
pub struct Curve {
    name: String,
    points: Vec<(f64, f64)>,
}

/// What is drawn in one panel.
pub struct Panel {
    title: &'static str,
    along: &'static str,
    curves: Vec<Curve>,
    logarithmic: bool,
}

impl Curve {
    pub fn new(name: impl Into<String>, along: &[f64], values: &[f64]) -> Self {
        Self {
            name: name.into(),
            points: along.iter().copied().zip(values.iter().copied()).collect(),
        }
    }
}

impl Panel {
    /// Against time.
    pub fn new(title: &'static str, curves: Vec<Curve>) -> Self {
        Self::along(title, "time, s", curves)
    }

    /// Against something else.
    pub fn along(title: &'static str, along: &'static str, curves: Vec<Curve>) -> Self {
        Self {
            title,
            along,
            curves,
            logarithmic: false,
        }
    }

    /// Both axes logarithmic, points marked.
    pub fn logarithmic(title: &'static str, along: &'static str, curves: Vec<Curve>) -> Self {
        Self {
            logarithmic: true,
            ..Self::along(title, along, curves)
        }
    }
}

/// Dark on white and told apart also by most who see few colours.
const COLORS: [RGBColor; 7] = [
    RGBColor(45, 95, 168),
    RGBColor(214, 110, 20),
    RGBColor(47, 125, 79),
    RGBColor(140, 60, 140),
    RGBColor(120, 120, 120),
    RGBColor(190, 40, 60),
    RGBColor(60, 170, 190),
];

/// Writes an SVG, two panels in a row.
pub fn draw(file: &Path, panels: &[Panel]) -> Result<(), Box<dyn Error>> {
    let rows = panels.len().div_ceil(2);
    let area = SVGBackend::new(file, (820, 280 * rows as u32)).into_drawing_area();
    area.fill(&WHITE)?;
    for (k, (part, panel)) in area.split_evenly((rows, 2)).iter().zip(panels).enumerate() {
        // Once for panels with the same curves.
        let names = |p: &Panel| p.curves.iter().map(|c| c.name.clone()).collect::<Vec<_>>();
        draw_panel(part, panel, k == 0 || names(panel) != names(&panels[0]))?;
    }
    area.present()?;
    Ok(())
}

fn draw_panel(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    panel: &Panel,
    legend: bool,
) -> Result<(), Box<dyn Error>> {
    let all = || panel.curves.iter().flat_map(|c| &c.points);
    let start = all().map(|p| p.0).fold(f64::MAX, f64::min);
    let end = all().map(|p| p.0).fold(f64::MIN, f64::max);
    let low = all().map(|p| p.1).fold(f64::MAX, f64::min);
    let high = all().map(|p| p.1).fold(f64::MIN, f64::max);
    let mut chart = ChartBuilder::on(area);
    chart
        .margin(8)
        .caption(panel.title, ("sans-serif", 15))
        .x_label_area_size(28)
        .y_label_area_size(48);
    if panel.logarithmic {
        let (x, y) = (0.9 * start..1.1 * end, 0.2 * low..1.4 * high);
        let chart = chart.build_cartesian_2d(x.log_scale(), y.log_scale())?;
        return draw_curves(chart, panel, legend);
    }
    let margin = 0.08 * (high - low).max(1e-6);
    let chart = chart.build_cartesian_2d(start..end, low - margin..high + margin)?;
    draw_curves(chart, panel, legend)
}

fn draw_curves<'a, X, Y>(
    mut chart: ChartContext<'a, SVGBackend<'a>, Cartesian2d<X, Y>>,
    panel: &Panel,
    legend: bool,
) -> Result<(), Box<dyn Error>>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut mesh = chart.configure_mesh();
    mesh.x_desc(panel.along).light_line_style(TRANSPARENT);
    let plain = |x: &f64| match x / 10f64.powf(x.log10().floor()) {
        leading if [1, 2, 5].contains(&(leading.round() as u8)) => x.to_string(),
        _ => String::new(),
    };
    if panel.logarithmic {
        mesh.x_label_formatter(&plain).y_label_formatter(&plain);
    }
    mesh.draw()?;
    if panel.curves.len() > COLORS.len() {
        return Err(format!("{}: more curves than colours", panel.title).into());
    }
    for (curve, color) in panel.curves.iter().zip(COLORS) {
        let line = LineSeries::new(curve.points.iter().copied(), color.stroke_width(2));
        let drawn = chart.draw_series(line)?;
        if legend {
            drawn.label(&curve.name).legend(move |(x, y)| {
                PathElement::new([(x, y), (x + 18, y)], color.stroke_width(2))
            });
        }
        if panel.logarithmic {
            let mark = |point: &(f64, f64)| Circle::new(*point, 3, color.filled());
            chart.draw_series(curve.points.iter().map(mark))?;
        }
    }
    if legend {
        chart
            .configure_series_labels()
            .position(match panel.logarithmic {
                true => SeriesLabelPosition::LowerRight,
                false => SeriesLabelPosition::UpperLeft,
            })
            .border_style(BLACK.mix(0.3))
            .background_style(WHITE)
            .draw()?;
    }
    Ok(())
}
