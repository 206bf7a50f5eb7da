//! Bringing SubDevices back: after an error, after power-off, or for the first time. Process data of the others
//! continues.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::ToString;
use core::cell::Cell;
use core::future::{Future, poll_fn};
use core::pin::{Pin, pin};
use core::task::Poll;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlState, AlStatusCode};

use super::al_state;
use super::configure::{BringUp, ConfigureError, RegisterFailure, StartupError};
use super::frame_limit;
use super::read_again::read_again;
use super::shared_segment::SharedSegment;
use super::sii;
use super::unassigned::{MappingEvidence, has_identity, mapping_evidence, take_away};
use crate::event::Subject;
use crate::mail::MailboxError;
use crate::mail::aoe::AoeError;
use crate::mail::coe::SdoFailure;
use crate::mail::eoe::EoeFailure;
use crate::mail::foe::FoeFailure;
use crate::mail::soe::SoeFailure;
use crate::segment::effect::{Check, Shown};
use crate::segment::member::Member;
use crate::segment::start::Start;
use crate::segment::{MemberFinding, Problem, ProcessDataStep, Retries};
use crate::supervisor::{Bus, BusError};

/// Pause before the first repeated attempt to configure a SubDevice; it doubles with every failure.
const FIRST_PAUSE: Duration = Duration::from_millis(100);
/// Longest pause between attempts.
const LONGEST_PAUSE: Duration = Duration::from_secs(5);
/// Reads of a SubDevice that did not answer once, before it is lost: at the moment of a cut a frame may have been
/// processed by none.
const SCANS: usize = 3;
/// Pause between two of these reads, and before the first repetition of a configuration that failed because of the bus.
const READ_PAUSE: Duration = Duration::from_millis(3);

/// Brings a SubDevice to its target state, repeatedly until it succeeds or the SubDevice no longer answers. `reported`:
/// its error that is reported and still present.
pub(super) async fn keep_up(
    bus: &Bus,
    segment: &SharedSegment,
    (index, attempt): (usize, u32),
    start: Start,
    reported: Option<Shown>,
) {
    let (mut start, mut reported) = (start, reported);
    let (mut pause, mut disturbed) = (FIRST_PAUSE, false);
    loop {
        let result = try_once(bus, segment, (index, attempt), start, &mut reported).await;
        bus.step(Subject::States, || match &result {
            Ok(state) => format!("SubDevice {index}: attempt {attempt} reached {state}"),
            Err(error) => format!("SubDevice {index}: attempt {attempt} failed: {error}"),
        });
        // After a failed short start the full start follows, and the reverse.
        start = if start == Start::Unknown { Start::Doubtful } else { Start::Unknown };
        match result {
            Ok(state) => return segment.observe_member((index, attempt), MemberFinding::Reached(state)),
            Err(error) if is_of_bus(&error) => {
                if !is_there(bus, segment, index).await {
                    // The supervision determines the cause.
                    return segment.observe_member((index, attempt), MemberFinding::Unreachable);
                }
                // A single failure may be due to a cut elsewhere, not to this SubDevice.
                if !core::mem::replace(&mut disturbed, true) {
                    bus.sleep(READ_PAUSE).await;
                    continue;
                }
                Box::pin(frame_limit::explain(bus, segment)).await;
                segment.observe_member((index, attempt), MemberFinding::Failed(problem(&error)));
            }
            // A late request of another program, or of a procedure that has ended, took effect meanwhile.
            Err(error) if !disturbed && (was_changed(&error) || has_left(bus, segment, index, &error).await) => {
                disturbed = true;
                bus.sleep(READ_PAUSE).await;
                continue;
            }
            // A repetition is useless with the same EEPROM, which is read again when the SubDevice comes back, or on
            // request.
            Err(error @ ConfigureError::Unfit(_)) => {
                segment.observe_member((index, attempt), MemberFinding::Failed(problem(&error)));
                segment.until_retried(index).await;
                // In a box: it needs the most memory, and is rare.
                Box::pin(read_again(bus, segment, (index, attempt))).await;
                continue;
            }
            Err(error) => {
                segment.observe_member((index, attempt), MemberFinding::Failed(problem(&error)));
                if segment.view().retries() == Retries::OnRequest {
                    segment.until_retried(index).await;
                    disturbed = false;
                    continue;
                }
            }
        }
        let is_requested = bus.within(pause, segment.until_retried(index)).await.is_ok();
        pause = if is_requested { FIRST_PAUSE } else { (pause * 2).min(LONGEST_PAUSE) };
    }
}

