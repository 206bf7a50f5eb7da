//! When the acyclic half has work, and its turn.

use super::MainDevice;
use crate::time::Instant;

impl MainDevice {
    /// Runs procedures whose replies, deadlines or signals have arrived.
    pub fn poll(&mut self, now: Instant) {
        self.supervisor.poll(now);
        #[cfg(feature = "standby")]
        {
            self.follow_role(now);
            self.poll_ethernet(now);
        }
    }

    /// The latest time of the next call of [`MainDevice::poll`].
    pub fn next_deadline(&self) -> Option<Instant> {
        if self.has_role_to_follow() { Some(Instant::default()) } else { self.supervisor.next_deadline() }
    }

    /// When the acyclic half has work: for [`MainDevice::poll`], a datagram to send, or a request to the link layer. In
    /// the distant past for work that does not wait for a time, never without work. Cheap while nothing changes.
    #[inline(always)]
    pub fn due_at(&self) -> Instant {
        if self.has_role_to_follow() { Instant::default() } else { self.supervisor.due_at() }
    }

    /// Whether the role has changed, or is to change, or frames for the other MainDevice wait.
    #[cfg(feature = "standby")]
    #[inline(always)]
    fn has_role_to_follow(&self) -> bool {
        match &self.standby {
            Some(standby) => self.is_role_due() || standby.has_frames(),
            None => false,
        }
    }

    #[cfg(not(feature = "standby"))]
    #[inline(always)]
    const fn has_role_to_follow(&self) -> bool {
        false
    }

    #[cfg(feature = "standby")]
    fn is_role_due(&self) -> bool {
        let (has_changed, is_requested) = (self.role_followed != self.roles.changes(), self.roles.is_requested());
        (has_changed || is_requested) && if self.active().is_some() { has_changed } else { is_requested }
    }
}
