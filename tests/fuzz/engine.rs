//! Inputs one after the other, made from the corpus and from what has met a new answer.

use super::limits::{folder, watched};
use super::mutate::Dice;
use std::cell::Cell;
use std::collections::{BTreeMap, HashSet};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Once;
use std::time::{Duration, Instant, UNIX_EPOCH};

/// Most inputs from which others are made.
const POOL: usize = 4000;
/// Longest time of an input from which others are made.
const QUICK: Duration = Duration::from_millis(500);
/// Most failures of different kinds that are told.
const TOLD: usize = 20;

/// What came of an input: taken or refused, in words that tell one kind from another; or what is wrong with the program.
pub enum Answer {
    Taken(String),
    Refused(String),
    Wrong(String),
}

fn asked(name: &str) -> Option<u64> {
    let text = std::env::var(format!("HYDROGRAD_FUZZ_{name}")).ok()?;
    Some(
        text.parse()
            .unwrap_or_else(|_| panic!("HYDROGRAD_FUZZ_{name}: {text}")),
    )
}

/// Files of `tests/fuzz/corpus/NAME`, in their order.
pub fn corpus(name: &str) -> Vec<Vec<u8>> {
    files(&root().join("tests/fuzz/corpus").join(name))
}

pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

pub fn files(folder: &Path) -> Vec<Vec<u8>> {
    let listed = std::fs::read_dir(folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut names: Vec<_> = listed.map(|f| f.unwrap().path()).collect();
    names.retain(|path| path.is_file());
    names.sort();
    names
        .iter()
        .map(|path| std::fs::read(path).unwrap())
        .collect()
}

/// A message without its numbers and quoted words: what kind of answer it is.
fn kind(message: &str) -> String {
    let mut out = String::new();
    let mut quoted = false;
    for c in message.chars() {
        match c {
            '"' | '`' => quoted = !quoted,
            _ if quoted || c.is_ascii_digit() || "+-.".contains(c) => {}
            _ => out.push(c),
        }
    }
    out.truncate(out.char_indices().nth(120).map_or(out.len(), |(at, _)| at));
    out
}

thread_local! {
    static UNDER_WAY: Cell<bool> = const { Cell::new(false) };
}

/// The program's answer, a panic included, of which nothing is printed: parsers that others wrote panic, and are caught where they are called.
fn answer(target: &'static str, input: &[u8], run: &mut dyn FnMut(&[u8]) -> Answer) -> Answer {
    static QUIET: Once = Once::new();
    QUIET.call_once(|| {
        let told = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            let test = std::thread::current()
                .name()
                .is_some_and(|n| n.ends_with("_hold"));
            if test && !UNDER_WAY.get() {
                told(info);
            }
        }));
    });
    let done = watched(target, input, || {
        UNDER_WAY.set(true);
        let done = catch_unwind(AssertUnwindSafe(|| run(input)));
        UNDER_WAY.set(false);
        done
    });
    done.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or(panic.downcast_ref::<&str>().copied());
        Answer::Wrong(format!("panic: {}", text.unwrap_or("?")))
    })
}

/// Gives `run` all of the corpus and then changed inputs: `inputs` of them, or as the environment says.
pub fn fuzz(
    target: &'static str,
    corpus: Vec<Vec<u8>>,
    inputs: u64,
    mut run: impl FnMut(&[u8]) -> Answer,
) {
    if let Ok(file) = std::env::var("HYDROGRAD_FUZZ_FILE") {
        let input = std::fs::read(&file).unwrap();
        match run(&input) {
            Answer::Taken(what) => println!("{target}: taken: {what}"),
            Answer::Refused(why) => println!("{target}: refused: {why}"),
            Answer::Wrong(how) => panic!("{target}: {how}"),
        }
        return;
    }
    let seconds = asked("SECONDS").map(Duration::from_secs);
    let clock = || UNIX_EPOCH.elapsed().map_or(1, |t: Duration| t.as_secs());
    let seed = asked("SEED").unwrap_or_else(|| if seconds.is_some() { clock() } else { 1 });
    let inputs = asked("INPUTS").unwrap_or(if seconds.is_some() { u64::MAX } else { inputs });
    let (start, mut told) = (Instant::now(), Instant::now());
    let (mut pool, mut kinds, mut wrong) = (corpus, HashSet::new(), BTreeMap::new());
    let mut good = pool.clone();
    let mut slowest = Vec::new();
    let (given, mut count, mut taken, mut longest) = (pool.len() as u64, 0, 0, Duration::ZERO);
    assert!(given > 0, "{target}: no corpus");
    while count < inputs.saturating_add(given) && seconds.is_none_or(|s| start.elapsed() < s) {
        let input = if count < given {
            pool[count as usize].clone()
        } else {
            let mut dice = Dice::new(seed, count);
            // Mostly from what is taken: what is refused once is seldom taken when changed again.
            let from = if dice.below(4) > 0 { &good } else { &pool };
            let (one, other) = (dice.pick(from), dice.pick(&pool));
            dice.change(one, other)
        };
        let begun = Instant::now();
        let answer = answer(target, &input, &mut run);
        let took = begun.elapsed();
        if took > QUICK {
            good.retain(|kept| *kept != input);
        }
        if took > longest {
            longest = took;
            slowest.clone_from(&input);
        }
        count += 1;
        let (message, pool) = match answer {
            Answer::Taken(what) => {
                taken += 1;
                (format!("taken: {what}"), &mut good)
            }
            Answer::Refused(why) => (why, &mut pool),
            Answer::Wrong(how) => {
                if wrong.len() < TOLD && !wrong.contains_key(&kind(&how)) {
                    let file = folder().join(format!("{target}-{seed}-{count}"));
                    std::fs::write(&file, &input).unwrap();
                    wrong.insert(kind(&how), format!("{}: {how}", file.display()));
                }
                continue;
            }
        };
        if kinds.insert(kind(&message)) && count > given && pool.len() < POOL && took <= QUICK {
            pool.push(input);
        }
        if told.elapsed() > Duration::from_secs(60) {
            told = Instant::now();
            println!("{target}: {count} inputs so far, {} failures", wrong.len());
        }
    }
    std::fs::write(folder().join(format!("{target}-longest")), slowest).unwrap();
    let rate = count as f64 / start.elapsed().as_secs_f64();
    println!(
        "{target}: {count} inputs (seed {seed}), {rate:.0} a second, {taken} taken, {} kinds of answers, the longest {longest:?}",
        kinds.len()
    );
    let listed: Vec<&String> = wrong.values().collect();
    assert!(wrong.is_empty(), "{target}: {listed:#?}");
}
