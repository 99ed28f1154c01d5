//! Calls of compiled shaders.

use super::buffer::Buffer;
use super::context::Context;
use super::pipeline::Kernel;
use crate::Result;
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// Calls of one submission: systems reset a card that works too long on one.
const AT_ONCE: usize = 64;

/// A kernel with its buffers and its number of workgroups.
pub(super) struct Call {
    kernel: Arc<Kernel>,
    groups: Vec<wgpu::BindGroup>,
    count: [u32; 3],
    _held: Vec<Buffer>,
}

/// What is to be done on the device, in order.
#[derive(Default)]
pub(super) struct Batch<'a> {
    calls: Vec<&'a Call>,
}

/// What stands in a variable.
pub(super) enum Bound<'a> {
    Buffer(&'a Buffer),
    Uniform(&'a wgpu::Buffer),
}

impl<'a> From<&'a Buffer> for Bound<'a> {
    fn from(b: &'a Buffer) -> Self {
        Self::Buffer(b)
    }
}

impl<'a> From<&'a wgpu::Buffer> for Bound<'a> {
    fn from(b: &'a wgpu::Buffer) -> Self {
        Self::Uniform(b)
    }
}

impl Context {
    /// A call of a kernel with these buffers, by the shader's own names for them.
    pub(super) fn call(
        &self,
        kernel: &Arc<Kernel>,
        buffers: &[(&str, Bound)],
        count: [u32; 3],
    ) -> Result<Call> {
        let wrong = |what: String| self.failure(format!("{}: {what}", kernel.name));
        let most = self.most_groups();
        if count.iter().any(|n| *n > most) {
            return Err(wrong(format!(
                "{count:?} workgroups are more than {most} along one dimension"
            )));
        }
        let mut entries: Vec<Vec<wgpu::BindGroupEntry>> =
            kernel.layouts.iter().map(|_| Vec::new()).collect();
        for b in &kernel.bindings {
            let resource = match buffers.iter().find(|(name, _)| *name == b.name) {
                Some((_, Bound::Buffer(buffer))) => buffer.raw().as_entire_binding(),
                Some((_, Bound::Uniform(buffer))) => buffer.as_entire_binding(),
                None if b.name == "nothing" => self.nothing.as_entire_binding(),
                None => return Err(wrong(format!("no buffer for {}", b.name))),
            };
            entries[b.group as usize].push(wgpu::BindGroupEntry {
                binding: b.binding,
                resource,
            });
        }
        let guard = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let groups = kernel
            .layouts
            .iter()
            .zip(&entries)
            .map(|(layout, entries)| {
                self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: Some(&kernel.name),
                    layout,
                    entries,
                })
            })
            .collect();
        if let Some(e) = pollster::block_on(guard.pop()) {
            return Err(wrong(e.to_string()));
        }
        let held = buffers.iter().filter_map(|(_, bound)| match bound {
            Bound::Buffer(buffer) => Some((*buffer).clone()),
            Bound::Uniform(_) => None,
        });
        Ok(Call {
            kernel: kernel.clone(),
            groups,
            count,
            _held: held.collect(),
        })
    }

    /// Starts everything of a batch, in order; returns at once.
    ///
    /// # Errors
    /// A fault of the device.
    pub(super) fn submit(&self, batch: &Batch) -> Result<()> {
        batch.calls.chunks(AT_ONCE).for_each(|c| self.start(c));
        self.check()
    }

    /// As [`Context::submit`], of calls in groups.
    ///
    /// # Errors
    /// As there.
    pub(super) fn run(&self, groups: &[&[Call]]) -> Result<()> {
        let mut batch = Batch::default();
        groups.iter().for_each(|calls| batch.extend(*calls));
        self.submit(&batch)
    }

    fn start(&self, calls: &[&Call]) {
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            for call in calls {
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
        }
        let count = calls.len() as u64;
        self.pool
            .counters
            .dispatches
            .fetch_add(count, Ordering::Relaxed);
        self.queue.submit([encoder.finish()]);
    }
}

impl<'a> Batch<'a> {
    pub fn push(&mut self, call: &'a Call) {
        self.calls.push(call);
    }

    pub fn extend(&mut self, calls: impl IntoIterator<Item = &'a Call>) {
        self.calls.extend(calls);
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
