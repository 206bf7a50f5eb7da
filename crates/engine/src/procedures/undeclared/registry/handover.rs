//! Entries that another process has kept, and that this one goes on with.

use alloc::rc::Rc;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::AlState;

use super::{Attempt, Progress, Undeclared};
use crate::info::SubDeviceInfo;
use crate::knowledge::{Handover, KnownMailbox, KnownProgress};
use crate::mail::InUse;

/// A SubDevice that another process has kept in its state, as its registers show it.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub station: StationAddress,
    pub target: AlState,
    pub progress: KnownProgress,
    /// Its mailbox, if it can be used without INIT.
    pub mailbox: Option<(InUse, KnownMailbox)>,
}

impl Undeclared {
    /// What another process must know about the SubDevice with a station address.
    pub(crate) fn known(&self, station: StationAddress) -> Option<(AlState, KnownProgress, Option<KnownMailbox>)> {
        let all = self.all.borrow();
        let entry = all.iter().find(|entry| entry.info.station == station)?;
        let progress = match entry.progress {
            Progress::Due(_) | Progress::UnderWay => KnownProgress::Due,
            Progress::Reached => KnownProgress::Reached,
            Progress::Left => KnownProgress::Left,
        };
        Some((entry.target, progress, entry.mailbox.known()))
    }

    /// The SubDevices from now on. Those that another process has kept go on as they are; the others, if entries are
    /// kept, are brought to PREOP. Returns those in OP, whose outputs are to be written.
    pub(crate) fn take_over(
        &self,
        present: &[(Position, Rc<SubDeviceInfo>)],
        kept: &[Kept],
        handover: Handover,
    ) -> Vec<Attempt> {
        let is_known = |info: &SubDeviceInfo| kept.iter().any(|kept| kept.station == info.station);
        let present = present.iter().filter(|(_, info)| self.is_kept() || is_known(info));
        let present: Vec<_> = present.cloned().collect();
        self.follow(&present);
        let now = self.bus.now();
        let mut in_op = Vec::new();
        let mut all = self.all.borrow_mut();
        for entry in &mut *all {
            let Some(kept) = kept.iter().find(|kept| kept.station == entry.info.station) else { continue };
            entry.target = kept.target;
            entry.progress = match kept.progress {
                KnownProgress::Reached => Progress::Reached,
                KnownProgress::Left => Progress::Left,
                KnownProgress::None | KnownProgress::Due => Progress::Due(now),
            };
            if let Some((in_use, known)) = &kept.mailbox {
                entry.mailbox.adopt(*in_use, known, handover);
            }
            if entry.progress == Progress::Reached && entry.target == AlState::Op {
                in_op.push(entry.attempt());
            }
        }
        drop(all);
        self.notify();
        in_op
    }
}
