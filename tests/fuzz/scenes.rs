//! Scene files: read, checked, written and read again; and the small ones simulated.

use super::engine::{Answer, corpus, files, fuzz, root};
use super::support::INTEGRATORS;
use hydrograd::{Controls, Fidelity, Scene, Settings, Shape, Simulator};
use std::path::PathBuf;

fn scenes() -> Vec<Vec<u8>> {
    let examples = files(&examples());
    examples.into_iter().chain(corpus("scene")).collect()
}

fn examples() -> PathBuf {
    root().join("examples/scenes")
}

/// Where meshes of scenes lie.
fn folder() -> PathBuf {
    root().join("tests/fuzz/corpus/mesh")
}

fn read(input: &[u8]) -> Result<Scene, Answer> {
    let text = String::from_utf8_lossy(input);
    let scene = Scene::from_toml(&text, folder()).map_err(|e| Answer::Refused(e.to_string()))?;
    let checked = scene.validate();
    checked.map_err(|e| Answer::Refused(e.to_string()))?;
    Ok(scene)
}

fn written_and_read(input: &[u8]) -> Answer {
    let scene = match read(input) {
        Ok(scene) => scene,
        Err(answer) => return answer,
    };
    let text = match scene.to_toml() {
        Ok(text) => text,
        Err(error) => return Answer::Refused(error.to_string()),
    };
    match Scene::from_toml(&text, folder()) {
        Ok(again) if again == scene => Answer::Taken(String::new()),
        Ok(_) => Answer::Wrong("a scene reads back as another".into()),
        Err(error) => Answer::Wrong(format!("a scene doesn't read back: {error}")),
    }
}

#[test]
fn scene_files_hold() {
    fuzz("scene", scenes(), 20_000, written_and_read);
}

/// The scene with few faces, or none where that can't be.
fn small(mut scene: Scene) -> Option<Scene> {
    for body in &mut scene.bodies {
        let pieces = body.collision.iter_mut().map(|p| &mut p.shape);
        for shape in body.shape.iter_mut().chain(pieces) {
            shape.set_faces(20);
            if matches!(shape, Shape::Triangles { faces, .. } if faces.len() > 100) {
                return None;
            }
        }
        body.refine.clear();
    }
    (scene.bodies.len() <= 6).then_some(scene)
}

/// Two steps and their gradient, all finite or an error.
fn simulated(input: &[u8]) -> Answer {
    let scene = match read(input) {
        Ok(scene) => scene,
        Err(answer) => return answer,
    };
    let Some(scene) = small(scene) else {
        return Answer::Refused("too large".into());
    };
    // As the input has it: all fidelities and integrators come to be tried.
    let choice = input.iter().fold(0_usize, |sum, b| {
        sum.wrapping_mul(31).wrapping_add(*b as usize)
    });
    let fidelity = match choice % 4 {
        0 | 1 => Fidelity::Isolated,
        2 => Fidelity::Reduced,
        _ => Fidelity::Full,
    };
    let mut settings = Settings::default().fidelity(fidelity);
    if let Some(integrator) = INTEGRATORS.get(choice / 4 % 12) {
        settings = settings.integrator(*integrator);
    }
    match run(&scene, settings) {
        Ok(Some(said)) => Answer::Taken(format!("{fidelity:?} {} {said}", scene.bodies.len())),
        Ok(None) => Answer::Wrong("a number isn't finite, without an error".into()),
        Err(error) => Answer::Refused(error.to_string()),
    }
}

/// The warnings of a run, if all that comes of it is finite.
fn run(scene: &Scene, settings: Settings) -> hydrograd::Result<Option<String>> {
    let simulator = Simulator::new(scene, settings)?;
    let matrix = simulator.added_mass()?;
    let rollout = simulator.rollout(&Controls::zeros(&simulator, 2))?;
    let summary = rollout.summary();
    let mut seed = rollout.zero_cotangents();
    seed.positions.fill(1.0);
    seed.v.fill(0.5);
    let gradient = rollout.vjp(&seed)?;
    let mut numbers: Vec<f64> = matrix.matrix.iter().copied().collect();
    for sample in rollout.samples() {
        numbers.extend(sample.q.iter().chain(&sample.v));
        numbers.extend([sample.kinetic_energy, sample.potential_energy]);
    }
    numbers.extend([
        summary.energy_initial,
        summary.energy_final,
        summary.energy_gain,
    ]);
    numbers.extend(gradient.controls.iter());
    numbers.extend(gradient.initial.q.iter().chain(&gradient.initial.v));
    numbers.extend(gradient.parameters.as_slice());
    let said = [simulator.warnings(), &rollout.warnings()]
        .concat()
        .concat();
    Ok(numbers.iter().all(|x| x.is_finite()).then_some(said))
}

#[test]
fn runs_of_scenes_hold() {
    fuzz("run", scenes(), 250, simulated);
}
