//! Where threads meet: each asks, and the last one to ask answers all.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::Thread;

/// Members ask questions `Q`, and get answers `A`.
pub(super) struct Meeting<Q, A> {
    state: Mutex<State<Q, A>>,
}

struct State<Q, A> {
    /// Members that haven't left.
    present: usize,
    waiting: Vec<Asked<Q, A>>,
}

/// Who asks what, and where the answer goes.
struct Asked<Q, A> {
    member: usize,
    question: Q,
    thread: Thread,
    cell: Arc<Cell<A>>,
}

/// An answer, or why there is none.
pub(super) type Answered<A> = Result<A, String>;

/// An answer, with who else is to be woken.
type Cell<A> = Mutex<Option<(Answered<A>, Woken)>>;

/// All who wait, and the place among them of one: waking is shared out, for it takes longer than the answer.
#[derive(Clone)]
struct Woken {
    all: Arc<Vec<Thread>>,
    place: usize,
}

impl Woken {
    /// Wakes the two of whom this one is to take care.
    fn pass_on(&self) {
        let first = 2 * self.place + 2;
        self.all.iter().skip(first).take(2).for_each(Thread::unpark);
    }
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<Q, A> Meeting<Q, A> {
    /// Of so many members.
    pub fn new(present: usize) -> Self {
        let waiting = Vec::with_capacity(present);
        Self {
            state: Mutex::new(State { present, waiting }),
        }
    }

    /// Asks, and waits until all who are present have; then `work` answers, in the members' order.
    ///
    /// # Errors
    /// What `work` reports: all get to know it.
    pub fn ask(
        &self,
        member: usize,
        question: Q,
        work: impl FnOnce(Vec<Q>) -> Answered<Vec<A>>,
    ) -> Answered<A> {
        let cell: Arc<Cell<A>> = Arc::default();
        let asked = Asked {
            member,
            question,
            thread: std::thread::current(),
            cell: cell.clone(),
        };
        let all = {
            let mut state = locked(&self.state);
            state.waiting.push(asked);
            state.complete()
        };
        if let Some(all) = all {
            answer(all, work);
        }
        loop {
            // What was parked may wake before its time.
            if let Some((answer, woken)) = locked(&cell).take() {
                woken.pass_on();
                return answer;
            }
            std::thread::park();
        }
    }

    /// A member goes; those who waited for nobody else are answered.
    pub fn leave(&self, work: impl FnOnce(Vec<Q>) -> Answered<Vec<A>>) {
        let all = {
            let mut state = locked(&self.state);
            state.present = state.present.saturating_sub(1);
            state.complete()
        };
        if let Some(all) = all {
            answer(all, work);
        }
    }
}

impl<Q, A> State<Q, A> {
    /// All who wait, if nobody else is to come.
    fn complete(&mut self) -> Option<Vec<Asked<Q, A>>> {
        let complete = !self.waiting.is_empty() && self.waiting.len() >= self.present;
        complete.then(|| std::mem::take(&mut self.waiting))
    }
}

fn answer<Q, A>(mut all: Vec<Asked<Q, A>>, work: impl FnOnce(Vec<Q>) -> Answered<Vec<A>>) {
    all.sort_by_key(|asked| asked.member);
    let (mut questions, mut threads, mut cells) = (Vec::new(), Vec::new(), Vec::new());
    for asked in all {
        questions.push(asked.question);
        threads.push(asked.thread);
        cells.push(asked.cell);
    }
    let threads = Arc::new(threads);
    // A panic here would leave the others waiting for ever.
    let done = catch_unwind(AssertUnwindSafe(|| work(questions)));
    let done =
        done.unwrap_or_else(|_| Err("what was asked of it together ended in a panic".into()));
    let mut answers: Vec<Answered<A>> = match done {
        Ok(answers) => answers.into_iter().map(Ok).collect(),
        Err(why) => cells.iter().map(|_| Err(why.clone())).collect(),
    };
    answers.resize_with(cells.len(), || Err("an answer is missing".into()));
    for (place, (cell, answer)) in cells.iter().zip(answers).enumerate() {
        let all = threads.clone();
        *locked(cell) = Some((answer, Woken { all, place }));
    }
    threads.iter().take(2).for_each(Thread::unpark);
}

#[cfg(test)]
mod tests {
    use super::Meeting;

    /// Members who ask a different number of times, one of them never.
    #[test]
    fn all_are_answered_whoever_leaves_first() {
        let meeting = Meeting::<usize, usize>::new(9);
        let work = |questions: Vec<usize>| Ok(questions.iter().map(|q| q + 1).collect());
        std::thread::scope(|scope| {
            for member in 0..9 {
                let meeting = &meeting;
                scope.spawn(move || {
                    for turn in 0..3 * member {
                        let question = 100 * member + turn;
                        assert_eq!(meeting.ask(member, question, work), Ok(question + 1));
                    }
                    meeting.leave(work);
                });
            }
        });
    }

    #[test]
    fn what_fails_fails_for_all() {
        let meeting = Meeting::<usize, usize>::new(5);
        std::thread::scope(|scope| {
            for member in 0..5 {
                let meeting = &meeting;
                scope.spawn(move || {
                    let broken = meeting.ask(member, 0, |_| Err("lost".into()));
                    assert_eq!(broken, Err("lost".into()));
                    let panicked = meeting.ask(member, 0, |_| panic!("on purpose"));
                    assert!(panicked.is_err_and(|why| why.contains("panic")));
                    meeting.leave(|_| Ok(Vec::new()));
                });
            }
        });
    }
}
