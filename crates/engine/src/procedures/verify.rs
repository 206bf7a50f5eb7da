//! Looking from time to time whether SubDevices in their target state still have the registers that were written to
//! them: SyncManagers, FMMUs, watchdog.
//!
//! A SubDevice without them stays in OP and answers everything, only its process data or its mails are missing. That
//! happens when a copy of a write that was thought lost arrives late, behind later ones, or when something else writes.

mod held;

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;

use self::held::{Held, registers};
use super::shared_segment::SharedSegment;
use crate::segment::Observation;
use crate::segment::member::Phase;
use crate::supervisor::Bus;

/// Pause between two looks: up to three datagrams per SubDevice and second.
const PAUSE: Duration = Duration::from_secs(1);
/// So often in a row a SubDevice is configured anew for the same reason; one that holds something else each time does
/// so by itself.
const ATTEMPTS: u8 = 3;

/// A SubDevice to be looked at.
struct Suspect {
    index: usize,
    attempt: u32,
    station: StationAddress,
    registers: Vec<Held>,
}

/// What a look found.
enum Found {
    /// It holds what was written.
    Right(usize),
    /// It does not; what differs.
    Wrong(Suspect, String),
}

/// What a SubDevice held when it was configured anew last, and how often that has not helped.
#[derive(Clone, Debug, Default)]
struct Remedy {
    reason: String,
    tries: u8,
}

/// Runs for ever.
pub(crate) async fn verify(bus: Bus, segment: SharedSegment) {
    let mut remedies = alloc::vec![Remedy::default(); segment.view().members.len()];
    loop {
        bus.sleep(PAUSE).await;
        let all = bus.gather_in_turns(settled(&segment), look).await;
        let mut wrong = Vec::new();
        for found in all.into_iter().flatten() {
            match found {
                Found::Right(index) => remedies[index] = Remedy::default(),
                Found::Wrong(suspect, _) => wrong.push(suspect),
            }
        }
        // Once may be the edge of a change.
        for found in bus.gather(wrong, look).await.into_iter().flatten() {
            if let Found::Wrong(suspect, reason) = found {
                let remedy = &mut remedies[suspect.index];
                if remedy.reason != reason {
                    *remedy = Remedy { reason: reason.clone(), tries: 0 };
                }
                let (index, attempt) = (suspect.index, suspect.attempt);
                if remedy.tries < ATTEMPTS && segment.view().members[index].attempt == attempt {
                    remedy.tries += 1;
                    segment.observe(Observation::Undone { index, attempt, reason });
                }
            }
        }
    }
}

/// Members that are where they should be, with what was written to them for that.
fn settled(segment: &SharedSegment) -> Vec<Suspect> {
    let access = segment.view();
    let members = access.members.iter().enumerate();
    members
        .filter_map(|(index, member)| {
            let Phase::Settled(state) = member.phase else { return None };
            let registers = registers(member.setup.as_ref()?, &member.config, state);
            let suspect = Suspect { index, attempt: member.attempt, station: member.station, registers };
            (!suspect.registers.is_empty()).then_some(suspect)
        })
        .collect()
}

/// `None` where it does not answer, which others look after.
async fn look(bus: Bus, suspect: Suspect) -> Option<Found> {
    let mut wrong = None;
    for held in &suspect.registers {
        let got = bus.fprd(suspect.station, held.register, held.bytes.len()).await.ok()?;
        if !held.is_in(&got) {
            wrong.get_or_insert_with(|| {
                format!("{} were written, something else is there: {}", held.name(), held.differences(&got))
            });
        }
    }
    Some(match wrong {
        Some(reason) => Found::Wrong(suspect, reason),
        None => Found::Right(suspect.index),
    })
}
