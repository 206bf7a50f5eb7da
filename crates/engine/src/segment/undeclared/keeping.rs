//! Which SubDevices without a declaration have mailboxes, and whether they are kept in their requested states.

use alloc::vec::Vec;

use ringcat_wire::address::Position;

use crate::segment::effect::{Effect, Effects};
use crate::segment::key::SubDeviceKey;
use crate::segment::subdevices::SubDevices;

/// Which SubDevices without a declaration have mailboxes, and whether they are kept in their requested states.
#[derive(Debug, Default)]
pub(in crate::segment) struct Keeping {
    /// They are kept in their requested states; otherwise only requests are executed.
    pub is_on: bool,
    /// Those that have mailboxes according to the last effect, at their positions.
    mailboxes: Vec<(SubDeviceKey, Position)>,
}

impl Keeping {
    /// Passes on changes since the last time: each SubDevice with a requested state has a mailbox.
    pub fn observe(&mut self, subdevices: &SubDevices, effects: &mut Effects) {
        let with_state = subdevices.unassigned().filter(|it| it.upkeep.is_some());
        let now = with_state.map(|it| (it.key, it.position));
        if !now.clone().eq(self.mailboxes.iter().copied()) {
            self.mailboxes = now.collect();
            effects.0.push(Effect::Mailboxes(self.mailboxes.clone()));
        }
    }
}
