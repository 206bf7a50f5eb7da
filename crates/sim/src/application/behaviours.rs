//! Sources of a device's inputs: a constant, its own outputs, a function of time and outputs, a drive.
//!
//! Input: virtual time and the valid outputs (zero in the safe state). Output: the bytes of the inputs. No clock and no
//! random number is used, so two runs with the same frames give the same inputs (protocol 11.4).

use core::fmt;

use crate::time::SimTime;

/// Computes inputs from the time and the currently valid outputs.
pub type InputFunction = fn(SimTime, outputs: &[u8], inputs: &mut [u8]);

/// Source of the inputs. Longer values are truncated, shorter ones are filled with zeros.
#[derive(Clone)]
pub enum InputSource {
    /// The same bytes until a test changes them.
    Constant(Vec<u8>),
    /// The device's own valid outputs.
    Outputs,
    /// A function, called after each exchange of process data.
    Function(InputFunction),
}

impl InputSource {
    /// Whether the value changes without new outputs.
    pub const fn varies_with_time(&self) -> bool {
        matches!(self, InputSource::Function(_))
    }

    /// Fills `inputs`.
    pub fn fill(&self, now: SimTime, outputs: &[u8], inputs: &mut [u8]) {
        match self {
            InputSource::Constant(bytes) => copy(bytes, inputs),
            InputSource::Outputs => copy(outputs, inputs),
            InputSource::Function(function) => function(now, outputs, inputs),
        }
    }
}

impl fmt::Debug for InputSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            InputSource::Constant(bytes) => f.debug_tuple("Constant").field(bytes).finish(),
            InputSource::Outputs => f.write_str("Outputs"),
            InputSource::Function(_) => f.write_str("Function"),
        }
    }
}

/// Handling of process data.
#[derive(Clone, Debug)]
pub enum Behaviour {
    /// Outputs are kept for inspection, inputs come from a source.
    Terminal(InputSource),
    /// A CiA 402 drive (see [`Servo`](super::servo::Servo)).
    Servo,
}

impl Default for Behaviour {
    fn default() -> Self {
        Behaviour::Terminal(InputSource::Constant(Vec::new()))
    }
}

fn copy(from: &[u8], to: &mut [u8]) {
    let length = from.len().min(to.len());
    to[..length].copy_from_slice(&from[..length]);
    to[length..].fill(0);
}

/// A sawtooth on each 16-bit channel: one digit per microsecond, each channel a quarter of the range ahead of the
/// one before. Used by the analogue input terminals.
pub fn sawtooth_16(now: SimTime, _outputs: &[u8], inputs: &mut [u8]) {
    for (channel, bytes) in (0u64..).zip(inputs.chunks_exact_mut(2)) {
        let value = (now.0 / 1000).wrapping_add(channel * 0x4000);
        bytes.copy_from_slice(&value.to_le_bytes()[..2]);
    }
}

/// A bit pattern that counts up every 10 ms, for digital inputs that change without outputs.
pub fn counter_10_ms(now: SimTime, _outputs: &[u8], inputs: &mut [u8]) {
    let count = (now.0 / 10_000_000).to_le_bytes();
    for (byte, value) in inputs.iter_mut().zip(count) {
        *byte = value;
    }
}
