//! Exact added masses at unit density: tables of `tests/data`, and formulas that hold anywhere. `tests/water/exact` holds
//! them against each other.

use faer::Mat;
use faer::linalg::solvers::Solve;
use nalgebra::DMatrix;
use serde_json::Value;
use std::f64::consts::PI;

pub fn data(name: &str) -> Value {
    let file = super::root().join("tests/data").join(name);
    let text = std::fs::read_to_string(file).expect("the table is in the repository");
    serde_json::from_str(&text).expect("the table is JSON")
}

pub fn rows<'a>(value: &'a Value, key: &str) -> &'a [Value] {
    value[key].as_array().expect("rows")
}

pub fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

// Ellipsoids

/// Semi-axes along x, y, z; added mass, in translation along them and rotation about them.
pub fn ellipsoids() -> Vec<([f64; 3], [f64; 6])> {
    let row = |row: &Value| {
        let list = |key: &str| -> [f64; 3] {
            let list = rows(row, key);
            std::array::from_fn(|i| number(&list[i]))
        };
        let (moved, turned) = (list("added_mass"), list("added_inertia"));
        let both = std::array::from_fn(|i| if i < 3 { moved[i] } else { turned[i - 3] });
        (list("semi_axes"), both)
    };
    rows(&data("ellipsoids.json"), "rows")
        .iter()
        .map(row)
        .collect()
}

/// Carlson's R_D by duplication: ³⁄₂ ∫ dt / (√(t+x) √(t+y) (t+z)^{3/2}).
fn carlson(mut x: f64, mut y: f64, mut z: f64) -> f64 {
    let (mut sum, mut power) = (0.0, 1.0);
    for _ in 0..60 {
        let (a, b, c) = (x.sqrt(), y.sqrt(), z.sqrt());
        let lambda = a * b + b * c + c * a;
        sum += 3.0 * power / (c * (z + lambda));
        power *= 0.25;
        (x, y, z) = ((x + lambda) / 4.0, (y + lambda) / 4.0, (z + lambda) / 4.0);
    }
    sum + power / (z * z.sqrt())
}

/// The same as in [`ellipsoids`] for any semi-axes (Lamb 1932, §114, §115).
pub fn lamb(s: [f64; 3]) -> [f64; 6] {
    let q = s.map(|a| a * a);
    let volume = 4.0 / 3.0 * PI * s[0] * s[1] * s[2];
    let of =
        |i: usize, j: usize, k: usize| 2.0 / 3.0 * s[0] * s[1] * s[2] * carlson(q[j], q[k], q[i]);
    let alpha = [of(0, 1, 2), of(1, 2, 0), of(2, 0, 1)];
    std::array::from_fn(|i| {
        if i < 3 {
            return volume * alpha[i] / (2.0 - alpha[i]);
        }
        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
        let (difference, alphas) = (q[j] - q[k], alpha[k] - alpha[j]);
        if difference == 0.0 {
            return 0.0;
        }
        let below = 2.0 * difference - (q[j] + q[k]) * alphas;
        volume / 5.0 * difference * difference * alphas / below
    })
}

// Two spheres

/// A sphere of radius 1 at the origin and another one on the z-axis.
pub struct TwoSpheres {
    /// Radius of the other one.
    pub radius: f64,
    /// Between the centres.
    pub distance: f64,
    /// Added mass in translation along the line of centres, both velocities counted in one direction.
    pub along: [[f64; 2]; 2],
    /// The same across it.
    pub across: [[f64; 2]; 2],
}

impl TwoSpheres {
    /// Two equal ones.
    pub fn equal(distance: f64) -> Self {
        let [along, along12, across, across12] = multipoles(distance);
        Self {
            radius: 1.0,
            distance,
            along: [[along, along12], [along12, along]],
            across: [[across, across12], [across12, across]],
        }
    }

    pub fn gap(&self) -> f64 {
        self.distance - 1.0 - self.radius
    }

    /// Along the line own and mutual, across it own and mutual: of equal spheres all there is.
    pub fn coefficients(&self) -> [f64; 4] {
        [
            self.along[0][0],
            self.along[0][1],
            self.across[0][0],
            self.across[0][1],
        ]
    }

    /// The same four of a matrix of two bodies.
    pub fn coefficients_of(m: &DMatrix<f64>) -> [f64; 4] {
        [m[(2, 2)], m[(2, 8)], m[(0, 0)], m[(0, 6)]]
    }

    /// Translations and rotations of the first, then of the second: 12 × 12.
    pub fn matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(12, 12, |i, j| match (i % 6 == j % 6, i % 6) {
            (true, 2) => self.along[i / 6][j / 6],
            (true, 0 | 1) => self.across[i / 6][j / 6],
            _ => 0.0,
        })
    }

    /// Translations alone: 6 × 6.
    pub fn translations(&self) -> DMatrix<f64> {
        let m = self.matrix();
        let at = |i: usize| 6 * (i / 3) + i % 3;
        DMatrix::from_fn(6, 6, |i, j| m[(at(i), at(j))])
    }
}

