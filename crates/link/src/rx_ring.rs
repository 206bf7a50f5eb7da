//! The receive ring that the kernel writes frames into (TPACKET_V2).
//!
//! The kernel writes frames into the ring; [`RxRing::take`] returns them in order of arrival, each in place. The status
//! word of a slot states whether the kernel or this process owns it; nothing else is shared.
//!
//! The functions of a cycle are inlined on purpose, so that its closure is called directly (bin `socket_cycle`).

mod place;

use std::io;
use std::mem::size_of;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, Ordering};

use crate::filter::VLAN;
use crate::kernel::{
    FrameHeader, PACKET_OUTGOING, RingRequest, TP_STATUS_KERNEL, TP_STATUS_USER, TP_STATUS_VLAN_TPID_VALID,
    TP_STATUS_VLAN_VALID,
};

/// Bytes of a slot: header, address of the sender, gap, and a frame of up to 1,982 bytes.
const SLOT: usize = 2048;
/// Offset of `sll_pkttype` in the `sockaddr_ll` that follows the header.
const PACKET_TYPE: usize = size_of::<FrameHeader>() + 10;
/// Bytes of a VLAN tag.
const TAG: usize = 4;
/// Bytes before the frame: header and `sockaddr_ll`.
const HEAD: usize = size_of::<FrameHeader>() + size_of::<libc::sockaddr_ll>();
/// A larger number of slots (32 MiB) is a configuration error.
const MAX_SLOTS: u32 = 16_384;

/// Result for the slot at the head of the ring.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Taken {
    /// The frame was returned.
    Frame,
    /// The frame was sent by this host.
    Outgoing,
    /// Its frame is longer than a slot.
    Truncated,
    /// There is no frame.
    Nothing,
}

/// A frame sent or received by an interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seen<'a> {
    /// Whether this host sent it.
    pub outgoing: bool,
    /// Time of the kernel, in nanoseconds since 1970.
    pub unix_time_ns: u64,
    /// Length of the whole frame; long frames are truncated in `bytes`.
    pub length: usize,
    /// The frame.
    pub bytes: &'a [u8],
}

/// The mapped ring.
#[derive(Debug)]
pub struct RxRing {
    base: NonNull<u8>,
    slots: usize,
    /// The slot that is read next.
    head: NonNull<u8>,
    /// Behind the last slot.
    end: NonNull<u8>,
    /// When the kernel received the frame that was handed out last: seconds and nanoseconds.
    stamp: [u32; 2],
}

// SAFETY: the mapping belongs to this value alone and is not bound to a thread.
unsafe impl Send for RxRing {}

/// The layout for at least `frames` slots.
pub fn layout(frames: u32) -> RingRequest {
    // SAFETY: no pointers are passed.
    let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) };
    // A block is one page, so that the kernel can always allocate it; slots do not cross pages.
    let page = usize::try_from(page).unwrap_or(0).max(SLOT);
    let per_block = (page / SLOT) as u32;
    let blocks = frames.clamp(per_block, MAX_SLOTS).div_ceil(per_block);
    RingRequest {
        block_size: page as libc::c_uint,
        block_count: blocks,
        frame_size: SLOT as libc::c_uint,
        frame_count: blocks * per_block,
    }
}

impl RxRing {
    /// Maps the ring of a socket that was made with this layout.
    pub fn map(fd: libc::c_int, layout: &RingRequest) -> Result<RxRing, i32> {
        let slots = layout.frame_count as usize;
        let (access, flags) = (libc::PROT_READ | libc::PROT_WRITE, libc::MAP_SHARED | libc::MAP_POPULATE);
        // SAFETY: the kernel chooses the address; no existing mapping is replaced.
        let base = unsafe { libc::mmap(std::ptr::null_mut(), slots * SLOT, access, flags, fd, 0) };
        if base == libc::MAP_FAILED {
            return Err(io::Error::last_os_error().raw_os_error().unwrap_or(0));
        }
        let base = NonNull::new(base.cast::<u8>()).ok_or(libc::ENOMEM)?;
        // SAFETY: the mapping has this length.
        let end = unsafe { base.add(slots * SLOT) };
        Ok(RxRing { base, slots, head: base, end, stamp: [0; 2] })
    }

    /// Number of slots.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// Whether a frame waits.
    #[inline(always)]
    pub fn has_frame(&self) -> bool {
        self.status().load(Ordering::Acquire) & TP_STATUS_USER != 0
    }

    /// Passes the oldest frame to `take` and returns its slot to the kernel.
    #[inline(always)]
    pub fn take(&mut self, take: &mut dyn FnMut(&[u8])) -> Taken {
        let mut stamp = self.stamp;
        let taken = self.take_slot(|status, slot| {
            stamp = [u32_at(slot, 16), u32_at(slot, 20)];
            hand_out(status, slot, |frame| take(frame))
        });
        self.stamp = stamp;
        taken
    }

