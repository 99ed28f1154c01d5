//! Questions to the device, and its answers: one submission and one read-back for as many as fit.

use super::model::Model;
use super::question::{Kind, Prepared, Question, Shared};
use crate::Result;
use crate::gpu::buffer::Buffer;
use crate::gpu::clock::Clock;
use crate::gpu::kernel::Call;
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;
use std::time::Instant;

/// What came back for one question: among the bytes for all, the solve's answer and the wrenches.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    bytes: Arc<Vec<u8>>,
    answer: Range<usize>,
    wrenches: Range<usize>,
}

/// Seconds of packing and of waiting.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spent {
    pub packing: f64,
    pub waiting: f64,
    /// Of the device's own work, where it has a clock.
    pub computing: Option<f64>,
}

/// The device's memory for a group of scenes.
pub(super) struct Runner {
    model: Arc<Model>,
    /// Questions at once.
    capacity: usize,
    shared: Shared,
    prepared: HashMap<Kind, Prepared>,
    /// Where the host reads.
    staging: Option<(wgpu::Buffer, u64)>,
    clock: Option<Clock>,
    pub spent: Spent,
}

impl Answer {
    /// The numbers of the solve's answer, and of the wrenches.
    pub fn numbers(&self, model: &Model) -> [Vec<f64>; 2] {
        let fine = model.context.fine();
        let of = |range: &Range<usize>| fine.numbers(&self.bytes[range.clone()]);
        [of(&self.answer), of(&self.wrenches)]
    }
}

/// Bytes on the device that a scene takes: its slots' state, and one question's work.
pub(super) fn scene_bytes(model: &Model, slots: usize) -> [usize; 4] {
    let (sizes, fine) = (&model.sizes, model.context.fine().size());
    let kinds = [
        Kind::Basis,
        Kind::Respond(sizes.columns),
        Kind::Tangent(1),
        Kind::Tangent(2),
    ];
    let most = |of: fn(&super::question::Lengths) -> usize| {
        let all = kinds.iter().map(|kind| of(&kind.lengths(sizes)));
        all.max().unwrap_or(0)
    };
    [
        3 * sizes.images * sizes.points * fine * slots,
        sizes.points * sizes.columns * fine * slots,
        most(|l| l.work) * fine,
        most(|l| l.rough) * 4,
    ]
}

impl Runner {
    /// For so many scenes of so many slots.
    ///
    /// # Errors
    /// A device that fails, or has too little memory.
    pub fn new(model: &Arc<Model>, scenes: usize, slots: usize) -> Result<Self> {
        let context = &model.context;
        let [points, charges, work, rough] = scene_bytes(model, slots).map(|n| n * scenes);
        let shared = Shared {
            points: context.bytes("points of the scenes", points)?,
            charges: context.bytes("charges of the scenes", charges)?,
            work: context.bytes("work of the scenes", work)?,
            rough: context.bytes("work in single precision", rough)?,
        };
        Ok(Self {
            model: model.clone(),
            capacity: scenes,
            shared,
            prepared: HashMap::new(),
            staging: None,
            clock: context.clock(),
            spent: Spent::default(),
        })
    }

    /// Answers, in the order of the questions.
    ///
    /// # Errors
    /// A device that fails.
    pub fn run(&mut self, questions: &[Question]) -> Result<Vec<Answer>> {
        let mut kinds: Vec<Kind> = questions.iter().map(|q| q.kind).collect();
        kinds.sort();
        kinds.dedup();
        let mut out: Vec<Option<Answer>> = vec![None; questions.len()];
        for kind in kinds {
            let of_kind: Vec<usize> = (0..questions.len())
                .filter(|i| questions[*i].kind == kind)
                .collect();
            for part in of_kind.chunks(self.capacity) {
                let found = self.part(kind, questions, part)?;
                for (i, answer) in part.iter().zip(found) {
                    out[*i] = Some(answer);
                }
            }
        }
        Ok(out.into_iter().flatten().collect())
    }

    /// Answers to some of the questions, all of one kind.
    fn part(&mut self, kind: Kind, all: &[Question], part: &[usize]) -> Result<Vec<Answer>> {
        let started = Instant::now();
        let (model, count) = (self.model.clone(), part.len());
        let (context, fine) = (&model.context, model.context.fine().size());
        for i in part {
            all[*i].check(&model)?;
        }
        let prepared = match self.prepared.remove(&kind) {
            Some(found) => found,
            None => Prepared::new(&model, &self.shared, kind, self.capacity)?,
        };
        let prepared = self.prepared.entry(kind).or_insert(prepared);
        let slots: Vec<u32> = part.iter().map(|i| all[*i].slot).collect();
        let join = |of: fn(&Question) -> &Vec<u8>| -> Vec<u8> {
            let parts = part.iter().map(|i| of(&all[*i]).as_slice());
            parts.collect::<Vec<_>>().concat()
        };
        let write = |buffer: &Buffer, bytes: &[u8]| {
            if !bytes.is_empty() {
                context.queue.write_buffer(buffer.raw(), 0, bytes);
            }
        };
        write(&prepared.slots, bytemuck::cast_slice(&slots));
        write(&prepared.inputs, &join(|q| &q.input));
        write(&prepared.directions, &join(|q| &q.direction));
        let mut encoder = context.device.create_command_encoder(&Default::default());
        let clock = self.clock.as_ref();
        let calls: Vec<&Call> = prepared.calls.iter_mut().map(|c| c.of(count)).collect();
        context.encode(&mut encoder, calls, clock.map(Clock::around));
        let times = clock.map(|clock| (clock.read(&mut encoder), Clock::BYTES));
        let lengths = prepared.lengths;
        let sizes = [lengths.answer, lengths.wrenches].map(|n| n * fine);
        let read = [
            (&prepared.answers, sizes[0]),
            (&prepared.wrenches, sizes[1]),
        ];
        let mut read: Vec<_> = read
            .iter()
            .map(|(buffer, size)| (*buffer, size * count))
            .collect();
        read.extend(times);
        let packed = started.elapsed().as_secs_f64();
        let bytes = context.finish_and_read(encoder, &read, &mut self.staging)?;
        self.spent.packing += packed;
        self.spent.waiting += started.elapsed().as_secs_f64() - packed;
        let second = sizes[0] * count;
        if let Some(clock) = &self.clock {
            let own = clock.seconds(&bytes[second + sizes[1] * count..]);
            self.spent.computing = Some(self.spent.computing.unwrap_or(0.0) + own);
        }
        let bytes = Arc::new(bytes);
        let of = |k: usize| Answer {
            bytes: bytes.clone(),
            answer: sizes[0] * k..sizes[0] * (k + 1),
            wrenches: second + sizes[1] * k..second + sizes[1] * (k + 1),
        };
        Ok((0..count).map(of).collect())
    }
}
