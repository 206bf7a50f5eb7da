//! Taking all SubDevices down to a state: the end of an orderly stop (protocol 5.3).
//!
//! Each is led by itself. What one broadcast asks for, some may not do: a SubDevice that was not declared is in INIT
//! and has no mailbox for PREOP, one may have another target state, one that copies AL control into AL status takes an
//! acknowledgement for an error; and of all AL states together frames bring back the OR. INIT is the exception, because
//! all states lead there: a broadcast asks for it first, so that all leave OP at once and those without a known
//! address, too.

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::map;

use super::al_state::{ask, read_status};
use crate::segment::Segment;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// Pause between two looks at AL status.
const PAUSE: Duration = Duration::from_millis(1);
/// A SubDevice that is silent so many times in a row is not there: at the edge of a cut a copy may have met none.
const SILENT_LOOKS: u8 = 3;
/// Pause between two of them: ends of a cable may notice late that it is cut.
const SILENT_PAUSE: Duration = Duration::from_millis(10);
/// From a request until one that shows an error is asked again: applications take milliseconds to clear it.
const ASKED_AGAIN: Duration = Duration::from_millis(20);

/// Why not all SubDevices are known to be in the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StopError {
    /// The bus failed.
    Bus(BusError),
    /// No SubDevice answers any more.
    NoAnswer,
    /// Some did not get there in time.
    NotReached {
        /// Index in the declaration of the first of them; `None` for one that was not declared.
        subdevice: Option<usize>,
        /// Its station address.
        station: StationAddress,
        /// What was asked for.
        requested: AlState,
        /// Its AL status at the end.
        status: AlStatus,
        /// The last reason that it gave; 0 where it gave none.
        code: AlStatusCode,
        /// How long was waited.
        limit: Duration,
        /// How many more did not get there.
        others: usize,
    },
}

impl fmt::Display for StopError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StopError::Bus(error) => error.fmt(f),
            StopError::NoAnswer => f.write_str("no SubDevice answers"),
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
            _ => None,
        }
    }
}

impl From<BusError> for StopError {
    fn from(error: BusError) -> StopError {
        StopError::Bus(error)
    }
}

/// A SubDevice to be led: its index in the declaration, if it was declared, and its station address.
pub(crate) type Led = (Option<usize>, StationAddress);

/// All SubDevices with a known address, declared ones first.
pub(crate) fn all_known(segment: &Segment) -> Vec<Led> {
    let members = segment.members.iter().enumerate().map(|(index, member)| (Some(index), member.station));
    members.chain(segment.unassigned.iter().map(|it| (None, it.station))).collect()
}

/// Takes SubDevices to a state that lies below the one they are in. Those that are in a lower one stay there, and so do
/// those in BOOT, unless INIT is asked for. Where none is known, only INIT is asked for, of all at once.
pub(crate) async fn stop(bus: &Bus, led: Vec<Led>, state: AlState, limit: Duration) -> Result<(), StopError> {
    let until = bus.now() + limit;
    if state == AlState::Init {
        bus.bwr(map::AL_CONTROL, &AlControl::with_acknowledge(state).encode()).await?;
    }
    let stations = led.iter().map(|(_, station)| *station);
    let ends = bus.gather(stations, |bus, station| async move { lead(&bus, station, state, until).await }).await;
    let mut late = led.iter().zip(&ends).filter_map(|((subdevice, station), end)| match end {
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

/// What came of leading one SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum End {
    There,
    /// It does not answer.
    Silent,
    /// It was not there at the end of the time; the last reason that it gave.
    Late(AlStatus, AlStatusCode),
    /// Its frames were lost.
    Failed(BusError),
}

/// Leads one SubDevice down, and clears its error.
async fn lead(bus: &Bus, station: StationAddress, state: AlState, until: Instant) -> End {
    let (mut silent, mut next, mut reason) = (0, None, AlStatusCode(0));
    loop {
        match read_status(bus, station).await {
            Ok((status, _)) if is_down(status, state) => return End::There,
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
                if silent >= SILENT_LOOKS {
                    return End::Silent;
                }
                bus.sleep(SILENT_PAUSE).await;
            }
            Err(error) => return End::Failed(error),
        }
        bus.sleep(PAUSE).await;
    }
}

/// Whether a SubDevice need not be asked for a state any more.
fn is_down(status: AlStatus, state: AlState) -> bool {
    let rank = |state: AlState| match state {
        AlState::Init => Some(0),
        AlState::PreOp => Some(1),
        AlState::SafeOp => Some(2),
        AlState::Op => Some(3),
        AlState::Boot => None,
    };
    match status.al_state() {
        Some(is) if is == state => !status.error,
        Some(AlState::Boot) => state != AlState::Init,
        Some(is) => rank(is) < rank(state),
        None => false,
    }
}
