//! A SubDevice that the application declared: its identity, its phase, its incidents.

use alloc::rc::Rc;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;

use super::setup::{Setup, SetupError};
use crate::config::SubDeviceConfig;
use crate::info::SubDeviceInfo;
use crate::time::Instant;

/// How far a SubDevice is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// It does not answer.
    Absent,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It is in its target state.
    Settled(AlState),
}

/// A SubDevice that the application declared.
#[derive(Debug)]
pub struct Member {
    /// The declaration.
    pub config: Rc<SubDeviceConfig>,
    /// The state to which it is brought: that of the declaration, or another one that was requested since.
    pub target: AlState,
    /// Its identity and abilities; `None` while it has never answered.
    pub info: Option<SubDeviceInfo>,
    /// Its station address.
    pub station: StationAddress,
    /// How far it is.
    pub phase: Phase,
    /// Number of the attempt to configure it that is under way; one that is out of date ends.
    pub attempt: u32,
    /// Its registers hold its configuration, FMMUs included, until it loses power or is sent back to INIT.
    pub configured: bool,
    /// Its place in the topology.
    pub node: Option<usize>,
    /// Its configuration, shared with the procedure that applies it.
    pub setup: Option<Rc<Setup>>,
    /// Why it has none though it is there.
    pub unfit: Option<SetupError>,
    /// What has happened to it since activation.
    pub incidents: Incidents,
    /// How often its process data was mapped, or counted on anew: inputs that were read before prove nothing.
    pub(super) mapping: u32,
    /// Silent looks in a row.
    pub(super) silent: u8,
    /// Process data does not wait for it though it is not lost.
    pub(super) suspended: bool,
    /// What answers at its address while it is lost.
    pub(super) mistaken: Mistaken,
}

/// First pause before what answers at the address of a lost SubDevice is asked again which one it is.
const FIRST_PAUSE: Duration = Duration::from_millis(2);
/// Longest pause: all are looked at so often anyway.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// So many times in a row are reported.
const PATIENCE: u32 = 10;

/// What answers at the address of a lost SubDevice and is not known to be it. It loses the address; one that keeps it
/// is asked again and again, after a pause that doubles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Mistaken {
    times: u32,
    until: Instant,
}

impl Mistaken {
    /// Once more. Returns the pause before it is asked again; none after the first time.
    pub fn again(&mut self, now: Instant) -> Option<Duration> {
        self.times = self.times.saturating_add(1);
        let doublings = self.times.checked_sub(2)?;
        let pause = FIRST_PAUSE.saturating_mul(1 << doublings.min(16)).min(LONGEST_PAUSE);
        self.until = now + pause;
        Some(pause)
    }

    /// How long it is not asked.
    pub fn pause(&self, now: Instant) -> Option<Duration> {
        (now < self.until).then(|| self.until.since(now))
    }

    /// It keeps the address: to be reported now.
    pub fn is_to_tell(&self) -> bool {
        self.times == PATIENCE
    }
}

/// What has happened to a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Incidents {
    /// How often it was no longer there.
    pub absences: u32,
    /// How often it left its state by itself.
    pub state_changes: u32,
}

impl Member {
    /// Whether it was there at the activation, or has come since.
    pub fn is_there(&self) -> bool {
        self.setup.is_some() || self.unfit.is_some()
    }

    /// Whether its process data flows in a state.
    pub fn exchanges(&self, state: AlState) -> bool {
        let early = || self.setup.as_ref().is_none_or(|setup| !setup.plan.is_op_only());
        state == AlState::Op || (state == AlState::SafeOp && early())
    }

    /// It answers, and its process data has not been mapped or counted on anew since this number.
    pub fn is_mapped_as(&self, mapping: u32) -> bool {
        self.phase != Phase::Absent && self.mapping == mapping
    }

    /// Another attempt to configure it begins; one that is under way ends. Returns its number.
    pub(super) fn begin_attempt(&mut self) -> u32 {
        self.phase = Phase::Configuring;
        self.attempt = self.attempt.wrapping_add(1);
        self.attempt
    }

    /// A member of which nothing is known but what the scan found.
    pub fn new(
        config: SubDeviceConfig,
        info: Option<SubDeviceInfo>,
        station: StationAddress,
        setup: Option<Rc<Setup>>,
    ) -> Member {
        let node = info.as_ref().map(|info| usize::from(info.position.0));
        Member {
            target: config.target,
            config: Rc::new(config),
            info,
            station,
            phase: Phase::Absent,
            attempt: 0,
            configured: false,
            node,
            setup,
            unfit: None,
            incidents: Incidents::default(),
            mapping: 0,
            silent: 0,
            suspended: false,
            mistaken: Mistaken::default(),
        }
    }
}
