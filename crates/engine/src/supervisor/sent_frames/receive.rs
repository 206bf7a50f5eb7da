//! Receives acyclic frames: pairs and merges the copies, passes replies to procedures, expires lost frames.

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;

use super::{SLOTS, SentFrames};
use crate::link::Link;
use crate::ring::FrameCopy;
use crate::supervisor::outbox::Rank;
use crate::supervisor::received::Received;
use crate::supervisor::reply::{BusError, Reply};
use crate::supervisor::round_trip::MAX_RETRIES;
use crate::supervisor::sent_frame::{SentDatagram, SentFrame};
use crate::supervisor::shared::Shared;
use crate::supervisor::stray::Stray;
use crate::supervisor::transfer::{Stage, TransferId};

impl Shared {
    /// Takes a copy of an acyclic frame.
    pub(in crate::supervisor) fn receive(&mut self, copy: FrameCopy, arrived_on: Link, bytes: &[u8]) -> Received {
        self.silence.came_back(copy.sent_on);
        self.events.messages().received(self.now, arrived_on, bytes);
        let slot = SentFrames::slot(copy.sequence);
        let Some(sent_frame) =
            self.sent_frames.slots[slot].as_mut().filter(|sent_frame| sent_frame.sequence == copy.sequence)
        else {
            self.round_trip.was_late();
            self.counters.late += 1;
            self.strays.late(copy.sequence, bytes, self.now);
            return Received::Late;
        };
        if !sent_frame.matches_sent(bytes) {
            self.counters.corrupt += 1;
            return Received::Corrupt;
        }
        let first = sent_frame.arrivals.arrived == 0;
        if !sent_frame.arrivals.note(copy.sent_on, arrived_on) {
            self.counters.late += 1;
            return Received::Late;
        }
        self.round_trip.took(self.now.ns_since(sent_frame.sent_at));
        self.outbox.note_round_trip(self.now.ns_since(sent_frame.left_at));
        for read in sent_frame.second_reads() {
            if let Some(mail) = read.mail(bytes) {
                self.strays.keep(read.station, Stray { mail, sent_at: read.sent_at });
            }
        }
        sent_frame.take(copy.sent_on, bytes, first);
        let newest = &mut self.sent_frames.newest_back[copy.sent_on.index()];
        *newest = sent_frame.sent_at.max(*newest);
        let finished = sent_frame.has_all_copies(self.links);
        let enough = finished || sent_frame.has_all_but(self.silence.mask(self.now) | sent_frame.no_return, self.links);
        self.answer(slot, enough);
        if finished {
            self.end(slot);
        } else if enough {
            self.sent_frames.release(slot);
        }
        self.end_overtaken();
        Received::Taken
    }

    /// Gives up frames whose copies do not come back because later ones have ([`SentFrame::is_overtaken`]). The margin
    /// of a round trip covers paths that become shorter when a ring opens or closes.
    fn end_overtaken(&mut self) {
        let (newest, margin) = (self.sent_frames.newest_back, self.round_trip.longest());
        if newest.into_iter().all(|newest| newest.ns_since(self.sent_frames.oldest) <= margin) {
            return;
        }
        for slot in 0..SLOTS {
            let is_overtaken = |sent_frame: &SentFrame| sent_frame.is_overtaken(newest, margin, self.links);
            if self.sent_frames.slots[slot].as_ref().is_some_and(is_overtaken) {
                self.expire(slot);
            }
        }
        self.sent_frames.find_earliest();
    }

    /// Passes replies to procedures: those with the expected working counter at once, all others when no further copy
    /// is awaited. Replies of a frame that crossed a change of the ring count as lost.
    fn answer(&mut self, slot: usize, enough: bool) {
        let Some(mut sent_frame) = self.sent_frames.slots[slot].take() else { return };
        let ring_changed = sent_frame.ring_changed_meanwhile();
        let stamp = (sent_frame.sequence, sent_frame.sent_at);
        if enough && !ring_changed {
            self.learn_main_count(&sent_frame);
        }
        for datagram in sent_frame.datagrams.iter_mut().filter(|datagram| !datagram.answered) {
            let satisfied = datagram.satisfied();
            if !satisfied && !enough {
                continue;
            }
            datagram.answered = true;
            if satisfied || !ring_changed {
                let reply = datagram.reply(&sent_frame.bytes, stamp, self.transfers.take_data(datagram.transfer));
                self.finish(datagram.transfer, Ok(reply));
            } else {
                self.lost(datagram.transfer);
            }
        }
        if !sent_frame.answered && sent_frame.datagrams.iter().all(|datagram| datagram.answered) {
            sent_frame.answered = true;
            self.counters.received += 1;
            self.outbox.reads_returned(core::mem::take(&mut sent_frame.reads));
        }
        self.sent_frames.slots[slot] = Some(sent_frame);
    }