/// The error is due to frames, not to the SubDevice.
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
        ConfigureError::Startup { error: StartupError::Foe(error), .. } => {
            matches!(error.cause, FoeFailure::Mailbox(MailboxError::Bus(_) | MailboxError::Closed))
        }
        ConfigureError::Startup { error: StartupError::Register(error), .. } => {
            matches!(error.cause, RegisterFailure::Bus(_))
        }
        ConfigureError::Startup {
            error: StartupError::Aoe(AoeError::Mailbox(error)) | StartupError::Voe(error),
            ..
        } => matches!(error, MailboxError::Bus(_) | MailboxError::Closed),
        ConfigureError::Startup {
            error: StartupError::Value { .. } | StartupError::IdnValue { .. } | StartupError::Aoe(_),
            ..
        }
        | ConfigureError::State(_)
        | ConfigureError::NotLocked(_)
        | ConfigureError::NotPermitted(_)
        | ConfigureError::NoSetup
        | ConfigureError::Unfit(_)
        | ConfigureError::NoBoot
        | ConfigureError::Absent
        | ConfigureError::Interrupted => false,
    }
}

/// AL status codes of refusals of other requests: those of a procedure are valid in the state in which it makes them,
/// and BOOT is requested by another procedure.
const NEVER_AN_ANSWER: [AlStatusCode; 3] = [
    AlStatusCode::INVALID_STATE_CHANGE,
    AlStatusCode::BOOT_NOT_SUPPORTED,
    AlStatusCode::INVALID_MAILBOX_CONFIGURATION_BOOT,
];

/// Another request took effect meanwhile: the SubDevice is in a state from which the requested one is not valid, has
/// refused a request that was not the one of this procedure, or PREOP before its mailboxes were enabled (0x0016), or
/// SAFEOP before its process data was configured (0x001D, 0x001E).
fn was_changed(error: &ConfigureError) -> bool {
    let (requested, code) = match error {
        ConfigureError::State(al_state::StateError::Left { .. }) => return true,
        ConfigureError::State(al_state::StateError::Refused { requested, code, .. }) => (requested, *code),
        _ => return false,
    };
    let is_early = [AlStatusCode::INVALID_OUTPUT_CONFIGURATION, AlStatusCode::INVALID_INPUT_CONFIGURATION];
    let is_mailbox = code == AlStatusCode::INVALID_MAILBOX_CONFIGURATION_PREOP;
    match requested {
        AlState::Boot => false,
        _ if NEVER_AN_ANSWER.contains(&code) => true,
        AlState::Init | AlState::PreOp => is_early.contains(&code) || is_mailbox,
        AlState::SafeOp => is_early.contains(&code),
        AlState::Op => false,
    }
}

/// A request for its mailbox was not answered because the SubDevice is no longer in a state with mailboxes.
async fn has_left(bus: &Bus, segment: &SharedSegment, index: usize, error: &ConfigureError) -> bool {
    if !matches!(error, ConfigureError::Sdo(_) | ConfigureError::Startup { .. }) {
        return false;
    }
    let Some(station) = segment.view().member(index).map(|member| member.station) else { return false };
    let status = al_state::read_status(bus, station).await;
    status.is_ok_and(|(status, _)| matches!(status.al_state(), Some(AlState::Init | AlState::Boot)))
}

/// Whether a SubDevice answers. While frames are lost this is unknown, and it counts as present.
async fn is_there(bus: &Bus, segment: &SharedSegment, index: usize) -> bool {
    let Some(station) = segment.view().member(index).map(|member| member.station) else { return false };
    for _ in 0..SCANS {
        match al_state::read_status(bus, station).await {
            Err(BusError::Wkc { .. }) => bus.sleep(READ_PAUSE).await,
            Ok(_) | Err(_) => return true,
        }
    }
    false
}

pub(super) fn problem(error: &ConfigureError) -> Problem {
    match error {
        ConfigureError::State(al_state::StateError::Refused { requested, status, code }) => {
            Problem::Refused { requested: *requested, shown: (*status, *code) }
        }
        error => Problem::Other(error.to_string()),
    }
}

/// The bring-up of a SubDevice to its present target.
pub(super) fn bring_up<'a>(
    bus: &'a Bus,
    segment: &'a SharedSegment,
    (index, attempt): (usize, u32),
) -> Result<BringUp<'a>, ConfigureError> {
    let access = segment.view();
    let member = access.member(index).ok_or(ConfigureError::NoSetup)?;
    Ok(BringUp {
        bus,
        segment,
        index,
        attempt,
        station: member.station,
        setup: member.setup.clone().ok_or_else(|| no_setup(&member))?,
        config: member.config.clone(),
        target: member.target,
        mailbox: segment.mailbox(index).ok_or(ConfigureError::NoSetup)?,
        goes_on_unlocked: Cell::new(false),
    })
}

/// Why there is no configuration for a SubDevice.
pub(super) fn no_setup(member: &Member) -> ConfigureError {
    member.unfit.clone().map_or(ConfigureError::NoSetup, ConfigureError::Unfit)
}

