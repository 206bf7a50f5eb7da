//! When cycles of an INACTIVE begin: in step with those of the ACTIVE (protocol FR-09).
//!
//! A cycle begins when the last master frame has come on both links. Its wait is bounded: a link without a carrier is
//! left out, and half a period after the first master frame the cycle begins with what is there. Without an ACTIVE
//! cycles go on, half a period after the time at which its next one was expected.

use super::Exchange;
use super::state::State;
use crate::link::Link;
use crate::role::MainDeviceRole;
use crate::time::Instant;

impl Exchange {
    /// When the next cycle of an INACTIVE begins, as far as is known now; `None` as ACTIVE.
    pub fn inactive_begins_at(&self) -> Option<Instant> {
        let state = self.standby.0.as_deref().filter(|state| state.role == MainDeviceRole::Inactive)?;
        let has_link = |link: Link| self.board.live.carrier(link) != Some(false);
        Some(state.begins_at(Link::ALL.map(has_link)))
    }

    /// When the cycle after this one begins, if it continues the grid of the ACTIVE that was followed: for the first
    /// cycle of this MainDevice as ACTIVE. `None` if no cycle of another one was seen.
    pub fn grid_of_other(&self, now: Instant) -> Option<Instant> {
        let state = self.standby.0.as_deref()?;
        let (_, begun_at) = state.following.newest()?;
        let periods = now.0.saturating_sub(begun_at.0).checked_div(state.period_ns)? + 1;
        Some(Instant(begun_at.0 + periods * state.period_ns))
    }

    /// When a frame of the ACTIVE came last; `None` if none has come since this MainDevice is INACTIVE.
    pub fn partner_data_at(&self) -> Option<Instant> {
        self.standby.0.as_deref()?.following.newest().map(|(_, at)| at)
    }

    /// When a frame of another MainDevice came last while this one was INACTIVE, whatever it contains: one that scans
    /// sends no process data yet.
    pub fn partner_frame_at(&self) -> Option<Instant> {
        self.standby.0.as_deref()?.words.partner_frame_at()
    }
}

impl State {
    fn begins_at(&self, has_link: [bool; 2]) -> Instant {
        let half = self.period_ns / 2;
        let after = |at: Instant, ns: u64| Instant(at.0.saturating_add(ns));
        // Without an ACTIVE, or before its next cycle.
        let alone = if self.begun_at == Instant::NEVER { Instant(0) } else { after(self.begun_at, self.period_ns) };
        let Some((newest, first_at)) = self.following.newest() else { return alone };
        if self.noticed == Some(newest) {
            if self.ends_with(newest) {
                return after(first_at, self.period_ns);
            }
            return alone.max(after(first_at, self.period_ns + half));
        }
        let ended = self.following.ended();
        let is_in = |link: Link| {
            let has_ended = ended[link.index()].is_some_and(|(cycle, _)| cycle == newest);
            has_ended || !has_link[link.index()]
        };
        let has_any = ended.iter().flatten().any(|(cycle, _)| *cycle == newest);
        if has_any && Link::ALL.into_iter().all(is_in) { Instant(0) } else { after(first_at, half) }
    }
}
