//! Bringing SubDevices back: from an error, from power-off, or for the first time. The others go on meanwhile.

use alloc::string::ToString;
use alloc::vec::Vec;
use core::future::{Future, poll_fn};
use core::pin::pin;
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::al::{AlState, AlStatus, AlStatusCode};

use super::al_state;
use super::configure::{BringUp, ConfigureError, RegisterFailure, Start, StartupError};
use super::fleet::{Member, Phase, SharedFleet};
use super::frame_limit;
use super::request_state::read_again;
use super::sii;
use super::strangers::{Mark, has_identity, mark, take_away};
use crate::event::Event;
use crate::mail::MailboxError;
use crate::mail::coe::SdoFailure;
use crate::mail::eoe::EoeFailure;
use crate::mail::soe::SoeFailure;
use crate::supervisor::{Bus, BusError};

/// Pause before the first new attempt to configure a SubDevice; it doubles with every failure.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause between attempts.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// Looks at a SubDevice that did not answer once, before it is lost: at the edge of a cut a frame may have met nobody.
const LOOKS: usize = 3;
/// Pause between two of them, and before a configuration that the bus disturbed is tried again for the first time.
const LOOK_PAUSE: Duration = Duration::from_millis(3);

/// AL status and code that a SubDevice showed.
pub(super) type Shown = (AlStatus, AlStatusCode);

/// Brings a SubDevice to its target state, again and again until it works or it no longer answers. `told`: the error of its
/// that was told and still stands.
pub(super) async fn keep_up(bus: Bus, fleet: SharedFleet, index: usize, start: Start, told: Option<Shown>) {
    let (mut start, mut told) = (start, told);
    let mut pause = FIRST_PAUSE;
    let mut disturbed = false;
    loop {
        let result = attempt(&bus, &fleet, index, start, &mut told).await;
        // A short way that did not lead there is followed by the whole one, and that by the short one.
        start = if start == Start::Unknown { Start::Doubtful } else { Start::Unknown };
        match result {
            Ok(state) => {
                fleet.set_phase(index, Phase::Settled(state));
                fleet.board.set_excused(index, !fleet.exchanges(index, state));
                bus.report(Event::StateReached { subdevice: index, state });
                return;
            }
            Err(error) if is_of_bus(&error) => {
                if !is_there(&bus, &fleet, index).await {
                    // Whoever supervises finds out more.
                    lose(&bus, &fleet, index);
                    return;
                }
                // Once may be the edge of a cut, which is no matter of this SubDevice.
                if !core::mem::replace(&mut disturbed, true) {
                    bus.sleep(LOOK_PAUSE).await;
                    continue;
                }
                frame_limit::explain(&bus, &fleet).await;
                bus.report(failure(index, &error));
            }
            // Another try brings nothing new before its EEPROM is another one, which is read when it comes back.
            Err(error @ ConfigureError::Unfit(_)) => return bus.report(failure(index, &error)),
            Err(error) => bus.report(failure(index, &error)),
        }
        bus.sleep(pause).await;
        pause = (pause * 2).min(LONGEST_PAUSE);
    }
}

/// The frames are to blame, not what the SubDevice said.
pub(super) fn is_of_bus(error: &ConfigureError) -> bool {
    match error {
        ConfigureError::Bus(_) => true,
        ConfigureError::Sdo(error) | ConfigureError::Startup { error: StartupError::Sdo(error), .. } => {
            matches!(error.cause, SdoFailure::Mailbox(MailboxError::Bus(_) | MailboxError::Closed))
        }
        ConfigureError::Startup { error: StartupError::Soe(error), .. } => {
            matches!(error.cause, SoeFailure::Mailbox(MailboxError::Bus(_) | MailboxError::Closed))
        }
        ConfigureError::Startup { error: StartupError::Eoe(error), .. } => {
            matches!(error.cause, EoeFailure::Mailbox(MailboxError::Bus(_) | MailboxError::Closed))
        }
        ConfigureError::Startup { error: StartupError::Register(error), .. } => {
            matches!(error.cause, RegisterFailure::Bus(_))
        }
        ConfigureError::Startup { error: StartupError::Value { .. }, .. }
        | ConfigureError::State(_)
        | ConfigureError::NotLocked(_)
        | ConfigureError::NoSetup
        | ConfigureError::Unfit(_)
        | ConfigureError::NoBoot
        | ConfigureError::Absent
        | ConfigureError::Interrupted => false,
    }
}

