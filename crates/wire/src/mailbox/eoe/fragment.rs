//! A part of an Ethernet frame (protocol 6.5).

use super::head::{FRAGMENT, LAST, OVERHEAD, TIME_APPENDED, TIME_REQUESTED};
use crate::mailbox::payload::{FieldWriter, PayloadError};

/// Unit of offsets and sizes in bytes.
pub const BLOCK: usize = 32;

const OFFSET_SHIFT: u16 = 6;
const FRAME_SHIFT: u16 = 12;
const SIX_BITS: u8 = 0x3F;
const TIME_LEN: usize = 4;

/// A part of an Ethernet frame without its check sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EoeFragment<'a> {
    /// Number of the frame, 0..=15: distinguishes frames with interleaved fragments.
    pub frame: u8,
    /// Number of the fragment, 0..=63.
    pub number: u8,
    /// Offset of the data in blocks of 32 bytes; in fragment 0 the size of the whole frame, rounded up to blocks.
    pub blocks: u8,
    /// No fragment of this frame follows.
    pub last: bool,
    /// The sender requests the time at which the frame left the SubDevice.
    pub time_requested: bool,
    /// Time at which the frame arrived at the SubDevice: lower half, nanoseconds. Only in the last fragment.
    pub time_ns: Option<u32>,
    /// The data; a multiple of 32 bytes in all fragments but the last.
    pub data: &'a [u8],
}

impl<'a> EoeFragment<'a> {
    /// Data bytes of each fragment but the last for a mailbox of this size (header included).
    pub const fn max_data(mailbox_size: usize) -> usize {
        let room = mailbox_size.saturating_sub(crate::mailbox::Header::LEN + OVERHEAD);
        room - room % BLOCK
    }

    /// Offset of the data in the frame in bytes.
    pub const fn offset(&self) -> usize {
        if self.number == 0 { 0 } else { self.blocks as usize * BLOCK }
    }

    pub(super) fn decode(head: u16, word: u16, data: &'a [u8]) -> Result<EoeFragment<'a>, PayloadError> {
        let (time_ns, data) = if head & TIME_APPENDED != 0 {
            let short = PayloadError::Short { what: "EoE fragment with a time", expected: TIME_LEN, got: data.len() };
            let (data, time) = data.split_last_chunk().ok_or(short)?;
            (Some(u32::from_le_bytes(*time)), data)
        } else {
            (None, data)
        };
        Ok(EoeFragment {
            frame: (word >> FRAME_SHIFT) as u8,
            number: word as u8 & SIX_BITS,
            blocks: (word >> OFFSET_SHIFT) as u8 & SIX_BITS,
            last: head & LAST != 0,
            time_requested: head & TIME_REQUESTED != 0,
            time_ns,
            data,
        })
    }

    pub(super) fn encode(&self, port: u16, out: &mut [u8]) -> Option<usize> {
        let mut head = FRAGMENT | port;
        for (set, bit) in
            [(self.last, LAST), (self.time_ns.is_some(), TIME_APPENDED), (self.time_requested, TIME_REQUESTED)]
        {
            if set {
                head |= bit;
            }
        }
        if self.number > SIX_BITS || self.blocks > SIX_BITS {
            return None;
        }
        let mut writer = FieldWriter::new(out);
        writer.put_u16(head)?;
        let frame = u16::from(self.frame & 0x0F) << FRAME_SHIFT;
        writer.put_u16(u16::from(self.number) | u16::from(self.blocks) << OFFSET_SHIFT | frame)?;
        writer.put(self.data)?;
        if let Some(time_ns) = self.time_ns {
            writer.put_u32(time_ns)?;
        }
        Some(writer.length())
    }
}
