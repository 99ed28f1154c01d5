//! Into how many pieces a step is cut, and why one was given up.

use crate::Error;
use crate::contact::ContactPair;

/// Most pieces of a step that is too long for its stage otherwise: a flat body that lands at 20 m/s in a step of 20 ms takes some 800.
pub(super) const MOST: usize = 1024;
/// Most pieces that contact and limits ask for, beforehand or because something was passed.
pub(super) const SEEN: usize = 64;

/// Pairs of surfaces, and limits of joints by their numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Stops {
    /// Of [`Contacts::pairs`](crate::contact::Contacts::pairs), ascending.
    pub pairs: Vec<ContactPair>,
    /// Those that press while one of the two turns too far, ascending.
    pub turned: Vec<ContactPair>,
    /// Of [`System::limits`](crate::dynamics::System::limits), ascending.
    pub limits: Vec<usize>,
}

impl Stops {
    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty() && self.turned.is_empty() && self.limits.is_empty()
    }

    /// What of it presses more stiffly in more pieces: limits, and pairs where contact is `rigid`.
    pub(super) fn sharper(&self, rigid: bool) -> Self {
        let mut out = Self {
            limits: self.limits.clone(),
            ..Self::default()
        };
        if rigid {
            add(&mut out.pairs, &self.pairs);
            add(&mut out.pairs, &self.turned);
        }
        out
    }

    /// Adds others.
    pub(super) fn add(&mut self, other: &Self) {
        add(&mut self.pairs, &other.pairs);
        add(&mut self.turned, &other.turned);
        add(&mut self.limits, &other.limits);
    }
}

/// Adds others, ascending.
fn add<T: Copy + Ord>(to: &mut Vec<T>, from: &[T]) {
    to.extend(from);
    to.sort_unstable();
    to.dedup();
}

/// How a step is cut.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    /// Number of pieces; one is the step as it is.
    pub pieces: usize,
    /// What presses as stiffly in a piece as it would in a whole step of that length.
    pub sharp: Stops,
}

impl Plan {
    /// A step as it is.
    pub fn whole() -> Self {
        Self {
            pieces: 1,
            sharp: Stops::default(),
        }
    }

    /// Whether more pieces may be asked for.
    pub fn may_cut(&self) -> bool {
        self.pieces < MOST
    }

    /// Whether what was passed asks for another plan: for more pieces, or because `rigid`, what of it may press more stiffly, doesn't yet.
    pub fn cures(&self, passed: &Stops, rigid: &Stops) -> bool {
        let pairs = &self.sharp.pairs;
        let limits = &self.sharp.limits;
        let stays = (rigid.pairs.iter()).all(|pair| pairs.binary_search(pair).is_ok())
            && (rigid.limits.iter()).all(|limit| limits.binary_search(limit).is_ok());
        !passed.is_empty() && (self.pieces < SEEN || !stays)
    }

    /// The plan that what was passed asks for.
    pub fn cure(&mut self, rigid: &Stops) {
        self.sharp.add(rigid);
        if self.pieces < SEEN {
            self.cut(2);
        }
    }

    /// Asks for `times` as many pieces.
    pub fn cut(&mut self, times: usize) {
        self.pieces = self.pieces.saturating_mul(times).min(MOST);
    }

    /// How much sharper the law of a pair of surfaces is than in the whole step.
    pub fn of_pair(&self, pair: &ContactPair) -> usize {
        self.of(&self.sharp.pairs, pair)
    }

    /// The same of a joint's limit.
    pub fn of_limit(&self, limit: usize) -> usize {
        self.of(&self.sharp.limits, &limit)
    }

    fn of<T: Ord>(&self, sharp: &[T], which: &T) -> usize {
        match sharp.binary_search(which) {
            Ok(_) => self.pieces,
            Err(_) => 1,
        }
    }
}

/// Why a step, or a piece of one, isn't made.
pub(super) enum Halt {
    /// It is so many times too long for its implicit stage.
    TooLong(usize),
    /// It failed.
    Failed(Error),
}

impl From<Error> for Halt {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}
