//! Sends acyclic frames: packs requests, sends on all links.

use core::time::Duration;

use ringcat_wire::command::Command;
use ringcat_wire::datagram::HEADER_LEN;
use ringcat_wire::frame::{FrameBuilder, MAX_FRAME, MIN_FRAME, MacAddress};
use ringcat_wire::source_address::MAX_RETRY;

use crate::link::{Link, LinkSet};
use crate::ring::identity::DATAGRAMS_AT;
use crate::ring::{Class, Identity};
use crate::supervisor::outbox::{Outbox, Rank};
use crate::supervisor::sent_frame::{SentDatagram, SentFrame};
use crate::supervisor::shared::Shared;
use crate::supervisor::transfer::{Request, Rest, Stage, TransferId, WITNESS_BYTES};
use crate::time::Instant;

/// A datagram that fits no send window is sent after this time nevertheless, and delays one cycle.
const STARVED: Duration = Duration::from_millis(10);

impl Shared {
    /// Packs datagrams from the outbox into frames and sends them, within the budget and the window.
    pub(in crate::supervisor) fn transmit(&mut self, budget: usize, transmit: &mut impl FnMut(Link, &[u8])) -> usize {
        let mut used = self.send_debug_messages(budget, transmit);
        while self.sent_frames.has_room() && used < budget {
            let limit = (budget - used).min(MAX_FRAME);
            let sent_frame = match self.alone.is_held() {
                true => self.next_alone().and_then(|(id, no_return)| self.pack_alone(id, no_return)),
                false if self.outbox.is_ready(self.now) => self.pack(limit),
                false => None,
            };
            let Some(sent_frame) = sent_frame else { break };
            self.blocked = None;
            used += sent_frame.bytes.len();
            self.counters.sent += 1;
            self.counters.bytes += sent_frame.bytes.len() as u64;
            self.counters.datagrams += sent_frame.datagrams.len() as u64;
            self.silence.sent(Link::Main, self.now);
            self.events.messages().sent(self.now, Link::Main, &sent_frame.bytes);
            transmit(Link::Main, &sent_frame.bytes);
            if self.links == LinkSet::Ring {
                self.silence.sent(Link::Redundant, self.now);
                let copy = &mut self.sent_frames.buffer[..sent_frame.bytes.len()];
                copy.copy_from_slice(&sent_frame.bytes);
                Identity::mark_redundant(copy, true);
                adjust_auto_increment(copy, &sent_frame.datagrams, self.main_count);
                for datagram in &sent_frame.datagrams {
                    let Some(transfer) = self.transfers.find(datagram.transfer) else { continue };
                    if let Some(station) = transfer.request.redundant_station {
                        let at = datagram.header_at + 2;
                        copy[at..at + 2].copy_from_slice(&station.0.to_le_bytes());
                    }
                    if let Some(data) = &transfer.request.redundant {
                        let at = datagram.header_at + HEADER_LEN;
                        copy[at..at + datagram.length].copy_from_slice(data);
                    }
                }
                self.events.messages().sent(self.now, Link::Redundant, copy);
                transmit(Link::Redundant, copy);
            }
            self.sent_frames.put(sent_frame);
        }
        used
    }

    /// Whether the first datagram, which is too long for this send window, has waited for [`STARVED`]: it may be too
    /// long for every window, and is then sent nevertheless.
    fn is_starved(blocked: &mut Option<(TransferId, Instant)>, first: TransferId, now: Instant) -> bool {
        let (_, since) = *blocked.insert(blocked.filter(|(id, _)| *id == first).unwrap_or((first, now)));
        now.since(since) >= STARVED
    }

    /// Builds one frame of at most `limit` bytes from the front of the outbox; `None` if nothing fits.
    fn pack(&mut self, limit: usize) -> Option<SentFrame> {
        let sequence = self.sent_frames.sequence.next();
        let mut sent_frame = self.sent_frames.fresh(sequence);
        let mut retry = 0;
        let length = {
            let source = self.identity.source();
            let mut builder = FrameBuilder::ethernet(&mut self.sent_frames.buffer, MacAddress::ETHERCAT_GROUP, source)?;
            // `reserved`: for the rest of a group. Of one that is sent again, less may be left.
            let (mut total, mut datagrams, mut is_alone, mut reserved) = (DATAGRAMS_AT, 0, false, Rest::NONE);
            let reads = self.outbox.may_read(self.now);
            let front = |outbox: &Outbox, now, reserved| match reserved == Rest::NONE {
                true => outbox.front(reads, now),
                false => outbox.front_of_urgent().or_else(|| outbox.front(reads, now)),
            };
            while let Some((id, rank)) = front(&self.outbox, self.now, reserved) {
                let Some(transfer) = self.transfers.find(id) else {
                    self.outbox.pop(rank);
                    continue;
                };
                if transfer.abandoned {
                    self.outbox.pop(rank);
                    self.transfers.remove(id);
                    // The rest of its group is abandoned as well.
                    reserved = Rest::NONE;
                    continue;
                }
                let request = &transfer.request;
                let group = request.group();
                let has_room = reserved != Rest::NONE && group == reserved;
                let count = if has_room { request.datagrams() } else { group.datagrams };
                let fills_up = is_alone || request.before > 0 || datagrams + count > self.max_datagrams;
                if fills_up && !sent_frame.datagrams.is_empty() {
                    break;
                }
                // Only the first datagram of a frame, with its group, may be longer than the window.
                if !has_room
                    && (total + group.bytes).max(MIN_FRAME) > limit
                    && (!sent_frame.datagrams.is_empty() || !Shared::is_starved(&mut self.blocked, id, self.now))
                {
                    break;
                }
                let index = sequence.index(Class::Acyclic);
                (is_alone, reserved) = (request.before > 0, request.rest);
                let Some(data_at) = put(&mut builder, request, index, self.now) else { break };
                let bytes = request.bytes();
                (total, datagrams) = (total + bytes, datagrams + request.datagrams());
                retry = retry.max(transfer.retries);
                sent_frame.repeatable &= request.resend;
                sent_frame.datagrams.push(SentDatagram::new(id, request, data_at));
                transfer.stage = Stage::InFlight;
                self.outbox.pop(rank);
                if rank == Rank::Read {
                    sent_frame.reads += bytes;
                    self.outbox.reads_sent(bytes);
                }
            }
            builder.finish()
        };
        self.launch(sent_frame, length, retry)
    }

