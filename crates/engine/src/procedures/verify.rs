//! Checks once a second whether SubDevices in their target state still hold the registers that were written to them:
//! SyncManagers, FMMUs, watchdog.
//!
//! A SubDevice without them stays in OP and answers everything; only its process data or its mails are missing. Causes
//! are a duplicate of a write that arrives late, after later writes, or writes of other software.

mod held;

use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;

use self::held::{Held, registers};
use super::shared_segment::SharedSegment;
use crate::segment::MemberFinding;
use crate::segment::member::Phase;
use crate::supervisor::Bus;

/// Interval of the checks: up to three datagrams per SubDevice and second.
const PAUSE: Duration = Duration::from_secs(1);
/// A SubDevice to be checked.
struct Suspect {
    index: usize,
    attempt: u32,
    station: StationAddress,
    registers: Vec<Held>,
    /// Its configuration was repeated because of a difference.
    is_repaired: bool,
}

/// Result of a check.
enum Found {
    /// The SubDevice holds the written values.
    Right(Suspect),
    /// The SubDevice holds other values; the difference.
    Wrong(Suspect, String),
}

/// Runs until the MainDevice stops.
pub(super) async fn verify(bus: Bus, segment: SharedSegment) {
    segment.until_branches_are_open().await;
    loop {
        bus.sleep(PAUSE).await;
        let all = bus.gather_in_turns(settled(&segment), check).await;
        let mut wrong = Vec::new();
        for found in all.into_iter().flatten() {
            match found {
                Found::Right(suspect) if suspect.is_repaired => {
                    segment.observe_member((suspect.index, suspect.attempt), MemberFinding::Held);
                }
                Found::Right(_) => {}
                Found::Wrong(suspect, _) => wrong.push(suspect),
            }
        }
        // A single difference may be due to a change under way.
        for found in bus.gather(wrong, check).await.into_iter().flatten() {
            if let Found::Wrong(suspect, reason) = found {
                segment.observe_member((suspect.index, suspect.attempt), MemberFinding::Undone(reason));
            }
        }
    }
}

/// Members in their target state, with the registers written for it.
fn settled(segment: &SharedSegment) -> Vec<Suspect> {
    let access = segment.view();
    let members = access.members().enumerate();
    members
        .filter_map(|(index, member)| {
            let Phase::Settled(state) = member.phase else { return None };
            let registers = registers(member.setup.as_ref()?, &member.config, state);
            let (attempt, station, is_repaired) = (member.attempt, member.station, member.repair.is_under_way());
            let suspect = Suspect { index, attempt, station, registers, is_repaired };
            (!suspect.registers.is_empty()).then_some(suspect)
        })
        .collect()
}

/// `None` if it does not answer, which the supervision handles.
async fn check(bus: Bus, suspect: Suspect) -> Option<Found> {
    let mut wrong = None;
    for held in &suspect.registers {
        let got = bus.fprd(suspect.station, held.register, held.bytes.len()).await.ok()?;
        if !held.is_in(&got) {
            wrong.get_or_insert_with(|| {
                format!("{} were written, but other values were read: {}", held.name(), held.differences(&got))
            });
        }
    }
    Some(match wrong {
        Some(reason) => Found::Wrong(suspect, reason),
        None => Found::Right(suspect),
    })
}
