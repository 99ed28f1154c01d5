//! How far a model is trusted: its regularisation, from iteration to iteration.
//!
//! It grows where no step helps, and is lessened after one that was half of a whole one or more. A step that was cut to an eighth or less may tell either of two things: that the
//! model is wrong by much, which regularisation mends, or that the way is narrow, along which the step's direction is right and any other worse. So it grows there, too, on trial: where
//! the next few steps gain less, in the mean, than that one did, it is taken back, and left for twice as many iterations as the last time.

use super::IlqrSettings;

/// The regularisation that follows on none, and its growth.
const LEAST: f64 = 1e-6;
const GROWTH: f64 = 10.0;
/// Part of a step from which on the model is trusted more, and up to which less.
const TRUSTED: f64 = 0.5;
const DOUBTED: f64 = 0.125;
/// Iterations by which a trial is judged.
const TRIAL: u32 = 5;
/// Most iterations in which steps that are cut short change nothing.
const CALM: u32 = 64;

/// The regularisation.
pub(super) struct Trust {
    pub mu: f64,
    most: f64,
    trial: Option<Trial>,
    /// Iterations in which steps that are cut short change nothing, and how many there will be the next time.
    calm: u32,
    next_calm: u32,
}

/// What began where a step was cut short.
struct Trial {
    /// The regularisation that was, and by how much that step lowered the cost.
    before: f64,
    fall: f64,
    /// Iterations since, and what they have lowered it by.
    count: u32,
    sum: f64,
}

impl Trust {
    pub fn new(settings: &IlqrSettings) -> Self {
        Self {
            mu: settings.regularisation,
            most: settings.most_regularisation,
            trial: None,
            calm: 0,
            next_calm: TRIAL,
        }
    }

    /// After a step of which `part` was taken, and which lowered the cost by `fall`.
    pub fn accepted(&mut self, part: f64, fall: f64) {
        if self.is_taken_back(fall) {
            return;
        }
        if part >= TRUSTED {
            self.mu /= GROWTH;
            if self.mu < LEAST {
                self.mu = 0.0;
            }
        } else if part <= DOUBTED && self.calm == 0 {
            self.trial.get_or_insert(Trial {
                before: self.mu,
                fall,
                count: 0,
                sum: 0.0,
            });
            // What was accepted ends nothing.
            let most = self.most.max(self.mu);
            self.grow();
            self.mu = self.mu.min(most);
        }
        self.calm = self.calm.saturating_sub(1);
    }

    /// After an iteration in which no step helped.
    pub fn refused(&mut self) {
        if !self.is_taken_back(0.0) {
            self.grow();
        }
    }

    /// Whether a trial ends with an iteration that lowered the cost by `fall`, and has gained too little.
    fn is_taken_back(&mut self, fall: f64) -> bool {
        let Some(trial) = &mut self.trial else {
            return false;
        };
        trial.count += 1;
        trial.sum += fall;
        if trial.count < TRIAL {
            return false;
        }
        let is_worse = trial.sum < f64::from(TRIAL) * trial.fall;
        if is_worse {
            self.mu = trial.before;
            self.calm = self.next_calm;
            self.next_calm = (2 * self.next_calm).min(CALM);
        }
        self.trial = None;
        is_worse
    }

    /// Where the model has no least point.
    pub fn grow(&mut self) {
        self.mu = (self.mu * GROWTH).max(LEAST);
    }

    /// Whether it is time to give up.
    pub fn is_gone(&self) -> bool {
        self.mu > self.most
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trust(regularisation: f64, most: f64) -> Trust {
        Trust::new(&IlqrSettings {
            regularisation,
            most_regularisation: most,
            ..IlqrSettings::default()
        })
    }

    #[test]
    fn what_gains_less_is_taken_back() {
        let mut trust = trust(0.0, 1e8);
        // Each time it is left alone for twice as long.
        for wait in [5, 10, 20, 40] {
            trust.accepted(0.125, 1.0);
            assert_eq!(trust.mu, LEAST);
            trust.refused();
            assert_eq!(trust.mu, GROWTH * LEAST);
            (0..TRIAL - 1).for_each(|_| trust.accepted(0.25, 1.2));
            assert_eq!((trust.mu, trust.calm), (0.0, wait));
            for _ in 0..wait {
                trust.accepted(0.125, 1.0);
                assert_eq!(trust.mu, 0.0, "{wait}");
            }
        }
        // Where it gains more it stays, and is lessened when steps are whole.
        trust.accepted(0.125, 1.0);
        (0..TRIAL).for_each(|_| trust.accepted(0.25, 1.1));
        assert_eq!(trust.mu, LEAST);
        trust.accepted(0.5, 0.1);
        assert_eq!(trust.mu, 0.0);
    }

    #[test]
    fn what_is_accepted_is_never_given_up() {
        let mut trust = trust(1.0, 50.0);
        for n in 0..9 {
            trust.accepted(0.1, 1.0 + f64::from(n));
        }
        assert_eq!(trust.mu, 50.0);
        assert!(!trust.is_gone());
        trust.refused();
        assert!(trust.is_gone());
    }
}
