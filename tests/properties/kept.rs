//! Momentum and energy where nothing outside acts.

use crate::scenes::{FIDELITIES, drifting, few, run};
use hydrograd::Fidelity;
use hydrograd::dynamics::Integrator;
use proptest::prelude::*;

proptest! {
    #![proptest_config(few(8))]

    /// By symmetry of the discrete equations: to rounding, with every integrator that steps in momentum.
    #[test]
    fn momentum_is_kept(scene in drifting()) {
        for fidelity in FIDELITIES {
            for integrator in [Integrator::MomentumEuler, Integrator::Midpoint, Integrator::Rk2, Integrator::Rk4] {
                let drift = run(&scene, fidelity, integrator, 10).summary().momentum_drift.unwrap();
                prop_assert!(drift <= 1e-11, "{fidelity:?} {integrator:?}: {drift:e}");
            }
        }
    }

    /// To rounding by the integrator that is made for it, of bodies that feel each other: what a lone body does it leaves as it is. By RK4 to its
    /// order.
    #[test]
    fn energy_is_kept(scene in drifting()) {
        let change = |fidelity, integrator| {
            let summary = run(&scene, fidelity, integrator, 10).summary();
            summary.energy_gain.max(summary.energy_loss) / summary.energy_initial
        };
        for fidelity in FIDELITIES {
            let by_order = change(fidelity, Integrator::Rk4);
            prop_assert!(by_order <= 1e-7, "{fidelity:?}: {by_order:e}");
            if fidelity != Fidelity::Isolated && scene.bodies.len() > 1 {
                let exact = change(fidelity, Integrator::EnergyEuler);
                prop_assert!(exact <= 1e-11, "{fidelity:?}: {exact:e}");
            }
        }
    }
}