async fn try_once(
    bus: &Bus,
    segment: &SharedSegment,
    (index, attempt): (usize, u32),
    start: Start,
    reported: &mut Option<Shown>,
) -> Result<AlState, ConfigureError> {
    let bring_up = bring_up(bus, segment, (index, attempt))?;
    let quickly = start == Start::Unknown && quick(&bring_up, reported).await?;
    // The full start begins with an acknowledgement: an error after it is new.
    let result = if quickly { Ok(()) } else { bring_up.run(start).await.inspect_err(|_| *reported = None) };
    // An attempt that ended on the way to PREOP, this or an earlier one, leaves the EEPROM assigned to the PDI.
    let is_left = match &result {
        Ok(()) => quickly && bring_up.target == AlState::PreOp,
        Err(error) => !is_of_bus(error),
    };
    if is_left && !bring_up.config.sii_to_pdi {
        sii::claim(bus, bring_up.station).await?;
    }
    result.map(|()| bring_up.target)
}

/// A SubDevice that only fell from OP to SAFEOP still has its configuration: after an acknowledgement it may go back to
/// OP. Its error is reported, unless it is the error reported before.
async fn quick(bring_up: &BringUp<'_>, reported: &mut Option<Shown>) -> Result<bool, ConfigureError> {
    let BringUp { bus, segment, index, attempt, station, setup, target, mailbox, .. } = bring_up;
    let (status, code) = al_state::read_status(bus, *station).await?;
    if !status.error && status.al_state() == Some(*target) {
        if segment.view().member(*index).is_some_and(|member| member.exchanges(*target)) {
            bring_up.join();
        } else {
            bring_up.process_data(ProcessDataStep::Off);
        }
        mailbox.resume();
        return Ok(true);
    }
    if status.al_state() != Some(AlState::SafeOp)
        || *target != AlState::Op
        || !segment.view().member(*index).is_some_and(|member| member.configured)
    {
        return Ok(false);
    }
    bring_up.join();
    mailbox.resume();
    if status.error {
        if reported.replace((status, code)) != Some((status, code)) {
            segment.observe_member((*index, *attempt), MemberFinding::Shows((status, code)));
        }
        al_state::acknowledge(bus, *station, setup.emulated).await?;
    }
    *reported = None;
    bring_up.op().await?;
    Ok(true)
}

/// Brings a member to its target state while the attempt is the current one. First its identity is checked; the address
/// of another SubDevice is taken away.
pub(super) async fn bring_up_member(
    bus: Bus,
    segment: SharedSegment,
    (index, attempt): (usize, u32),
    from: Start,
    reported: Option<Shown>,
    check: Check,
) {
    let procedure = pin!(async {
        if check == Check::None {
            return keep_up(&bus, &segment, (index, attempt), from, reported).await;
        }
        if !is_the_member(&bus, &segment, (index, attempt), check).await {
            return;
        }
        if segment.view().member(index).is_some_and(|member| member.unfit.is_some()) {
            Box::pin(read_again(&bus, &segment, (index, attempt))).await;
        }
        keep_up(&bus, &segment, (index, attempt), from, reported).await;
    });
    while_current(&segment, index, attempt, procedure).await;
}

/// Whether the SubDevice with the station address of a member is that member.
async fn is_the_member(bus: &Bus, segment: &SharedSegment, (index, attempt): (usize, u32), check: Check) -> bool {
    let Some(station) = segment.view().member(index).map(|member| member.station) else { return false };
    let is = match check {
        Check::None => Ok(true),
        Check::Identity => Ok(has_identity(bus, segment, index, station).await),
        Check::Return => is_the_lost_one(bus, segment, index, station).await,
    };
    match (is, check) {
        (Ok(true), Check::Return) => segment.observe_member((index, attempt), MemberFinding::Returned),
        (Ok(true), Check::Identity | Check::None) => {}
        (not, check) => {
            if not.is_ok() {
                // If that fails, the next scan finds the address again.
                let _ = take_away(bus, segment, station).await;
            }
            // A SubDevice at the address of a lost member is handled as unassigned, and reported by its position then.
            let finding = match check {
                Check::Return => MemberFinding::NotReturned,
                Check::Identity | Check::None => MemberFinding::Unreachable,
            };
            segment.observe_member((index, attempt), finding);
            return false;
        }
    }
    true
}

/// Whether the SubDevice with the station address of a lost member is that member. It may have this address from an
/// earlier session, or have been moved here from another segment.
async fn is_the_lost_one(
    bus: &Bus,
    segment: &SharedSegment,
    index: usize,
    station: StationAddress,
) -> Result<bool, BusError> {
    Ok(match mapping_evidence(bus, segment, index, station).await? {
        MappingEvidence::Held => true,
        MappingEvidence::Missing | MappingEvidence::Unmapped => false,
        MappingEvidence::None => has_identity(bus, segment, index, station).await,
    })
}

/// Runs a procedure for a SubDevice until another one begins or the SubDevice is lost. It is pinned by the caller: a
/// future that an async function takes by value is in that function's memory twice.
pub(super) async fn while_current(
    segment: &SharedSegment,
    index: usize,
    attempt: u32,
    mut procedure: Pin<&mut impl Future<Output = ()>>,
) {
    poll_fn(|context| {
        if segment.view().member(index).is_none_or(|member| member.attempt != attempt) {
            return Poll::Ready(());
        }
        procedure.as_mut().poll(context)
    })
    .await;
}
