//! What is asked about one scene, and how many numbers that takes.

use super::model::{Model, STEPS};
use crate::coupling::SceneSize;
use crate::gpu::buffer::Buffer;
use crate::gpu::kernel::Call;
use crate::gpu::source::{Arithmetic, Constant};
use crate::{Error, Result};

/// Questions of one kind go to the device together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Kind {
    /// The basis at new poses: momenta alone.
    Value,
    /// The same, with the wrenches of all pairs of columns, and all that the others ask for.
    Basis,
    /// So many columns of further twists: momenta, and wrenches with a combination of the basis.
    Respond(usize),
    /// The tangent of one or two combinations of the basis along a displacement.
    Tangent(usize),
}

/// Numbers of the status: unsolved columns, columns with a direction of no positive curvature, iterations, the residual.
pub(super) const STATUS: usize = 4;

/// One question.
#[derive(Clone, Debug)]
pub(super) struct Question {
    pub kind: Kind,
    /// Where the scene's state is.
    pub slot: u32,
    /// Numbers for the solve, as the device has them.
    pub input: Vec<u8>,
    /// And for the wrenches.
    pub direction: Vec<u8>,
}

/// Numbers of one question of a kind.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lengths {
    pub input: usize,
    pub direction: usize,
    /// Of the solve's answer.
    pub answer: usize,
    /// Of the wrenches.
    pub wrenches: usize,
    pub work: usize,
    /// In single precision.
    pub rough: usize,
}

impl Kind {
    /// Columns that are solved for.
    pub fn columns(self, sizes: &SceneSize) -> usize {
        match self {
            Self::Value | Self::Basis => sizes.columns,
            Self::Respond(n) | Self::Tangent(n) => n,
        }
    }

    /// Those and the probe.
    pub fn wide(self, sizes: &SceneSize) -> usize {
        self.columns(sizes) + usize::from(self.places())
    }

    /// Whether it places the points.
    pub fn places(self) -> bool {
        matches!(self, Self::Value | Self::Basis)
    }

    /// How many numbers it takes.
    pub fn lengths(self, sizes: &SceneSize) -> Lengths {
        let (n, wide) = (self.columns(sizes), self.wide(sizes));
        let (points, modes, bodies) = (sizes.points, sizes.modes, sizes.bodies);
        let twists = 6 * bodies * n;
        let work =
            |directions: usize, pulls: usize| 2 * modes * n + points * (2 * n + directions + pulls);
        let placed = twists + STATUS + 1 + 2 * STEPS;
        let poses = 12 * (bodies + sizes.images);
        let [input, direction, answer, wrenches] = match self {
            Self::Value => [poses + twists, 0, placed, 0],
            Self::Basis => [poses + twists, 0, placed, 3 * bodies * n * (n + 1)],
            Self::Respond(n) => [twists, sizes.columns, twists + STATUS, 6 * bodies * n],
            Self::Tangent(n) => [
                sizes.columns * n + 6 * sizes.images * bodies,
                0,
                twists + 12 * bodies + STATUS,
                0,
            ],
        };
        Lengths {
            input,
            direction,
            answer,
            wrenches,
            work: match self {
                Self::Tangent(n) => work(2 * n, 12),
                _ => work(1, 3 * (n + 1)),
            },
            rough: (4 * modes + 2 * points) * wide.next_multiple_of(4),
        }
    }
}

/// The shaders of a kind with their buffers, for up to so many questions.
pub(super) struct Prepared {
    pub lengths: Lengths,
    pub slots: Buffer,
    pub inputs: Buffer,
    pub directions: Buffer,
    pub answers: Buffer,
    pub wrenches: Buffer,
    /// The solve, and the wrenches where they are asked for.
    pub calls: Vec<Call>,
}

/// What questions of all kinds share: state by slots, and work by questions.
pub(super) struct Shared {
    pub points: Buffer,
    pub charges: Buffer,
    pub work: Buffer,
    pub rough: Buffer,
}

impl Prepared {
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(model: &Model, shared: &Shared, kind: Kind, capacity: usize) -> Result<Self> {
        let (context, lengths) = (&model.context, kind.lengths(&model.sizes));
        let reals = |label, count: usize| context.reals(label, context.fine(), count * capacity);
        let slots = context.upload_words("slots", &vec![0; capacity])?;
        let inputs = reals("questions", lengths.input)?;
        let directions = reals("directions", lengths.direction)?;
        let answers = reals("answers", lengths.answer)?;
        let wrenches = reals("wrenches", lengths.wrenches)?;
        let number = |n: usize| Constant::Number(n as u32);
        let columns = kind.columns(&model.sizes);
        let fine = context.fine();
        let call = |shader: (&'static str, &'static str, Arithmetic),
                    wide: usize,
                    inputs: &Buffer,
                    answers: &Buffer| {
            let mut constants = vec![
                ("LANES", number(model.lanes)),
                ("COLUMNS", number(columns)),
                ("WIDE", number(wide)),
                ("QUADS", number(wide.div_ceil(4))),
            ];
            if shader.0 == "batch_solve" {
                constants.push(("PLACE", Constant::Flag(kind.places())));
            }
            let buffers = [
                ("slots", &slots),
                ("inputs", inputs),
                ("points", &shared.points),
                ("charges", &shared.charges),
                ("work", &shared.work),
                ("rough", &shared.rough),
                ("answers", answers),
            ];
            context.call(shader, &constants, &[], (&model.table, &buffers), [0; 3])
        };
        let wide = kind.wide(&model.sizes);
        let calls = match kind {
            Kind::Value => vec![call(
                ("batch_solve", "main", fine),
                wide,
                &inputs,
                &answers,
            )?],
            Kind::Basis => vec![
                call(("batch_solve", "main", fine), wide, &inputs, &answers)?,
                call(
                    ("batch_pull", "main", fine),
                    columns,
                    &directions,
                    &wrenches,
                )?,
            ],
            Kind::Respond(_) => vec![
                call(("batch_solve", "main", fine), wide, &inputs, &answers)?,
                call(
                    ("batch_pull", "main", fine),
                    columns + 1,
                    &directions,
                    &wrenches,
                )?,
            ],
            Kind::Tangent(_) => vec![call(
                ("batch_tangent", "main", fine),
                wide,
                &inputs,
                &answers,
            )?],
        };
        Ok(Self {
            lengths,
            slots,
            inputs,
            directions,
            answers,
            wrenches,
            calls,
        })
    }
}

impl Question {
    /// Checks that it is of its kind's size.
    ///
    /// # Errors
    /// One that isn't.
    pub fn check(&self, model: &Model) -> Result<()> {
        let lengths = self.kind.lengths(&model.sizes);
        let size = model.context.fine().size();
        let given = [self.input.len(), self.direction.len()];
        let right = [lengths.input * size, lengths.direction * size];
        if given == right {
            return Ok(());
        }
        Err(Error::input(
            "a question to the device",
            format!("{given:?} bytes"),
            format!("must have {right:?}: the poses, twists or directions are of another scene"),
        ))
    }
}