    /// Builds a frame that holds one datagram.
    fn pack_alone(&mut self, id: TransferId, no_return: u8) -> Option<SentFrame> {
        let sequence = self.sent_frames.sequence.next();
        let mut sent_frame = self.sent_frames.fresh(sequence);
        sent_frame.no_return = no_return;
        let length = {
            let source = self.identity.source();
            let mut builder = FrameBuilder::ethernet(&mut self.sent_frames.buffer, MacAddress::ETHERCAT_GROUP, source)?;
            let transfer = self.transfers.find(id)?;
            let (request, index) = (&transfer.request, sequence.index(Class::Acyclic));
            let data_at = builder.datagram(request.command, index, request.target, request.data.len())?;
            builder.data_mut(data_at, request.data.len())?.copy_from_slice(&request.data);
            sent_frame.datagrams.push(SentDatagram::new(id, request, data_at));
            transfer.stage = Stage::InFlight;
            builder.finish()
        };
        self.launch(sent_frame, length, 0)
    }

    /// Completes a frame of this length for sending; `None` if it is empty.
    fn launch(&mut self, mut sent_frame: SentFrame, length: usize, retry: u8) -> Option<SentFrame> {
        let sequence = sent_frame.sequence;
        sent_frame.bytes.extend_from_slice(&self.sent_frames.buffer[..length]);
        // The retry index has three bits (protocol SM-04).
        self.identity.stamp(&mut sent_frame.bytes, sequence, retry.min(MAX_RETRY));
        if sent_frame.datagrams.is_empty() {
            self.sent_frames.spare.push(sent_frame);
            return None;
        }
        self.sent_frames.sequence = sequence;
        sent_frame.sent_at = self.now;
        let (begins, left_at) = self.outbox.hand_over(sent_frame.bytes.len(), self.now);
        sent_frame.left_at = left_at;
        sent_frame.deadline = begins + self.round_trip.wait(retry);
        Some(sent_frame)
    }
}

/// Appends the datagrams of a request. Returns the offset of its own data; `None` if they do not fit.
fn put(builder: &mut FrameBuilder<'_>, request: &Request, index: u8, now: Instant) -> Option<usize> {
    if let Some((command, target, preceding)) = &request.preceding {
        let at = builder.datagram(*command, index, *target, preceding.len())?;
        if let Some(data) = builder.data_mut(at, preceding.len()) {
            data.copy_from_slice(preceding);
        }
    }
    for _ in 0..request.before {
        builder.datagram(request.command, index, request.target, request.data.len());
    }
    let data_at = builder.datagram(request.command, index, request.target, request.data.len())?;
    if let Some(data) = builder.data_mut(data_at, request.data.len()) {
        data.copy_from_slice(&request.data);
        request.advance_time(data, now);
    }
    Some(data_at)
}

/// Adjusts positions in the redundant copy: in an open ring, the SubDevice at position `p` behind the break is at `p -
/// main_count` on the redundant link; in a closed ring, no SubDevice is addressed twice (protocol CR-09).
fn adjust_auto_increment(frame: &mut [u8], datagrams: &[SentDatagram], main_count: u16) {
    for datagram in datagrams {
        if !matches!(datagram.command, Command::Aprd | Command::Apwr | Command::Aprw | Command::Armw) {
            continue;
        }
        let witness = datagram.witness.then(|| datagram.header_at - WITNESS_BYTES);
        for at in [Some(datagram.header_at), witness].into_iter().flatten() {
            let adp = at + 2;
            let shifted = u16::from_le_bytes([frame[adp], frame[adp + 1]]).wrapping_add(main_count);
            frame[adp..adp + 2].copy_from_slice(&shifted.to_le_bytes());
        }
    }
}
