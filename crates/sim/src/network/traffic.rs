//! Frames in the segment: from an interface of the MainDevice through cables and devices back to an interface.

use core::time::Duration;

use ringcat_wire::frame::{BYTE_TIME_NS, MAX_FRAME_VLAN, MIN_FRAME};

use super::route::leaves_paths_unchanged;
use super::statistics::LossCause;
use super::{Beyond, Event, Network, Slot};
use crate::cable::{Delivery, Endpoint, HostLink, LegFaults, LegId};
use crate::controller::Passage;
use crate::frame::{Fcs, Port, SimFrame};
use crate::host::Received;
use crate::queue::Lane;
use crate::time::SimTime;

/// Bytes of preamble and delimiter before a frame.
const PREAMBLE: u64 = 8;

impl Network {
    /// Queues a frame on an interface, padded to the minimum length.
    pub(super) fn transmit(&mut self, link: HostLink, bytes: &[u8]) {
        let mut padded = [0; MIN_FRAME];
        let bytes = match padded.get_mut(..bytes.len()) {
            Some(head) => {
                head.copy_from_slice(bytes);
                &padded
            }
            None => bytes,
        };
        if bytes.len() > MAX_FRAME_VLAN {
            return self.statistics.lose(LossCause::Oversized);
        }
        let Some(out) = self.hosts[link as usize].out.filter(|_| self.carrier(link)) else {
            return self.statistics.lose(LossCause::NoCarrier);
        };
        let slot = self.frames.put(bytes);
        if let Some(limit) = self.options.max_datagrams
            && self.frames.frame(slot).datagrams.len() > usize::from(limit.datagrams)
        {
            match limit.beyond {
                Beyond::Unprocessed => self.frames.frame_mut(slot).process_at_most(usize::from(limit.datagrams)),
                Beyond::Dropped => return self.lose(slot, LossCause::TooManyDatagrams),
            }
        }
        let Some(last_bit) = self.hosts[link as usize].transmit(self.now, self.frames.frame(slot)) else {
            return self.lose(slot, LossCause::TransmitQueueFull);
        };
        if let Some(log) = &mut self.host_log {
            log.note(self.now, link, true, bytes);
        }
        let counters = &mut self.statistics.links[link as usize];
        counters.frames_sent += 1;
        counters.bytes_sent += bytes.len() as u64;
        let at = last_bit + Duration::from_nanos(self.legs[out.index()].delay_ns);
        match link.entry_lane().filter(|_| leaves_paths_unchanged(self.frames.frame(slot))) {
            Some(lane) => self.queue.push(lane, at, Event::Entry { slot, link, leg: out }),
            None => self.queue.push(Lane::Any, at, Event::Arrival { slot, leg: out, faults_applied: false }),
        }
    }

    /// Handles the arrival of a frame's last bit at the end of a leg. Returns its next arrival.
    pub(super) fn arrive(&mut self, slot: Slot, id: LegId, faults_applied: bool) -> Option<(SimTime, Event)> {
        if self.legs[id.index()].faulty && !faults_applied {
            return self.apply_leg_faults(slot, id);
        }
        let first_bit = self.now.back_ns(self.frames.frame(slot).first_to_last_bit_ns());
        let leg = &self.legs[id.index()];
        let (to, detected) = (leg.to, leg.detected && leg.detected_at <= first_bit);
        match leg.delivery(first_bit) {
            Delivery::Arrives => {}
            Delivery::Truncated { seen } if bytes_within(seen) > 0 => {
                let frame = self.frames.frame_mut(slot);
                frame.truncate(bytes_within(seen));
                frame.fcs = Fcs::Bad;
            }
            Delivery::Truncated { .. } | Delivery::Lost => return self.lose_hop(slot, LossCause::DeadCable),
        }
        if !detected {
            return self.lose_hop(slot, LossCause::NoLink);
        }
        match to {
            Endpoint::Device(device, port) => self.hop(slot, device.0, port, first_bit),
            Endpoint::Host(link) => {
                self.deliver(slot, link);
                None
            }
        }
    }

