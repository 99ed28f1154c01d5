//! Numbers in the device's memory.

use super::context::Context;
use super::pool::Pool;
use super::source::Arithmetic;
use crate::{Error, Result};
use std::sync::Arc;

/// An array in the device's memory. Clones are the same array; calls hold one, so that nothing is used again
/// before what was to be done with it has been started.
#[derive(Clone)]
pub(super) struct Buffer(Arc<Held>);

struct Held {
    raw: wgpu::Buffer,
    bytes: u64,
    /// Where it goes when it is no longer in use; nowhere with the settings of a call.
    pool: Option<Arc<Pool>>,
}

impl Drop for Held {
    fn drop(&mut self) {
        if let Some(pool) = &self.pool {
            pool.put(self.bytes, self.raw.clone());
        }
    }
}

impl Buffer {
    pub fn raw(&self) -> &wgpu::Buffer {
        &self.0.raw
    }
}

/// Beginnings of arrays, read back.
type Bytes = Vec<Vec<u8>>;

/// Whole numbers from their bytes.
pub(super) fn words(bytes: &[u8]) -> Vec<u32> {
    let word = bytemuck::pod_read_unaligned;
    bytes.chunks_exact(4).map(word).collect()
}

impl Arithmetic {
    /// Bytes of one number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Single => 4,
            Self::Double | Self::TwoFloat => 8,
        }
    }

    /// Bytes of numbers.
    pub(super) fn bytes(self, values: &[f64]) -> Vec<u8> {
        let two = |x: f64| [x as f32, (x - f64::from(x as f32)) as f32];
        let single = |x: &f64| (*x as f32).to_ne_bytes();
        match self {
            Self::Single => values.iter().flat_map(single).collect(),
            Self::Double => bytemuck::cast_slice(values).to_vec(),
            Self::TwoFloat => {
                let halves = values.iter().flat_map(|x| two(*x));
                halves.flat_map(f32::to_ne_bytes).collect()
            }
        }
    }

    /// Numbers from their bytes.
    pub(super) fn numbers(self, bytes: &[u8]) -> Vec<f64> {
        let single = |bytes: &[u8]| f64::from(bytemuck::pod_read_unaligned::<f32>(bytes));
        let number = |c: &[u8]| match self {
            Self::Single => single(c),
            Self::Double => bytemuck::pod_read_unaligned(c),
            Self::TwoFloat => single(&c[..4]) + single(&c[4..]),
        };
        bytes.chunks_exact(self.size()).map(number).collect()
    }
}

/// Of memory that the host reads.
const READ: wgpu::BufferUsages = wgpu::BufferUsages::MAP_READ.union(wgpu::BufferUsages::COPY_DST);

impl Context {
    /// An array of so many bytes, whatever they hold.
    ///
    /// # Errors
    /// [`Error::Device`] where it is larger than a shader can see, or the memory is at its end.
    pub(super) fn bytes(&self, label: &str, bytes: usize) -> Result<Buffer> {
        let bytes = (bytes.max(16) as u64).next_multiple_of(16);
        let failed = |what: String| Error::Device {
            adapter: self.adapter().name.clone(),
            what: format!("{label}, {bytes} bytes: {what}"),
            remedy: "use fewer faces or bodies, the preconditioner jacobi, or the backend cpu"
                .into(),
        };
        let most = self.adapter().largest_binding;
        if bytes > most {
            return Err(failed(format!("a shader sees at most {most}")));
        }
        let of = |raw| {
            let pool = Some(self.pool.clone());
            Buffer(Arc::new(Held { raw, bytes, pool }))
        };
        if let Some(raw) = self.pool.take(bytes) {
            return Ok(of(raw));
        }
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let raw = self
            .made(label, bytes, usage)
            .map_err(|e| failed(e.to_string()))?;
        self.check()?;
        self.pool.count(|c| c.memory += bytes);
        Ok(of(raw))
    }