/// Pairs of radius 1, by growing distance (multipoles against images, agreeing to 1e-16).
pub fn equal_spheres() -> Vec<TwoSpheres> {
    let row = |row: &Value| {
        let pair = |key: &str| {
            let (own, other) = (number(&row[key]["M11"]), number(&row[key]["M12"]));
            [[own, other], [other, own]]
        };
        TwoSpheres {
            radius: 1.0,
            distance: number(&row["d"]),
            along: pair("longitudinal"),
            across: pair("transverse"),
        }
    };
    let file = data("two_spheres.json");
    rows(&file, "equal").iter().map(row).collect()
}

/// Pairs of radius 1 and ½.
pub fn unequal_spheres() -> Vec<TwoSpheres> {
    let row = |row: &Value| {
        let pair = |key: &str| -> [[f64; 2]; 2] {
            std::array::from_fn(|i| std::array::from_fn(|j| number(&row[key][i][j])))
        };
        assert_eq!(number(&row["a"]), 1.0);
        TwoSpheres {
            radius: number(&row["b"]),
            distance: number(&row["d"]),
            along: pair("longitudinal"),
            across: pair("transverse"),
        }
    };
    let file = data("two_spheres.json");
    rows(&file, "unequal").iter().map(row).collect()
}

/// The coefficients of two equal spheres at any distance, from multipoles about both centres.
///
/// The flow of both spheres moving as mirror images (s = 1) or against each other (s = −1) is
/// `Σ a_n (r⁻ⁿ⁻¹P_nᵐ + s their mirror images)`, m = 0 along the line of centres and m = 1 across it;
/// the images have the coefficients `C(n+k, k+m) d⁻⁽ⁿ⁺ᵏ⁺¹⁾ rⁿ` about the other centre (Hobson 1931, §88), so
///
/// ```text
/// −(n+1) a_n + s n Σ_k C(n+k, k+m) d⁻⁽ⁿ⁺ᵏ⁺¹⁾ a_k = δ_n1,      M = −4π/3 (1 + 3 a_1)
/// ```
pub fn multipoles(d: f64) -> [f64; 4] {
    // Images gather where the terms fall like e^{−2η}, cosh η = d/2.
    let eta = (0.5 * d).acosh();
    let most = (20.0 / eta).ceil().clamp(20.0, 500.0) as usize;
    let mode = |m: usize, s: f64| {
        let mut matrix = Mat::<f64>::zeros(most, most);
        let mut right = Mat::<f64>::zeros(most, 1);
        right[(0, 0)] = 1.0;
        for n in 1..=most {
            // C(n+k, k+m) d^{−(n+k+1)} from k = 1 on, from logarithms and then by its ratio.
            let mut log = -((n + 2) as f64) * d.ln();
            log += ((n + 1) as f64).ln();
            if m == 1 {
                // C(n+1, 2) for C(n+1, 1).
                log += (0.5 * n as f64).ln();
            }
            for k in 1..=most {
                matrix[(n - 1, k - 1)] = s * n as f64 * log.exp();
                log += ((n + k + 1) as f64 / ((k + m + 1) as f64 * d)).ln();
            }
            matrix[(n - 1, n - 1)] -= (n + 1) as f64;
        }
        let a = matrix.partial_piv_lu().solve(&right);
        -4.0 * PI / 3.0 * (1.0 + 3.0 * a[(0, 0)])
    };
    let [along, against] = [mode(0, 1.0), mode(0, -1.0)];
    let [across, opposite] = [mode(1, 1.0), mode(1, -1.0)];
    // Mirror images move in opposite directions along the line.
    [
        0.5 * (along + against),
        -0.5 * (along - against),
        0.5 * (across + opposite),
        0.5 * (across - opposite),
    ]
}

/// Added mass of a unit sphere that moves along the line to an equal one, which moves as its mirror image
/// (sign 1) or with it (−1): Lamb, Hydrodynamics, §98; a dipole in the centre and its images on the line, each
/// of (a/s)³ times the strength of the last, s that one's distance from the centre in which it is
/// mirrored.
pub fn image_series(d: f64, sign: f64) -> f64 {
    let (mut at, mut strength, mut sum) = (0.0, 1.0_f64, 0.0);
    while strength.abs() > 1e-16 {
        let s = d - at;
        strength *= sign / (s * s * s);
        at = 1.0 / s;
        sum += strength;
        if at > 0.999_999 && strength.abs() < 1e-13 {
            break;
        }
    }
    2.0 / 3.0 * PI * (1.0 + 3.0 * sum)
}

// A sphere and a rigid wall

/// A sphere of radius 1 with its centre at this height over a rigid wall.
pub struct SphereByWall {
    pub height: f64,
    /// Added mass in translation along the wall's normal.
    pub across: f64,
    /// Along the wall.
    pub along: f64,
}

pub fn spheres_by_wall() -> Vec<SphereByWall> {
    let row = |row: &Value| SphereByWall {
        height: number(&row["h"]),
        across: number(&row["perpendicular"]),
        along: number(&row["parallel"]),
    };
    let file = data("sphere_wall.json");
    rows(&file, "rows").iter().map(row).collect()
}