    /// Takes the number of SubDevices that process the main copy from a broadcast (protocol CR-09).
    fn learn_main_count(&mut self, sent_frame: &SentFrame) {
        let is_broadcast = |datagram: &&SentDatagram| matches!(datagram.command, Command::Brd | Command::Bwr);
        // A working counter of 0 says nothing about the links.
        let answered = |datagram: &&SentDatagram| datagram.total() != Wkc(0);
        if let Some(datagram) = sent_frame.datagrams.iter().rfind(is_broadcast).filter(answered) {
            self.main_count = datagram.wkc[Link::Main.index()].0;
        }
    }

    fn end(&mut self, slot: usize) {
        let Some(sent_frame) = self.sent_frames.take(slot) else { return };
        self.monitor.observe(sent_frame.arrivals);
        self.sent_frames.spare.push(sent_frame);
    }

    pub(in crate::supervisor) fn finish(&mut self, id: TransferId, result: Result<Reply, BusError>) {
        let result = self.check_alone(id, result);
        let Some(transfer) = self.transfers.find(id) else { return };
        if transfer.abandoned {
            self.transfers.remove(id);
            return;
        }
        let wrong = match &result {
            Ok(reply) if self.command_reports.is_on() => transfer.request.wrong_command(reply.wkc()),
            _ => None,
        };
        transfer.stage = Stage::Done(result);
        let task = transfer.task;
        self.wake(task);
        let due = wrong.and_then(|wrong| self.command_reports.note(wrong, self.now));
        due.into_iter().for_each(|wrong| self.report_command(wrong));
    }

    /// Gives up frames after their deadline.
    pub(in crate::supervisor) fn expire_sent_frames(&mut self) {
        if self.sent_frames.next_deadline() > self.now {
            return;
        }
        for slot in 0..SLOTS {
            let overdue = |sent_frame: &SentFrame| sent_frame.deadline <= self.now;
            if self.sent_frames.slots[slot].as_ref().is_some_and(overdue) {
                self.expire(slot);
            }
        }
        self.sent_frames.find_earliest();
    }

    /// Completes the datagrams that one addressed SubDevice processed in the received copy (CR-06), and all datagrams
    /// if the missing copies were sent on silent links. All others count as lost: the addressed SubDevice may have
    /// processed the missing copy.
    fn expire(&mut self, slot: usize) {
        let Some(sent_frame) = self.sent_frames.take(slot) else { return };
        self.monitor.observe(sent_frame.arrivals);
        self.outbox.reads_returned(sent_frame.reads);
        sent_frame.mail_reads().for_each(|read| self.strays.remember(read));
        let missing = sent_frame.missing_links(self.links);
        for link in Link::ALL.into_iter().filter(|link| missing & link.bit() != 0) {
            self.counters.copies_lost[link.index()] += 1;
            self.counters.bytes_lost[link.index()] += sent_frame.bytes.len() as u64;
        }
        if !sent_frame.answered {
            if sent_frame.arrivals.arrived == 0 {
                self.counters.lost += 1;
            } else {
                self.counters.half += 1;
            }
            let enough = sent_frame.has_all_but(self.silence.mask(self.now), self.links);
            if enough {
                self.learn_main_count(&sent_frame);
            }
            for datagram in sent_frame.datagrams.iter().filter(|datagram| !datagram.answered) {
                if enough || (datagram.is_answered_by_one() && !self.copies_differ(datagram.transfer)) {
                    let stamp = (sent_frame.sequence, sent_frame.sent_at);
                    let reply = datagram.reply(&sent_frame.bytes, stamp, self.transfers.take_data(datagram.transfer));
                    self.finish(datagram.transfer, Ok(reply));
                } else {
                    self.lost(datagram.transfer);
                }
            }
        }
        self.sent_frames.spare.push(sent_frame);
    }

    /// Whether the copies of a datagram differ, so that neither can replace the other.
    fn copies_differ(&mut self, id: TransferId) -> bool {
        let transfer = self.transfers.find(id);
        transfer.is_some_and(|it| it.request.redundant.is_some() || it.request.redundant_station.is_some())
    }

    fn lost(&mut self, id: TransferId) {
        let Some(transfer) = self.transfers.find(id) else { return };
        if transfer.request.resend && transfer.retries < MAX_RETRIES && !transfer.abandoned {
            transfer.retries += 1;
            transfer.stage = Stage::Queued;
            self.counters.resent += 1;
            let target = transfer.request.target;
            let rank = if transfer.request.urgent { Rank::Urgent } else { Rank::First };
            self.outbox.push(id, rank, target, 0, self.now);
            return;
        }
        let error = BusError::Lost { target: transfer.request.target, retries: transfer.retries };
        self.counters.timed_out += 1;
        self.finish(id, Err(error));
    }
}