    /// Fresh memory; where there is none, once more after all that isn't in use has been given back.
    fn made(
        &self,
        label: &str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> std::result::Result<wgpu::Buffer, wgpu::Error> {
        let attempt = || {
            let guard = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
            let raw = self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage,
                mapped_at_creation: false,
            });
            pollster::block_on(guard.pop()).map_or(Ok(raw), Err)
        };
        attempt().or_else(|_| {
            self.pool.drain();
            // What is still in use is given back only once that has ended.
            let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
            attempt()
        })
    }

    /// An array of so many real numbers, zero at first.
    ///
    /// # Errors
    /// As [`Context::bytes`].
    pub(super) fn zeros(
        &self,
        label: &str,
        arithmetic: Arithmetic,
        count: usize,
    ) -> Result<Buffer> {
        let out = self.reals(label, arithmetic, count)?;
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.clear_buffer(out.raw(), 0, None);
        self.queue.submit([encoder.finish()]);
        Ok(out)
    }

    /// An array of so many real numbers.
    ///
    /// # Errors
    /// As [`Context::bytes`].
    pub(super) fn reals(
        &self,
        label: &str,
        arithmetic: Arithmetic,
        count: usize,
    ) -> Result<Buffer> {
        self.bytes(label, count * arithmetic.size())
    }

    /// An array of these real numbers.
    ///
    /// # Errors
    /// As [`Context::bytes`].
    pub(super) fn upload(
        &self,
        label: &str,
        arithmetic: Arithmetic,
        values: &[f64],
    ) -> Result<Buffer> {
        let out = self.reals(label, arithmetic, values.len())?;
        let bytes = arithmetic.bytes(values);
        self.queue.write_buffer(out.raw(), 0, &bytes);
        Ok(out)
    }

    /// An array of these whole numbers.
    ///
    /// # Errors
    /// As [`Context::bytes`].
    pub(super) fn upload_words(&self, label: &str, words: &[u32]) -> Result<Buffer> {
        let out = self.bytes(label, 4 * words.len())?;
        // Shaders see the padding, too.
        let mut words = words.to_vec();
        words.resize((out.0.bytes / 4) as usize, 0);
        let bytes = bytemuck::cast_slice(&words);
        self.queue.write_buffer(out.raw(), 0, bytes);
        Ok(out)
    }

    /// Where the device's times are put, so many bytes.
    pub(super) fn times(&self, bytes: usize) -> Buffer {
        let bytes = bytes as u64;
        let raw = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("times"),
            size: bytes,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let pool = None;
        Buffer(Arc::new(Held { raw, bytes, pool }))
    }

    /// The settings of a call: words, floats as their bits.
    pub(super) fn uniform(&self, words: &[usize]) -> Buffer {
        let mut words: Vec<u32> = words.iter().map(|n| *n as u32).collect();
        words.resize(words.len().next_multiple_of(4), 0);
        let bytes = 4 * words.len() as u64;
        let raw = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("settings"),
            size: bytes,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let all = bytemuck::cast_slice(&words);
        self.queue.write_buffer(&raw, 0, all);
        let pool = None;
        Buffer(Arc::new(Held { raw, bytes, pool }))
    }

    /// Waits for the beginnings of some arrays, so many bytes of each: one read-back.
    ///
    /// # Errors
    /// A fault of the device.
    pub(super) fn read_bytes(&self, parts: &[(&Buffer, usize)]) -> Result<Bytes> {
        let padded = |n: usize| n.next_multiple_of(16) as u64;
        let total: u64 = parts.iter().map(|(_, n)| padded(*n)).sum();
        if total == 0 {
            return Ok(parts.iter().map(|_| Vec::new()).collect());
        }
        self.check()?;
        let most = self.limits.max_buffer_size;
        if total > most {
            return Err(self.failure(format!(
                "{total} bytes are to be read back at once, and a buffer holds at most {most}"
            )));
        }
        let staging = self
            .made("read-back", total, READ)
            .map_err(|e| self.failure(format!("reading {total} bytes back: {e}")))?;
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut at = 0;
        for (buffer, n) in parts {
            let size = padded(*n).min(buffer.0.bytes);
            encoder.copy_buffer_to_buffer(buffer.raw(), 0, &staging, at, size);
            at += padded(*n);
        }
        self.queue.submit([encoder.finish()]);
        let (send, receive) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, .., move |result| {
            // A receiver that is gone wants nothing.
            let _ = send.send(result);
        });
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        waited.map_err(|e| self.failure(format!("waiting for it failed: {e}")))?;
        let failed = |e: String| self.failure(format!("reading back failed: {e}"));
        let mapped = receive.recv().map_err(|e| failed(e.to_string()))?;
        mapped.map_err(|e| failed(e.to_string()))?;
        let view = staging.get_mapped_range(..);
        let view = view.map_err(|e| failed(e.to_string()))?;
        let mut at = 0;
        let mut out = Vec::with_capacity(parts.len());
        for (_, n) in parts {
            out.push(view[at..at + n].to_vec());
            at += padded(*n) as usize;
        }
        self.pool.count(|c| {
            c.read_backs += 1;
            c.bytes_back += total;
        });
        Ok(out)
    }

    /// Starts what is written down, and waits for so many bytes (multiples of 4) of each of some arrays, one behind the other: in memory that is
    /// kept from one time to the next. What others have started meanwhile isn't waited for.
    ///
    /// # Errors
    /// A fault of the device.
    pub(super) fn finish_and_read(
        &self,
        mut encoder: wgpu::CommandEncoder,
        parts: &[(&Buffer, usize)],
        staging: &mut Option<(wgpu::Buffer, u64)>,
    ) -> Result<Vec<u8>> {
        self.check()?;
        let total: u64 = parts.iter().map(|(_, n)| *n as u64).sum();
        let most = self.limits.max_buffer_size;
        if total > most {
            return Err(self.failure(format!(
                "{total} bytes are to be read back at once, and a buffer holds at most {most}"
            )));
        }
        if staging.as_ref().is_none_or(|(_, size)| *size < total) {
            let size = total.next_power_of_two().clamp(16, most);
            let made = self
                .made("read-back", size, READ)
                .map_err(|e| self.failure(format!("reading {total} bytes back: {e}")))?;
            *staging = Some((made, size));
        }
        let Some((staging, _)) = staging else {
            return Ok(Vec::new());
        };
        let mut at = 0;
        for (buffer, n) in parts.iter().filter(|(_, n)| *n > 0) {
            encoder.copy_buffer_to_buffer(buffer.raw(), 0, staging, at, *n as u64);
            at += *n as u64;
        }
        let submitted = self.queue.submit([encoder.finish()]);
        let (send, receive) = std::sync::mpsc::channel();
        staging.map_async(wgpu::MapMode::Read, ..total, move |result| {
            // A receiver that is gone wants nothing.
            let _ = send.send(result);
        });
        let waited = self.device.poll(wgpu::PollType::Wait {
            submission_index: Some(submitted),
            timeout: None,
        });
        self.check()?;
        waited.map_err(|e| self.failure(format!("waiting for it failed: {e}")))?;
        let failed = |e: String| self.failure(format!("reading back failed: {e}"));
        let mapped = receive.recv().map_err(|e| failed(e.to_string()))?;
        mapped.map_err(|e| failed(e.to_string()))?;
        let view = staging.get_mapped_range(..total);
        let out = view.map_err(|e| failed(e.to_string()))?.to_vec();
        staging.unmap();
        self.pool.count(|c| {
            c.read_backs += 1;
            c.bytes_back += total;
        });
        Ok(out)
    }

    /// Waits for the beginnings of some arrays of real numbers, so many of each: one read-back.
    ///
    /// # Errors
    /// A fault of the device.
    pub(super) fn read(
        &self,
        arithmetic: Arithmetic,
        parts: &[(&Buffer, usize)],
    ) -> Result<Vec<Vec<f64>>> {
        Ok(self.read_beside(arithmetic, parts, &[])?.0)
    }

    /// As [`Context::read`], with so many bytes of other arrays.
    ///
    /// # Errors
    /// As there.
    pub(super) fn read_beside(
        &self,
        arithmetic: Arithmetic,
        parts: &[(&Buffer, usize)],
        others: &[(&Buffer, usize)],
    ) -> Result<(Vec<Vec<f64>>, Bytes)> {
        let size = arithmetic.size();
        let mut all: Vec<(&Buffer, usize)> = parts.iter().map(|(b, n)| (*b, n * size)).collect();
        all.extend(others);
        let mut bytes = self.read_bytes(&all)?;
        let others = bytes.split_off(parts.len());
        Ok((
            bytes.iter().map(|b| arithmetic.numbers(b)).collect(),
            others,
        ))
    }
}

#[cfg(test)]
mod tests {
    use crate::gpu::{Context, Options};

    /// Arrays of ever other sizes, each given back: what lies idle doesn't grow without end.
    #[test]
    fn idle_memory_is_bounded() {
        let context = Context::open(&Options::default()).expect("a device, if a software one");
        for k in 0..40 {
            let bytes = (24 << 20) + 4096 * k;
            drop(context.bytes("tried", bytes).expect("memory"));
        }
        assert!(context.counts().memory <= super::super::pool::IDLE);
        // The same size again is the same memory.
        let before = context.counts().memory;
        let bytes = (24 << 20) + 4096 * 39;
        drop(context.bytes("tried", bytes).expect("memory"));
        assert_eq!(context.counts().memory, before);
    }
}
