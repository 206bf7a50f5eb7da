//! Requests a state of a SubDevice and waits for it (protocol 5.3).

use alloc::format;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode, transition_allowed};
use ringcat_wire::register::{EscConfiguration, map};

use crate::event::Subject;
use crate::supervisor::{Bus, BusError};

/// First two pauses between reads of AL status. Later pauses grow by half: a change that takes milliseconds is detected
/// soon, and a change that takes seconds costs few datagrams.
const FIRST_PAUSE: Duration = Duration::from_micros(500);
/// Longest pause.
const LONGEST_PAUSE: Duration = Duration::from_millis(10);
/// How long a SubDevice may take to clear its error bit after the acknowledgement.
const ACKNOWLEDGE_LIMIT: Duration = Duration::from_millis(500);

/// Consecutive readings of a state from which the requested one cannot be reached, before the wait for it ends: a write
/// of AL control may still be in the SubDevice.
const LEFT_READINGS: u32 = 3;

/// Maximum wait for the effect of a request of a procedure that has ended.
const PENDING_LIMIT: Duration = Duration::from_millis(500);
/// Bytes from AL control to the end of AL status code.
const CONTROL_TO_CODE: usize = (map::AL_STATUS.0 - map::AL_CONTROL.0) as usize + 6;

/// How long a SubDevice may take to return its identification.
const IDENTIFICATION_LIMIT: Duration = Duration::from_millis(50);

/// Why a SubDevice is not in the requested state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StateError {
    /// The bus failed.
    Bus(BusError),
    /// The SubDevice refused.
    Refused {
        /// The requested state.
        requested: AlState,
        /// The AL status.
        status: AlStatus,
        /// The AL status code.
        code: AlStatusCode,
    },
    /// The SubDevice did not reach the state in time.
    Timeout {
        /// The requested state.
        requested: AlState,
        /// The last AL status.
        status: AlStatus,
        /// The time limit.
        limit: Duration,
    },
    /// The SubDevice is in a state from which the requested one is no valid request: another request took effect.
    Left {
        /// The requested state.
        requested: AlState,
        /// The AL status.
        status: AlStatus,
    },
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StateError::Bus(error) => error.fmt(f),
            StateError::Refused { requested, status, code } => {
                write!(f, "refused {requested}: AL status {status}, code {code}")
            }
            StateError::Timeout { requested, status, limit } => {
                write!(f, "expected {requested} within {} ms, AL status is {status}", limit.as_millis())
            }
            StateError::Left { requested, status } => {
                write!(f, "expected {requested}, another request took effect: AL status is {status}")
            }
        }
    }
}

impl core::error::Error for StateError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            StateError::Bus(error) => Some(error),
            _ => None,
        }
    }
}

impl From<BusError> for StateError {
    fn from(error: BusError) -> StateError {
        StateError::Bus(error)
    }
}

/// AL status and AL status code, in one datagram.
pub async fn read_status(bus: &Bus, station: StationAddress) -> Result<(AlStatus, AlStatusCode), BusError> {
    let bytes: [u8; 6] = bus.fprd_array(station, map::AL_STATUS).await?;
    let (status, code) = split_status(&bytes);
    bus.post_al_status(station, status, code);
    Ok((status, code))
}

/// AL status after a pending request of a procedure that has ended, or of another program, has taken effect. Until then
/// the SubDevice shows its previous state, which a new request for that state would take for its own effect; and the
/// SubDevice ignores another request until it has read the pending one (protocol 3.4). A SubDevice whose application
/// has left its state by itself cannot be distinguished from this, so the wait has a limit.
pub(super) async fn read_quiet_status(bus: &Bus, station: StationAddress) -> Result<AlStatus, BusError> {
    let until = bus.now() + PENDING_LIMIT;
    let mut pause = FIRST_PAUSE;
    loop {
        let bytes: [u8; CONTROL_TO_CODE] = bus.fprd_array(station, map::AL_CONTROL).await?;
        let [low, high, .., a, b, c, d, e, f] = bytes;
        let (control, (status, code)) = (AlControl::decode(&[low, high]), split_status(&[a, b, c, d, e, f]));
        bus.post_al_status(station, status, code);
        let (from, to) = (status.al_state().filter(|_| !status.error), control.al_state());
        let is_pending = from.zip(to).is_some_and(|(from, to)| from != to && transition_allowed(from, to));
        if !is_pending || bus.now() >= until {
            return Ok(status);
        }
        bus.sleep(pause).await;
        pause = (pause * 3 / 2).min(LONGEST_PAUSE);
    }
}

/// AL status (0x0130) and AL status code (0x0134) from the six bytes that contain both.
fn split_status(bytes: &[u8; 6]) -> (AlStatus, AlStatusCode) {
    let [a, b, _, _, c, d] = *bytes;
    (AlStatus::decode(&[a, b]), AlStatusCode::decode(&[c, d]))
}