/// Whether a SubDevice answers. While frames get lost nothing is known, and it counts as there.
async fn is_there(bus: &Bus, fleet: &SharedFleet, index: usize) -> bool {
    let Some(station) = fleet.access().members.get(index).map(|member| member.station) else { return false };
    for _ in 0..LOOKS {
        match al_state::read_status(bus, station).await {
            Err(BusError::Wkc { .. }) => bus.sleep(LOOK_PAUSE).await,
            Ok(_) | Err(_) => return true,
        }
    }
    false
}

/// A SubDevice no longer answers. What was under way for it ends.
pub(super) fn lose(bus: &Bus, fleet: &SharedFleet, index: usize) {
    fleet.next_attempt(index);
    if fleet.phase(index) != Phase::Absent {
        fleet.set_phase(index, Phase::Absent);
        fleet.count(index, |incidents| &mut incidents.absences);
        bus.report(Event::Lost { subdevice: index });
    }
    fleet.board.set_taking_part(index, false);
    fleet.board.set_unproven(index, false);
    // One that was on its way to process data is missed from now on.
    fleet.board.set_excused(index, !fleet.exchanges(index, fleet.target(index)));
    if let Some(mailbox) = fleet.mailbox(index) {
        mailbox.suspend();
    }
}

pub(super) fn failure(index: usize, error: &ConfigureError) -> Event {
    match error {
        ConfigureError::State(al_state::StateError::Refused { requested, status, code }) => {
            Event::StateError { subdevice: index, requested: Some(*requested), status: *status, code: *code }
        }
        error => Event::ConfigurationFailed { subdevice: index, reason: error.to_string() },
    }
}

/// The bring-up of a SubDevice to its present target.
pub(super) fn bring_up<'a>(bus: &'a Bus, fleet: &'a SharedFleet, index: usize) -> Result<BringUp<'a>, ConfigureError> {
    let access = fleet.access();
    let member = access.members.get(index).ok_or(ConfigureError::NoSetup)?;
    Ok(BringUp {
        bus,
        fleet,
        index,
        station: member.station,
        setup: member.setup.clone().ok_or_else(|| no_setup(member))?,
        config: member.config.clone(),
        target: member.target,
        mailbox: member.mailbox.clone(),
    })
}

/// Why there is nothing to write to a SubDevice.
pub(super) fn no_setup(member: &Member) -> ConfigureError {
    member.unfit.clone().map_or(ConfigureError::NoSetup, ConfigureError::Unfit)
}

async fn attempt(
    bus: &Bus,
    fleet: &SharedFleet,
    index: usize,
    start: Start,
    told: &mut Option<Shown>,
) -> Result<AlState, ConfigureError> {
    let bring_up = bring_up(bus, fleet, index)?;
    let quickly = start == Start::Unknown && quick(&bring_up, told).await?;
    // The whole way begins with an acknowledgement: what it shows behind that is new.
    let result = if quickly { Ok(()) } else { bring_up.run(start).await.inspect_err(|_| *told = None) };
    // An attempt that ended on the way to PREOP, this one or one before, leaves the EEPROM to the PDI.
    let is_left = match &result {
        Ok(()) => quickly && bring_up.target == AlState::PreOp,
        Err(error) => !is_of_bus(error),
    };
    if is_left && !bring_up.config.sii_to_pdi {
        sii::claim(bus, bring_up.station).await?;
    }
    result.map(|()| bring_up.target)
}

/// A SubDevice that only fell from OP to SAFEOP still has its configuration: acknowledged, it may go back to OP. Its error is
/// told, unless it is the one that was.
async fn quick(bring_up: &BringUp<'_>, told: &mut Option<Shown>) -> Result<bool, ConfigureError> {
    let BringUp { bus, fleet, index, station, setup, target, mailbox, .. } = bring_up;
    let (status, code) = al_state::read_status(bus, *station).await?;
    if !status.error && status.al_state() == Some(*target) {
        if fleet.exchanges(*index, *target) {
            bring_up.join();
        } else {
            fleet.board.set_taking_part(*index, false);
        }
        mailbox.resume();
        return Ok(true);
    }
    if status.al_state() != Some(AlState::SafeOp) || *target != AlState::Op || !fleet.is_configured(*index) {
        return Ok(false);
    }
    bring_up.join();
    mailbox.resume();
    if status.error {
        if told.replace((status, code)) != Some((status, code)) {
            bus.report(Event::StateError { subdevice: *index, requested: None, status, code });
        }
        al_state::acknowledge(bus, *station, setup.emulated).await?;
    }
    *told = None;
    bring_up.op().await?;
    Ok(true)
}

