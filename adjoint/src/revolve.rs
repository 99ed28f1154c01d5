//! Binomial checkpointing: the reverse sweep of a long chain of parts with few of its states kept.
//!
//! With s states kept at a time and each part run forward at most r times beforehand, β(s, r) = C(s + r, s) parts can be reversed; the states are placed so that the
//! number of forward runs is the least there is.
//!
//! # References
//! A. Griewank and A. Walther, "Algorithm 799: Revolve", ACM Transactions on Mathematical Software 26, 2000.

/// C(s + r, s), as long as it is under `most`; else that.
fn reach(s: usize, r: usize, most: usize) -> usize {
    let (few, many) = (s.min(r), s.max(r));
    let mut out: usize = 1;
    for k in 1..=few {
        // Each quotient is a binomial coefficient: no remainder.
        out = match out.checked_mul(many + k) {
            Some(x) => x / k,
            None => return most,
        };
        if out >= most {
            return most;
        }
    }
    out
}

/// After how many of `parts` parts the next state is kept, with `states` kept in all, that at the start among them.
fn left(parts: usize, states: usize) -> usize {
    if states <= 1 {
        return parts - 1;
    }
    let mut r = 1;
    while reach(states, r, parts) < parts {
        r += 1;
    }
    let right = reach(states - 1, r, parts);
    let least = match r {
        0 | 1 => 1,
        r => reach(states, r - 2, parts),
    };
    parts.saturating_sub(right).max(least).clamp(1, parts - 1)
}

/// Goes through the parts from the last to the first: `reverse` is called for each with the state at its start, `advance` gives the state after a part. At most `states`
/// (at least one) states are kept at a time, that at the start among them.
///
/// # Errors
/// The first of either.
pub fn revolve<S: Clone, E>(
    parts: usize,
    states: usize,
    first: S,
    advance: &mut impl FnMut(usize, &S) -> Result<S, E>,
    reverse: &mut impl FnMut(usize, &S) -> Result<(), E>,
) -> Result<(), E> {
    let states = states.max(1);
    // Ranges of parts still to be reversed, each with the state at its start: (from, how many, state).
    let mut kept = vec![(0, parts, first)];
    while let Some((from, parts, state)) = kept.pop() {
        if parts <= 1 {
            if parts == 1 {
                reverse(from, &state)?;
            }
            continue;
        }
        let left = left(parts, states - kept.len());
        let mut next = advance(from, &state)?;
        for n in 1..left {
            next = advance(from + n, &next)?;
        }
        kept.push((from, left, state));
        match kept.len() < states {
            true => kept.push((from + left, parts - left, next)),
            // Only the last part is right of it.
            false => reverse(from + left, &next)?,
        }
    }
    Ok(())
}

/// How many parts [`revolve`] runs forward before they are reversed.
pub fn advances(parts: usize, states: usize) -> usize {
    let (states, mut out) = (states.max(1), 0);
    let mut kept = vec![parts];
    while let Some(parts) = kept.pop() {
        if parts > 1 {
            let left = left(parts, states - kept.len());
            out += left;
            kept.push(left);
            if kept.len() < states {
                kept.push(parts - left);
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The least number of forward runs, by trying all places.
    fn least(parts: usize, states: usize, known: &mut Vec<Vec<Option<usize>>>) -> usize {
        if parts <= 1 {
            return 0;
        }
        if states == 1 {
            return parts * (parts - 1) / 2;
        }
        if let Some(found) = known[parts][states] {
            return found;
        }
        let tried = (1..parts)
            .map(|left| left + least(parts - left, states - 1, known) + least(left, states, known));
        let found = tried.min().unwrap();
        known[parts][states] = Some(found);
        found
    }

    #[test]
    fn states_are_kept_where_fewest_parts_run_again() {
        let mut known = vec![vec![None; 9]; 81];
        for parts in 0..=80 {
            for states in 1..=8 {
                let right = least(parts, states, &mut known);
                assert_eq!(
                    advances(parts, states),
                    right,
                    "{parts} parts, {states} states"
                );
            }
        }
        // A state for each part: each but the last runs once.
        assert_eq!(advances(1000, 1000), 999);
        assert_eq!(advances(1_000_000, 1_000_000), 999_999);
    }

    #[test]
    fn parts_come_in_reverse_from_their_own_states() {
        for (parts, states) in [(0, 3), (1, 1), (2, 1), (7, 1), (40, 3), (200, 5), (30, 100)] {
            let (mut seen, mut made) = (Vec::new(), 0);
            revolve(
                parts,
                states,
                0,
                &mut |n, state: &usize| {
                    assert_eq!(n, *state);
                    made += 1;
                    Ok::<_, ()>(state + 1)
                },
                &mut |n, state| {
                    assert_eq!(n, *state);
                    seen.push(n);
                    Ok(())
                },
            )
            .unwrap();
            assert_eq!(seen, (0..parts).rev().collect::<Vec<_>>());
            assert_eq!(made, advances(parts, states));
        }
    }

    #[test]
    fn an_error_ends_the_sweep() {
        let mut reverse = |n: usize, _: &usize| if n == 3 { Err(n) } else { Ok(()) };
        let found = revolve(9, 3, 0, &mut |_, s| Ok(s + 1), &mut reverse);
        assert_eq!(found, Err(3));
    }
}
