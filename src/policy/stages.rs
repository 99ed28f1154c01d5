//! Constant forces that change as bodies gain speed.

use super::{Action, ActionBar, Observation, Policy, expect};
use crate::Result;
use nalgebra::DVector;

/// Controls until a speed is reached.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedStage {
    /// Speed that ends it, m/s or rad/s.
    pub until: f64,
    /// Controls, N or N m.
    pub control: Vec<f64>,
}

/// Constant controls, stage by stage: a stage ends for good once one of the watched speeds is larger than its `until`, and
/// after the last one nothing acts. The paper's grasps. Gains: the controls of all stages in turn; see [`Policy`] for what
/// switches do to a gradient.
#[derive(Clone, Debug)]
pub struct SpeedStages {
    /// Velocities in v that are watched.
    pub watch: Vec<usize>,
    /// Stages in their order.
    pub stages: Vec<SpeedStage>,
}

impl SpeedStages {
    /// Number of the stage that acts at an observation; that of stages after the last.
    fn stage(&self, observed: &Observation) -> usize {
        let speeds = self.watch.iter().map(|&i| observed.v[i].abs());
        let fastest = speeds.fold(0.0, f64::max);
        let mut stage = observed.mode;
        while self.stages.get(stage).is_some_and(|s| fastest > s.until) {
            stage += 1;
        }
        stage
    }
}

impl Policy for SpeedStages {
    fn act(&self, observed: &Observation) -> Result<Action> {
        let mode = self.stage(observed);
        let control = self.stages.get(mode).map(|s| s.control.clone());
        Ok(Action {
            control: control.unwrap_or_default(),
            mode,
            ..Action::default()
        })
    }

    fn act_vjp(&self, observed: &Observation, control_bar: &DVector<f64>) -> Result<ActionBar> {
        let acting = self.stage(observed);
        let gains = self.stages.iter().enumerate().flat_map(|(k, s)| {
            let bar = (0..s.control.len()).map(move |i| (k == acting, i));
            bar.map(|(acts, i)| if acts { control_bar[i] } else { 0.0 })
        });
        Ok(ActionBar::gains(gains.collect()))
    }

    fn gains(&self) -> Vec<f64> {
        self.stages.iter().flat_map(|s| s.control.clone()).collect()
    }

    fn with_gains(&self, gains: &[f64]) -> Result<Box<dyn Policy>> {
        expect(self.gains().len(), gains)?;
        let mut out = self.clone();
        let mut rest = gains.iter();
        for value in out.stages.iter_mut().flat_map(|s| &mut s.control) {
            *value = *rest.next().unwrap_or(value);
        }
        Ok(Box::new(out))
    }
}
