//! Which configurations of a scene the trade-off compares, and scenes in which there is nothing to compare.

use hydrograd::dynamics::Integrator;
use hydrograd::simulate::Method;
use hydrograd::tradeoff::{Configuration, Family, TradeoffSettings, configurations};
use hydrograd::{Body, Fidelity, Fluid, Scene, Shape};

fn scene(shapes: &[Shape]) -> Scene {
    let mut scene = Scene::new(Fluid::fresh_water());
    for shape in shapes {
        scene.add(Body::new(shape.clone()).density(998.0));
    }
    scene
}

fn of(plan: &[Configuration], fidelity: Fidelity, family: Family) -> Vec<Configuration> {
    let fits = |c: &&Configuration| (c.fidelity, c.family) == (fidelity, family);
    plan.iter().filter(fits).copied().collect()
}

#[test]
fn configurations_are_distinct_and_bases_come_first() {
    for shapes in [
        vec![Shape::sphere(1.0)],
        vec![Shape::cuboid([1.0; 3])],
        vec![Shape::sphere(1.0), Shape::cuboid([1.0; 3])],
    ] {
        let plan = configurations(&scene(&shapes), &TradeoffSettings::default()).unwrap();
        assert!(plan[..4].iter().all(|c| c.family == Family::Base));
        assert!(plan[4..].iter().all(|c| c.family != Family::Base));
        for (i, c) in plan.iter().enumerate() {
            let label = c.label();
            assert!(plan[..i].iter().all(|d| d.label() != label), "{label}");
        }
    }
}

#[test]
fn methods_without_a_difference_are_one() {
    let methods = |shapes: &[Shape]| -> Vec<Method> {
        let plan = configurations(&scene(shapes), &TradeoffSettings::default()).unwrap();
        let families = [Family::Base, Family::Method];
        let reduced = families.map(|f| of(&plan, Fidelity::Reduced, f)).concat();
        reduced.iter().map(|c| c.method).collect()
    };
    let sphere = Shape::sphere(1.0);
    let cube = Shape::cuboid([1.0; 3]);
    let all = [
        Method::Exact,
        Method::Panel,
        Method::MfsVertex,
        Method::MfsFace,
    ];
    assert_eq!(methods(std::slice::from_ref(&sphere)), all);
    assert_eq!(methods(std::slice::from_ref(&cube)), all[1..]);
    assert_eq!(methods(&[sphere, cube])[0], Method::Auto);
}

#[test]
fn first_values_are_the_base() {
    let settings = TradeoffSettings {
        fidelities: vec![Fidelity::Reduced, Fidelity::Full],
        methods: vec![Method::Exact, Method::MfsFace],
        faces: vec![320, 80],
        ranks: vec![20, 40],
        tolerances: vec![1e-6],
        integrators: vec![Integrator::Rk4],
        time_steps: vec![0.02, 0.01],
        ..TradeoffSettings::default()
    };
    let plan = configurations(&scene(&[Shape::sphere(1.0)]), &settings).unwrap();
    let reduced = plan[0];
    assert_eq!(reduced.method, Method::Exact);
    assert_eq!(reduced.faces_per_body, Some(320));
    assert_eq!((reduced.rank, reduced.accuracy), (Some(20), None));
    assert_eq!(reduced.time_step, 0.02);
    // Full takes the first method that it can step with; what it can't follows as a row of its own.
    let full = plan[1];
    assert_eq!(full.method, Method::MfsFace);
    assert_eq!(full.tolerance, Some(1e-6));
    let methods = of(&plan, Fidelity::Full, Family::Method);
    assert_eq!(methods.len(), 1);
    assert_eq!(methods[0].method, Method::Exact);
    let steps = of(&plan, Fidelity::Reduced, Family::TimeStep);
    assert_eq!(steps.len(), 1);
    let as_long = Configuration {
        family: Family::Base,
        time_step: reduced.time_step,
        ..steps[0]
    };
    assert!(steps[0].time_step != reduced.time_step && as_long == reduced);
    assert!(plan.iter().all(|c| c.integrator == Integrator::Rk4));
}

#[test]
fn product_has_every_combination_once() {
    let settings = TradeoffSettings {
        fidelities: vec![Fidelity::Reduced],
        methods: vec![Method::Panel, Method::MfsVertex],
        faces: vec![80, 320],
        ranks: vec![20, 40],
        accuracies: vec![1e-2],
        integrators: vec![Integrator::Rk2, Integrator::Rk4],
        time_steps: vec![0.01, 0.02, 0.04],
        full_product: true,
        ..TradeoffSettings::default()
    };
    let plan = configurations(&scene(&[Shape::sphere(1.0)]), &settings).unwrap();
    assert_eq!(plan.len(), 2 * 2 * 3 * 2 * 3);
}

#[test]
fn scenes_without_anything_to_compare_are_refused() {
    let mut scene = scene(&[Shape::sphere(1.0)]);
    let settings = TradeoffSettings::default();
    assert!(configurations(&scene, &settings).is_ok());
    let refused = |scene: &Scene| configurations(scene, &settings).unwrap_err().to_string();
    let water = std::mem::replace(&mut scene.fluid, Fluid::none());
    assert!(refused(&scene).contains("fluid.density"));
    scene.fluid = water;
    scene.bodies[0].locked = true;
    assert!(refused(&scene).contains("joints"));
}
