//! Every derivative rung of this crate with its check.

use crate::check::{Outcome, Rung, dot, outcome};
use crate::contact::{Law, Meeting, contact_force, contact_force_jvp, contact_force_vjp};
use crate::drag::{Element, Part, quadratic_drag, quadratic_drag_jvp, quadratic_drag_vjp};
use crate::lie::{
    Mat3, Mat6, Vec3, Vec6, exp_jacobian_inverse, exp_jacobian_inverse_vjp, exp_matrix,
    exp_matrix_vjp,
};
use crate::rigid::{spatial_inertia, spatial_inertia_vjp};

/// Largest accepted relative error.
const TOLERANCE: f64 = 1e-6;
/// Rotation angles of the checks: zero, both sides of the switch to the series, and large.
const ANGLES: [f64; 5] = [0.0, 0.099, 0.101, 1.3, 2.9];
/// Parts of the drag.
const PARTS: [Part; 3] = [Part::Tangential, Part::Normal, Part::Total];

/// Every derivative rung of this crate, named by its path.
pub fn rungs() -> Vec<Rung> {
    let mut out = crate::kernel::rungs();
    out.extend([
        Rung {
            name: "lie::rotation::exp_matrix_vjp",
            check: exp_matrix_check,
        },
        Rung {
            name: "lie::rotation::exp_jacobian_inverse_vjp",
            check: exp_jacobian_inverse_check,
        },
        Rung {
            name: "rigid::spatial_inertia_vjp",
            check: spatial_inertia_check,
        },
        Rung {
            name: "drag::quadratic_drag_jvp",
            check: quadratic_drag_jvp_check,
        },
        Rung {
            name: "drag::quadratic_drag_vjp",
            check: quadratic_drag_vjp_check,
        },
        Rung {
            name: "contact::contact_force_jvp",
            check: contact_force_jvp_check,
        },
        Rung {
            name: "contact::contact_force_vjp",
            check: contact_force_vjp_check,
        },
    ]);
    out
}

/// Fixed numbers between −`size` and `size`, without the linear relations that samples of a sine
/// have.
fn numbers<const N: usize>(seed: usize, size: f64) -> [f64; N] {
    std::array::from_fn(|i| {
        let x = 43758.545 * (12.9898 * (i + 50 * seed) as f64 + 1.0).sin();
        size * (2.0 * (x - x.floor()) - 1.0)
    })
}

/// The worst of several checks.
fn all(outcomes: impl IntoIterator<Item = Outcome>) -> Outcome {
    outcomes
        .into_iter()
        .reduce(Outcome::worst)
        .expect("at least one check")
}

/// `bar · f(x)` against the cotangent `x_bar`.
fn pulled_back<const N: usize>(
    f: impl Fn(&[f64]) -> f64,
    x: &[f64; N],
    x_bar: &[f64],
    corruption: f64,
) -> Outcome {
    let dx = numbers::<N>(9, 0.3);
    let slope = corruption * dot(x_bar, &dx);
    outcome(|x| vec![f(x)], x, &dx, &[slope], TOLERANCE)
}

fn exp_matrix_check(corruption: f64) -> Outcome {
    let bar = Mat3::from_row_slice(&numbers::<9>(1, 1.0));
    all(ANGLES.map(|angle| {
        let theta = angle * Vec3::new(0.36, -0.48, 0.8);
        let x_bar = exp_matrix_vjp(&theta, &bar);
        pulled_back::<3>(
            |x| exp_matrix(&Vec3::from_column_slice(x)).dot(&bar),
            &theta.into(),
            x_bar.as_slice(),
            corruption,
        )
    }))
}

fn exp_jacobian_inverse_check(corruption: f64) -> Outcome {
    let (omega, bar) = (Vec3::from(numbers(2, 1.0)), Vec3::from(numbers(3, 1.0)));
    all(ANGLES.map(|angle| {
        let theta = angle * Vec3::new(0.36, -0.48, 0.8);
        let x_bar = exp_jacobian_inverse_vjp(&theta, &omega, &bar);
        pulled_back::<3>(
            |x| (exp_jacobian_inverse(&Vec3::from_column_slice(x)) * omega).dot(&bar),
            &theta.into(),
            x_bar.as_slice(),
            corruption,
        )
    }))
}

/// Mass and inertia, in which the value is linear.
fn spatial_inertia_check(corruption: f64) -> Outcome {
    let center = Vec3::new(0.2, -0.1, 0.4);
    let bar = Mat6::from_row_slice(&numbers::<36>(4, 1.0));
    let (mass_bar, inertia_bar) = spatial_inertia_vjp(&center, &bar);
    let inertia = [0.7, 0.9, 1.1, 0.1, -0.05, 0.02];
    let mass = pulled_back::<1>(
        |x| spatial_inertia(x[0], &center, &inertia).dot(&bar),
        &[2.5],
        &[mass_bar],
        corruption,
    );
    let turning = pulled_back::<6>(
        |x| spatial_inertia(2.5, &center, &std::array::from_fn(|k| x[k])).dot(&bar),
        &inertia,
        &inertia_bar,
        corruption,
    );
    mass.worst(turning)
}

