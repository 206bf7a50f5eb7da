//! The role of a MainDevice, and requests for another one, for all threads (protocol 9.6).
//!
//! A request takes effect at the next cycle: the half that runs the cycles takes it, and sets the role. The last
//! request before a cycle counts.

use alloc::sync::Arc;
use core::fmt;
use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, Ordering};

#[cfg(feature = "standby")]
use ringcat_wire::master_frame::NotReady;

use super::MainDeviceRole;

/// What is requested of the role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RoleRequest {
    /// It becomes ACTIVE with the next cycle, whatever the other MainDevice does. A MainDevice that is ACTIVE stays
    /// ACTIVE, and withdraws an offer of its role without an event, unless it has already sent its last cycle as
    /// ACTIVE.
    Active,
    /// It becomes INACTIVE with the next cycle, whether or not the other MainDevice takes over.
    Inactive,
    /// It becomes INACTIVE as soon as the other MainDevice goes on in the cycle after: no cycle is lost. While that is
    /// under way, the same request again changes nothing. Needs the feature `standby`.
    HandOver,
}

impl RoleRequest {
    const fn code(self) -> u8 {
        match self {
            RoleRequest::Active => 1,
            RoleRequest::Inactive => 2,
            RoleRequest::HandOver => 3,
        }
    }

    const fn from_code(code: u8) -> Option<RoleRequest> {
        match code {
            1 => Some(RoleRequest::Active),
            2 => Some(RoleRequest::Inactive),
            3 => Some(RoleRequest::HandOver),
            _ => None,
        }
    }
}

/// Why the role has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RoleCause {
    /// It was requested.
    Requested,
    /// The ACTIVE has handed its role over.
    HandedOver,
    /// All links of the ACTIVE were lost.
    LinksLost,
}

impl fmt::Display for RoleCause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            RoleCause::Requested => "requested",
            RoleCause::HandedOver => "handed over",
            RoleCause::LinksLost => "all links lost",
        })
    }
}

/// Bit of a request: it takes effect also while a write into the memory of a SubDevice is under way.
const FORCED: u8 = 0x80;

#[derive(Debug)]
struct Words {
    /// 0 is ACTIVE, 1 is INACTIVE.
    role: AtomicU8,
    changes: AtomicU32,
    request: AtomicU8,
    /// Reasons of the application against a takeover, as bits.
    not_ready: AtomicU16,
    /// All reasons as of the last cycle, as bits. Writer: the half that runs the cycles; without an application the
    /// one that listens.
    #[cfg(feature = "standby")]
    readiness: AtomicU16,
}

/// The role, and requests for another one; copies are handles to the same.
#[derive(Clone, Debug)]
pub struct RoleControl {
    words: Arc<Words>,
}

impl Default for RoleControl {
    fn default() -> RoleControl {
        RoleControl::new(MainDeviceRole::Active)
    }
}

impl RoleControl {
    /// A control that begins with this role.
    pub fn new(role: MainDeviceRole) -> RoleControl {
        let words = Words {
            role: AtomicU8::new(code(role)),
            changes: AtomicU32::new(0),
            request: AtomicU8::new(0),
            not_ready: AtomicU16::new(0),
            #[cfg(feature = "standby")]
            readiness: AtomicU16::new(NotReady::NO_APPLICATION.0),
        };
        RoleControl { words: Arc::new(words) }
    }

    /// The role.
    #[inline]
    pub fn role(&self) -> MainDeviceRole {
        match self.words.role.load(Ordering::Acquire) {
            0 => MainDeviceRole::Active,
            _ => MainDeviceRole::Inactive,
        }
    }

    /// Number of changes of the role so far.
    #[inline]
    pub fn changes(&self) -> u32 {
        self.words.changes.load(Ordering::Acquire)
    }

    /// Requests a role from the next cycle on. It replaces a request that has not taken effect.
    ///
    /// While a file is written to a SubDevice (FoE), an EEPROM is written, or a SubDevice is in BOOT, a request that
    /// would take the bus away from the MainDevice that writes is refused and reported as an event.
    pub fn request(&self, request: RoleRequest) {
        self.words.request.store(request.code(), Ordering::Release);
    }

    /// Requests a role from the next cycle on, also if that cuts off a write into the memory of a SubDevice: it may be
    /// destroyed.
    pub fn force(&self, request: RoleRequest) {
        self.words.request.store(request.code() | FORCED, Ordering::Release);
    }

