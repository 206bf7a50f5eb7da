//! The state of one SubDevice, by its station address.

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::al::{AlStatus, AlStatusCode};

use super::al_state::read_status;
use crate::segment::ShownState;
use crate::supervisor::{Bus, BusError, Reply};

/// Bytes of AL status, a reserved word, AL status code.
pub(super) const LEN: usize = 6;

/// Reads the state.
pub(super) async fn read(bus: &Bus, station: StationAddress) -> ShownState {
    match read_status(bus, station).await {
        Ok(shown) => ShownState::Shown(shown),
        Err(BusError::Wkc { .. }) => ShownState::Elsewhere,
        Err(_) => ShownState::Unknown,
    }
}

/// What a reply shows.
pub(super) fn shown(reply: &Reply) -> ShownState {
    let of = |data: &[u8; LEN]| {
        let [low, high, _, _, code @ ..] = *data;
        (AlStatus::decode(&[low, high]), AlStatusCode::decode(&code))
    };
    match reply.data.first_chunk() {
        Some(data) if reply.wkc() == Wkc(1) => ShownState::Shown(of(data)),
        Some(_) | None => ShownState::Elsewhere,
    }
}