    /// As [`RxRing::take`], with the frame to be changed, and with the time at which the kernel received it, in
    /// nanoseconds since 1970.
    #[inline]
    pub fn take_in_place(&mut self, mut take: impl FnMut(&mut [u8], u64)) -> Taken {
        self.take_slot(|status, slot| {
            let stamp = stamp(slot);
            hand_out(status, slot, |frame| take(frame, stamp))
        })
    }

    /// When the kernel received the last frame returned, in nanoseconds since 1970.
    #[inline]
    pub fn stamp_unix_ns(&self) -> u64 {
        unix_ns(self.stamp)
    }

    /// As [`RxRing::take`], for all frames, including outgoing frames and the beginning of long frames; false if there
    /// is none.
    pub fn take_seen(&mut self, take: &mut dyn FnMut(Seen<'_>)) -> bool {
        self.take_slot(|status, slot| show(status, slot, take)) != Taken::Nothing
    }

    #[inline(always)]
    fn take_slot(&mut self, mut hand_out: impl FnMut(u32, &mut [u8]) -> Taken) -> Taken {
        let status = self.status().load(Ordering::Acquire);
        if status & TP_STATUS_USER == 0 {
            return Taken::Nothing;
        }
        // SAFETY: this process owns the slot until it returns it, which needs `&mut self` again; the
        // slot lies within the mapping, and bytes have no invalid values.
        let slot = unsafe { std::slice::from_raw_parts_mut(self.head.as_ptr(), SLOT) };
        let taken = hand_out(status, slot);
        self.status().store(TP_STATUS_KERNEL, Ordering::Release);
        // SAFETY: the head is a slot that is mapped, so the result is the next one or the end.
        let next = unsafe { self.head.add(SLOT) };
        self.head = if next == self.end { self.base } else { next };
        taken
    }

    #[inline(always)]
    fn status(&self) -> &AtomicU32 {
        // SAFETY: the status is the first word of the aligned slot and lives as long as the mapping. The slice over the
        // slot in `take` is no longer used when this is called.
        unsafe { AtomicU32::from_ptr(self.head.as_ptr().cast()) }
    }
}

impl Drop for RxRing {
    fn drop(&mut self) {
        // SAFETY: this is the mapping made in `map`; no reference into it outlives `self`.
        unsafe { libc::munmap(self.base.as_ptr().cast(), self.slots * SLOT) };
    }
}

/// Offsets in a slot.
struct Place {
    length: usize,
    start: usize,
    captured: usize,
}

#[inline(always)]
fn u32_at(slot: &[u8], at: usize) -> u32 {
    slot.get(at..).and_then(<[u8]>::first_chunk).map_or(0, |bytes| u32::from_ne_bytes(*bytes))
}

/// The position of the frame in a slot; `None` if the header is invalid.
#[inline(always)]
fn place(slot: &[u8]) -> Option<Place> {
    let start = usize::from(u16::from_ne_bytes([slot[12], slot[13]]));
    let (length, captured) = (u32_at(slot, 4) as usize, u32_at(slot, 8) as usize);
    if captured < 14 || start < HEAD + TAG || start + captured > slot.len() {
        return None;
    }
    Some(Place { length, start, captured })
}

/// Puts back a VLAN tag that the kernel removed. Returns the new start of the frame and the additional bytes.
#[cold]
fn put_tag_back(status: u32, slot: &mut [u8], start: usize) -> (usize, usize) {
    if status & TP_STATUS_VLAN_VALID == 0 {
        return (start, 0);
    }
    let u16_at = |at: usize| u16::from_ne_bytes([slot[at], slot[at + 1]]);
    let (tci, tpid) = (u16_at(24), u16_at(26));
    let tpid = if status & TP_STATUS_VLAN_TPID_VALID == 0 { VLAN } else { tpid };
    // The addresses move down into the gap; the tag follows them.
    slot.copy_within(start..start + 12, start - TAG);
    slot[start + 8..start + 10].copy_from_slice(&tpid.to_be_bytes());
    slot[start + 10..start + 12].copy_from_slice(&tci.to_be_bytes());
    (start - TAG, TAG)
}

/// When the kernel received or sent the frame of a slot.
fn stamp(slot: &[u8]) -> u64 {
    unix_ns([u32_at(slot, 16), u32_at(slot, 20)])
}

const fn unix_ns([seconds, nanoseconds]: [u32; 2]) -> u64 {
    seconds as u64 * 1_000_000_000 + nanoseconds as u64
}

/// Passes the content of a slot that this process owns to `take`.
fn show(status: u32, slot: &mut [u8], take: &mut dyn FnMut(Seen<'_>)) -> Taken {
    let Some(Place { length, start, captured }) = place(slot) else { return Taken::Truncated };
    let unix_time_ns = stamp(slot);
    let outgoing = slot[PACKET_TYPE] == PACKET_OUTGOING;
    let (start, tag) = put_tag_back(status, slot, start);
    let bytes = &slot[start..start + captured + tag];
    take(Seen { outgoing, unix_time_ns, length: length + tag, bytes });
    Taken::Frame
}

/// Returns the frame of a slot that this process owns, with its VLAN tag put back if the kernel removed it.
#[inline(always)]
fn hand_out(status: u32, slot: &mut [u8], take: impl FnOnce(&mut [u8])) -> Taken {
    if slot[PACKET_TYPE] == PACKET_OUTGOING {
        return Taken::Outgoing;
    }
    let Some(Place { length, start, captured }) = place(slot) else { return Taken::Truncated };
    if captured != length {
        return Taken::Truncated;
    }
    let has_tag = status & TP_STATUS_VLAN_VALID != 0;
    let (start, tag) = if has_tag { put_tag_back(status, slot, start) } else { (start, 0) };
    let Some(frame) = slot.get_mut(start..start + length + tag) else { return Taken::Truncated };
    take(frame);
    Taken::Frame
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slot(frame: &[u8], tci: u16, packet_type: u8) -> Vec<u8> {
        let mut slot = vec![0; SLOT];
        slot[4..8].copy_from_slice(&(frame.len() as u32).to_ne_bytes());
        slot[8..12].copy_from_slice(&(frame.len() as u32).to_ne_bytes());
        slot[12..14].copy_from_slice(&66u16.to_ne_bytes());
        slot[24..26].copy_from_slice(&tci.to_ne_bytes());
        slot[PACKET_TYPE] = packet_type;
        slot[66..66 + frame.len()].copy_from_slice(frame);
        slot
    }

    fn handed(status: u32, mut slot: Vec<u8>) -> (Taken, Vec<u8>) {
        let mut frame = Vec::new();
        let taken = hand_out(status, &mut slot, |bytes| frame.extend_from_slice(bytes));
        (taken, frame)
    }

    const FRAME: [u8; 18] = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 0x88, 0xa4, 0x02, 0x10, 0x07, 0x01];

    #[test]
    fn a_frame_is_returned_unchanged() {
        assert_eq!(handed(TP_STATUS_USER, slot(&FRAME, 0, 0)), (Taken::Frame, FRAME.to_vec()));
    }

    #[test]
    fn a_tag_that_the_kernel_took_off_is_put_back() {
        let mut expected = FRAME.to_vec();
        expected.splice(12..12, [0x81, 0x00, 0xe0, 0x05]);
        let status = TP_STATUS_USER | TP_STATUS_VLAN_VALID;
        assert_eq!(handed(status, slot(&FRAME, 0xe005, 0)), (Taken::Frame, expected));
    }

    #[test]
    fn frames_that_this_host_sent_are_left_out() {
        assert_eq!(handed(TP_STATUS_USER, slot(&FRAME, 0, PACKET_OUTGOING)), (Taken::Outgoing, Vec::new()));
    }

    #[test]
    fn a_truncated_or_invalid_frame_is_not_returned() {
        let mut long = slot(&FRAME, 0, 0);
        long[4..8].copy_from_slice(&9000u32.to_ne_bytes());
        assert_eq!(handed(TP_STATUS_USER, long).0, Taken::Truncated);
        let mut far = slot(&FRAME, 0, 0);
        far[12..14].copy_from_slice(&u16::MAX.to_ne_bytes());
        assert_eq!(handed(TP_STATUS_USER, far).0, Taken::Truncated);
        assert_eq!(handed(TP_STATUS_USER, slot(&FRAME[..10], 0, 0)).0, Taken::Truncated);
    }

    // covers: capture
    #[test]
    fn a_sniffer_gets_sent_frames_times_and_the_beginning_of_long_frames() {
        let mut long = slot(&FRAME, 0xe005, PACKET_OUTGOING);
        long[4..8].copy_from_slice(&9000u32.to_ne_bytes());
        long[16..20].copy_from_slice(&5u32.to_ne_bytes());
        long[20..24].copy_from_slice(&7u32.to_ne_bytes());
        let mut expected = FRAME.to_vec();
        expected.splice(12..12, [0x81, 0x00, 0xe0, 0x05]);
        let mut count = 0;
        let taken = show(TP_STATUS_USER | TP_STATUS_VLAN_VALID, &mut long, &mut |seen| {
            let bytes = expected.as_slice();
            assert_eq!(seen, Seen { outgoing: true, unix_time_ns: 5_000_000_007, length: 9004, bytes });
            count += 1;
        });
        assert_eq!((taken, count), (Taken::Frame, 1));
        let mut far = slot(&FRAME, 0, 0);
        far[12..14].copy_from_slice(&u16::MAX.to_ne_bytes());
        assert_eq!(show(TP_STATUS_USER, &mut far, &mut |_| panic!("not within the slot")), Taken::Truncated);
    }

    #[test]
    fn a_ring_has_at_least_the_requested_slots_and_an_upper_limit() {
        for frames in [0, 1, 3, 64, 65] {
            let layout = layout(frames);
            assert!(layout.frame_count >= frames.max(2));
            assert_eq!(layout.block_size * layout.block_count, layout.frame_size * layout.frame_count);
        }
        assert_eq!(layout(u32::MAX).frame_count, MAX_SLOTS);
    }
}
