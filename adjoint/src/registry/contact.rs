//! Checks of the law of contact.

use super::{TOLERANCE, all, array, transposed};
use crate::check::{Outcome, outcome};
use crate::contact::{
    Law, PointState, Push, Rates, contact_force, contact_force_jvp, contact_force_vjp,
};
use crate::lie::Vec3;

/// Gap, weight, normal, velocity, stiffness, dissipation and friction in one row: setting in, pressed, sticking,
/// sliding, and parting near the speed at which nothing presses.
const CONTACTS: [[f64; 11]; 4] = [
    [0.021, 0.8, 0.36, -0.48, 0.8, 0.3, 0.2, -0.1, 3e3, 0.4, 0.6],
    [
        0.008, 1.0, 0.8, 0.36, -0.48, -0.03, 0.02, -0.01, 3e3, 0.4, 0.6,
    ],
    [-0.03, 1.0, 0.6, 0.0, 0.8, -0.9, 0.4, -0.3, 3e3, 0.4, 0.6],
    [-0.08, 0.5, 0.0, 0.6, 0.8, 0.1, 0.9, 2.2, 3e3, 0.5, 0.2],
];

/// How the body turns, and torsional and rolling friction: each with each of [`CONTACTS`].
const TURNING: [[f64; 5]; 4] = [
    [0.3, -0.7, 0.4, 0.03, 0.05],
    [-0.02, 0.01, 0.03, 0.1, 0.02],
    [0.0, 0.0, 0.0, 0.04, 0.01],
    [0.1, 0.2, -0.1, 0.02, 0.03],
];

/// Numbers of a contact: those of [`CONTACTS`], then of [`TURNING`].
const NUMBERS: usize = 16;

fn contacts() -> Vec<[f64; NUMBERS]> {
    let joined = |(x, y): ([f64; 11], [f64; 5])| {
        std::array::from_fn(|i| if i < 11 { x[i] } else { y[i - 11] })
    };
    let each = CONTACTS
        .into_iter()
        .flat_map(|x| TURNING.map(|y| (x, y)))
        .map(joined);
    each.collect()
}

fn three(x: &[f64]) -> Vec3 {
    Vec3::from_column_slice(&x[..3])
}

fn contact(x: &[f64]) -> (Law, PointState) {
    let law = Law {
        stiffness: x[8],
        dissipation: x[9],
        friction: x[10],
        torsional_friction: x[14],
        rolling_friction: x[15],
        stiction_speed: 0.05,
        stiction_spin: 0.2,
        gap: 0.02,
        width: 5e-3,
        horizon: 0.01,
    };
    let point_state = PointState {
        gap: x[0],
        weight: x[1],
        normal: three(&x[2..]),
        rates: Rates {
            velocity: three(&x[5..]),
            spin: three(&x[11..]),
        },
    };
    (law, point_state)
}

fn pushed(push: &Push) -> Vec<f64> {
    push.force.iter().chain(&push.torque).copied().collect()
}

pub(super) fn contact_force_jvp_check(corruption: f64) -> Outcome {
    all(contacts().into_iter().flat_map(|x| {
        let (law, point_state) = contact(&x);
        let at = point_state.rates;
        let value = |u: &[f64]| {
            let rates = Rates {
                velocity: three(u),
                spin: three(&u[3..]),
            };
            pushed(&contact_force(
                &law,
                &PointState {
                    rates,
                    ..point_state
                },
            ))
        };
        let along = |d: [f64; 6]| {
            let rates = Rates {
                velocity: three(&d),
                spin: three(&d[3..]),
            };
            let jvp = pushed(&contact_force_jvp(&law, &point_state, &rates));
            let jvp: Vec<f64> = jvp.iter().map(|x| corruption * x).collect();
            let (u, w) = (at.velocity, at.spin);
            let start = [u.x, u.y, u.z, w.x, w.y, w.z];
            outcome(value, &start, &d, &jvp, TOLERANCE)
        };
        (70..78)
            .map(|seed| along(array(seed, 0.01)))
            .collect::<Vec<_>>()
    }))
}

pub(super) fn contact_force_vjp_check(corruption: f64) -> Outcome {
    all(contacts().into_iter().map(|x| {
        let (law, point_state) = contact(&x);
        // In units of each argument's own size.
        let mut size = [0.01; NUMBERS];
        size[1..5].fill(0.1);
        size[8..11].copy_from_slice(&[1e3, 0.1, 0.1]);
        let value = |y: &[f64]| {
            let row: [f64; NUMBERS] = std::array::from_fn(|i| x[i] + size[i] * y[i]);
            let (law, point_state) = contact(&row);
            pushed(&contact_force(&law, &point_state))
        };
        let bars = |bar: &[f64]| {
            let bar = Push {
                force: three(bar),
                torque: three(&bar[3..]),
            };
            let b = contact_force_vjp(&law, &point_state, &bar);
            let mut bars = vec![b.gap, b.weight];
            bars.extend(b.normal.iter().chain(&b.rates.velocity));
            bars.extend([b.stiffness, b.dissipation, b.friction]);
            bars.extend(&b.rates.spin);
            bars.extend([b.torsional_friction, b.rolling_friction]);
            bars.iter().zip(size).map(|(b, size)| b * size).collect()
        };
        transposed::<NUMBERS>(value, &[0.0; NUMBERS], bars, corruption)
    }))
}
