//! Figure 10: what K⁺F and its gradient cost by the number of faces: by pseudo-inverse and by least squares, dense and differentiated as PyTorch does, by the paper's scheme, and by ours.
//!
//! All on one core. A line ends with the first solve that passes a minute, and before one that would take over two or over 10 GB, by what the last took.

use crate::operator::{Case, Made as Solve, Solved, factors, jacobi};
use crate::plot::{Curve, Panel, draw};
use crate::spent::{self, seconds};
use crate::{How, Made, Numbers, dense};
use serde_json::json;
use std::error::Error;

/// Height of the body's middle above the wall, m: its lowest point is 0.1 m over it.
const HEIGHT: f64 = 0.2;
/// Steps of the central differences, of the height.
const STEP: f64 = 1e-3;
/// To which those that iterate go on, and for the values that are differenced.
const TOLERANCE: f64 = 1e-10;
const EXACT: f64 = 1e-13;
/// s, bytes
const MINUTE: f64 = 60.0;
const MEMORY: f64 = 10e9;
/// Solves are repeated until so much time has passed, s.
const ENOUGH: f64 = 0.3;

struct Method {
    name: &'static str,
    label: &'static str,
    solve: fn(&Case, f64, f64) -> Solve,
    /// Whether it uses the body's own factor.
    factored: bool,
    /// Power of the number of faces with which its time grows.
    grows: i32,
}

const METHODS: [Method; 4] = [
    Method {
        name: "pseudo_inverse",
        label: "pseudo-inverse, SVD",
        solve: dense::svd,
        factored: false,
        grows: 3,
    },
    Method {
        name: "least_squares",
        label: "least squares, QR",
        solve: dense::qr,
        factored: false,
        grows: 3,
    },
    Method {
        name: "pcg",
        label: "PCG, Eq. 21",
        solve: jacobi,
        factored: false,
        grows: 2,
    },
    Method {
        name: "ours",
        label: "ours",
        solve: factors,
        factored: true,
        grows: 2,
    },
];

/// One method at one size.
struct Point {
    faces: usize,
    /// What prepares the body, once for all heights, s.
    setup: f64,
    forward: f64,
    backward: f64,
    /// Most that was held at once, bytes, the body included.
    memory: f64,
    iterations: usize,
    /// dJ/dq, and by central differences of the values, where they are at hand.
    slope: f64,
    difference: Option<f64>,
    /// Whether the body's factor was a sparse one.
    sparse: bool,
}

impl Point {
    fn seconds(&self) -> f64 {
        self.forward + self.backward
    }
}

pub fn make(how: &How) -> Made {
    let sizes: &[usize] = match how.quick {
        true => &[320, 500, 1000],
        false => &[500, 1000, 2000, 4000, 8000, 10000, 20000],
    };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let all = || {
        METHODS
            .each_ref()
            .map(|m| line(m, sizes).map_err(|e| e.to_string()))
    };
    let [svd, qr, pcg, ours] = pool.install(all);
    let lines = [svd?, qr?, pcg?, ours?];
    let mut numbers = Numbers::new();
    for (method, points) in METHODS.iter().zip(&lines) {
        numbers.insert(method.name.into(), report(points, &lines[3]));
    }
    numbers.insert("times_ours".into(), times_ours(&lines));
    picture(how, &lines)?;
    Ok(numbers)
}

fn line(method: &Method, sizes: &[usize]) -> Result<Vec<Point>, Box<dyn Error>> {
    let mut points: Vec<Point> = Vec::new();
    for &faces in sizes {
        if let Some(last) = points.last() {
            let more = faces as f64 / last.faces as f64;
            let seconds = last.seconds() * more.powi(method.grows);
            if last.seconds() > MINUTE
                || seconds > 2.0 * MINUTE
                || last.memory * more.powi(2) > MEMORY
            {
                break;
            }
        }
        points.push(point(method, faces)?);
    }
    Ok(points)
}

