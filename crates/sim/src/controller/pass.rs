//! Effects of the frame in the processing unit, kept until its FCS is known (protocol 2.5).
//!
//! Input: writes to shadowed registers and reads with side effects, in the order of the datagrams. Output: the same,
//! for [`super::Controller`] to apply at the end of the frame, or to discard.

use crate::time::SimTime;

/// Capacity for the data of the largest datagram and the register writes of a usual frame.
const BUFFER: usize = 2048;

/// Reads and writes of one frame that take effect at its end.
#[derive(Clone, Debug)]
pub(super) struct Pass {
    /// Number of the frame.
    pub frame: u64,
    /// Time at which its first bit arrived.
    pub start: SimTime,
    /// Whether it wrote REGISTER_WRITE_ENABLE.
    pub register_write_enable: bool,
    /// Whether it wrote ESC_WRITE_ENABLE.
    pub esc_write_enable: bool,
    /// Whether it read DL_STATUS.
    pub read_dl_status: bool,
    /// Whether it read AL_STATUS.
    pub read_al_status: bool,
    /// Whether it latches receive times.
    pub latches: bool,
    /// SyncManagers of the areas that it accessed, one bit each.
    pub sync_managers: u16,
    /// Address and length of each register write; the bytes are in `bytes`, in order.
    pub writes: Vec<(u16, u16)>,
    /// Value and mask of each byte to write.
    pub bytes: Vec<(u8, u8)>,
    /// Received data, for commands that read and write.
    pub incoming: Vec<u8>,
}

impl Pass {
    pub fn new() -> Pass {
        Pass {
            frame: 0,
            start: SimTime::ZERO,
            register_write_enable: false,
            esc_write_enable: false,
            read_dl_status: false,
            read_al_status: false,
            latches: false,
            sync_managers: 0,
            writes: Vec::new(),
            bytes: Vec::new(),
            incoming: Vec::new(),
        }
    }

    /// Starts a new frame.
    pub fn begin(&mut self, frame: u64, start: SimTime) {
        (self.frame, self.start) = (frame, start);
        self.clear();
    }

    /// Whether the frame has no effects at its end.
    pub fn is_idle(&self) -> bool {
        self.writes.is_empty()
            && self.sync_managers == 0
            && !(self.read_dl_status || self.read_al_status || self.latches)
    }

    /// Clears everything except the frame.
    pub fn clear(&mut self) {
        (self.register_write_enable, self.esc_write_enable) = (false, false);
        (self.read_dl_status, self.read_al_status, self.latches) = (false, false, false);
        self.sync_managers = 0;
        self.writes.clear();
        self.bytes.clear();
    }

    /// Stores a write to registers.
    pub fn write(&mut self, address: u32, data: &[u8], mask: u8) {
        if self.bytes.capacity() == 0 {
            self.bytes.reserve(BUFFER);
        }
        self.writes.push((address as u16, data.len() as u16));
        self.bytes.extend(data.iter().map(|&value| (value, mask)));
    }

    /// Stores received data.
    pub fn keep_incoming(&mut self, data: &[u8]) {
        if self.incoming.capacity() == 0 {
            self.incoming.reserve(BUFFER);
        }
        self.incoming.clear();
        self.incoming.extend_from_slice(data);
    }
}
