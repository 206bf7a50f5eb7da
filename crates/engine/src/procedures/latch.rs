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
use crate::time::Instant;

/// Lost or disturbed frames before the procedure fails.
const TRIES: u32 = 12;
/// Lost or disturbed frames before the cyclic half is requested to pause: its frames may be sent back to back, or count
/// as on the wire until an application with its own loop receives again.
const PATIENCE: u32 = 4;
/// Requested length of a pause of the cyclic half; it ends earlier when the frame has returned.
const PAUSE: Duration = Duration::from_millis(3);
/// The pause grows to this: an application with its own loop has to come to its next send within it. With longer cycles
/// than this the wire counts as empty between them.
const LONGEST_PAUSE: Duration = Duration::from_millis(50);

/// A latched frame; no other frame is latched until this is dropped.
pub(super) struct Latches {
    /// Number of SubDevices that latched it.
    pub answered: Wkc,
    /// When it was sent.
    pub sent_at: Instant,
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
    let sent = send(bus, pauses, no_return).await;
    bus.ask_for_pause(Duration::ZERO);
    let (answered, sent_at) = sent?;
    Ok(Latches { answered, sent_at, _turn })
}

/// The same, alone if possible; otherwise other frames may falsify some receive times.
pub(super) async fn latch_anyway(bus: &Bus, no_return: Option<Link>) -> Result<Latches, BusError> {
    let _turn = bus.latch_turn().await;
    let (answered, sent_at) = match send(bus, Pauses::Forbidden, no_return).await {
        Err(BusError::Busy { .. } | BusError::Disturbed { .. }) => {
            let reply = bus.bwr(map::DC_RECEIVE_TIME, &[0; 4]).await?;
            (reply.wkc(), reply.sent_at)
        }
        other => other?,
    };
    Ok(Latches { answered, sent_at, _turn })
}

/// Sends the frame until it was alone; the SubDevices that latched it, and when it was sent. A requested pause is left
/// to the caller to end.
async fn send(bus: &Bus, pauses: Pauses, no_return: Option<Link>) -> Result<(Wkc, Instant), BusError> {
    let (mut failures, mut pause) = (0, None);
    let longer = |pause: Option<Duration>| Some(pause.map_or(PAUSE, |pause| (2 * pause).min(LONGEST_PAUSE)));
    loop {
        if let Some(pause) = pause {
            bus.ask_for_pause(pause);
        }
        let reply = bus.alone(Command::Bwr, Target::Broadcast(map::DC_RECEIVE_TIME), vec![0; 4], no_return).await;
        match reply {
            Ok(reply) => return Ok((reply.wkc(), reply.sent_at)),
            Err(BusError::Busy { .. }) if pauses == Pauses::Allowed && pause != Some(LONGEST_PAUSE) => {
                pause = longer(pause);
            }
            Err(BusError::Lost { .. } | BusError::Disturbed { .. }) if failures < TRIES => {
                failures += 1;
                if failures > PATIENCE && pauses == Pauses::Allowed {
                    pause = longer(pause);
                }
            }
            Err(error) => return Err(error),
        }
    }
}
