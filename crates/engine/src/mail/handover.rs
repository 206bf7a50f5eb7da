//! A mailbox in use that another process goes on with: its counters, and answers that may still arrive.
//!
//! The SubDevice is not informed: it stays in its state, with its session.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest};
use ringcat_wire::sii::MailboxLayout;

use super::lane::Lane;
use super::mailbox::Mailbox;
use super::reader;
use super::recent::Recent;
use super::shared::{Session, SharedMailbox};
use crate::knowledge::{Handover, KnownMailbox, LateAnswer};

/// Time in which a request of a crashed owner may still be answered. An SDO does not wait for it: another object is
/// read before (`coe`).
const AFTER_CRASH: Duration = Duration::from_secs(1);
/// Longest time that an abort may wait to be written.
const ABORT_LIMIT: Duration = Duration::from_millis(100);
/// Room for an abort of any protocol.
const ABORT_BYTES: usize = 32;

/// A mailbox in use, by the registers of its SubDevice.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InUse {
    pub station: StationAddress,
    pub layout: MailboxLayout,
    /// SyncManager of the send mailbox (SubDevice to MainDevice).
    pub send_manager: u8,
    /// The send mailbox contains mail.
    pub is_full: bool,
}

impl Mailbox {
    /// What another process needs to continue with this mailbox; `None` if it is not in use.
    pub(crate) fn known(&self) -> Option<KnownMailbox> {
        let shared = self.shared();
        let (state, now) = (shared.state(), shared.bus.now());
        let session = state.session.filter(|_| state.open)?;
        let late = state.lanes.numbered().filter_map(|(lane, state)| {
            let limit_ms = u32::try_from(state.still_expected(now)?.as_millis()).unwrap_or(u32::MAX);
            Some(LateAnswer { lane, mark: state.mark, limit_ms })
        });
        let is_under_way = |lane: &Lane| state.lanes.of(*lane).is_some_and(|state| !state.turns.is_empty());
        // Ethernet frames have no beginning and no end.
        let under_way = Lane::ALL.into_iter().filter(|lane| *lane != Lane::Frames).filter(is_under_way);
        Some(KnownMailbox {
            under_way: under_way.map(|lane| lane.index() as u8).collect(),
            counter: session.counter,
            repeat: state.repeat || state.reading,
            recent: state.recent.known(),
            late: late.collect(),
        })
    }

    /// The registers of a mailbox in use. What its SubDevice has for the MainDevice is not known: it may have mail.
    pub(crate) fn in_use(&self) -> Option<InUse> {
        let state = self.shared().state();
        let Session { station, layout, send_manager, .. } = state.session.filter(|_| state.open)?;
        Some(InUse { station, layout, send_manager, is_full: true })
    }

    /// Goes on with a mailbox that another process has used.
    pub(crate) fn adopt(&self, in_use: InUse, known: &KnownMailbox, handover: Handover) {
        let shared = self.shared();
        let InUse { station, layout, send_manager, is_full } = in_use;
        let session = Session::new(station, layout, send_manager, shared.bus.now());
        shared.close();
        shared.open(Session { counter: known.counter, is_stale: handover == Handover::AfterCrash, ..session });
        shared.take_over(known, handover);
        if is_full {
            shared.mail_available();
        }
        reader::start(shared);
        if handover == Handover::Orderly {
            known.cut().for_each(|lane| shared.abort(lane));
        }
    }
}

impl KnownMailbox {
    /// Lanes with a conversation that the hand-over has cut.
    fn cut(&self) -> impl Iterator<Item = Lane> {
        let lane = |index: &u8| Lane::ALL.into_iter().find(|lane| lane.index() == usize::from(*index));
        self.under_way.iter().filter_map(lane)
    }

    /// Protocols of conversations that the hand-over has cut.
    pub(crate) fn cut_protocols(&self) -> Vec<Protocol> {
        self.cut().map(Lane::protocol).collect()
    }
}

impl SharedMailbox {
    /// Ends a transfer of the former owner at the SubDevice, which otherwise waits for its next part. Others end with
    /// their answer.
    fn abort(self: &Rc<SharedMailbox>, lane: Lane) {
        let mut payload = [0; ABORT_BYTES];
        let length = match lane {
            Lane::Coe => {
                let index = self.state().lanes.of(lane).map_or(0, |lane| lane.mark);
                SdoRequest::Abort { index, sub_index: 0, code: AbortCode::GENERAL }.encode(&mut payload)
            }
            Lane::Foe => {
                FoeMessage::Error { code: FoeErrorCode::NOT_DEFINED, text: b"handed over" }.encode(&mut payload)
            }
            Lane::Soe | Lane::Aoe | Lane::Voe | Lane::Eoe | Lane::Frames | Lane::Other(_) => None,
        };
        if let Some(length) = length {
            // A mailbox that is too small had no such transfer.
            let _ = self.queue(lane, payload[..length].to_vec(), ABORT_LIMIT, (0, None));
        }
    }

    fn take_over(self: &Rc<SharedMailbox>, known: &KnownMailbox, handover: Handover) {
        let now = self.bus.now();
        let state = &mut *self.state_mut();
        match handover {
            Handover::Orderly => {
                state.repeat = known.repeat;
                state.recent = Recent::of(&known.recent, now);
                for late in &known.late {
                    if let Some(lane) = state.lanes.at_mut(usize::from(late.lane)) {
                        lane.mark = late.mark;
                        lane.late_from(now, Duration::from_millis(late.limit_ms.into()));
                    }
                }
            }
            Handover::AfterCrash => {
                let answering = Lane::ALL.into_iter().filter(|lane| *lane != Lane::Frames);
                answering.for_each(|lane| state.lanes.of_mut(lane).late_from(now, AFTER_CRASH));
            }
        }
    }
}
