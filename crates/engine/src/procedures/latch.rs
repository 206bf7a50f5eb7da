//! Receive times of one frame: all clocks latch it, and what they have latched is read (protocol 7.1).
//!
//! Another frame that is on the wire meanwhile may spoil what is latched, and another one that latches overwrites it.
//! So the frame is alone on the wire ([`Bus::alone`]), and its latches belong to one procedure until it has read them
//! ([`Latches`]).

use core::time::Duration;

use alloc::vec;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use crate::link::Link;
use crate::supervisor::{Bus, BusError, Turn};

/// Frames that were lost or disturbed before it is given up.
const TRIES: u32 = 12;
/// Of these, so many until the cyclic half is asked to pause: its frames leave as soon as the last ones are home.
const PATIENCE: u32 = 4;
/// A pause of the cyclic half is asked for so long; it ends when the frame is home.
const PAUSE: Duration = Duration::from_millis(3);

/// A frame was latched; until this is dropped no other one is.
pub(super) struct Latches {
    /// How many SubDevices have latched it.
    pub met: Wkc,
    /// Keeps others waiting.
    _turn: Turn,
}

/// Whether the cyclic half may be asked to pause where its frames are on the wire all the time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pauses {
    Allowed,
    Forbidden,
}

/// Lets all clocks latch a frame that is alone on the wire. Copies on the link that is `deaf` are known not to come
/// home.
pub(super) async fn latch(bus: &Bus, pauses: Pauses, deaf: Option<Link>) -> Result<Latches, BusError> {
    let _turn = bus.latch_turn().await;
    let met = send(bus, pauses, deaf).await?;
    Ok(Latches { met, _turn })
}

/// The same where it may be; elsewhere other frames may spoil some receive times.
pub(super) async fn latch_anyway(bus: &Bus) -> Result<Latches, BusError> {
    let _turn = bus.latch_turn().await;
    let met = match send(bus, Pauses::Forbidden, None).await {
        Err(BusError::Busy { .. } | BusError::Disturbed { .. }) => bus.bwr(map::DC_RECEIVE_TIME, &[0; 4]).await?.wkc(),
        other => other?,
    };
    Ok(Latches { met, _turn })
}

async fn send(bus: &Bus, pauses: Pauses, deaf: Option<Link>) -> Result<Wkc, BusError> {
    let (mut failures, mut is_pausing) = (0, false);
    loop {
        if is_pausing {
            bus.ask_for_pause(PAUSE);
        }
        let reply = bus.alone(Command::Bwr, Target::Broadcast(map::DC_RECEIVE_TIME), vec![0; 4], deaf).await;
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
