//! The picture: time against error, log–log.

use std::io::Write as _;
use std::path::Path;

use plotters::coord::Shift;
use plotters::prelude::*;

use crate::simulate::{Fidelity, Method, Recording, replace};
use crate::tradeoff::{Tradeoff, TradeoffReference, TradeoffRow, short};
use crate::{Error, Result};

const WIDTH: u32 = 860;
const HEIGHT: u32 = 470;
/// Room for the legend, right of the chart.
const LEGEND: u32 = 200;
/// Errors are drawn no lower than this: less is rounding.
const FLOOR: f64 = 1e-12;

/// Decades left free beside the outermost points, and shown at least.
const MARGIN: f64 = 0.25;
const LEAST: f64 = 1.6;

type Panel<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A failure of the drawing itself, in words.
type Drawn = std::result::Result<(), Box<dyn std::error::Error>>;

/// What is refused of a file before hours are spent on it.
fn refuse(file: &Path, expected: &str) -> Error {
    Error::input("--plot", file.display().to_string(), expected)
}

/// Whether the picture can be written there.
pub(super) fn prepare(file: &Path) -> Result<()> {
    let extension = file.extension().unwrap_or_default().to_string_lossy();
    if !extension.eq_ignore_ascii_case("svg") {
        return Err(refuse(
            file,
            "give a name that ends in .svg: that is what is written",
        ));
    }
    if file.is_dir() {
        return Err(refuse(file, "is a folder: give the name of a file"));
    }
    let folder = file.parent().filter(|f| !f.as_os_str().is_empty());
    Recording::prepare(folder.unwrap_or(Path::new(".")))
}

/// Writes the picture; a file that stood there is replaced only once it is complete.
pub(super) fn write(file: &Path, found: &Tradeoff) -> Result<()> {
    let mut text = String::new();
    draw(&mut text, found).map_err(|e| Error::File {
        path: file.to_owned(),
        action: "write",
        source: std::io::Error::other(e.to_string()),
    })?;
    replace(file, |out| out.write_all(text.as_bytes()))
}

/// One chart of the picture.
struct Chart<'a> {
    title: String,
    x: &'static str,
    y: &'static str,
    points: Vec<(&'a TradeoffRow, (f64, f64))>,
    on_front: fn(&TradeoffRow) -> bool,
    /// The reference's own error.
    estimate: Option<f64>,
}

fn charts(found: &Tradeoff) -> Vec<Chart<'_>> {
    let reference = &found.reference;
    type Point = fn(&TradeoffRow, &TradeoffReference) -> Option<(f64, f64)>;
    let points = |of: Point, which: &dyn Fn(&TradeoffRow) -> bool| {
        let rows = found.rows.iter().filter(|r| which(r));
        let point = |r| of(r, reference).map(|(x, y)| (r, (x, y.max(FLOOR))));
        rows.filter_map(point).collect::<Vec<_>>()
    };
    let first = found.rows.first();
    let alike = |r: &TradeoffRow| first.is_some_and(|f| r.steps_like(f));
    let mut out = vec![Chart {
        title: format!("{}: added mass at the start", found.scene),
        x: "time per step, ms",
        y: "relative error of the added mass",
        points: points(TradeoffRow::by_added_mass, &alike),
        on_front: |r| r.pareto,
        estimate: reference.added_mass.error_estimate,
    }];
    if let Some(first) = first {
        let integrator: &str = first.configuration.integrator.into();
        out[0].title += &format!(" (steps by {integrator})");
    }
    if let Some(end_state) = &reference.end_state {
        out.push(Chart {
            title: format!(
                "{}: where the bodies are after {} s",
                found.scene,
                short(reference.horizon_seconds)
            ),
            x: "time per simulated second, ms",
            y: "relative error of the end state",
            points: points(TradeoffRow::by_end_state, &|_| true),
            on_front: |r| r.pareto_end_state,
            estimate: end_state.error_estimate,
        });
    }
    out
}

