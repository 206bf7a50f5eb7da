//! Receive times of one frame: all clocks latch it, and the latched times are read (protocol 7.1).
//!
//! Another frame on the wire may falsify the latched times, and a second latching frame overwrites them. So the frame
//! is alone on the wire ([`Bus::alone`]), and its latches belong to one procedure until it has read them ([`Latches`]).

use core::time::Duration;

use alloc::vec;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use crate::link::Link;
use crate::supervisor::{Bus, BusError, Turn};

/// Lost or disturbed frames before the procedure fails.
const TRIES: u32 = 12;
/// Lost or disturbed frames before the cyclic half is requested to pause: its frames may be sent back to back.
const PATIENCE: u32 = 4;
/// Requested length of a pause of the cyclic half; it ends earlier when the frame has returned.
const PAUSE: Duration = Duration::from_millis(3);

/// A latched frame; no other frame is latched until this is dropped.
pub(super) struct Latches {
    /// Number of SubDevices that latched it.
    pub answered: Wkc,
    /// Blocks other procedures.
    _turn: Turn,
}

/// Whether the cyclic half may be requested to pause if its frames are on the wire all the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pauses {
    Allowed,
    Forbidden,
}

/// Latches a frame that is alone on the wire in all clocks. Copies on the link `no_return` do not return.
pub(super) async fn latch(bus: &Bus, pauses: Pauses, no_return: Option<Link>) -> Result<Latches, BusError> {
    let _turn = bus.latch_turn().await;
    let answered = send(bus, pauses, no_return).await?;
    Ok(Latches { answered, _turn })
}

/// The same, alone if possible; otherwise other frames may falsify some receive times.
pub(super) async fn latch_anyway(bus: &Bus) -> Result<Latches, BusError> {
    let _turn = bus.latch_turn().await;
    let answered = match send(bus, Pauses::Forbidden, None).await {
        Err(BusError::Busy { .. } | BusError::Disturbed { .. }) => bus.bwr(map::DC_RECEIVE_TIME, &[0; 4]).await?.wkc(),
        other => other?,
    };
    Ok(Latches { answered, _turn })
}

async fn send(bus: &Bus, pauses: Pauses, no_return: Option<Link>) -> Result<Wkc, BusError> {
    let (mut failures, mut is_pausing) = (0, false);
    loop {
        if is_pausing {
            bus.ask_for_pause(PAUSE);
        }
        let reply = bus.alone(Command::Bwr, Target::Broadcast(map::DC_RECEIVE_TIME), vec![0; 4], no_return).await;
        if is_pausing {
            bus.ask_for_pause(Duration::ZERO);
        }
        match reply {
            Ok(reply) => return Ok(reply.wkc()),
            Err(BusError::Busy { .. }) if pauses == Pauses::Allowed && !is_pausing => is_pausing = true,
            Err(BusError::Disturbed { .. }) if failures == PATIENCE && pauses == Pauses::Allowed && !is_pausing => {
                is_pausing = true;
            }
            Err(BusError::Lost { .. } | BusError::Disturbed { .. }) if failures < TRIES => failures += 1,
            Err(error) => return Err(error),
        }
    }
}
