//! A time step and its transpose, and the sweep through a trajectory.
//!
//! The forward pass keeps every state, what was observed there, and each step's record; the reverse pass makes a step's
//! internals again from its record. [`reverse`] takes a [`Tape`], which only [`forward`] makes.

/// One step of a simulation with its transpose.
pub trait Step {
    /// State between steps.
    type State: Clone;
    /// What is observed at a state.
    type Observation;
    /// What a step leaves behind: the key to its transpose.
    type Record;
    /// Cotangent of a state.
    type Cotangent;
    /// Cotangent that enters at a time: derivative of an objective with respect to what is observed there.
    type Seed;
    /// What a step's transpose yields besides the state's cotangent (controls, parameters).
    type Partial;
    /// Why a step can fail.
    type Error;

    /// State n + 1 from state n, what is observed at state n, and the step's record.
    ///
    /// # Errors
    /// As the implementation says.
    fn step(&self, index: usize, state: &Self::State) -> Result<Made<Self>, Self::Error>;

    /// What is observed at the last state.
    ///
    /// # Errors
    /// As the implementation says.
    fn last(&self, index: usize, state: &Self::State) -> Result<Self::Observation, Self::Error>;

    /// Transpose of [`Step::step`] and of what is observed there.
    ///
    /// # Errors
    /// As the implementation says.
    fn step_vjp(
        &self,
        index: usize,
        record: &Self::Record,
        next_bar: &Self::Cotangent,
        seed: &Self::Seed,
    ) -> Result<(Self::Cotangent, Self::Partial), Self::Error>;

    /// Transpose of [`Step::last`].
    ///
    /// # Errors
    /// As the implementation says.
    fn last_vjp(
        &self,
        index: usize,
        state: &Self::State,
        observation: &Self::Observation,
        seed: &Self::Seed,
    ) -> Result<(Self::Cotangent, Self::Partial), Self::Error>;
}

/// What a step makes: the next state, what is observed at its own, and its record.
pub type Made<S> = (
    <S as Step>::State,
    <S as Step>::Observation,
    <S as Step>::Record,
);

/// A trajectory: states 0 … N, what was observed there, and the records of steps 0 … N − 1; the key to its reverse sweep.
pub struct Tape<State, Observation, Record> {
    states: Vec<State>,
    observations: Vec<Observation>,
    records: Vec<Record>,
}

impl<State, Observation, Record> Tape<State, Observation, Record> {
    /// States, one more than steps.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// What was observed at each state.
    pub fn observations(&self) -> &[Observation] {
        &self.observations
    }

    /// What each step left behind.
    pub fn records(&self) -> &[Record] {
        &self.records
    }
}

/// The tape of a simulation's steps.
pub type TapeOf<S> = Tape<<S as Step>::State, <S as Step>::Observation, <S as Step>::Record>;

/// Runs `steps` steps from `initial`; `progress` is called with the number of steps made after each, and may end the run with
/// an error.
///
/// # Errors
/// The first step that fails, or that of `progress`.
pub fn forward<S: Step>(
    step: &S,
    initial: S::State,
    steps: usize,
    progress: impl FnMut(usize) -> Result<(), S::Error>,
) -> Result<TapeOf<S>, S::Error> {
    let (mut tape, failed) = run(step, initial, steps, progress);
    if let Some((_, error)) = failed {
        return Err(error);
    }
    let last = step.last(steps, &tape.states[steps])?;
    tape.observations.push(last);
    Ok(tape)
}

/// A tape, and the step that ended it before its time with its error.
pub type Ended<S> = (TapeOf<S>, Option<(usize, <S as Step>::Error)>);

/// As [`forward`], as far as it comes: the tape ends at the last state that can be observed, and holds no observation where not even the first can.
pub fn forward_as_far<S: Step>(
    step: &S,
    initial: S::State,
    steps: usize,
    progress: impl FnMut(usize) -> Result<(), S::Error>,
) -> Ended<S> {
    let (mut tape, mut failed) = run(step, initial, steps, progress);
    loop {
        let n = tape.records.len();
        match step.last(n, &tape.states[n]) {
            Ok(last) => tape.observations.push(last),
            Err(error) => {
                failed.get_or_insert((n, error));
                if n > 0 {
                    tape.states.pop();
                    tape.records.pop();
                    tape.observations.pop();
                    continue;
                }
            }
        }
        return (tape, failed);
    }
}

/// Steps until one fails; the last state isn't observed yet.
fn run<S: Step>(
    step: &S,
    initial: S::State,
    steps: usize,
    mut progress: impl FnMut(usize) -> Result<(), S::Error>,
) -> Ended<S> {
    let mut tape = Tape {
        states: vec![initial],
        observations: Vec::new(),
        records: Vec::new(),
    };
    for n in 0..steps {
        match step.step(n, &tape.states[n]) {
            Ok((next, observation, record)) => {
                tape.states.push(next);
                tape.observations.push(observation);
                tape.records.push(record);
            }
            Err(error) => return (tape, Some((n, error))),
        }
        if let Err(error) = progress(n + 1) {
            return (tape, Some((n + 1, error)));
        }
    }
    (tape, None)
}

/// Cotangent of the initial state, and what every step yields.
pub type Swept<S> = (<S as Step>::Cotangent, Vec<<S as Step>::Partial>);

/// Cotangent of the initial state, and what every step yields, in the order of time, from one seed per state;
/// `progress` is called with the number of steps gone back after each, and may end the sweep with an error.
///
/// # Errors
/// The first transpose that fails, or that of `progress`.
///
/// # Panics
/// If there isn't one seed per state.
pub fn reverse<S: Step>(
    step: &S,
    tape: &TapeOf<S>,
    seeds: &[S::Seed],
    progress: impl FnMut(usize) -> Result<(), S::Error>,
) -> Result<Swept<S>, S::Error> {
    assert_eq!(seeds.len(), tape.states.len(), "one seed per state");
    let last = tape.records.len();
    let (bar, partial) = step.last_vjp(
        last,
        &tape.states[last],
        &tape.observations[last],
        &seeds[last],
    )?;
    let (bar, mut partials) = reverse_from(step, tape, bar, seeds, progress)?;
    partials.push(partial);
    Ok((bar, partials))
}

/// As [`reverse`], from the cotangent of the last state, of which no seed is read.
///
/// # Errors
/// As there.
///
/// # Panics
/// If there isn't one seed per state but the last.
pub fn reverse_from<S: Step>(
    step: &S,
    tape: &TapeOf<S>,
    mut bar: S::Cotangent,
    seeds: &[S::Seed],
    mut progress: impl FnMut(usize) -> Result<(), S::Error>,
) -> Result<Swept<S>, S::Error> {
    let last = tape.records.len();
    assert!(seeds.len() >= last, "one seed per state but the last");
    let mut partials = Vec::with_capacity(last + 1);
    for (n, record) in tape.records.iter().enumerate().rev() {
        let (previous, partial) = step.step_vjp(n, record, &bar, &seeds[n])?;
        bar = previous;
        partials.push(partial);
        progress(last - n)?;
    }
    partials.reverse();
    Ok((bar, partials))
}
