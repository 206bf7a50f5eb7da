//! The explicit device identification of SubDevices whose SII offers it (protocol 4.3, 5.3).

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::register::EscConfiguration;
use ringcat_wire::sii::{CategoryKind, General};

use crate::procedures::al_state;
use crate::procedures::sii::SiiContents;
use crate::supervisor::{Bus, BusError};

/// Reads it; `None` if there is none, or the SubDevice does not return it.
pub(super) async fn read(bus: &Bus, station: StationAddress, contents: &SiiContents) -> Result<Option<u16>, BusError> {
    let general = contents.categories().find(|category| category.kind == CategoryKind::General);
    let Some(general) = general.and_then(|it| General::decode(it.data.first_chunk::<{ General::LEN }>()?)) else {
        return Ok(None);
    };
    // A controller that copies AL control has no application that answers.
    let emulated = EscConfiguration::from_bits((contents.header.pdi_control >> 8) as u8).device_emulation;
    if general.flags.identification_al_status_code() && !emulated {
        return al_state::identification(bus, station).await;
    }
    if !general.flags.identification_memory() {
        return Ok(None);
    }
    match bus.fprd_array(station, RegisterAddress(general.id_switch_address)).await {
        Ok(bytes) => Ok(Some(u16::from_le_bytes(bytes))),
        // The memory does not exist.
        Err(BusError::Wkc { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