fn surface() -> Vec<Element> {
    (0..10)
        .map(|k| {
            let a = k as f64;
            let normal = Vec3::new(a.sin(), (1.3 * a).cos(), 0.4 - 0.1 * a).normalize();
            Element {
                center: normal * 0.7 + Vec3::new(0.1, -0.2, 0.05 * a),
                normal,
                area: 0.3 + 0.02 * a,
            }
        })
        .collect()
}

const NU: [f64; 6] = [0.9, -0.8, 0.5, 0.4, 0.3, -0.2];

fn quadratic_drag_jvp_check(corruption: f64) -> Outcome {
    let (surface, dnu) = (surface(), numbers::<6>(5, 0.1));
    all(PARTS.map(|part| {
        let jvp = quadratic_drag_jvp(&surface, part, &Vec6::from(NU), &Vec6::from(dnu));
        let value = |x: &[f64]| {
            quadratic_drag(&surface, part, &Vec6::from_column_slice(x))
                .as_slice()
                .to_vec()
        };
        let jvp = corruption * jvp;
        outcome(value, &NU, &dnu, jvp.as_slice(), TOLERANCE)
    }))
}

fn quadratic_drag_vjp_check(corruption: f64) -> Outcome {
    let (surface, bar) = (surface(), Vec6::from(numbers(6, 1.0)));
    all(PARTS.map(|part| {
        let x_bar = quadratic_drag_vjp(&surface, part, &Vec6::from(NU), &bar);
        pulled_back::<6>(
            |x| quadratic_drag(&surface, part, &Vec6::from_column_slice(x)).dot(&bar),
            &NU,
            x_bar.as_slice(),
            corruption,
        )
    }))
}

/// Gap, weight, normal, velocity, stiffness, dissipation and friction in one row: setting in, pressed, sticking,
/// sliding, and parting near the speed at which nothing presses.
const CONTACTS: [[f64; 11]; 4] = [
    [0.021, 0.8, 0.36, -0.48, 0.8, 0.3, 0.2, -0.1, 3e3, 0.4, 0.6],
    [
        0.008, 1.0, 0.36, -0.48, 0.8, 0.02, -0.01, -0.03, 3e3, 0.4, 0.6,
    ],
    [-0.03, 1.0, 0.6, 0.0, 0.8, -0.9, 0.4, -0.3, 3e3, 0.4, 0.6],
    [-0.08, 0.5, 0.6, 0.0, 0.8, 0.9, 0.1, 2.2, 3e3, 0.5, 0.2],
];

fn contact(x: &[f64]) -> (Law, Meeting) {
    let law = Law {
        stiffness: x[8],
        dissipation: x[9],
        friction: x[10],
        stiction_speed: 0.05,
        gap: 0.02,
        width: 5e-3,
        horizon: 0.01,
    };
    let meeting = Meeting {
        gap: x[0],
        weight: x[1],
        normal: Vec3::new(x[2], x[3], x[4]),
        velocity: Vec3::new(x[5], x[6], x[7]),
    };
    (law, meeting)
}

fn contact_force_jvp_check(corruption: f64) -> Outcome {
    all(CONTACTS.map(|x| {
        let (law, meeting) = contact(&x);
        let (at, du) = (meeting.velocity, numbers::<3>(7, 0.01));
        let value = |u: &[f64]| {
            let meeting = Meeting {
                velocity: Vec3::from_column_slice(u),
                ..meeting
            };
            contact_force(&law, &meeting).as_slice().to_vec()
        };
        let jvp = corruption * contact_force_jvp(&law, &meeting, &Vec3::from(du));
        outcome(value, &[at.x, at.y, at.z], &du, jvp.as_slice(), TOLERANCE)
    }))
}

fn contact_force_vjp_check(corruption: f64) -> Outcome {
    let bar = Vec3::from(numbers(8, 1.0));
    all(CONTACTS.map(|x| {
        let (law, meeting) = contact(&x);
        let b = contact_force_vjp(&law, &meeting, &bar);
        let (n, u) = (b.normal, b.velocity);
        let bars = [
            b.gap,
            b.weight,
            n.x,
            n.y,
            n.z,
            u.x,
            u.y,
            u.z,
            b.stiffness,
            b.dissipation,
            b.friction,
        ];
        // In units of each argument's own size.
        let size = [0.01, 0.1, 0.1, 0.1, 0.1, 0.01, 0.01, 0.01, 1e3, 0.1, 0.1];
        let scaled: [f64; 11] = std::array::from_fn(|i| bars[i] * size[i]);
        let value = |y: &[f64]| {
            let row: [f64; 11] = std::array::from_fn(|i| x[i] + size[i] * y[i]);
            let (law, meeting) = contact(&row);
            contact_force(&law, &meeting).dot(&bar)
        };
        pulled_back::<11>(value, &[0.0; 11], &scaled, corruption)
    }))
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_rung_passes_and_fails_when_corrupted() {
        for rung in super::rungs() {
            let right = (rung.check)(1.0);
            println!("{} {right:?}", rung.name);
            assert!(right.passes(), "{} {right:?}", rung.name);
            let wrong = (rung.check)(1.01);
            assert!(!wrong.passes(), "{} {wrong:?}", rung.name);
        }
    }
}
