//! Inputs from others: bytes, words, numbers and lines changed, and parts of one put into another.

use mutatis::Session;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// Longest input, bytes.
const LONGEST: usize = 1 << 16;

/// Numbers at which something may change its mind.
const NUMBERS: [&str; 48] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "3",
    "4",
    "7",
    "0.5",
    "1e-3",
    "1e3",
    "1e-9",
    "1e9",
    "1e15",
    "-1e15",
    "1e-15",
    "1e-30",
    "1e30",
    "1e-100",
    "1e100",
    "-1e100",
    "1e150",
    "1e154",
    "-1e154",
    "1e160",
    "1e300",
    "-1e300",
    "1e-300",
    "1e308",
    "1.7976931348623157e308",
    "-1.7976931348623157e308",
    "4.9e-324",
    "2.2250738585072014e-308",
    "nan",
    "-nan",
    "inf",
    "-inf",
    "127",
    "255",
    "256",
    "65535",
    "65536",
    "4294967295",
    "4294967296",
    "2147483648",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551616",
];

/// Chance of one seed.
pub struct Dice {
    rng: ChaCha8Rng,
    bytes: Session,
}

impl Dice {
    pub fn new(seed: u64, number: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(number);
        let bytes = Session::new().seed(rng.next_u64());
        Self { rng, bytes }
    }

    /// A number below `count`, which isn't zero.
    pub fn below(&mut self, count: usize) -> usize {
        (self.rng.next_u64() % count.max(1) as u64) as usize
    }

    pub fn pick<'a, T>(&mut self, from: &'a [T]) -> &'a T {
        &from[self.below(from.len())]
    }

    /// `input` changed in a number or a few, or in anything, once or a few times, with parts of `other`.
    pub fn change(&mut self, input: &[u8], other: &[u8]) -> Vec<u8> {
        let mut out = input.to_vec();
        let gentle = self.below(3) > 0;
        for _ in 0..1 + self.below(4).min(self.below(6)) {
            out = match self.below(12) {
                _ if gentle => self.numbers(&out),
                0 => self.bytes(out),
                1 => self.cut(&out),
                2 => self.spliced(&out, other),
                3 | 4 => self.lines(&out, other),
                5 | 6 => self.numbers(&out),
                _ => self.tokens(&out, other),
            };
        }
        out.truncate(LONGEST);
        out
    }

    fn bytes(&mut self, mut input: Vec<u8>) -> Vec<u8> {
        // Fails only where there is nothing to change.
        let _ = self.bytes.mutate(&mut input);
        input
    }

    fn cut(&mut self, input: &[u8]) -> Vec<u8> {
        let (a, b) = (self.below(input.len() + 1), self.below(input.len() + 1));
        match self.below(3) {
            0 => input[..a].to_vec(),
            1 => [&input[..a.min(b)], &input[a.max(b)..]].concat(),
            _ => [&input[..a.max(b)], &input[a.min(b)..]].concat(),
        }
    }

    fn spliced(&mut self, input: &[u8], other: &[u8]) -> Vec<u8> {
        let (a, b) = (self.below(input.len() + 1), self.below(other.len() + 1));
        [&input[..a], &other[b..]].concat()
    }

    /// A line left out, doubled, moved, or taken from the other.
    fn lines(&mut self, input: &[u8], other: &[u8]) -> Vec<u8> {
        let mut lines: Vec<&[u8]> = input.split_inclusive(|b| *b == b'\n').collect();
        let others: Vec<&[u8]> = other.split_inclusive(|b| *b == b'\n').collect();
        if lines.is_empty() || others.is_empty() {
            return other.to_vec();
        }
        let (a, b) = (self.below(lines.len()), self.below(lines.len()));
        match self.below(5) {
            0 => drop(lines.remove(a)),
            1 => lines.insert(b, lines[a]),
            2 => lines.swap(a, b),
            3 => lines[a] = others[self.below(others.len())],
            _ => {
                let from = self.below(others.len());
                let to = from + self.below(12.min(others.len() - from) + 1);
                lines.splice(b..b, others[from..to].iter().copied());
            }
        }
        lines.concat()
    }

    /// A number for another, or bytes where there is none.
    fn numbers(&mut self, input: &[u8]) -> Vec<u8> {
        let mut all = tokens(input);
        let numbers: Vec<usize> = (0..all.len()).filter(|i| is_number(all[*i])).collect();
        if numbers.is_empty() {
            return self.bytes(input.to_vec());
        }
        let at = *self.pick(&numbers);
        let value: f64 = String::from_utf8_lossy(all[at]).parse().unwrap_or(1.0);
        let other = match self.below(10) {
            0 => format!("{:?}", -value),
            1 | 2 => format!("{:?}", value * 10_f64.powi(self.below(13) as i32 - 6)),
            3 | 4 => format!("{:?}", value + self.below(2001) as f64 * 1e-3 - 1.0),
            5 => format!("{:?}", value * (self.below(2001) as f64 * 1e-3)),
            6 => format!("{}", self.below(40)),
            7 => String::from_utf8_lossy(all[*self.pick(&numbers)]).into_owned(),
            _ => self.pick(&NUMBERS).to_string(),
        };
        all[at] = other.as_bytes();
        all.concat()
    }

    /// A word left out, doubled, or another for it.
    fn tokens(&mut self, input: &[u8], other: &[u8]) -> Vec<u8> {
        let (mut own, others) = (tokens(input), tokens(other));
        let words = |all: &[&[u8]]| -> Vec<usize> {
            let word = |i: &usize| all[*i].first().is_some_and(|b| in_word(*b));
            (0..all.len()).filter(word).collect()
        };
        let (mine, theirs) = (words(&own), words(&others));
        if mine.is_empty() {
            return input.to_vec();
        }
        let at = *self.pick(&mine);
        match self.below(4) {
            0 => own[at] = own[*self.pick(&mine)],
            1 => own.insert(at, own[*self.pick(&mine)]),
            2 => drop(own.remove(at)),
            _ if theirs.is_empty() => {}
            _ => own[at] = others[*self.pick(&theirs)],
        }
        own.concat()
    }
}

fn is_number(token: &[u8]) -> bool {
    let digit = token.iter().any(u8::is_ascii_digit);
    let letter =
        |b: &u8| (b.is_ascii_alphabetic() && !b"eE".contains(b)) || *b >= 128 || *b == b'_';
    digit && !token.iter().any(letter)
}

fn in_word(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || b"_.+-".contains(&byte) || byte >= 128
}

/// Words, numbers, and whatever one byte each stands between them.
fn tokens(input: &[u8]) -> Vec<&[u8]> {
    let mut out = Vec::new();
    let mut from = 0;
    while from < input.len() {
        let length = input[from..].iter().take_while(|b| in_word(**b)).count();
        out.push(&input[from..from + length.max(1)]);
        from += length.max(1);
    }
    out
}
