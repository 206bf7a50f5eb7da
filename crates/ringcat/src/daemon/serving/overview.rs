//! What is seen of a segment now.

use ringcat_control::message::SegmentOverview;
use ringcat_engine::main_device::RawDatagram;
use ringcat_engine::main_device::snapshot::Activity;
use ringcat_engine::ring_status::Redundancy;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use crate::error::Error;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;

/// The bits of AL states in AL status.
const AL_STATES: u8 = 0x0F;

/// Reads the AL status of all SubDevices with one broadcast. A lost frame counts as no answer.
///
/// # Errors
/// The thread of the acyclic half has ended.
pub fn overview(supervisor: &SupervisorThread) -> Result<SegmentOverview, Error> {
    let asked = supervisor.act(|engine| (engine.ring_status(), engine.snapshot().activity, engine.subdevices().len()));
    let (ring, activity, found) = asked?;
    let read = RawDatagram::new(Command::Brd, Target::Broadcast(map::AL_STATUS), [0; 2]);
    let replies = supervisor.datagrams(vec![read.with_resend(true)]).unwrap_or_default();
    let mut seen = SegmentOverview::default();
    seen.is_ring = ring.redundancy != Redundancy::None;
    seen.found = u32::try_from(found).unwrap_or(u32::MAX);
    seen.is_scanned = matches!(activity, Activity::Scanned | Activity::Active);
    seen.scans = activity == Activity::Scanning;
    if let Some(Ok(reply)) = replies.first() {
        seen.counts = [reply.main.0, reply.redundant.0];
        seen.al_states = reply.data.first().copied().unwrap_or(0) & AL_STATES;
    }
    for (number, link) in ring.links.iter().enumerate() {
        seen.is_up[number] = link.carrier.unwrap_or(seen.counts[number] > 0);
    }
    Ok(seen)
}
