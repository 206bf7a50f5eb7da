//! A mailbox in use that another process goes on with: its counters, and answers that may still arrive.
//!
//! The SubDevice is not informed: it stays in its state, with its session.

use alloc::rc::Rc;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
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
    /// What another process must know to go on with this mailbox; `None` if it is not in use.
    pub(crate) fn known(&self) -> Option<KnownMailbox> {
        let shared = self.shared();
        let (state, now) = (shared.state(), shared.bus.now());
        let session = state.session.filter(|_| state.open)?;
        let late = (0_u8..).zip(&state.lanes).filter_map(|(lane, state)| {
            let limit_ms = u32::try_from(state.still_expected(now)?.as_millis()).unwrap_or(u32::MAX);
            Some(LateAnswer { lane, mark: state.mark, limit_ms })
        });
        Some(KnownMailbox {
            counter: session.counter,
            repeat: state.repeat || state.reading,
            recent: state.recent.known(),
            late: late.collect(),
        })
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
    }
}

impl SharedMailbox {
    fn take_over(self: &Rc<SharedMailbox>, known: &KnownMailbox, handover: Handover) {
        let now = self.bus.now();
        let state = &mut *self.state_mut();
        match handover {
            Handover::Orderly => {
                state.repeat = known.repeat;
                state.recent = Recent::of(&known.recent, now);
                for late in &known.late {
                    if let Some(lane) = state.lanes.get_mut(usize::from(late.lane)) {
                        lane.mark = late.mark;
                        lane.late_from(now, Duration::from_millis(late.limit_ms.into()));
                    }
                }
            }
            Handover::AfterCrash => {
                let answering = Lane::ALL.into_iter().filter(|lane| *lane != Lane::Frames);
                answering.for_each(|lane| state.lanes[lane.index()].late_from(now, AFTER_CRASH));
            }
        }
    }
}
