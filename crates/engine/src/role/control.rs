//! The role of a MainDevice, and requests for another one, for all threads (protocol 9.6).
//!
//! A request takes effect at the next cycle: the half that runs the cycles takes it, and sets the role. Of several
//! requests before a cycle the one with the highest priority counts ([`Requester`]), of equal ones the last.

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
    /// Only withdraws an offer of the role, as [`RoleRequest::Active`] does. Nothing changes if there is none, or if
    /// the other MainDevice has accepted it meanwhile.
    Withdraw,
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
            RoleRequest::Withdraw => 4,
        }
    }

    const fn from_code(code: u8) -> Option<RoleRequest> {
        match code {
            1 => Some(RoleRequest::Active),
            2 => Some(RoleRequest::Inactive),
            3 => Some(RoleRequest::HandOver),
            4 => Some(RoleRequest::Withdraw),
            _ => None,
        }
    }
}

/// The origin of a request for a role, the lowest priority first. A request replaces one of the same or a lower
/// priority that has not taken effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Requester {
    /// A schedule, which asks again later.
    Schedule,
    /// A policy, which decides again with the next cycle.
    Policy,
    /// An operator, or the program itself. No other request replaces it.
    Operator,
}

impl Requester {
    /// The bits in a request.
    const fn bits(self) -> u8 {
        match self {
            Requester::Schedule => 0x10,
            Requester::Policy => 0x20,
            Requester::Operator => PRIORITY,
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
/// Bit of a request: permanent standby begins when it takes effect.
#[cfg(any(test, feature = "standby"))]
const HOLDS: u8 = 0x40;
/// Bits of a request: its priority.
const PRIORITY: u8 = 0x30;
/// Bits that are no role.
const MODIFIERS: u8 = 0xF0;
/// A bit beside the reasons of the application: [`RoleControl::hold`] was called.
#[cfg(feature = "standby")]
const HOLD_DECIDED: u16 = 0x8000;
/// The bits that are reasons.
const REASONS: u16 = 0x7FFF;

/// A request when it is taken.
#[cfg(any(test, feature = "standby"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Taken {
    pub request: RoleRequest,
    /// Also while a write into the memory of a SubDevice is under way.
    pub is_forced: bool,
    /// Permanent standby begins if it is not refused.
    pub holds: bool,
}

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

    /// Requests a role from the next cycle on, as [`Requester::Operator`]. It replaces a request that has not taken
    /// effect.
    ///
    /// While a file is written to a SubDevice (FoE), an EEPROM is written, or a SubDevice is in BOOT, a request that
    /// would take the bus away from the MainDevice that writes is refused and reported as an event.
    pub fn request(&self, request: RoleRequest) {
        self.words.request.store(request.code() | Requester::Operator.bits(), Ordering::Release);
    }

    /// As [`RoleControl::request`], for this requester. False if nothing was requested: a request of a higher priority
    /// has not taken effect yet, or another one came at the same time. Neither waits nor repeats.
    #[must_use]
    pub fn request_as(&self, request: RoleRequest, by: Requester) -> bool {
        let before = self.words.request.load(Ordering::Acquire);
        let code = request.code() | by.bits();
        before & PRIORITY <= by.bits()
            && self.words.request.compare_exchange(before, code, Ordering::AcqRel, Ordering::Relaxed).is_ok()
    }

    /// Requests a role from the next cycle on, also if that cuts off a write into the memory of a SubDevice: it may be
    /// destroyed.
    pub fn force(&self, request: RoleRequest) {
        self.words.request.store(request.code() | FORCED | Requester::Operator.bits(), Ordering::Release);
    }

    /// The request that has not taken effect yet.
    pub fn requested(&self) -> Option<RoleRequest> {
        RoleRequest::from_code(self.words.request.load(Ordering::Acquire) & !MODIFIERS)
    }

    /// Whether there is a request. Cheap.
    #[cfg(feature = "standby")]
    #[inline]
    pub(crate) fn is_requested(&self) -> bool {
        self.words.request.load(Ordering::Relaxed) != 0
    }

    /// Takes the request: the cycle in which it takes effect begins.
    #[cfg(any(test, feature = "standby"))]
    pub(crate) fn take_request(&self) -> Option<Taken> {
        let code = self.words.request.swap(0, Ordering::AcqRel);
        let request = RoleRequest::from_code(code & !MODIFIERS)?;
        Some(Taken { request, is_forced: code & FORCED != 0, holds: code & HOLDS != 0 })
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
        let bits = bits & REASONS;
        match set {
            true => self.words.not_ready.fetch_or(bits, Ordering::Relaxed),
            false => self.words.not_ready.fetch_and(!bits, Ordering::Relaxed),
        };
    }

    /// The reasons that are set.
    pub fn not_ready(&self) -> u16 {
        self.words.not_ready.load(Ordering::Relaxed) & REASONS
    }

    /// Whether this MainDevice is to stay INACTIVE (permanent standby): a policy then neither takes over nor accepts
    /// the role. A requested role takes effect nevertheless.
    #[cfg(feature = "standby")]
    pub fn is_held(&self) -> bool {
        NotReady(self.not_ready()).has(NotReady::HELD)
    }

    /// Switches the permanent standby on or off, from the next cycle on (the notifications 1 and 2 of protocol 9.10,
    /// which also request [`RoleRequest::Inactive`] with the first one: [`RoleControl::request_hold`]).
    #[cfg(feature = "standby")]
    pub fn hold(&self, held: bool) {
        self.change_hold(|before| Some(with_hold(before, held) | HOLD_DECIDED));
    }

    /// Requests [`RoleRequest::Inactive`] and permanent standby together from the next cycle on: if the request is
    /// refused because of a write, neither takes effect. `force`: it is not refused.
    #[cfg(feature = "standby")]
    pub fn request_hold(&self, force: bool) {
        let forced = if force { FORCED } else { 0 };
        let code = RoleRequest::Inactive.code() | HOLDS | forced | Requester::Operator.bits();
        self.words.request.store(code, Ordering::Release);
    }

    /// Permanent standby as a policy requires, before an application begins; no change if it was decided with
    /// [`RoleControl::hold`] or [`RoleControl::request_hold`] before.
    #[cfg(feature = "standby")]
    pub fn begin_held(&self, held: bool) {
        self.change_hold(|before| (before & HOLD_DECIDED == 0).then(|| with_hold(before, held)));
    }

    #[cfg(feature = "standby")]
    fn change_hold(&self, change: impl Fn(u16) -> Option<u16>) {
        // It is not changed where `change` returns nothing.
        let _ = self.words.not_ready.fetch_update(Ordering::Relaxed, Ordering::Relaxed, change);
    }

    /// Why a failure of one MainDevice now would cost more than the time-out of a takeover, as this one has seen it in
    /// its last cycle; [`NotReady::NOTHING`] if it would not. As ACTIVE it contains the reasons of the other one and
    /// its own, as INACTIVE its own. If cycles stop, [`NotReady::STOPPED`] after 100 ms and four periods.
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

#[cfg(feature = "standby")]
const fn with_hold(bits: u16, held: bool) -> u16 {
    NotReady(bits).with(NotReady::HELD, held).0
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
        let taken = |request, is_forced| Taken { request, is_forced, holds: false };
        let control = RoleControl::new(MainDeviceRole::Inactive);
        let handle = control.clone();
        assert_eq!((control.role(), control.requested()), (MainDeviceRole::Inactive, None));
        handle.request(RoleRequest::Active);
        handle.request(RoleRequest::HandOver);
        handle.request(RoleRequest::Inactive);
        assert_eq!(control.role(), MainDeviceRole::Inactive, "before the next cycle");
        assert_eq!(control.take_request(), Some(taken(RoleRequest::Inactive, false)));
        handle.force(RoleRequest::HandOver);
        assert_eq!(control.requested(), Some(RoleRequest::HandOver));
        assert_eq!(control.take_request(), Some(taken(RoleRequest::HandOver, true)));
        assert_eq!((control.take_request(), control.requested()), (None, None));
        assert!(!control.set(MainDeviceRole::Inactive) && control.changes() == 0);
        assert!(control.set(MainDeviceRole::Active) && handle.changes() == 1);
        assert_eq!(handle.role(), MainDeviceRole::Active);
        handle.set_not_ready(0x50, true);
        handle.set_not_ready(0x10, false);
        assert_eq!(control.not_ready(), 0x40);
    }

    // covers: MR-02, standby
    #[test]
    fn a_request_is_replaced_by_those_of_the_same_or_a_higher_priority_only() {
        use Requester::{Operator, Policy, Schedule};
        let all = [Schedule, Policy, Operator];
        for (first, second) in all.into_iter().flat_map(|first| all.map(|second| (first, second))) {
            let control = RoleControl::new(MainDeviceRole::Active);
            assert!(control.request_as(RoleRequest::HandOver, first));
            assert_eq!(control.request_as(RoleRequest::Withdraw, second), second >= first, "{first:?}, {second:?}");
            let expected = if second >= first { RoleRequest::Withdraw } else { RoleRequest::HandOver };
            assert_eq!(control.requested(), Some(expected), "{first:?}, {second:?}");
            control.request(RoleRequest::Inactive);
            assert_eq!(control.requested(), Some(RoleRequest::Inactive));
            assert!(!control.request_as(RoleRequest::Active, Policy) && control.take_request().is_some());
            assert!(control.request_as(RoleRequest::Active, Schedule));
        }
    }

    // covers: MR-15, standby
    #[test]
    #[cfg(feature = "standby")]
    fn a_hold_that_was_decided_stays_and_a_requested_one_waits() {
        let control = RoleControl::new(MainDeviceRole::Active);
        control.begin_held(true);
        assert!(control.is_held());
        control.begin_held(false);
        assert!(!control.is_held(), "the policy of a later application");
        control.hold(true);
        control.begin_held(false);
        assert!(control.is_held(), "it was decided");
        control.hold(false);
        control.begin_held(true);
        assert!(!control.is_held() && control.not_ready() == 0);
        control.request_hold(true);
        assert!(!control.is_held() && control.requested() == Some(RoleRequest::Inactive));
        let expected = Taken { request: RoleRequest::Inactive, is_forced: true, holds: true };
        assert_eq!(control.take_request(), Some(expected));
    }
}
