//! Brings all SubDevices down to a state: the end of an orderly stop (protocol 5.3).
//!
//! Each SubDevice gets its own request. A broadcast is not possible for all of them: an undeclared SubDevice is in INIT
//! and has no mailbox for PREOP, a SubDevice may have another target state, a device that copies AL control into AL
//! status would show the acknowledgement as an error; and a broadcast read returns only the OR of all AL states. INIT
//! is the exception, because every state may change to it: a broadcast requests it first, so that all leave OP at once,
//! including SubDevices without a known address.

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::map;

use super::al_state::{ask, read_status};
use crate::declared::SubDeviceId;
use crate::role::NotPermitted;
use crate::segment::Segment;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Interval of reads of AL status.
const PAUSE: Duration = Duration::from_millis(1);
/// Consecutive reads without an answer after which a SubDevice is absent: at the moment of a cut a copy may have been
/// processed by none.
const SILENT_READS: u8 = 3;
/// Pause between two of these reads: the ends of a cable may detect late that it is cut.
const SILENT_PAUSE: Duration = Duration::from_millis(10);
/// Time from a request until it is repeated if the SubDevice shows an error: applications take milliseconds to clear
/// it.
const ASKED_AGAIN: Duration = Duration::from_millis(20);

/// Why not all SubDevices are confirmed in the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopError {
    /// The bus failed.
    Bus(BusError),
    /// A stop is refused in the present role.
    NotPermitted(NotPermitted),
    /// No SubDevice answers any more.
    NoAnswer,
    /// Another application, or a scan, has begun meanwhile.
    Ended,
    /// Frames were lost, or an answer was late: it is not known whether all reached the state.
    Unconfirmed {
        /// The requested state.
        requested: AlState,
        /// The time limit.
        limit: Duration,
    },
    /// Some did not reach the state in time.
    NotReached {
        /// The first of them; `None` if it was not declared.
        subdevice: Option<SubDeviceId>,
        /// Its station address.
        station: StationAddress,
        /// The requested state.
        requested: AlState,
        /// Its AL status at the end.
        status: AlStatus,
        /// The last AL status code; 0 if there was none.
        code: AlStatusCode,
        /// The time limit, or the time after which no further attempt follows.
        limit: Duration,
        /// Number of other SubDevices that did not reach the state.
        others: usize,
    },
}

impl fmt::Display for StopError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StopError::Bus(error) => error.fmt(f),
            StopError::NotPermitted(denied) => denied.fmt(f),
            StopError::NoAnswer => f.write_str("no SubDevice answers"),
            StopError::Ended => f.write_str("it was ended by another application or a scan"),
            StopError::Unconfirmed { requested, limit } => {
                let limit = limit.as_millis();
                write!(f, "not all SubDevices have confirmed {requested} within {limit} ms: frames are lost or late")
            }
            StopError::NotReached { subdevice, station, requested, status, code, limit, others } => {
                match subdevice {
                    Some(subdevice) => write!(f, "SubDevice {subdevice} (station {station})")?,
                    None => write!(f, "the undeclared SubDevice with station {station}")?,
                }
                let limit = limit.as_millis();
                write!(f, " did not reach {requested} within {limit} ms: its AL status is {status}")?;
                if code.0 != 0 {
                    write!(f, ", code {code}")?;
                }
                if *others > 0 { write!(f, "; {others} more did not either") } else { Ok(()) }
            }
        }
    }
}

impl core::error::Error for StopError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            StopError::Bus(error) => Some(error),
            StopError::NotPermitted(error) => Some(error),
            _ => None,
        }
    }
}

impl From<NotPermitted> for StopError {
    fn from(denied: NotPermitted) -> StopError {
        StopError::NotPermitted(denied)
    }
}

impl From<BusError> for StopError {
    fn from(error: BusError) -> StopError {
        StopError::Bus(error)
    }
}

/// A SubDevice to be stopped: its index in the declaration, if it was declared, and its station address.
pub(crate) type ToStop = (Option<SubDeviceId>, StationAddress);

/// All SubDevices with a known address, declared ones first.
pub(crate) fn all_known(segment: &Segment) -> Vec<ToStop> {
    let all = segment.subdevices().all().iter().enumerate();
    all.map(|(index, it)| (it.as_member().map(|_| SubDeviceId(index)), it.key.station)).collect()
}