    /// The request that has not taken effect yet.
    pub fn requested(&self) -> Option<RoleRequest> {
        RoleRequest::from_code(self.words.request.load(Ordering::Acquire) & !FORCED)
    }

    /// Whether there is a request. Cheap.
    #[cfg(feature = "standby")]
    #[inline]
    pub(crate) fn is_requested(&self) -> bool {
        self.words.request.load(Ordering::Relaxed) != 0
    }

    /// Takes the request, and whether it is forced: the cycle in which it takes effect begins.
    #[cfg(any(test, feature = "standby"))]
    pub(crate) fn take_request(&self) -> Option<(RoleRequest, bool)> {
        let code = self.words.request.swap(0, Ordering::AcqRel);
        Some((RoleRequest::from_code(code & !FORCED)?, code & FORCED != 0))
    }

    /// Sets the role; false if it is that already. For the half that runs the cycles.
    pub(crate) fn set(&self, role: MainDeviceRole) -> bool {
        let is_another = self.words.role.swap(code(role), Ordering::AcqRel) != code(role);
        if is_another {
            self.words.changes.fetch_add(1, Ordering::AcqRel);
        }
        is_another
    }

    /// Sets reasons against a takeover, as bits of `NotReady`: the application is not ready, or this MainDevice is to
    /// stay INACTIVE.
    pub fn set_not_ready(&self, bits: u16, set: bool) {
        match set {
            true => self.words.not_ready.fetch_or(bits, Ordering::Relaxed),
            false => self.words.not_ready.fetch_and(!bits, Ordering::Relaxed),
        };
    }

    /// The reasons that are set.
    pub fn not_ready(&self) -> u16 {
        self.words.not_ready.load(Ordering::Relaxed)
    }

    /// Whether this MainDevice is to stay INACTIVE (permanent standby): a policy then neither takes over nor accepts
    /// the role. A requested role takes effect nevertheless.
    #[cfg(feature = "standby")]
    pub fn is_held(&self) -> bool {
        NotReady(self.not_ready()).has(NotReady::HELD)
    }

    /// Switches the permanent standby on or off, from the next cycle on (the notifications 1 and 2 of protocol 9.10,
    /// which also request [`RoleRequest::Inactive`] with the first one).
    #[cfg(feature = "standby")]
    pub fn hold(&self, held: bool) {
        self.set_not_ready(NotReady::HELD.0, held);
    }

    /// Why a failure of one MainDevice now would cost more than the time-out of a takeover, as this one has seen it in
    /// its last cycle; [`NotReady::NOTHING`] if it would not. As ACTIVE it contains the reasons of the other one and
    /// its own, as INACTIVE its own.
    #[cfg(feature = "standby")]
    pub fn readiness(&self) -> NotReady {
        NotReady(self.words.readiness.load(Ordering::Relaxed))
    }

    /// Posts [`RoleControl::readiness`].
    #[cfg(feature = "standby")]
    pub(crate) fn post_readiness(&self, reasons: NotReady) {
        self.words.readiness.store(reasons.0, Ordering::Relaxed);
    }
}

const fn code(role: MainDeviceRole) -> u8 {
    match role {
        MainDeviceRole::Active => 0,
        MainDeviceRole::Inactive => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: MR-01, MR-02, MR-03, standby
    #[test]
    fn the_last_request_counts_and_the_present_role_is_no_change() {
        let control = RoleControl::new(MainDeviceRole::Inactive);
        let handle = control.clone();
        assert_eq!((control.role(), control.requested()), (MainDeviceRole::Inactive, None));
        handle.request(RoleRequest::Active);
        handle.request(RoleRequest::HandOver);
        handle.request(RoleRequest::Inactive);
        assert_eq!(control.role(), MainDeviceRole::Inactive, "before the next cycle");
        assert_eq!(control.take_request(), Some((RoleRequest::Inactive, false)));
        handle.force(RoleRequest::HandOver);
        assert_eq!(control.requested(), Some(RoleRequest::HandOver));
        assert_eq!(control.take_request(), Some((RoleRequest::HandOver, true)));
        assert_eq!((control.take_request(), control.requested()), (None, None));
        assert!(!control.set(MainDeviceRole::Inactive) && control.changes() == 0);
        assert!(control.set(MainDeviceRole::Active) && handle.changes() == 1);
        assert_eq!(handle.role(), MainDeviceRole::Active);
        handle.set_not_ready(0x50, true);
        handle.set_not_ready(0x10, false);
        assert_eq!(control.not_ready(), 0x40);
    }
}
