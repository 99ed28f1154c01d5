//! Added masses as other simulators read them: each body's own 6 × 6, in its own axes about its origin. What bodies do to each other has no place there.

use std::fmt::Write as _;

use clap::ValueEnum;

use nalgebra::Matrix6;

/// How they are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Format {
    /// SDFormat: `<fluid_added_mass>` of each link, in the link's frame.
    Sdf,
    /// Fossen's M_A and its hydrodynamic derivatives (X_udot = −M_A11, …), in each body's own axes.
    Fossen,
    /// One row for each row of each matrix.
    Csv,
    /// An object with a matrix for each body.
    Json,
}

/// One body's own added mass.
pub(super) struct Own<'a> {
    /// The body's name.
    pub name: &'a str,
    /// Linear, then angular: kg, kg m, kg m².
    pub matrix: Matrix6<f64>,
}

/// Axes and degrees of freedom as SDFormat names them.
const SDF: [char; 6] = ['x', 'y', 'z', 'p', 'q', 'r'];
/// Forces and moments, and rates, as SNAME and Fossen name them.
const FORCES: [char; 6] = ['X', 'Y', 'Z', 'K', 'M', 'N'];
const RATES: [char; 6] = ['u', 'v', 'w', 'p', 'q', 'r'];

impl Format {
    /// The whole text; `density` is the water's, kg/m³.
    pub fn write(self, bodies: &[Own], density: f64) -> String {
        match self {
            Self::Sdf => sdf(bodies, density),
            Self::Fossen => fossen(bodies, density),
            Self::Csv => csv(bodies),
            Self::Json => json(bodies, density),
        }
    }
}

/// A name as the value of an attribute.
fn escaped(name: &str) -> String {
    let mut out = String::new();
    for c in name.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

fn sdf(bodies: &[Own], density: f64) -> String {
    let mut out = format!(
        "<!-- Added mass in water of {density} kg/m³: link axes, about the link's origin; to go into each link's <inertial>. -->\n"
    );
    for Own { name, matrix } in bodies {
        let _ = writeln!(out, "<link name=\"{}\">", escaped(name));
        out.push_str("  <inertial>\n    <fluid_added_mass>\n");
        for i in 0..6 {
            for j in i..6 {
                let (a, b, x) = (SDF[i], SDF[j], matrix[(i, j)]);
                let _ = writeln!(out, "      <{a}{b}>{x:.9e}</{a}{b}>");
            }
        }
        out.push_str("    </fluid_added_mass>\n  </inertial>\n</link>\n");
    }
    out
}

fn fossen(bodies: &[Own], density: f64) -> String {
    let mut out = format!(
        "# Added mass in water of {density} kg/m³: the body's own axes, about its origin; τ_A = −M_A ν̇ − C_A(ν) ν, rows and columns u v w p q r.\n"
    );
    for Own { name, matrix } in bodies {
        let _ = writeln!(out, "# {name}\nM_A = [");
        for row in matrix.row_iter() {
            let row: Vec<String> = row.iter().map(|x| format!("{x:.9e}")).collect();
            let _ = writeln!(out, "  {}", row.join(" "));
        }
        out.push_str("]\n");
        for (i, force) in FORCES.iter().enumerate() {
            for (j, rate) in RATES.iter().enumerate().skip(i) {
                let _ = writeln!(out, "{force}_{rate}dot = {:.9e}", -matrix[(i, j)]);
            }
        }
    }
    out
}

fn csv(bodies: &[Own]) -> String {
    let mut out = String::from("body,row,x,y,z,p,q,r\n");
    for Own { name, matrix } in bodies {
        let name = format!("\"{}\"", name.replace('"', "\"\""));
        for (row, axis) in matrix.row_iter().zip(SDF) {
            let row: Vec<String> = row.iter().map(|x| format!("{x:.17e}")).collect();
            let _ = writeln!(out, "{name},{axis},{}", row.join(","));
        }
    }
    out
}

fn json(bodies: &[Own], density: f64) -> String {
    let rows = |m: &Matrix6<f64>| -> Vec<Vec<f64>> {
        m.row_iter()
            .map(|row| row.iter().copied().collect())
            .collect()
    };
    let each = |own: &Own| (own.name.to_string(), serde_json::json!(rows(&own.matrix)));
    let bodies: serde_json::Map<_, _> = bodies.iter().map(each).collect();
    serde_json::json!({
        "density": density,
        "frame": "body axes, about the body's origin; linear x y z, then angular",
        "added_mass": bodies,
    })
    .to_string()
}
