//! Trajectories that runs go on from.

use super::engine::{Answer, fuzz, root};
use hydrograd::simulate::{Earlier, Recording};
use hydrograd::{Controls, Fidelity, Scene, Settings, Simulator};

#[test]
fn trajectories_hold() {
    let folder = tempfile::tempdir().unwrap();
    // With a controller that remembers, joints that are held, and a turning body.
    let mut scene = Scene::load(root().join("examples/scenes/falling_ball.toml")).unwrap();
    scene.set_faces(20);
    let settings = Settings::default().fidelity(Fidelity::Isolated);
    let simulator = Simulator::new(&scene, settings).unwrap();
    let rollout = |steps| {
        simulator
            .rollout(&Controls::zeros(&simulator, steps))
            .unwrap()
    };
    let written = Recording::of(&scene, &rollout(2))
        .unwrap()
        .write(folder.path())
        .unwrap();
    let [_, file] = written;
    let whole = std::fs::read(&file).unwrap();
    let go_on = |input: &[u8]| -> hydrograd::Result<bool> {
        std::fs::write(&file, input).unwrap();
        let earlier = Earlier::read(&file)?;
        let state = simulator.resume(earlier.state(), "trajectory")?;
        let controls = Controls::zeros(&simulator, 1);
        let ran =
            simulator.rollout_as_far(&state, &controls, |_| std::ops::ControlFlow::Continue(()));
        let ran = ran.map_err(|halted| halted.error)?;
        let mut recording = Recording::of(&scene, &ran)?;
        earlier.put_before(&mut recording)?;
        let last = &ran.samples()[1];
        Ok(last.q.iter().chain(&last.v).all(|x| x.is_finite())
            && recording
                .observables
                .iter()
                .all(|o| o.values.len() == recording.time.len()))
    };
    fuzz("trajectory", vec![whole], 4_000, |input| {
        match go_on(input) {
            Ok(true) => Answer::Taken(String::new()),
            Ok(false) => {
                Answer::Wrong("numbers that aren't finite, or rows that are missing".into())
            }
            Err(error) => Answer::Refused(error.to_string()),
        }
    });
}
