//! Resetting a SubDevice controller (protocol 3.2): R, E, S in three frames to ESC_RESET_ECAT.

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use super::ServiceError;
use crate::supervisor::{Bus, BusError};

const SEQUENCE: [u8; 3] = *b"RES";
/// Attempts of the sequence when a frame of it is lost.
const TRIES: u32 = 4;

/// Restarts a controller as after power-on. It loses its station address, and is found again like a SubDevice that was
/// switched off.
pub async fn reset_controller(bus: &Bus, station: StationAddress) -> Result<(), ServiceError> {
    let mut tries = 0;
    loop {
        tries += 1;
        match sequence(bus, station).await {
            Ok(()) => return Ok(()),
            Err(error @ BusError::Lost { .. }) if tries < TRIES => {
                // Only the answer may have been lost, also that of the last letter.
                match bus.fprd_array::<1>(station, map::ESC_RESET_ECAT).await {
                    Ok(_) => {}
                    Err(BusError::Wkc { .. }) => return Ok(()),
                    Err(_) => return Err(error.into()),
                }
            }
            Err(error) => return Err(error.into()),
        }
    }
}

/// Each letter is sent after the previous one has returned: the register takes one letter per frame.
async fn sequence(bus: &Bus, station: StationAddress) -> Result<(), BusError> {
    let (target, expected) = (Target::Station(station, map::ESC_RESET_ECAT), Wkc(1));
    for letter in SEQUENCE {
        let reply = bus.transfer_once(Command::Fpwr, target, alloc::vec![letter]).await?;
        if reply.wkc() != expected {
            return Err(BusError::Wkc { target, expected, got: reply.wkc() });
        }
    }
    Ok(())
}
