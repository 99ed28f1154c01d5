//! The transpose of the flow's potentials on surfaces, and of their rates, with every fidelity.

use super::coupling::{
    displaced, extrapolated_panels, field, filmed_panels, given_systems, isolated, panel_systems,
    panels, poses, reduced_systems, scattering_between_walls, scattering_systems, systems,
};
use super::tools::{Group, all, groups, wavy};
use hydrograd::adjoint::check::{Outcome, Rung};
use hydrograd::adjoint::lie::Vec6;
use hydrograd::coupling::{Coupling, Motion, SurfacePotential};

pub fn rungs() -> Vec<Rung> {
    macro_rules! rungs {
        ($($name:literal => $check:expr),* $(,)?) => {
            vec![$(Rung { name: $name, check: $check }),*]
        };
    }
    rungs![
        "coupling::isolated::Isolated::surface_potentials_vjp" => |c| vjp(&isolated(), c),
        "coupling::panel::PanelCoupled::surface_potentials_vjp" => |c| all(panel_systems().iter().map(|s| vjp(s, c))),
        "coupling::panel::extrapolated::ExtrapolatedPanels::surface_potentials_vjp" => |c| vjp(&extrapolated_panels(), c),
        "coupling::reduced::linearised::Reduced::surface_potentials_vjp" => |c| all(reduced_systems().iter().map(|s| vjp(s, c))),
        "coupling::scattering::linearised::Scattering::surface_potentials_vjp" => |c| all(scattering_systems()[..3].iter().chain(&[scattering_between_walls()]).map(|s| vjp(s, c))),
        "coupling::full::Full::surface_potentials_vjp" => |c| all(systems().iter().map(|s| vjp(s, c))),
        "coupling::given::Given::surface_potentials_vjp" => |c| vjp(&given_systems()[0], c),
    ]
}

/// Twists, rates, displacement and poses, each by itself: each moves values and rates.
fn vjp(s: &dyn Coupling, c: f64) -> Outcome {
    let own = s.surfaces().map(<[_]>::to_vec);
    let surfaces = own.unwrap_or_else(|| panels(80));
    let (twists, rates, z) = (wavy(12, 0.3, 1.0), wavy(12, 1.6, 1.0), field(2.1));
    let bars: Vec<SurfacePotential> = (surfaces.iter().zip([3.2, 4.3]))
        .map(|(surface, phase)| SurfacePotential {
            value: wavy(surface.faces.len(), phase, 1.0).as_slice().to_vec(),
            rate: wavy(surface.faces.len(), phase + 0.5, 1.0)
                .as_slice()
                .to_vec(),
            film: None,
        })
        .collect();
    let (moved, dz) = (field(5.4), field(6.5));
    let (dt, dr) = (wavy(12, 7.6, 0.3), wavy(12, 8.7, 0.3));
    let value = |[pose, twist, rate, place]: [f64; 4]| -> f64 {
        let pairs = z.iter().zip(&dz);
        let displacement: Vec<Vec6> = pairs.map(|(z, d)| z + place * d).collect();
        let found = s.surface_potentials(
            &Motion {
                poses: &displaced(&moved, pose),
                twists: &(&twists + twist * &dt),
                rates: Some(&(&rates + rate * &dr)),
                displacement: &displacement,
            },
            &surfaces,
        );
        let products = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        (found.unwrap().iter().zip(&bars))
            .map(|(f, bar)| products(&f.value, &bar.value) + products(&f.rate, &bar.rate))
            .sum()
    };
    let motion = Motion {
        poses: &poses(),
        twists: &twists,
        rates: Some(&rates),
        displacement: &z,
    };
    let bar = s.surface_potentials_vjp(&motion, &surfaces, &bars).unwrap();
    let dot = |a: &[Vec6], b: &[Vec6]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
    let value = &value;
    let group = |name, slope, at: usize| Group {
        name,
        slope,
        value: Box::new(move |h| {
            let mut steps = [0.0; 4];
            steps[at] = h;
            value(steps)
        }),
    };
    groups(
        vec![
            group("poses", dot(&bar.poses, &moved), 0),
            group("twists", bar.twists.dot(&dt), 1),
            group("rates", bar.rates.dot(&dr), 2),
            group("displacement", dot(&bar.displacement, &dz), 3),
        ],
        c,
    )
}

/// Where films hold bodies apart there is no flow on surfaces, and no transpose either.
#[test]
fn films_are_refused() {
    let s = &filmed_panels()[0];
    let (twists, z) = (wavy(12, 0.3, 1.0), field(2.1));
    let motion = Motion {
        poses: &poses(),
        twists: &twists,
        rates: None,
        displacement: &z,
    };
    let surfaces = s.surfaces().unwrap();
    let bars = s.surface_potentials_vjp(&motion, surfaces, &[]);
    let text = bars.unwrap_err().to_string();
    assert!(text.contains("film"), "{text}");
}
