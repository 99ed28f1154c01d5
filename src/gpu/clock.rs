//! The device's own clock.

use super::buffer::Buffer;
use super::context::Context;

/// Times at which a pass begins and ends.
pub(super) struct Clock {
    set: wgpu::QuerySet,
    read: Buffer,
    /// Seconds of a tick.
    tick: f64,
}

impl Context {
    /// A clock, where the device has one.
    pub(super) fn clock(&self) -> Option<Clock> {
        let features = self.device.features();
        features
            .contains(wgpu::Features::TIMESTAMP_QUERY)
            .then(|| Clock {
                set: self.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("clock"),
                    ty: wgpu::QueryType::Timestamp,
                    count: 2,
                }),
                read: self.times(Clock::BYTES),
                tick: 1e-9 * f64::from(self.queue.get_timestamp_period()),
            })
    }
}

impl Clock {
    /// Of both times.
    pub const BYTES: usize = 16;

    /// What a pass is given to be timed.
    pub fn around(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// Writes down that the times are put where they can be read.
    pub fn read(&self, encoder: &mut wgpu::CommandEncoder) -> &Buffer {
        encoder.resolve_query_set(&self.set, 0..2, self.read.raw(), 0);
        &self.read
    }

    /// Seconds between both times.
    pub fn seconds(&self, bytes: &[u8]) -> f64 {
        let time = |at: usize| -> Option<u64> {
            Some(bytemuck::pod_read_unaligned(bytes.get(at..at + 8)?))
        };
        match (time(0), time(8)) {
            (Some(begin), Some(end)) => end.saturating_sub(begin) as f64 * self.tick,
            _ => 0.0,
        }
    }
}