fn point(method: &Method, faces: usize) -> Result<Point, Box<dyn Error>> {
    let before = spent::watch();
    let start = seconds();
    let case = Case::new(faces, method.factored)?;
    let setup = seconds() - start;
    spent::watch();
    let (start, mut solves) = (seconds(), Vec::new());
    while solves.is_empty() || seconds() - start < ENOUGH {
        solves.push((method.solve)(&case, HEIGHT, TOLERANCE)?);
    }
    let mean = |of: fn(&Solved) -> f64| solves.iter().map(of).sum::<f64>() / solves.len() as f64;
    Ok(Point {
        faces: case.size(),
        setup,
        forward: mean(|s| s.forward),
        backward: mean(|s| s.backward),
        memory: (spent::most() - before) as f64,
        iterations: solves[0].iterations,
        slope: solves[0].slope,
        difference: (method.factored && !case.sparse())
            .then(|| difference(&case))
            .transpose()?,
        sparse: case.sparse(),
    })
}

/// dJ/dq to fourth order.
fn difference(case: &Case) -> Result<f64, Box<dyn Error>> {
    let h = STEP * HEIGHT;
    let value = |k: f64| factors(case, HEIGHT + k * h, EXACT).map(|s| s.value);
    let [near, far] = [value(1.0)? - value(-1.0)?, value(2.0)? - value(-2.0)?];
    Ok((8.0 * near - far) / (12.0 * h))
}

fn report(points: &[Point], ours: &[Point]) -> serde_json::Value {
    let each = points.iter().zip(ours).map(|(p, ours)| {
        let exact = ours.difference;
        json!({
            "faces": p.faces,
            "sparse_factor": p.sparse,
            "prepared_once_s": p.setup,
            "forward_s": p.forward,
            "backward_s": p.backward,
            "megabytes": 1e-6 * p.memory,
            "iterations": p.iterations,
            "gradient_off_by": exact.map(|exact| (p.slope / exact - 1.0).abs()),
        })
    });
    json!({
        "sizes": each.collect::<Vec<_>>(),
        "ends_early": points.len() < ours.len(),
        "time_grows_with_power": grows(points, Point::seconds),
        "memory_grows_with_power": grows(points, |p| p.memory),
    })
}

/// Slope of the last two points with the same kind of factor on logarithmic axes.
fn grows(points: &[Point], of: impl Fn(&Point) -> f64) -> Option<f64> {
    let dense = points.iter().filter(|p| !p.sparse).collect::<Vec<_>>();
    let [.., a, b] = dense[..] else { return None };
    Some((of(b) / of(a)).ln() / (b.faces as f64 / a.faces as f64).ln())
}

/// Time of the others over ours at each size.
fn times_ours(lines: &[Vec<Point>; 4]) -> serde_json::Value {
    let [svd, qr, pcg, ours] = lines;
    let each = ours.iter().enumerate().map(|(k, ours)| {
        let times = |p: &Point| p.seconds() / ours.seconds();
        let dense = svd.get(k).zip(qr.get(k));
        json!({
            "faces": ours.faces,
            "best_dense": dense.map(|(a, b)| times(a).min(times(b))),
            "qr_forward_alone": qr.get(k).map(|p| p.forward / ours.seconds()),
            "pcg": pcg.get(k).map(times),
        })
    });
    each.collect()
}

fn picture(how: &How, lines: &[Vec<Point>]) -> Result<(), Box<dyn Error>> {
    let panel = |title, of: fn(&Point) -> f64| {
        let curve = |(method, points): (&Method, &Vec<Point>)| {
            let faces: Vec<f64> = points.iter().map(|p| p.faces as f64).collect();
            let values: Vec<f64> = points.iter().map(of).collect();
            Curve::new(method.label, &faces, &values)
        };
        let curves = METHODS.iter().zip(lines).map(curve).collect();
        Panel::logarithmic(title, "faces", curves)
    };
    draw(
        how.picture,
        &[
            panel("forward and backward, s of one core", Point::seconds),
            panel("memory, MB", |p| 1e-6 * p.memory),
        ],
    )
}
