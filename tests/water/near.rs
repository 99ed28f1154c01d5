//! Gaps under what a body resolves everywhere, resolved where its faces are refined.

use hydrograd::scene::{Body, Fluid, Scene, Shape};
use hydrograd::simulate::{Fidelity, Method, Settings, Simulator};
use nalgebra::DMatrix;

/// Width of the gap between the coin and the plate, m.
const GAP: f64 = 0.02;

/// A coin lies `GAP` over a plate, off its middle, tilted; faces refined to `edge` on both where they come near one another.
fn scene(edge: Option<f64>) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    let mut plate = Body::new(Shape::cuboid([1.0, 1.0, 0.2]).faces(720)).named("plate");
    let mut coin = Body::new(Shape::ellipsoid([0.15, 0.15, 0.05]).faces(500)).named("coin");
    if let Some(edge) = edge {
        plate = plate.refine([0.2, 0.1, 0.1], 0.22, edge);
        coin = coin.refine([0.0; 3], 0.2, edge);
    }
    let height = 0.1 + GAP + f64::hypot(0.15 * 0.2_f64.sin(), 0.05 * 0.2_f64.cos());
    scene.add(plate.density(998.0));
    scene.add(
        coin.density(998.0)
            .at([0.2, 0.1, height])
            .rotated([0.2, 0.0, 0.0]),
    );
    scene
}

fn simulator(scene: &Scene, settings: Settings) -> Simulator {
    Simulator::new(scene, settings).unwrap()
}

/// Largest |ΔM_ij| / √(M_ii M_jj), of the coin's block alone and of all.
fn errors(m: &DMatrix<f64>, exact: &DMatrix<f64>) -> [f64; 2] {
    let error = |i: usize, j: usize| {
        (m[(i, j)] - exact[(i, j)]).abs() / (exact[(i, i)] * exact[(j, j)]).sqrt()
    };
    // The spin of the coin about its axis moves no water.
    let moves = |i: &usize| *i != 11;
    let largest = |from: usize| {
        let of = |i: usize| {
            (from..12)
                .filter(moves)
                .map(move |j| error(i, j))
                .fold(0.0, f64::max)
        };
        (from..12).filter(moves).map(of).fold(0.0, f64::max)
    };
    [largest(6), largest(0)]
}

#[test]
fn a_coin_near_a_plate() {
    let panels = Settings::default()
        .fidelity(Fidelity::Full)
        .method(Method::Panel);
    let of = |edge, settings| {
        simulator(&scene(edge), settings)
            .added_mass()
            .unwrap()
            .matrix
    };
    let [coarse, fine] = [0.04, 0.02].map(|edge| of(Some(edge), panels.clone()));
    let exact = &fine + (&fine - &coarse) / 3.0;
    let reduced = Settings::default().fidelity(Fidelity::Reduced).films(false);
    let even = errors(&of(None, reduced.clone()), &exact);
    let near = errors(&of(Some(0.04), reduced), &exact);
    println!(
        "coin, all: panels of 0.04 {:.4?}, reduced {even:.4?}, with refined regions {near:.4?}",
        errors(&coarse, &exact)
    );
    assert!(near[1] < 0.02 && even[1] > 0.1, "{near:?} {even:?}");
}

#[test]
fn where_it_is_resolved() {
    let warning = |scene: &Scene| {
        let settings = Settings::default().fidelity(Fidelity::Reduced).films(false);
        simulator(scene, settings).start_gap_warning()
    };
    assert!(warning(&scene(None)).is_some());
    assert_eq!(warning(&scene(Some(0.036))), None);
    // Half a gap isn't resolved there, and none beside the region.
    let mut nearer = scene(Some(0.036));
    nearer.bodies[1].placement.position[2] -= 0.5 * GAP;
    assert!(warning(&nearer).is_some());
    let mut beside = scene(Some(0.036));
    beside.bodies[1].placement.position[0] = -0.3;
    let said = warning(&beside).unwrap();
    assert!(said.contains("plate") && said.contains("coin"), "{said}");
}

/// A box over a box, and over a wall: fundamental solutions lose the water between them as it closes, and at these gaps refuse or give a force of the right
/// sign. Box over box it turns at 0.27 m, and is refused below 0.225.
#[test]
fn no_force_of_the_wrong_sign_between_flat_faces() {
    for wall in [false, true] {
        for gap in [0.3, 0.22, 0.18, 0.14, 0.1, 0.07, 0.05, 0.02] {
            // As far from its image as from the other box.
            let gap = if wall { 0.5 * gap } else { gap };
            let along = |gap: f64| -> hydrograd::Result<f64> {
                let mut scene = Scene::new(Fluid::fresh_water());
                let brick = || Body::new(Shape::cuboid([1.0, 1.0, 0.5]).faces(1280)).density(998.0);
                match wall {
                    true => scene.add_wall([0.0; 3], [0.0, 0.0, 1.0]),
                    false => _ = scene.add(brick().at([0.0, 0.0, -0.25])),
                }
                scene.add(brick().at([0.0, 0.0, 0.25 + gap]));
                let settings = Settings::default().fidelity(Fidelity::Full);
                let simulator = Simulator::new(&scene, settings.method(Method::MfsVertex))?;
                let m = simulator.added_mass()?.matrix;
                let last = m.nrows() - 4;
                Ok(m[(last, last)] / 998.0)
            };
            let step = 0.02 * gap;
            match (along(gap - step), along(gap + step)) {
                (Ok(near), Ok(far)) => {
                    let slope = (far - near) / (2.0 * step);
                    println!("wall {wall}, gap {gap}: slope {slope:.4}");
                    assert!(slope < 0.0, "wall {wall}, gap {gap}: {slope}");
                    assert!(gap > 0.1, "wall {wall}, gap {gap}");
                }
                (near, far) => {
                    let said = near.or(far).unwrap_err().to_string();
                    println!("wall {wall}, gap {gap}: refused");
                    assert!(
                        said.contains("flat gap in m") && said.contains("edges"),
                        "{said}"
                    );
                }
            }
        }
    }
}
