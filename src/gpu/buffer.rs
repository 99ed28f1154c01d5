//! Numbers in the device's memory.

use super::context::Context;
use super::pool::Pool;
use super::source::Arithmetic;
use crate::{Error, Result};
use std::sync::Arc;
use std::sync::atomic::Ordering;

/// An array in the device's memory. Clones are the same array; calls hold one, so that nothing is used again
/// before what was to be done with it has been started.
#[derive(Clone)]
pub(super) struct Buffer(Arc<Held>);

struct Held {
    raw: wgpu::Buffer,
    bytes: u64,
    pool: Arc<Pool>,
}

impl Drop for Held {
    fn drop(&mut self) {
        self.pool.put(self.bytes, self.raw.clone());
    }
}

impl Buffer {
    pub fn raw(&self) -> &wgpu::Buffer {
        &self.0.raw
    }
}

impl Arithmetic {
    /// Bytes of one number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::Single => 4,
            Self::Double | Self::TwoFloat => 8,
        }
    }

    fn encode(self, x: f64) -> [u8; 8] {
        match self {
            Self::Single => {
                let mut out = [0; 8];
                out[..4].copy_from_slice(&(x as f32).to_le_bytes());
                out
            }
            Self::Double => x.to_le_bytes(),
            Self::TwoFloat => {
                let high = x as f32;
                let low = (x - f64::from(high)) as f32;
                let mut out = [0; 8];
                out[..4].copy_from_slice(&high.to_le_bytes());
                out[4..].copy_from_slice(&low.to_le_bytes());
                out
            }
        }
    }

    /// Numbers from their bytes.
    pub(super) fn numbers(self, bytes: &[u8]) -> Vec<f64> {
        bytes
            .chunks_exact(self.size())
            .map(|c| self.decode(c))
            .collect()
    }

    fn decode(self, bytes: &[u8]) -> f64 {
        let single = |at: usize| {
            let mut four = [0; 4];
            four.copy_from_slice(&bytes[at..at + 4]);
            f64::from(f32::from_le_bytes(four))
        };
        match self {
            Self::Single => single(0),
            Self::Double => {
                let mut eight = [0; 8];
                eight.copy_from_slice(&bytes[..8]);
                f64::from_le_bytes(eight)
            }
            Self::TwoFloat => single(0) + single(4),
        }
    }
}

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
        let most = self.largest_binding();
        if bytes > most {
            return Err(failed(format!("a shader sees at most {most}")));
        }
        let of = |raw| {
            let pool = self.pool.clone();
            Buffer(Arc::new(Held { raw, bytes, pool }))
        };
        if let Some(raw) = self.pool.take(bytes) {
            return Ok(of(raw));
        }
        let attempt = || {
            let guard = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
            let raw = self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage: wgpu::BufferUsages::STORAGE
                    | wgpu::BufferUsages::COPY_DST
                    | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            });
            pollster::block_on(guard.pop()).map_or(Ok(raw), Err)
        };
        let raw = match attempt() {
            Ok(raw) => raw,
            Err(_) => {
                self.pool.drain();
                // What is still in use is given back only once that has ended.
                let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
                attempt().map_err(|e| failed(e.to_string()))?
            }
        };
        self.check()?;
        self.pool.counters.allocate(bytes);
        Ok(of(raw))
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
        self.write(&out, arithmetic, values);
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
        self.write_words(&out, &words);
        Ok(out)
    }

    /// Overwrites the beginning of an array.
    pub(super) fn write(&self, to: &Buffer, arithmetic: Arithmetic, values: &[f64]) {
        let size = arithmetic.size();
        let bytes: Vec<u8> = values
            .iter()
            .flat_map(|x| arithmetic.encode(*x).into_iter().take(size))
            .collect();
        if !bytes.is_empty() {
            self.queue.write_buffer(to.raw(), 0, &bytes);
        }
    }

    /// Overwrites the beginning of an array of whole numbers.
    pub(super) fn write_words(&self, to: &Buffer, words: &[u32]) {
        if !words.is_empty() {
            self.queue
                .write_buffer(to.raw(), 0, bytemuck::cast_slice(words));
        }
    }

    /// The settings of one call: words, floats as their bits.
    pub(super) fn uniform(&self, words: &[u32]) -> wgpu::Buffer {
        let mut words = words.to_vec();
        words.resize(words.len().next_multiple_of(4), 0);
        let raw = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("settings"),
            size: 4 * words.len() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.queue
            .write_buffer(&raw, 0, bytemuck::cast_slice(&words));
        raw
    }

    /// Waits for the beginnings of some arrays, so many bytes of each: one read-back.
    ///
    /// # Errors
    /// A fault of the device.
    pub(super) fn read_bytes(&self, parts: &[(&Buffer, usize)]) -> Result<Vec<Vec<u8>>> {
        let padded = |n: usize| n.next_multiple_of(16) as u64;
        let total: u64 = parts.iter().map(|(_, n)| padded(*n)).sum();
        if total == 0 {
            return Ok(parts.iter().map(|_| Vec::new()).collect());
        }
        self.check()?;
        let most = self.largest_buffer();
        if total > most {
            return Err(self.failure(format!(
                "{total} bytes are to be read back at once, and a buffer holds at most {most}"
            )));
        }
        let guard = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read-back"),
            size: total,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        if let Some(e) = pollster::block_on(guard.pop()) {
            return Err(self.failure(format!("reading {total} bytes back: {e}")));
        }
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut at = 0;
        for (buffer, n) in parts {
            encoder.copy_buffer_to_buffer(
                buffer.raw(),
                0,
                &staging,
                at,
                padded(*n).min(buffer.0.bytes),
            );
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
        match receive.recv() {
            Ok(Ok(())) => {}
            Ok(Err(e)) => return Err(self.failure(format!("reading back failed: {e}"))),
            Err(e) => return Err(self.failure(format!("reading back failed: {e}"))),
        }
        let view = staging
            .get_mapped_range(..)
            .map_err(|e| self.failure(format!("reading back failed: {e}")))?;
        let mut at = 0;
        let mut out = Vec::with_capacity(parts.len());
        for (_, n) in parts {
            out.push(view[at..at + n].to_vec());
            at += padded(*n) as usize;
        }
        self.pool
            .counters
            .read_backs
            .fetch_add(1, Ordering::Relaxed);
        self.pool
            .counters
            .bytes_back
            .fetch_add(total, Ordering::Relaxed);
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
        let size = arithmetic.size();
        let sized: Vec<(&Buffer, usize)> = parts.iter().map(|(b, n)| (*b, n * size)).collect();
        let bytes = self.read_bytes(&sized)?;
        Ok(bytes.iter().map(|b| arithmetic.numbers(b)).collect())
    }
}
