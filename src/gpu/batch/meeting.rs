//! Where members meet: each asks, and once all have, whoever serves them answers all.

use super::crew::make_way;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::Thread;

/// Members ask questions `Q`, and get answers `A`.
pub(super) struct Meeting<Q, A> {
    state: Mutex<State<Q, A>>,
    /// Told when all have asked, or nobody is left.
    complete: Condvar,
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

type Cell<A> = Mutex<Option<Answered<A>>>;

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<Q, A> Meeting<Q, A> {
    /// Of so many members.
    pub fn new(present: usize) -> Self {
        let waiting = Vec::with_capacity(present);
        Self {
            state: Mutex::new(State { present, waiting }),
            complete: Condvar::new(),
        }
    }

    /// Asks, and makes way for others of this thread until whoever serves has answered.
    ///
    /// # Errors
    /// What was reported there: all get to know it; that nobody is present any more.
    pub fn ask(&self, member: usize, question: Q) -> Answered<A> {
        let cell: Arc<Cell<A>> = Arc::default();
        let asked = Asked {
            member,
            question,
            thread: std::thread::current(),
            cell: cell.clone(),
        };
        let mut state = locked(&self.state);
        if state.present == 0 {
            return Err("it was asked of seats that have all been left".into());
        }
        state.waiting.push(asked);
        self.tell(&state);
        drop(state);
        let mut moved = true;
        loop {
            if let Some(answer) = locked(&cell).take() {
                return answer;
            }
            make_way(moved);
            moved = false;
        }
    }

    /// A member goes; those who waited for nobody else are answered.
    pub fn leave(&self) {
        let mut state = locked(&self.state);
        state.present = state.present.saturating_sub(1);
        self.tell(&state);
    }

    fn tell(&self, state: &State<Q, A>) {
        if state.waiting.len() >= state.present {
            self.complete.notify_one();
        }
    }

    /// Answers all who are present each time that they have asked, in the members' order, until all have left.
    pub fn serve(&self, mut work: impl FnMut(Vec<Q>) -> Answered<Vec<A>>) {
        loop {
            let mut state = locked(&self.state);
            while state.waiting.len() < state.present {
                let woken = self.complete.wait(state);
                state = woken.unwrap_or_else(PoisonError::into_inner);
            }
            if state.waiting.is_empty() {
                return;
            }
            let room = Vec::with_capacity(state.present);
            let all = std::mem::replace(&mut state.waiting, room);
            drop(state);
            answer(all, &mut work);
        }
    }
}

fn answer<Q, A>(mut all: Vec<Asked<Q, A>>, work: &mut impl FnMut(Vec<Q>) -> Answered<Vec<A>>) {
    all.sort_by_key(|asked| asked.member);
    let (mut questions, mut cells) = (Vec::new(), Vec::new());
    let mut threads: Vec<Thread> = Vec::new();
    for asked in all {
        questions.push(asked.question);
        cells.push(asked.cell);
        if threads.iter().all(|known| known.id() != asked.thread.id()) {
            threads.push(asked.thread);
        }
    }
    // A panic here would leave all waiting for ever.
    let done = catch_unwind(AssertUnwindSafe(|| work(questions)));
    let done =
        done.unwrap_or_else(|_| Err("what was asked of it together ended in a panic".into()));
    let mut answers: Vec<Answered<A>> = match done {
        Ok(answers) => answers.into_iter().map(Ok).collect(),
        Err(why) => cells.iter().map(|_| Err(why.clone())).collect(),
    };
    answers.resize_with(cells.len(), || Err("an answer is missing".into()));
    for (cell, answer) in cells.iter().zip(answers) {
        *locked(cell) = Some(answer);
    }
    threads.iter().for_each(Thread::unpark);
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
            scope.spawn(|| meeting.serve(work));
            for member in 0..9 {
                let meeting = &meeting;
                scope.spawn(move || {
                    for turn in 0..3 * member {
                        let question = 100 * member + turn;
                        assert_eq!(meeting.ask(member, question), Ok(question + 1));
                    }
                    meeting.leave();
                });
            }
        });
    }

    #[test]
    fn what_fails_fails_for_all() {
        let meeting = Meeting::<usize, usize>::new(5);
        let mut turn = 0;
        let work = |_| {
            turn += 1;
            match turn {
                1 => Err("lost".into()),
                _ => panic!("on purpose"),
            }
        };
        std::thread::scope(|scope| {
            scope.spawn(|| meeting.serve(work));
            for member in 0..5 {
                let meeting = &meeting;
                scope.spawn(move || {
                    assert_eq!(meeting.ask(member, 0), Err("lost".into()));
                    let panicked = meeting.ask(member, 0);
                    assert!(panicked.is_err_and(|why| why.contains("panic")));
                    meeting.leave();
                });
            }
        });
        assert!(meeting.ask(0, 0).is_err(), "nobody is left");
    }
}