fn draw(text: &mut String, found: &Tradeoff) -> Drawn {
    let charts = charts(found);
    let height = HEIGHT * charts.len() as u32;
    let area = SVGBackend::with_string(text, (WIDTH, height)).into_drawing_area();
    area.fill(&WHITE)?;
    for (panel, chart) in area.split_evenly((charts.len(), 1)).iter().zip(&charts) {
        chart.draw(panel)?;
    }
    area.present()?;
    Ok(())
}

/// From a little below to a little above the values; more than a decade, so that there is something
/// to read.
fn around(values: impl Iterator<Item = f64>) -> std::ops::Range<f64> {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for x in values.filter(|x| *x > 0.0 && x.is_finite()).map(f64::log10) {
        (low, high) = (low.min(x), high.max(x));
    }
    if low > high {
        (low, high) = (0.0, 0.0);
    }
    let widen = (0.5 * (LEAST - (high - low))).max(MARGIN);
    10f64.powf(low - widen)..10f64.powf(high + widen)
}

/// A power of ten as people write it.
fn tick(x: f64) -> String {
    if (0.99e-3..1.01e4).contains(&x) {
        let digits = (-x.log10().round()).max(0.0) as usize;
        format!("{x:.digits$}")
    } else {
        format!("{x:.0e}")
    }
}

impl Chart<'_> {
    fn draw(&self, panel: &Panel) -> Drawn {
        let (panel, legend) = panel.split_horizontally(WIDTH - LEGEND);
        let x = around(self.points.iter().map(|p| p.1.0));
        let y = around(self.points.iter().map(|p| p.1.1).chain(self.estimate));
        let (left, right) = (x.start, x.end);
        let mut chart = ChartBuilder::on(&panel)
            .margin(12)
            .caption(&self.title, ("sans-serif", 17))
            .x_label_area_size(42)
            .y_label_area_size(64)
            .build_cartesian_2d(x.log_scale(), y.log_scale())?;
        chart
            .configure_mesh()
            .x_desc(self.x)
            .y_desc(self.y)
            .axis_desc_style(("sans-serif", 14))
            .label_style(("sans-serif", 12))
            .bold_line_style(BLACK.mix(0.18))
            .light_line_style(TRANSPARENT)
            .x_label_formatter(&|x| tick(*x))
            .y_label_formatter(&|y| format!("{y:.0e}"))
            .draw()?;
        let (across, down) = panel.get_pixel_range();
        let corner = (across.start, down.start);
        let mut entries: Vec<(Sign, String)> = Vec::new();
        if let Some(estimate) = self.estimate.filter(|e| *e >= FLOOR) {
            let line = [(left, estimate), (right, estimate)];
            chart.draw_series(DashedLineSeries::new(line, 5, 5, DASHED.into()))?;
            let dashes = |area: &Panel, (x, y): Pixel| -> Drawn {
                for k in [-9, -1, 7] {
                    area.draw(&PathElement::new([(x + k, y), (x + k + 4, y)], DASHED))?;
                }
                Ok(())
            };
            entries.push((Box::new(dashes), "error of the reference".into()));
        }
        let mut front: Vec<(f64, f64)> = (self.points.iter())
            .filter(|(row, _)| (self.on_front)(row))
            .map(|(_, at)| *at)
            .collect();
        front.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.total_cmp(&a.1)));
        if !front.is_empty() {
            chart.draw_series(LineSeries::new(front, FRONT))?;
            let line = |area: &Panel, (x, y): Pixel| -> Drawn {
                Ok(area.draw(&PathElement::new([(x - 9, y), (x + 9, y)], FRONT))?)
            };
            entries.push((Box::new(line), "Pareto front".into()));
        }
        let family = |row: &TradeoffRow| (row.configuration.fidelity, row.configuration.method);
        let mut drawn = Vec::new();
        for family_of in self.points.iter().map(|(row, _)| family(row)) {
            if drawn.contains(&family_of) {
                continue;
            }
            drawn.push(family_of);
            for (row, at) in self.points.iter().filter(|p| family(p.0) == family_of) {
                let (x, y) = chart.backend_coord(at);
                let at = (x - corner.0, y - corner.1);
                mark(&panel, at, family_of, (self.on_front)(row))?;
            }
            let sign = move |area: &Panel, at: Pixel| mark(area, at, family_of, true);
            entries.push((Box::new(sign), format!("{}, {}", family_of.0, family_of.1)));
        }
        for (i, (sign, text)) in entries.into_iter().enumerate() {
            let at = (14, 52 + 20 * i as i32);
            sign(&legend, at)?;
            legend.draw(&Text::new(text, (at.0 + 18, at.1 - 4), ("sans-serif", 13)))?;
        }
        Ok(())
    }
}

