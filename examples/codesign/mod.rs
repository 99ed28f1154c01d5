//! What the two co-designs share: effort that is the same for all, bounds of a shape, a descent, and options.

use hydrograd::optimize::{OptimizeSettings, minimise};
use std::path::PathBuf;

/// The pattern, scaled to this length: forces of a given effort.
pub fn scaled(pattern: &[f64], effort: f64) -> Vec<f64> {
    let length = norm(pattern);
    pattern.iter().map(|p| effort * p / length).collect()
}

/// Transpose of [`scaled`]. Along the pattern itself nothing changes: it is only a direction.
pub fn scaled_vjp(pattern: &[f64], effort: f64, bar: &[f64]) -> Vec<f64> {
    let length = norm(pattern);
    let along: f64 = pattern.iter().zip(bar).map(|(p, b)| p * b).sum();
    let own = pattern.iter().zip(bar);
    own.map(|(p, b)| effort / length * (b - p * along / (length * length)))
        .collect()
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// What is designed.
#[derive(Clone)]
pub struct Design {
    /// Direction of the forces.
    pub pattern: Vec<f64>,
    /// Logarithms of lengths, in parts of those at the start.
    pub logs: Vec<f64>,
}

/// The design of the lowest cost, from one. `cost` gives a value with its derivatives by the pattern and the logarithms.
///
/// With `reach`, the logarithms are free within these bounds: each is `reach` times the sine of a variable, so that the descent needs to know no bounds
/// and can still end on one. Without, they stay.
pub fn descend(
    mut cost: impl FnMut(&Design) -> hydrograd::Result<(f64, Design)>,
    start: &Design,
    reach: Option<&[f64]>,
    settings: &OptimizeSettings,
) -> hydrograd::Result<Design> {
    let many = start.pattern.len();
    let design = |x: &[f64]| Design {
        pattern: x[..many].to_vec(),
        logs: match reach {
            Some(reach) => (reach.iter().zip(&x[many..]))
                .map(|(r, z)| r * z.sin())
                .collect(),
            None => start.logs.clone(),
        },
    };
    // Of length 1, as the logarithms' variables are of size 1.
    let mut x = scaled(&start.pattern, 1.0);
    if let Some(reach) = reach {
        x.extend(start.logs.iter().zip(reach).map(|(l, r)| (l / r).asin()));
    }
    let value = |x: &[f64]| {
        let (value, bar) = cost(&design(x))?;
        let mut slope = bar.pattern;
        if let Some(reach) = reach {
            let own = bar.logs.iter().zip(reach).zip(&x[many..]);
            slope.extend(own.map(|((b, r), z)| b * r * z.cos()));
        }
        Ok((value, slope))
    };
    let found = minimise(value, &x, settings, |p| {
        eprintln!(
            "iteration {:3}: cost {:9.5}, {} rollouts",
            p.iteration, p.cost, p.evaluations
        );
    })?;
    Ok(design(&found.x))
}

/// What the command line asks for.
#[derive(Default)]
pub struct Options {
    pub quick: bool,
    pub check: bool,
    pub json: bool,
    pub out: Option<PathBuf>,
}

impl Options {
    pub fn read() -> Result<Self, String> {
        let mut options = Self::default();
        let mut arguments = std::env::args().skip(1);
        while let Some(name) = arguments.next() {
            match name.as_str() {
                "--quick" => options.quick = true,
                "--check" => options.check = true,
                "--json" => options.json = true,
                "--out" => {
                    let file = arguments.next().ok_or("--out needs a value")?;
                    options.out = Some(file.into());
                }
                _ => {
                    return Err(format!(
                        "{name}: expected --quick, --check, --out or --json"
                    ));
                }
            }
        }
        Ok(options)
    }
}
