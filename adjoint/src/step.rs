//! A time step and its transpose, and the sweep through a trajectory.
//!
//! The forward pass keeps every state and what each step observed; the reverse pass recomputes a step's internals
//! from them. [`reverse`] takes a [`Path`], which only [`forward`] makes.

/// One step of a simulation with its transpose.
pub trait Step {
    /// State between steps.
    type State: Clone;
    /// What a step observes at its state and needs to be redone: kept with the trajectory.
    type Kept;
    /// Cotangent of a state.
    type Bar;
    /// Cotangent that enters at a time: derivative of an objective with respect to what is observed there.
    type Seed;
    /// What a step's transpose yields besides the state's cotangent (controls, parameters).
    type Local;
    /// Why a step can fail.
    type Error;

    /// State n + 1 from state n.
    ///
    /// # Errors
    /// As the implementation says.
    fn step(
        &self,
        index: usize,
        state: &Self::State,
    ) -> Result<(Self::State, Self::Kept), Self::Error>;

    /// What is observed at the last state.
    ///
    /// # Errors
    /// As the implementation says.
    fn last(&self, index: usize, state: &Self::State) -> Result<Self::Kept, Self::Error>;

    /// Transpose of [`Step::step`] and of what it observes.
    ///
    /// # Errors
    /// As the implementation says.
    fn step_vjp(
        &self,
        index: usize,
        state: &Self::State,
        kept: &Self::Kept,
        next_bar: &Self::Bar,
        seed: &Self::Seed,
    ) -> Result<(Self::Bar, Self::Local), Self::Error>;

    /// Transpose of [`Step::last`].
    ///
    /// # Errors
    /// As the implementation says.
    fn last_vjp(
        &self,
        index: usize,
        state: &Self::State,
        kept: &Self::Kept,
        seed: &Self::Seed,
    ) -> Result<(Self::Bar, Self::Local), Self::Error>;
}

/// States and observations of a trajectory: the key to its reverse sweep.
pub struct Path<State, Kept> {
    states: Vec<State>,
    kept: Vec<Kept>,
}

impl<State, Kept> Path<State, Kept> {
    /// States, one more than steps.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// Observations at each state.
    pub fn kept(&self) -> &[Kept] {
        &self.kept
    }
}

/// Runs `steps` steps from `initial`; `progress` hears of each step made, and may end the run with an error.
///
/// # Errors
/// The first step that fails, or that of `progress`.
pub fn forward<S: Step>(
    step: &S,
    initial: S::State,
    steps: usize,
    mut progress: impl FnMut(usize) -> Result<(), S::Error>,
) -> Result<Path<S::State, S::Kept>, S::Error> {
    let mut states = vec![initial];
    let mut kept = Vec::new();
    for n in 0..steps {
        let (next, observed) = step.step(n, &states[n])?;
        states.push(next);
        kept.push(observed);
        progress(n + 1)?;
    }
    kept.push(step.last(steps, &states[steps])?);
    Ok(Path { states, kept })
}

/// Cotangent of the initial state, and what every step yields.
pub type Swept<S> = (<S as Step>::Bar, Vec<<S as Step>::Local>);

/// Cotangent of the initial state, and what every step yields, in the order of time, from one seed per state;
/// `progress` hears of each step gone back, and may end the sweep with an error.
///
/// # Errors
/// The first transpose that fails, or that of `progress`.
///
/// # Panics
/// If there isn't one seed per state.
pub fn reverse<S: Step>(
    step: &S,
    path: &Path<S::State, S::Kept>,
    seeds: &[S::Seed],
    mut progress: impl FnMut(usize) -> Result<(), S::Error>,
) -> Result<Swept<S>, S::Error> {
    assert_eq!(seeds.len(), path.states.len(), "one seed per state");
    let last = path.states.len() - 1;
    let (mut bar, local) =
        step.last_vjp(last, &path.states[last], &path.kept[last], &seeds[last])?;
    let mut locals = vec![local];
    for n in (0..last).rev() {
        let (previous, local) =
            step.step_vjp(n, &path.states[n], &path.kept[n], &bar, &seeds[n])?;
        bar = previous;
        locals.push(local);
        progress(last - n)?;
    }
    locals.reverse();
    Ok((bar, locals))
}