/// Starts the configuration of a SubDevice that answers. `told`: its error that was told.
pub(super) fn start(bus: &Bus, fleet: &SharedFleet, index: usize, from: Start, told: Option<Shown>) {
    fleet.set_phase(index, Phase::Configuring);
    let attempt = fleet.next_attempt(index);
    let (own_bus, own_fleet) = (bus.clone(), fleet.clone());
    bus.spawn(async move {
        let procedure = keep_up(own_bus.clone(), own_fleet.clone(), index, from, told);
        while_current(&own_fleet, index, attempt, procedure).await;
    });
}

/// A lost SubDevice's station address answers again: it comes back, if it is the same one.
pub(super) fn welcome(bus: &Bus, fleet: &SharedFleet, index: usize) {
    fleet.set_phase(index, Phase::Configuring);
    let attempt = fleet.next_attempt(index);
    let (bus, fleet) = (bus.clone(), fleet.clone());
    bus.clone().spawn(async move {
        let checked = async {
            match is_the_lost_one(&bus, &fleet, index).await {
                Ok(true) => {
                    bus.report(Event::Returned { subdevice: index });
                    return bring_back(&bus, &fleet, index, Start::Unknown).await;
                }
                // It is looked at like others without an address of ours, and told by its place then.
                Ok(false) => turn_away(&bus, &fleet, index).await,
                Err(_) => {}
            }
            fleet.set_phase(index, Phase::Absent);
            fleet.note_news();
        };
        while_current(&fleet, index, attempt, checked).await;
    });
}

/// Starts the configuration of what answers at a member's station address, if it is that member; otherwise takes the address
/// away.
pub(super) fn start_if_same(bus: &Bus, fleet: &SharedFleet, index: usize, from: Start) {
    fleet.set_phase(index, Phase::Configuring);
    let attempt = fleet.next_attempt(index);
    let (bus, fleet) = (bus.clone(), fleet.clone());
    bus.clone().spawn(async move {
        let checked = async {
            let station = fleet.access().members[index].station;
            if has_identity(&bus, &fleet, index, station).await {
                return bring_back(&bus, &fleet, index, from).await;
            }
            turn_away(&bus, &fleet, index).await;
            lose(&bus, &fleet, index);
        };
        while_current(&fleet, index, attempt, checked).await;
    });
}

async fn bring_back(bus: &Bus, fleet: &SharedFleet, index: usize, from: Start) {
    if fleet.access().members[index].unfit.is_some() {
        read_again(bus, fleet, index).await;
    }
    keep_up(bus.clone(), fleet.clone(), index, from, None).await;
}

async fn turn_away(bus: &Bus, fleet: &SharedFleet, index: usize) {
    let station = fleet.access().members[index].station;
    // Where that fails, the next look finds the address again.
    let _ = take_away(bus, fleet, station).await;
}

/// Whether what has the station address of a lost member is that member: it may be one that had this address in an
/// earlier session, or was exchanged for one that ran elsewhere.
async fn is_the_lost_one(bus: &Bus, fleet: &SharedFleet, index: usize) -> Result<bool, BusError> {
    let station = fleet.access().members[index].station;
    Ok(match mark(bus, fleet, index, station).await? {
        Mark::Borne => true,
        Mark::Missing | Mark::Unmapped => false,
        Mark::None => has_identity(bus, fleet, index, station).await,
    })
}

/// Lets a procedure for a SubDevice run until another one begins or the SubDevice is lost.
pub(super) async fn while_current(
    fleet: &SharedFleet,
    index: usize,
    attempt: u32,
    procedure: impl Future<Output = ()>,
) {
    let mut procedure = pin!(procedure);
    poll_fn(|context| {
        if fleet.attempt(index) != attempt {
            return Poll::Ready(());
        }
        procedure.as_mut().poll(context)
    })
    .await;
}

/// Starts the configuration of all SubDevices that were found.
pub(crate) fn start_all(bus: &Bus, fleet: &SharedFleet, from: Start) {
    let found: Vec<usize> = {
        let access = fleet.access();
        let members = access.members.iter().enumerate();
        members.filter(|(_, member)| member.is_there()).map(|(index, _)| index).collect()
    };
    for index in found {
        start(bus, fleet, index, from, None);
    }
}