/// Brings SubDevices to a state below their present one. SubDevices in a lower state stay there, and so do those in
/// BOOT unless INIT is requested. If no address is known, only INIT is requested, by broadcast.
pub(crate) async fn stop(bus: &Bus, to_stop: Vec<ToStop>, state: AlState, limit: Duration) -> Result<(), StopError> {
    let until = bus.now() + limit;
    if state == AlState::Init {
        bus.bwr(map::AL_CONTROL, &AlControl::with_acknowledge(state).encode()).await?;
    }
    let stations = to_stop.iter().map(|(_, station)| *station);
    let ends = bus.gather(stations, |bus, station| async move { bring_down(&bus, station, state, until).await }).await;
    let mut late = to_stop.iter().zip(&ends).filter_map(|((subdevice, station), end)| match end {
        End::Late(status, code) => Some((*subdevice, *station, *status, *code)),
        End::There | End::Silent | End::Failed(_) => None,
    });
    if let Some((subdevice, station, status, code)) = late.next() {
        let others = late.count();
        return Err(StopError::NotReached { subdevice, station, requested: state, status, code, limit, others });
    }
    let failed = ends.iter().find_map(|end| if let End::Failed(error) = end { Some(*error) } else { None });
    if let Some(error) = failed {
        return Err(error.into());
    }
    if !ends.contains(&End::There) && bus.brd(map::AL_STATUS, AlStatus::LEN).await?.wkc() == Wkc(0) {
        return Err(StopError::NoAnswer);
    }
    Ok(())
}

/// Result for one SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    There,
    /// It does not answer.
    Silent,
    /// It was not in the state at the limit; its last AL status and code.
    Late(AlStatus, AlStatusCode),
    /// Its frames were lost.
    Failed(BusError),
}

/// Brings one SubDevice down, and clears its error.
async fn bring_down(bus: &Bus, station: StationAddress, state: AlState, until: Instant) -> End {
    let (mut silent, mut next, mut reason) = (0, None, AlStatusCode(0));
    loop {
        match read_status(bus, station).await {
            Ok((status, code)) if is_down(status, state) => match withdraw(bus, station, status, state).await {
                Ok(Requested::NoHigher) => return End::There,
                Ok(Requested::Higher) | Err(BusError::Wkc { .. }) if bus.now() >= until => {
                    return End::Late(status, code);
                }
                Ok(Requested::Higher) | Err(BusError::Wkc { .. }) => {}
                Err(error) => return End::Failed(error),
            },
            Ok((status, code)) => {
                silent = 0;
                if status.error {
                    reason = code;
                }
                if bus.now() >= until {
                    return End::Late(status, reason);
                }
                if next.is_none_or(|next| status.error && bus.now() >= next) {
                    next = Some(bus.now() + ASKED_AGAIN);
                    match ask(bus, station, state, status.error).await {
                        Ok(()) | Err(BusError::Wkc { .. }) => {}
                        Err(error) => return End::Failed(error),
                    }
                }
            }
            Err(BusError::Wkc { got: Wkc(0), .. }) => {
                silent += 1;
                if silent >= SILENT_READS {
                    return End::Silent;
                }
                bus.sleep(SILENT_PAUSE).await;
            }
            Err(error) => return End::Failed(error),
        }
        bus.sleep(PAUSE).await;
    }
}

/// What AL control of a SubDevice held.
enum Requested {
    /// The present state, or a lower one than that of the stop.
    NoHigher,
    /// A higher state. It was replaced by the present one.
    Higher,
}

/// Withdraws the request of a procedure that has ended: a SubDevice may be on its way to a higher state, while its AL
/// status is still the one before.
async fn withdraw(bus: &Bus, station: StationAddress, status: AlStatus, state: AlState) -> Result<Requested, BusError> {
    let control = AlStatus::decode(&bus.fprd_array(station, map::AL_CONTROL).await?);
    let Some(present) = status.al_state().filter(|present| *present != AlState::Boot) else {
        return Ok(Requested::NoHigher);
    };
    if control.al_state().is_none_or(|requested| requested == present || rank(requested) <= rank(state)) {
        return Ok(Requested::NoHigher);
    }
    ask(bus, station, present, status.error).await?;
    Ok(Requested::Higher)
}

/// Place of a state in the order of the states.
fn rank(state: AlState) -> Option<u8> {
    match state {
        AlState::Init => Some(0),
        AlState::PreOp => Some(1),
        AlState::SafeOp => Some(2),
        AlState::Op => Some(3),
        AlState::Boot => None,
    }
}

/// Whether a SubDevice needs no further request.
fn is_down(status: AlStatus, state: AlState) -> bool {
    match status.al_state() {
        Some(is) if is == state => !status.error,
        Some(AlState::Boot) => state != AlState::Init,
        Some(is) => rank(is) < rank(state),
        None => false,
    }
}
