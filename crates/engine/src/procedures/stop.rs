//! Taking all SubDevices down to a state at once: the end of an orderly stop (facts 5.3).
//!
//! One broadcast asks everybody. The acknowledge bit goes with it, so that a SubDevice with an error follows too.

use core::fmt;
use core::time::Duration;

use ringcat_wire::address::Wkc;
use ringcat_wire::al::{AlControl, AlState, AlStatus};
use ringcat_wire::register::map;

use crate::supervisor::{Bus, BusError};

/// Pause between two looks at AL status.
const PAUSE: Duration = Duration::from_millis(1);

/// Why not all SubDevices are known to be in the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StopError {
    /// The bus failed.
    Bus(BusError),
    /// Nobody answers any more.
    NoAnswer,
    /// Some did not get there in time.
    Timeout {
        /// What was asked for.
        requested: AlState,
        /// OR of everybody's AL status.
        status: AlStatus,
        /// How long was waited.
        limit: Duration,
    },
}

impl fmt::Display for StopError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StopError::Bus(error) => error.fmt(f),
            StopError::NoAnswer => f.write_str("no SubDevice answers"),
            StopError::Timeout { requested, status, limit } => {
                let limit = limit.as_millis();
                write!(
                    f,
                    "not all SubDevices reached {requested} within {limit} ms: their AL status, ORed, is {status}"
                )
            }
        }
    }
}

impl core::error::Error for StopError {}

impl From<BusError> for StopError {
    fn from(error: BusError) -> StopError {
        StopError::Bus(error)
    }
}

/// Takes all SubDevices to a state that lies below the one they are in.
///
/// Devices that copy AL control into AL status show the acknowledge bit as an error: they get the bare state.
pub async fn stop(bus: &Bus, state: AlState, limit: Duration) -> Result<(), StopError> {
    let until = bus.now() + limit;
    bus.bwr(map::AL_CONTROL, &AlControl::with_acknowledge(state).encode()).await?;
    loop {
        let reply = bus.brd(map::AL_STATUS, AlStatus::LEN).await?;
        let status = AlStatus::decode(&[reply.data[0], reply.data[1]]);
        if reply.wkc() == Wkc(0) {
            return Err(StopError::NoAnswer);
        }
        if status.state == state.code() {
            if !status.error {
                return Ok(());
            }
            bus.bwr(map::AL_CONTROL, &AlControl::new(state).encode()).await?;
        }
        if bus.now() >= until {
            return Err(StopError::Timeout { requested: state, status, limit });
        }
        bus.sleep(PAUSE).await;
    }
}
