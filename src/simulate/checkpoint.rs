//! Where a run stands, so that it can go on: to the bit, in another process.

use super::Simulator;
use crate::dynamics::State;
use crate::scene::Scene;
use crate::{Error, Result};
use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

/// A state between two steps, and what it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// Digest of version, scene (but for its number of steps, and with what is in the files of meshes in place of their paths) and choices.
    key: String,
    /// Steps made.
    step: usize,
    /// Joint coordinates, as in [`State`].
    q: Vec<f64>,
    /// The conserved variable.
    y: Vec<f64>,
    /// Joints held in the last step.
    held: Vec<bool>,
    /// What the controller remembers.
    mode: usize,
}

impl Simulator {
    /// What goes with a state of this simulator.
    ///
    /// # Errors
    /// A scene that can't be written as TOML, or the file of a mesh that can't be read.
    pub fn checkpoint(&self, state: &State) -> Result<Checkpoint> {
        Ok(Checkpoint {
            key: self.key()?,
            step: state.step,
            q: state.q.as_slice().to_vec(),
            y: state.y.as_slice().to_vec(),
            held: state.held.clone(),
            mode: state.mode,
        })
    }

    /// The state of a checkpoint of this scene with these choices, `place` being where it was found. The scene's own controller and
    /// parameters are taken to be those that it was made with.
    ///
    /// # Errors
    /// A checkpoint of another scene, version or other choices; sizes or values that no state has.
    pub fn resume(&self, checkpoint: &Checkpoint, place: &str) -> Result<State> {
        let wrong = |what: &str, value: String, right: String| {
            Error::input(format!("{place}: state: {what}"), value, right)
        };
        let Checkpoint { q, y, held, .. } = checkpoint;
        if checkpoint.key != self.key()? {
            return Err(wrong(
                "key",
                checkpoint.key.chars().take(12).collect(),
                "is of another scene, version of hydrograd, or other settings; run from the start"
                    .into(),
            ));
        }
        let velocities = self.system().tree.velocities();
        let [bodies, given] = [self.system().len(), held.len()];
        if y.len() != velocities || !(given == 0 || given == bodies) {
            return Err(wrong(
                "momenta and held joints",
                format!("{} and {given} numbers", y.len()),
                format!("must be {velocities} and {bodies}"),
            ));
        }
        if let Some(x) = y.iter().find(|x| !x.is_finite()) {
            return Err(wrong("momenta", x.to_string(), "must be finite".into()));
        }
        let (q, y) = (DVector::from_column_slice(q), DVector::from_column_slice(y));
        self.check_start(checkpoint.step, &q, &DVector::zeros(velocities))?;
        Ok(State {
            step: checkpoint.step,
            q,
            y,
            held: held.clone(),
            mode: checkpoint.mode,
        })
    }

    fn key(&self) -> Result<String> {
        let mut scene = Scene::clone(&self.scene);
        scene.steps = 0;
        self.mesh_files.put_into(&mut scene)?;
        let mut digest = Sha256::new();
        digest.update(env!("CARGO_PKG_VERSION"));
        digest.update(scene.to_toml()?);
        // Choices are plain data: they always serialise.
        digest.update(serde_json::to_vec(&self.choices).unwrap_or_default());
        Ok(format!("{:x}", digest.finalize()))
    }
}
