use hydrograd::{Body, Controls, Fluid, Joint, Scene, Settings, Shape, Simulator, objective};

fn main() -> hydrograd::Result<()> {
    // A ball on a rail beside a free coin, both as dense as the still water around them.
    let mut scene = Scene::new(Fluid::fresh_water());
    let rail = Joint::Prismatic { axis: [1.0, 0.0, 0.0] };
    scene.add(Body::new(Shape::sphere(0.05)).density(998.0).at([-0.15, 0.0, 0.0]).joint(rail).actuated());
    let coin = scene.add(Body::new(Shape::ellipsoid([0.01, 0.04, 0.04])).density(998.0));

    // 100 steps of 0.01 s; one control, the force on the ball along its rail (N).
    let sim = Simulator::new(&scene, Settings::default().time_step(0.01).faces(80))?;
    let mut push = Controls::zeros(&sim, 100);

    // The coin shall end 2 cm from where it lies, and the pushing shall be gentle.
    let goal = objective::final_position(coin, [0.01, 0.0, 0.0]) + objective::effort(1e-8);
    for iteration in 0..8 {
        let rollout = sim.rollout(&push)?;
        let (cost, gradient) = (rollout.value(&goal), rollout.gradient(&goal)?.controls);
        let ball = rollout.samples()[100].poses[0].translation.x;
        let x = rollout.samples()[100].poses[1].translation;
        println!("{iteration}: cost {cost:.3e}, |gradient| {:.3e} ball {ball} coin {x:?}", gradient.norm());
        // Polyak's step: as far as the cost would reach zero if it were linear.
        let step = cost / gradient.norm_squared();
        push = Controls::from_matrix(&sim, push.matrix() - step * gradient)?;
    }
    Ok(())
}