type Pixel = (i32, i32);

/// What stands in the legend beside a text.
type Sign = Box<dyn Fn(&Panel, Pixel) -> Drawn>;

const DASHED: RGBAColor = RGBAColor(0, 0, 0, 0.6);
const FRONT: RGBAColor = RGBAColor(0, 0, 0, 0.8);

/// A marker at a pixel, filled if it is on the front: colour by fidelity, form by method, told apart without
/// colours too.
fn mark(area: &Panel, (x, y): Pixel, of: (Fidelity, Method), filled: bool) -> Drawn {
    let color = match of.0 {
        Fidelity::Isolated => RGBColor(110, 110, 110),
        Fidelity::Reduced => RGBColor(0, 100, 190),
        Fidelity::Auto => RGBColor(0, 145, 90),
        Fidelity::Full => RGBColor(200, 60, 20),
    };
    let style = color.stroke_width(if filled { 2 } else { 1 });
    let corners = match of.1 {
        Method::Exact => {
            let style = if filled { style.filled() } else { style };
            return Ok(area.draw(&Circle::new((x, y), 4, style))?);
        }
        Method::MfsFace => return Ok(area.draw(&Cross::new((x, y), 4, style))?),
        Method::Panel => vec![(-4, -4), (4, -4), (4, 4), (-4, 4)],
        Method::MfsVertex => vec![(0, -5), (5, 4), (-5, 4)],
        Method::Auto => vec![(0, -5), (5, 0), (0, 5), (-5, 0)],
    };
    let mut corners: Vec<_> = corners.into_iter().map(|c| (x + c.0, y + c.1)).collect();
    if filled {
        return Ok(area.draw(&Polygon::new(corners, color))?);
    }
    corners.push(corners[0]);
    Ok(area.draw(&PathElement::new(corners, style))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_hold_the_values_and_a_tick() {
        for values in [
            vec![0.02, 3.0, 0.0, f64::NAN],
            vec![0.5],
            vec![1.0, 1.1],
            vec![],
        ] {
            let range = around(values.iter().copied());
            assert!(range.start > 0.0 && range.end > 10.0 * range.start);
            let known = values.iter().filter(|x| **x > 0.0);
            known.for_each(|x| assert!(range.start < *x && *x < range.end));
        }
    }

    #[test]
    fn ticks_read_well() {
        let texts = [1e-6, 1e-3, 0.1, 1.0, 100.0, 1e5].map(tick);
        assert_eq!(texts, ["1e-6", "0.001", "0.1", "1", "100", "1e5"]);
    }

    #[test]
    fn only_svg_is_written() {
        let refused = |file: &Path| prepare(file).unwrap_err().to_string();
        assert!(refused(Path::new("a.png")).contains(".svg"));
        let folder = tempfile::tempdir().unwrap();
        assert!(prepare(&folder.path().join("new/a.SVG")).is_ok());
        let named = folder.path().join("folder.svg");
        std::fs::create_dir(&named).unwrap();
        assert!(refused(&named).contains("folder"));
    }
}
