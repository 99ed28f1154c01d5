//! What may be asked of a coupling: a pose and six rows for each body, whatever the fidelity.

use crate::support::{mesh, says};
use hydrograd::Error;
use hydrograd::adjoint::lie::{Mat3, Mat6, Pose, Vec3};
use hydrograd::boundary::{BodyBoundary, ExactBoundary, MfsSettings, PanelBoundary};
use hydrograd::coupling::full::{Full, SolveSettings};
use hydrograd::coupling::reduced::{Reduced, compress};
use hydrograd::coupling::scattering::{Levels, Scattering};
use hydrograd::coupling::{
    Exclusions, ExtrapolatedPanels, Given, Isolated, Linearise, PanelCoupled,
};
use hydrograd::scene::Shape;
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;

fn at(x: f64) -> Pose {
    Pose::new(Mat3::identity(), Vec3::new(x, 0.0, 0.0))
}

/// Of two equal bodies.
fn both<T>(body: Arc<T>) -> Vec<Arc<T>> {
    vec![body.clone(), body]
}

/// Two balls by every fidelity.
fn couplings() -> Vec<Box<dyn Linearise>> {
    let surface = mesh(&Shape::sphere(1.0), 320);
    let sources = BodyBoundary::new("ball", &surface, &MfsSettings::default()).unwrap();
    let panels = Arc::new(PanelBoundary::new("ball", &surface).unwrap());
    let exact = ExactBoundary::new("ball", [1.0; 3], &Pose::identity(), 0.3).unwrap();
    let settings = compress::CompressSettings {
        rank: None,
        tolerance: 0.03,
        resolved_gap: Some(0.3),
    };
    let compressed = compress::compress("ball", &surface, &exact, &settings, &[]).unwrap();
    let (none, solve) = (Exclusions::none(), SolveSettings::default());
    let coupled = || {
        let bodies = vec![panels.clone(); 2];
        PanelCoupled::new(bodies, &[], none.clone(), solve).unwrap()
    };
    let filmed = coupled().with_films(&[(&surface, None), (&surface, None)], &[]);
    let reduced = Reduced::new(both(Arc::new(compressed)), &[], |_, _| None).unwrap();
    let levels = Levels::for_accuracy(0.01).unwrap();
    let many = Scattering::of(&reduced, &[at(0.0), at(3.0)], levels).unwrap();
    let full = Full::new(both(Arc::new(sources)), &[], none.clone(), solve);
    vec![
        Box::new(Isolated::new(vec![Mat6::identity(); 2])),
        Box::new(full.unwrap()),
        Box::new(coupled()),
        Box::new(ExtrapolatedPanels::new(coupled(), coupled(), 2.0).unwrap()),
        Box::new(filmed.unwrap()),
        Box::new(Given::new(Box::new(coupled()), vec![Mat6::zeros(); 2]).unwrap()),
        Box::new(reduced),
        Box::new(many),
    ]
}

#[test]
fn other_numbers_of_poses_and_rows_are_refused() {
    let places = [at(0.0), at(3.0), at(6.0)];
    let all = DMatrix::identity(12, 12);
    for coupling in couplings() {
        let name = coupling.name();
        assert!(coupling.linearise(&places[..2], &all).is_ok(), "{name}");
        for (poses, rows) in [(1, 12), (3, 12), (2, 6), (2, 11), (2, 18)] {
            let basis = DMatrix::identity(rows, 2);
            let asked = [
                coupling.evaluate(&places[..poses], &basis).map(|_| ()),
                coupling.linearise(&places[..poses], &basis).map(|_| ()),
            ];
            for error in asked.map(|found| found.err().unwrap()) {
                assert!(matches!(error, Error::Input { .. }), "{error}");
                let given = format!("{poses} poses, {rows} rows");
                says(error, &[name, given.as_str(), "2 bodies"]);
            }
        }
        // Of fidelities that have them.
        let flow = coupling.velocity(&places[..1], &DVector::zeros(12), &[Vec3::repeat(9.0)]);
        assert!(
            matches!(flow, Ok(None) | Err(Error::Input { .. })),
            "{name}"
        );
        let films = coupling.film_momenta(&places[..1], &all);
        assert!(
            matches!(films, Ok(None) | Err(Error::Input { .. })),
            "{name}"
        );
    }
}
