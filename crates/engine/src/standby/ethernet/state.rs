//! The Ethernet of one MainDevice: numbers, signs of the other one, frames that are taken.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec;
use core::sync::atomic::Ordering;
use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::frame::{Frame, MAX_FRAME};
use ringcat_wire::master_frame::{ADO, Area, EthernetHead, FragmentHead};

use super::answers::Answers;
use super::pace::Pace;
use crate::ring::Identity;
use crate::standby::endpoint::{ETHERNET_QUEUE, Figures, PartnerEndpoint, add};
use crate::standby::frame_queue::{FrameConsumer, FrameProducer, frame_queue};
use crate::time::Instant;

/// Without a sign of the other MainDevice for this time it counts as absent: longer than any takeover takes.
const SIGN_WITHIN: Duration = Duration::from_secs(1);

/// The Ethernet of one MainDevice, beside its acyclic half.
#[derive(Debug)]
pub(crate) struct PartnerEthernet {
    pub(super) identity: Identity,
    pub(super) stream: u32,
    /// Number of the last Ethernet frame that has left.
    pub(super) number: u32,
    pub(super) outgoing: FrameConsumer,
    pub(super) incoming: FrameProducer,
    pub(super) figures: Arc<Figures>,
    /// Stream and number of the last Ethernet frame that was taken.
    pub(super) taken: Option<(u32, u32)>,
    /// When a frame of the other MainDevice came last.
    pub(super) sign_at: Option<Instant>,
    /// When an Ethernet frame has left or arrived last.
    pub(super) traffic_at: Option<Instant>,
    pub(super) answers: Answers,
    pub(super) pace: Pace,
    /// The master frame being built.
    pub(super) buffer: Box<[u8]>,
}

impl PartnerEthernet {
    /// With at most this number of master frames per cycle, and its endpoint for the application.
    pub fn new(identity: Identity, most: u8, now: Instant) -> (PartnerEthernet, PartnerEndpoint) {
        let (producer, outgoing) = frame_queue(ETHERNET_QUEUE as u32);
        let (incoming, consumer) = frame_queue(ETHERNET_QUEUE as u32);
        let figures: Arc<Figures> = Arc::default();
        let endpoint = PartnerEndpoint { outgoing: producer, incoming: consumer, figures: figures.clone() };
        let ethernet = PartnerEthernet {
            stream: stream(&identity, now),
            identity,
            number: 0,
            outgoing,
            incoming,
            figures,
            taken: None,
            sign_at: None,
            traffic_at: None,
            answers: Answers::new(),
            pace: Pace::new(most),
            buffer: vec![0; MAX_FRAME].into_boxed_slice(),
        };
        (ethernet, endpoint)
    }

    /// A copy of an own master frame has come back: takes what the INACTIVE has put in. True if it is one.
    pub fn take_own(&mut self, bytes: &[u8], now: Instant) -> bool {
        let mut is_one = false;
        for_each_area(bytes, |head, wkc, data| match head.area {
            Area::EthernetToInactive => is_one = true,
            Area::EthernetToActive if wkc == head.area.weight() => self.take_answer(head.cycle, data, now),
            _ => {}
        });
        is_one
    }

    /// A master frame of another MainDevice has come that is not forwarded: takes its Ethernet frame.
    pub fn take_foreign(&mut self, bytes: &[u8], now: Instant) {
        for_each_area(bytes, |head, _, data| {
            if head.area == Area::EthernetToInactive
                && let Some((head, frame)) = EthernetHead::split(data)
            {
                self.take(&head, frame, now);
            }
        });
    }

    fn take_answer(&mut self, poll: u32, data: &[u8], now: Instant) {
        let Some((head, frame)) = EthernetHead::split(data) else { return };
        self.note_sign(now);
        if self.pace.note_answer(poll, head.next) {
            add(&self.figures.answers, 1);
        }
        self.take(&head, frame, now);
    }

    /// Takes an Ethernet frame, unless it has come before, or a later one has.
    pub(super) fn take(&mut self, head: &EthernetHead, frame: Option<&[u8]>, now: Instant) {
        let Some(frame) = frame else { return };
        if let Some((stream, number)) = self.taken
            && stream == head.stream
        {
            let later = head.number.wrapping_sub(number) as i32;
            if later <= 0 {
                return;
            }
            add(&self.figures.missed, later as u64 - 1);
        }
        self.taken = Some((head.stream, head.number));
        self.traffic_at = Some(now);
        if self.incoming.push(frame) {
            add(&self.figures.received, 1);
            add(&self.figures.received_bytes, frame.len() as u64);
        } else {
            add(&self.figures.overflowed, 1);
        }
    }

    /// A frame of the other MainDevice has come.
    pub(super) fn note_sign(&mut self, now: Instant) {
        self.sign_at = Some(now);
        if !self.figures.is_up.load(Ordering::Relaxed) {
            self.figures.is_up.store(true, Ordering::Relaxed);
        }
    }

    /// Ends the time in which the other MainDevice counts as there, if it is over. When it ends otherwise.
    pub(super) fn check_sign(&mut self, now: Instant) -> Instant {
        let Some(at) = self.sign_at else { return Instant::NEVER };
        if now < at + SIGN_WITHIN {
            return at + SIGN_WITHIN;
        }
        self.sign_at = None;
        self.figures.is_up.store(false, Ordering::Relaxed);
        // Frames for a MainDevice that is absent must not reach it after its return.
        add(&self.figures.dropped_down, self.outgoing.clear().into());
        Instant::NEVER
    }

    /// Takes the next Ethernet frame of at most `room` bytes into an area behind its head, which is written. The length
    /// of both.
    pub(super) fn put_next(&mut self, room: usize, area: &mut [u8], now: Instant) -> usize {
        let mut length = 0;
        if self.outgoing.next_len().is_some_and(|next| next <= room)
            && let Some(place) = area.get_mut(EthernetHead::LEN..)
            && let Some(taken) = self.outgoing.pop(place)
        {
            length = taken;
            self.number = self.number.wrapping_add(1);
            self.traffic_at = Some(now);
            add(&self.figures.sent, 1);
            add(&self.figures.sent_bytes, length as u64);
        }
        let next = self.outgoing.next_len().unwrap_or(0) as u16;
        let head = EthernetHead { stream: self.stream, number: self.number, length: length as u16, next };
        if let Some(place) = area.first_chunk_mut() {
            *place = head.encode();
        }
        EthernetHead::LEN + length
    }
}

/// Another number for each start: address and time.
fn stream(identity: &Identity, now: Instant) -> u32 {
    let [.., a, b, c] = identity.source().0;
    let address = u32::from_be_bytes([0, a, b, c]);
    // Times of two starts differ by more than some microseconds.
    (now.0 >> 10) as u32 ^ address.wrapping_mul(0x9E37_79B1)
}

/// Calls a function with each area of a master frame, the working counter of its datagram, and its bytes.
fn for_each_area(bytes: &[u8], mut take: impl FnMut(FragmentHead, u16, &[u8])) {
    let Ok(frame) = Frame::parse(bytes) else { return };
    for datagram in frame.datagrams() {
        let is_of_master_frame = datagram.header.command == Command::Nop && datagram.header.ado() == ADO;
        if is_of_master_frame && let Some((head, data)) = datagram.data.split_first_chunk() {
            take(FragmentHead::decode(head), datagram.wkc.0, data);
        }
    }
}