/// Requests the explicit device identification of a SubDevice, in any state without an error; `None` if it does not
/// return it in time (protocol 5.3).
pub async fn identification(bus: &Bus, station: StationAddress) -> Result<Option<u16>, BusError> {
    let (status, _) = read_status(bus, station).await?;
    let Some(state) = status.al_state().filter(|_| !status.error) else { return Ok(None) };
    let plain = AlControl::new(state);
    bus.fpwr(station, map::AL_CONTROL, &AlControl { identification: true, ..plain }.encode()).await?;
    let until = bus.now() + IDENTIFICATION_LIMIT;
    let value = loop {
        let (status, code) = read_status(bus, station).await?;
        if status.error {
            break None;
        }
        if status.identification {
            break Some(code.0);
        }
        if bus.now() >= until {
            break None;
        }
        bus.sleep(FIRST_PAUSE).await;
    };
    bus.fpwr(station, map::AL_CONTROL, &plain.encode()).await?;
    Ok(value)
}

/// Requests a state once. If the SubDevice shows an error the request acknowledges it, unless the device copies AL
/// control into AL status.
pub(super) async fn ask(bus: &Bus, station: StationAddress, state: AlState, error: bool) -> Result<(), BusError> {
    let copies = error && {
        let bytes = bus.fprd_array(station, map::ESC_CONFIGURATION).await?;
        EscConfiguration::decode(&bytes).device_emulation
    };
    let control = if error && !copies { AlControl::with_acknowledge(state) } else { AlControl::new(state) };
    bus.fpwr(station, map::AL_CONTROL, &control.encode()).await
}

/// Clears an error by acknowledging it in the present state. Devices that copy AL control into AL status must not get
/// the acknowledge bit, which is the error bit for them: writing the state without it clears the error.
pub async fn acknowledge(bus: &Bus, station: StationAddress, emulated: bool) -> Result<AlStatus, StateError> {
    let (status, _) = read_status(bus, station).await?;
    let state = status.al_state().unwrap_or(AlState::Init);
    let control = if emulated { AlControl::new(state) } else { AlControl::with_acknowledge(state) };
    bus.step(Subject::States, || format!("{station}: error acknowledged in {state}"));
    bus.fpwr(station, map::AL_CONTROL, &control.encode()).await?;
    let limit = bus.now() + ACKNOWLEDGE_LIMIT;
    let mut pause = FIRST_PAUSE;
    loop {
        let (status, _) = read_status(bus, station).await?;
        if !status.error || bus.now() >= limit {
            return Ok(status);
        }
        bus.sleep(pause).await;
        pause = (pause * 3 / 2).min(LONGEST_PAUSE);
    }
}

/// Requests a state and waits for it. After a refusal its code is read, and the error acknowledged.
pub async fn request(
    bus: &Bus,
    station: StationAddress,
    state: AlState,
    emulated: bool,
    limit: Duration,
) -> Result<(), StateError> {
    let begin = bus.now();
    bus.step(Subject::States, || format!("{station}: {state} requested"));
    let result = request_once(bus, station, state, emulated, limit).await;
    bus.step(Subject::States, || match &result {
        Ok(()) => format!("{station}: {state} after {} us", bus.now().since(begin).as_micros()),
        Err(error) => format!("{station}: {state} not reached: {error}"),
    });
    result
}

async fn request_once(
    bus: &Bus,
    station: StationAddress,
    state: AlState,
    emulated: bool,
    limit: Duration,
) -> Result<(), StateError> {
    bus.fpwr(station, map::AL_CONTROL, &AlControl::new(state).encode()).await?;
    let until = bus.now() + limit;
    let (mut pause, mut readings, mut left) = (FIRST_PAUSE, 0_u32, 0_u32);
    loop {
        let (status, code) = read_status(bus, station).await?;
        if status.error {
            acknowledge(bus, station, emulated).await?;
            return Err(StateError::Refused { requested: state, status, code });
        }
        if status.al_state() == Some(state) {
            return Ok(());
        }
        let is_valid = status.al_state().is_none_or(|from| transition_allowed(from, state));
        left = if is_valid { 0 } else { left + 1 };
        if left == LEFT_READINGS {
            return Err(StateError::Left { requested: state, status });
        }
        if bus.now() >= until {
            return Err(StateError::Timeout { requested: state, status, limit });
        }
        readings += 1;
        if readings > 2 {
            pause = (pause * 3 / 2).min(LONGEST_PAUSE);
        }
        if pause == LONGEST_PAUSE {
            insist(bus, station, state).await?;
        }
        bus.sleep(pause).await;
    }
}

/// Writes a request again if AL control holds another one: a write of a procedure that had ended, or of another
/// MainDevice, came after it.
async fn insist(bus: &Bus, station: StationAddress, state: AlState) -> Result<(), StateError> {
    let control = AlControl::new(state).encode();
    if bus.fprd_array(station, map::AL_CONTROL).await? != control {
        bus.fpwr(station, map::AL_CONTROL, &control).await?;
    }
    Ok(())
}
