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
use super::configure::Start;
use super::fleet::{Phase, SharedFleet};
use super::recover::start_if_same;
use crate::event::Event;
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
pub(crate) async fn verify(bus: Bus, fleet: SharedFleet) {
    let mut remedies = alloc::vec![Remedy::default(); fleet.access().members.len()];
    loop {
        bus.sleep(PAUSE).await;
        let all = bus.gather_in_turns(settled(&fleet), look).await;
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
                if remedy.tries < ATTEMPTS && fleet.attempt(suspect.index) == suspect.attempt {
                    remedy.tries += 1;
                    configure_anew(&bus, &fleet, suspect.index, reason);
                }
            }
        }
    }
}

/// Members that are where they should be, with what was written to them for that.
fn settled(fleet: &SharedFleet) -> Vec<Suspect> {
    let access = fleet.access();
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

fn configure_anew(bus: &Bus, fleet: &SharedFleet, index: usize, reason: String) {
    bus.report(Event::ConfigurationFailed { subdevice: index, reason });
    // Another SubDevice may answer at its address: one that was out of reach since an earlier session.
    start_if_same(bus, fleet, index, Start::Doubtful);
}
