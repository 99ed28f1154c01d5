//! Calls of compiled shaders.

use super::buffer::Buffer;
use super::context::Context;
use super::pipeline::Kernel;
use super::source::{Arithmetic, Constant};
use crate::Result;
use std::sync::Arc;

/// Calls of one submission: systems reset a card that works too long on one.
const AT_ONCE: usize = 64;

/// An array by the shaders' own name for it.
type Entry<T> = (&'static str, T);

/// Arrays that a family of shaders shares.
pub(super) type Table = Vec<Entry<Buffer>>;

/// A kernel with its buffers and its number of workgroups.
pub(super) struct Call {
    kernel: Arc<Kernel>,
    groups: Vec<wgpu::BindGroup>,
    count: [u32; 3],
    _held: Vec<Buffer>,
}

impl Context {
    /// A call of a shader's entry: what is fixed when it is compiled, the words of its `task`, and its buffers by
    /// the shader's own names for them, those of the call itself before the table's.
    pub(super) fn call(
        &self,
        (shader, entry, arithmetic): (&'static str, &'static str, Arithmetic),
        constants: &[(&'static str, Constant)],
        task: &[usize],
        (table, own): (&[Entry<Buffer>], &[Entry<&Buffer>]),
        count: [u32; 3],
    ) -> Result<Call> {
        let kernel = self.kernel(shader, entry, arithmetic, constants)?;
        let wrong = |what: String| self.failure(format!("{}: {what}", kernel.name));
        let most = self.limits.max_compute_workgroups_per_dimension;
        if count.iter().any(|n| *n > most) {
            return Err(wrong(format!(
                "{count:?} workgroups are more than {most} along one dimension"
            )));
        }
        let bound = |name: &str| match name {
            "task" => Ok(self.uniform(task)),
            // Zero, for shaders whose compiler mustn't know it.
            "nothing" => Ok(self.uniform(&[0])),
            _ => {
                let of_call = own.iter().copied();
                let of_table = table.iter().map(|(name, buffer)| (*name, buffer));
                let found = of_call.chain(of_table).find(|(n, _)| *n == name);
                let missing = || wrong(format!("no buffer for {name}"));
                found.map(|(_, buffer)| buffer.clone()).ok_or_else(missing)
            }
        };
        let bindings = kernel.bindings.iter();
        let held: Vec<Buffer> = bindings.map(|b| bound(&b.name)).collect::<Result<_>>()?;
        let mut entries: Vec<Vec<_>> = kernel.layouts.iter().map(|_| Vec::new()).collect();
        for (b, buffer) in kernel.bindings.iter().zip(&held) {
            entries[b.group as usize].push(wgpu::BindGroupEntry {
                binding: b.binding,
                resource: buffer.raw().as_entire_binding(),
            });
        }
        let guard = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let bind = |(layout, entries): (_, &Vec<_>)| {
            self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(&kernel.name),
                layout,
                entries,
            })
        };
        let groups = kernel.layouts.iter().zip(&entries).map(bind).collect();
        if let Some(e) = pollster::block_on(guard.pop()) {
            return Err(wrong(e.to_string()));
        }
        Ok(Call {
            kernel,
            groups,
            count,
            _held: held,
        })
    }

    /// Writes calls down, in order, perhaps with the times around them.
    pub(super) fn encode<'a>(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        calls: impl IntoIterator<Item = &'a Call>,
        timestamp_writes: Option<wgpu::ComputePassTimestampWrites>,
    ) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: None,
            timestamp_writes,
        });
        let mut made = 0;
        for call in calls {
            made += 1;
            if call.count.contains(&0) {
                continue;
            }
            pass.set_pipeline(&call.kernel.pipeline);
            for (i, group) in call.groups.iter().enumerate() {
                pass.set_bind_group(i as u32, group, &[]);
            }
            let [x, y, z] = call.count;
            pass.dispatch_workgroups(x, y, z);
        }
        drop(pass);
        self.pool.count(|c| c.dispatches += made);
    }

    /// Starts calls, in order; returns at once.
    ///
    /// # Errors
    /// A fault of the device.
    pub(super) fn submit<'a>(&self, calls: impl IntoIterator<Item = &'a Call>) -> Result<()> {
        let calls: Vec<&Call> = calls.into_iter().collect();
        for calls in calls.chunks(AT_ONCE) {
            let mut encoder = self.device.create_command_encoder(&Default::default());
            self.encode(&mut encoder, calls.iter().copied(), None);
            self.queue.submit([encoder.finish()]);
        }
        self.check()
    }
}

impl Call {
    /// The same with so many workgroups.
    pub fn of(&mut self, groups: usize) -> &Self {
        self.count = [groups as u32, 1, 1];
        self
    }
}

/// Workgroups of 64 threads for so many elements.
pub(super) fn threads(elements: usize) -> [u32; 3] {
    groups(elements.div_ceil(64))
}

/// So many workgroups, or a few more: over two dimensions where one doesn't do.
pub(super) fn groups(count: usize) -> [u32; 3] {
    let y = count.div_ceil(32768).max(1);
    [count.div_ceil(y) as u32, y as u32, 1]
}
