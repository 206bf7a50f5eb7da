//! Looking from time to time whether SubDevices in their target state still have the FMMUs that were written.
//!
//! A SubDevice without them stays in OP and answers everything, only its process data is missing. That happens when a
//! write that was thought lost arrives late, or when another MainDevice writes.

use alloc::vec::Vec;
use core::fmt::Write;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{Fmmu, map};

use super::shared_segment::SharedSegment;
use crate::segment::Observation;
use crate::segment::member::Phase;
use crate::supervisor::Bus;

/// Pause between two looks: one datagram per SubDevice and second.
const PAUSE: Duration = Duration::from_secs(1);

/// A SubDevice to be looked at.
struct Suspect {
    index: usize,
    attempt: u32,
    station: StationAddress,
    expected: Vec<u8>,
}

/// Runs for ever.
pub(crate) async fn verify(bus: Bus, segment: SharedSegment) {
    loop {
        bus.sleep(PAUSE).await;
        let all = bus.gather_in_turns(settled(&segment), look).await;
        // Once may be the edge of a change.
        let wrong = bus.gather(all.into_iter().flatten(), look).await;
        for Suspect { index, attempt, expected, .. } in wrong.into_iter().flatten() {
            let mut reason = alloc::string::String::new();
            let count = expected.len() / Fmmu::LEN;
            let _ = write!(
                reason,
                "registers from {} on: the {count} FMMUs that were written are not there",
                map::FMMU_BASE
            );
            segment.observe(Observation::Undone { index, attempt, reason });
        }
    }
}

/// Members that have FMMUs and are where they should be.
fn settled(segment: &SharedSegment) -> Vec<Suspect> {
    let access = segment.view();
    let members = access.members.iter().enumerate();
    members
        .filter_map(|(index, member)| {
            let expected = member.setup.as_ref()?.fmmu_registers();
            let is_settled = matches!(member.phase, Phase::Settled(_)) && member.configured && !expected.is_empty();
            is_settled.then_some(Suspect { index, attempt: member.attempt, station: member.station, expected })
        })
        .collect()
}

/// Gives it back where its FMMUs are not as they should be.
async fn look(bus: Bus, suspect: Suspect) -> Option<Suspect> {
    let got = bus.fprd(suspect.station, map::FMMU_BASE, suspect.expected.len()).await.ok()?;
    (got != suspect.expected).then_some(suspect)
}
