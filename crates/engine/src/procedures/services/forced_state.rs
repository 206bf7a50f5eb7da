//! AL control written without the sequence of state changes (protocol 5.1, 5.3): for tests and maintenance.

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::{AlControl, AlState, AlStatus, AlStatusCode};
use ringcat_wire::register::map;

use super::ServiceError;
use crate::procedures::al_state::read_status;
use crate::supervisor::Bus;

/// Whether an error that the SubDevice shows is acknowledged by the same write.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Acknowledge {
    /// The error bit is left.
    #[default]
    No,
    /// Bit 4 of AL control is set.
    Yes,
}

/// What a SubDevice shows in AL_STATUS and AL_STATUS_CODE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct AlRegisters {
    /// Its state, and whether it shows an error.
    pub status: AlStatus,
    /// The reason of the error; of the last one where none is shown.
    pub code: AlStatusCode,
}

impl AlRegisters {
    /// Registers with these values.
    pub const fn new(status: AlStatus, code: AlStatusCode) -> AlRegisters {
        AlRegisters { status, code }
    }
}

/// Writes AL control once, before all datagrams that wait, and reads what the SubDevice shows at once. A SubDevice may
/// need longer for the change.
pub(crate) async fn force(
    bus: &Bus,
    station: StationAddress,
    state: AlState,
    acknowledge: Acknowledge,
) -> Result<AlRegisters, ServiceError> {
    let control = match acknowledge {
        Acknowledge::No => AlControl::new(state),
        Acknowledge::Yes => AlControl::with_acknowledge(state),
    };
    bus.fpwr_first(station, map::AL_CONTROL, &control.encode()).await?;
    let (status, code) = read_status(bus, station).await?;
    Ok(AlRegisters { status, code })
}