    /// A frame passes a device.
    fn hop(&mut self, slot: Slot, index: usize, from: Port, first_bit: SimTime) -> Option<(SimTime, Event)> {
        self.statistics.hops += 1;
        let id = self.frames.frame(slot).id;
        if self.nodes[index].device.controller.may_process(from) {
            // A loop that closed meanwhile returned the frame: the processing unit has not received its beginning.
            let node = &self.nodes[index];
            if node.device.controller.returns_to_unit(from) && node.interrupted(from, Port::A, first_bit) {
                return self.lose_hop(slot, LossCause::LoopChanged);
            }
            self.settle_before(index, id);
        }
        let frame = self.frames.frame_mut(slot);
        let node = &mut self.nodes[index];
        let passage = node.device.controller.receive_between(frame, from, first_bit, self.now);
        // A frame that only passes by needs no reaction of the application.
        if !matches!(passage, Passage::Leaves { processed: false, .. }) {
            if self.defers_settling {
                self.settle_later(index, id);
            } else {
                self.settle(index);
            }
        }
        let Passage::Leaves { port, processed } = passage else {
            return self.lose_hop(slot, LossCause::Destroyed);
        };
        let node = &self.nodes[index];
        if node.interrupted(from, port, first_bit) {
            return self.lose_hop(slot, LossCause::LoopChanged);
        }
        let Some(leg) = node.out[port.index()] else {
            return self.lose_hop(slot, LossCause::OpenPort);
        };
        let at = self.now
            + self.options.passage(&node.device, processed)
            + Duration::from_nanos(self.legs[leg.index()].delay_ns);
        Some((at, Event::Arrival { slot, leg, faults_applied: false }))
    }

    /// A frame reaches an interface of the MainDevice.
    fn deliver(&mut self, slot: Slot, link: HostLink) {
        if self.frames.frame(slot).fcs != Fcs::Good {
            return self.lose(slot, LossCause::BadCheckSequence);
        }
        let bytes = self.frames.remove_bytes(slot);
        let length = bytes.len() as u64;
        if let Some(log) = &mut self.host_log {
            log.note(self.now, link, false, &bytes);
        }
        if let Err(refused) = self.hosts[link as usize].deliver(Received { at: self.now, bytes }) {
            self.frames.give_back(refused.bytes);
            return self.statistics.lose(LossCause::ReceiveQueueFull);
        }
        let counters = &mut self.statistics.links[link as usize];
        counters.frames_received += 1;
        counters.bytes_received += length;
        self.expect_reaction(link.host());
    }

    /// Applies the faults of a leg to a frame that is due at its end.
    fn apply_leg_faults(&mut self, slot: Slot, id: LegId) -> Option<(SimTime, Event)> {
        let leg = &mut self.legs[id.index()];
        if leg.faults.blocked {
            return self.lose_hop(slot, LossCause::Blocked);
        }
        let dropped = LegFaults::take(&mut leg.faults.drop);
        let corrupted = !dropped && LegFaults::take(&mut leg.faults.corrupt);
        let symbol_error = !dropped && LegFaults::take(&mut leg.faults.symbol_errors);
        let doubled = !dropped && LegFaults::take(&mut leg.faults.duplicate);
        let late =
            if !dropped && LegFaults::take(&mut leg.faults.delay) { leg.faults.delay_by } else { Duration::ZERO };
        leg.refresh_faulty();
        if dropped {
            return self.lose_hop(slot, LossCause::Dropped);
        }
        if corrupted || symbol_error {
            self.corrupt(slot);
        }
        self.frames.frame_mut(slot).symbol_error |= symbol_error;
        let at = self.now + late;
        if doubled {
            let copy = self.frames.put_copy(slot);
            let behind = at + Duration::from_nanos(self.frames.frame(slot).occupies_ns());
            self.queue.push(Lane::Any, behind, Event::Arrival { slot: copy, leg: id, faults_applied: true });
        }
        Some((at, Event::Arrival { slot, leg: id, faults_applied: true }))
    }

    /// Inverts one bit of a frame.
    fn corrupt(&mut self, slot: Slot) {
        let frame = self.frames.frame_mut(slot);
        let mut bytes = core::mem::take(&mut frame.bytes);
        let bit = self.random.below(bytes.len() * 8);
        if let Some(byte) = bytes.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
        // The bit may be part of a datagram's length: the datagrams must be found again.
        let fcs = if frame.fcs == Fcs::Good { Fcs::Bad } else { frame.fcs };
        let most = frame.most_datagrams;
        *frame = SimFrame { fcs, ..SimFrame::new(frame.id, bytes) };
        frame.process_at_most(most);
    }

    fn lose(&mut self, slot: Slot, cause: LossCause) {
        self.statistics.lose(cause);
        self.frames.remove(slot);
    }

    fn lose_hop(&mut self, slot: Slot, cause: LossCause) -> Option<(SimTime, Event)> {
        self.lose(slot, cause);
        None
    }
}

/// Bytes of a frame that have arrived this long after the first bit of the preamble.
fn bytes_within(time: Duration) -> usize {
    usize::try_from((time.as_nanos() as u64 / BYTE_TIME_NS).saturating_sub(PREAMBLE)).unwrap_or(usize::MAX)
}
