//! The state of a SubDevice declared by the application: its phase, its target, its incidents.

use alloc::collections::VecDeque;
use alloc::rc::Rc;
use alloc::string::String;
use core::ops::Deref;
use core::time::Duration;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;

use super::repair::Repair;
use super::setup::{Setup, SetupError};
use crate::config::{SubDeviceConfig, Transition};
use crate::info::SubDeviceInfo;
use crate::time::Instant;

/// Phase of a SubDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// It does not answer.
    Absent,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It is in its target state.
    Settled(AlState),
}

/// The state of a SubDevice declared by the application.
#[derive(Debug)]
pub struct Member {
    /// The declaration.
    pub config: Rc<SubDeviceConfig>,
    /// Its target state: that of the declaration, or one requested since.
    pub target: AlState,
    /// Its phase.
    pub phase: Phase,
    /// Number of the configuration attempt under way; procedures of earlier attempts end.
    pub attempt: u32,
    /// Its registers hold its configuration, FMMUs included, until it loses power or is sent back to INIT.
    pub configured: bool,
    /// Its place in the topology.
    pub node: Option<usize>,
    /// Its configuration, shared with the procedure that applies it.
    pub setup: Option<Rc<Setup>>,
    /// Why it has none although it is present.
    pub unfit: Option<SetupError>,
    /// Incidents since activation.
    pub incidents: Incidents,
    /// Number of its mappings, increased also when its process data is expected anew: inputs read before prove nothing.
    pub(super) mapping: u32,
    /// Consecutive rounds without an answer.
    pub(super) silent: u8,
    /// Number of the last round in which it answered and was known to be this member; 0 before the first.
    pub(super) answered: u64,
    /// Process data does not wait for it although it is not lost.
    pub(super) suspended: bool,
    /// The SubDevice that answers at its address while it is lost.
    pub(super) mistaken: Mistaken,
    /// Repeated configurations because of lost registers.
    pub repair: Repair,
    /// Requests for another attempt without a further pause.
    pub retries: u32,
    /// Differences that were reported.
    pub(super) reported_warnings: ReportedWarnings,
}

/// Maximum number of differences that are kept: more than a SubDevice has SyncManagers.
const MAX_REPORTED_WARNINGS: usize = 32;

/// Differences between a declaration and a SubDevice: each attempt finds them again, and each is reported once.
#[derive(Debug, Default)]
pub(super) struct ReportedWarnings(VecDeque<String>);

impl ReportedWarnings {
    /// Whether a difference is not yet reported; it is then kept. The oldest are dropped.
    pub fn is_new(&mut self, what: &str) -> bool {
        if self.0.iter().any(|other| other == what) {
            return false;
        }
        if self.0.len() == MAX_REPORTED_WARNINGS {
            self.0.pop_front();
        }
        self.0.push_back(what.into());
        true
    }
}

/// First pause before the SubDevice at the address of a lost member is identified again.
const FIRST_PAUSE: Duration = Duration::from_millis(2);
/// Longest pause: the interval of the routine rounds.
const LONGEST_PAUSE: Duration = Duration::from_secs(1);
/// Consecutive identifications after which it is reported.
const PATIENCE: u32 = 10;

/// A SubDevice at the address of a lost member that is not identified as the member. Its address is taken away; while
/// it keeps the address it is identified again, after a pause that doubles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Mistaken {
    times: u32,
    until: Instant,
}

impl Mistaken {
    /// Counts an identification. Returns the pause before the next; none after the first.
    pub fn again(&mut self, now: Instant) -> Option<Duration> {
        self.times = self.times.saturating_add(1);
        let doublings = self.times.checked_sub(2)?;
        let pause = FIRST_PAUSE.saturating_mul(1 << doublings.min(16)).min(LONGEST_PAUSE);
        self.until = now + pause;
        Some(pause)
    }

    /// Remaining pause before the next identification.
    pub fn pause(&self, now: Instant) -> Option<Duration> {
        (now < self.until).then(|| self.until.since(now))
    }

    /// It keeps the address: to be reported now.
    pub fn is_due(&self) -> bool {
        self.times == PATIENCE
    }
}

/// Incidents of a SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Incidents {
    /// How often it was lost.
    pub absences: u32,
    /// How often it left its state without a request.
    pub state_changes: u32,
}

impl Member {
    /// Whether it was present at the activation, or has come since.
    pub fn is_there(&self) -> bool {
        self.setup.is_some() || self.unfit.is_some()
    }

    /// Whether commands are declared for another request of a state in which it is.
    pub fn has_commands_within(&self, state: AlState) -> bool {
        let transition = Transition::within(state);
        self.config.startup.iter().any(|command| Some(command.transition) == transition)
    }

    /// Whether it is in its declared state.
    pub fn is_as_declared(&self) -> bool {
        self.phase == Phase::Settled(self.config.target)
    }

    /// Whether its process data is exchanged in a state.
    pub fn exchanges(&self, state: AlState) -> bool {
        let early = || self.setup.as_ref().is_none_or(|setup| !setup.plan.is_op_only());
        state == AlState::Op || (state == AlState::SafeOp && early())
    }

    /// It answers, and its process data has not been mapped or expected anew since this number.
    pub fn is_mapped_as(&self, mapping: u32) -> bool {
        self.phase != Phase::Absent && self.mapping == mapping
    }

    /// Begins another attempt to configure it; the previous attempt ends. Returns the number.
    pub(super) fn begin_attempt(&mut self) -> u32 {
        self.phase = Phase::Configuring;
        self.attempt = self.attempt.wrapping_add(1);
        self.attempt
    }

    /// Begins an attempt in its state, which it keeps.
    pub(super) fn begin_again(&mut self) -> u32 {
        self.attempt = self.attempt.wrapping_add(1);
        self.attempt
    }

    /// A member of which nothing was observed since the scan.
    pub(super) fn new(
        config: SubDeviceConfig,
        node: Option<usize>,
        setup: Result<Rc<Setup>, Option<SetupError>>,
    ) -> Member {
        let (setup, unfit) = setup.map_or_else(|unfit| (None, unfit), |setup| (Some(setup), None));
        Member {
            target: config.target,
            config: Rc::new(config),
            phase: Phase::Absent,
            attempt: 0,
            configured: false,
            node,
            setup,
            unfit,
            incidents: Incidents::default(),
            mapping: 0,
            silent: 0,
            answered: 0,
            suspended: false,
            mistaken: Mistaken::default(),
            repair: Repair::default(),
            retries: 0,
            reported_warnings: ReportedWarnings::default(),
        }
    }
}

/// A declared SubDevice: its state, and what is known of it.
#[derive(Clone, Copy, Debug)]
pub struct MemberView<'a> {
    /// Its station address.
    pub station: StationAddress,
    /// Its identity and features; `None` if it has never answered.
    pub info: Option<&'a Rc<SubDeviceInfo>>,
    /// Its state.
    pub member: &'a Member,
}

impl Deref for MemberView<'_> {
    type Target = Member;

    fn deref(&self) -> &Member {
        self.member
    }
}
