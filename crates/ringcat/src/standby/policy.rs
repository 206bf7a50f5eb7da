//! When one of two MainDevices takes the role of the ACTIVE, and when it gives it up: a ready-made policy (protocol
//! 9.6, 9.9).
//!
//! In: the role, when a frame of the other MainDevice arrived last, whether two are ACTIVE, and the time. Out: a
//! request. An application that decides itself has no policy, and uses [`RoleControl`](super::RoleControl).

use std::time::Duration;

use ringcat_engine::event::CyclicStandbyEvent;
use ringcat_engine::main_device::MainDeviceRole;
use ringcat_engine::role::RoleRequest;
use ringcat_engine::time::Instant;
use ringcat_wire::frame::MacAddress;

use super::alarm::ActiveMonitor;

/// Fewer cycles without process data may be those of a single fault of a cable.
const LEAST_CYCLES: u32 = 3;

/// What an ACTIVE with an application does if it receives frames of another ACTIVE (protocol MR-10). Without an
/// application, during a scan, [`OnCollision::LowerAddressStays`] always applies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum OnCollision {
    /// The one with the lower bytes 3 to 5 in the address of its main interface stays ACTIVE, the other one becomes
    /// INACTIVE with its next cycle. No cycle is lost if both have this policy. Exception: one that writes a file or an
    /// EEPROM, or has a SubDevice in BOOT, stays. If both do, both stay until one of the writes has ended.
    #[default]
    LowerAddressStays,
    /// It becomes INACTIVE, but not while it writes as above. If both do, one of them takes over after its time-out and
    /// a random pause.
    Yield,
    /// Nothing: the application decides, which gets [`StandbyEvent::Collision`](super::StandbyEvent::Collision).
    Stay,
}

/// When one of two MainDevices takes over, and when it yields.
///
/// ```
/// use std::time::Duration;
/// use ringcat::standby::Policy;
///
/// let policy = Policy::default().with_time_out(3, Duration::from_millis(15));
/// assert_eq!(policy.time_out_of(Duration::from_millis(10)), Duration::from_millis(30));
/// assert_eq!(policy.time_out_of(Duration::from_millis(1)), Duration::from_millis(15));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Policy {
    /// Whether it takes over without a request. Otherwise it stays INACTIVE until the role is requested (permanent
    /// standby), and does not accept a hand-over. [`RoleControl::hold`](super::RoleControl::hold) changes that later,
    /// from any thread.
    pub takes_over: bool,
    /// Cycles without process data of the ACTIVE after which it takes over. At least 3.
    pub time_out_cycles: u32,
    /// But not before this time.
    pub least_time_out: Duration,
    /// How long it listens before it becomes ACTIVE at its start, and the longest random pause after that: of two
    /// controllers that start at the same time one becomes ACTIVE.
    pub listen: Duration,
    /// What follows a collision.
    pub on_collision: OnCollision,
}

/// The policy by default.
const DEFAULT: Policy = Policy {
    takes_over: true,
    time_out_cycles: 3,
    least_time_out: Duration::from_millis(15),
    listen: Duration::from_secs(2),
    on_collision: OnCollision::LowerAddressStays,
};

impl Default for Policy {
    fn default() -> Policy {
        DEFAULT
    }
}

impl Policy {
    /// Stays INACTIVE until a role is requested.
    #[must_use]
    pub const fn permanent_standby() -> Policy {
        Policy { takes_over: false, ..DEFAULT }
    }

    /// Sets [`Policy::time_out_cycles`] and [`Policy::least_time_out`].
    #[must_use]
    pub const fn with_time_out(mut self, cycles: u32, at_least: Duration) -> Policy {
        (self.time_out_cycles, self.least_time_out) = (cycles, at_least);
        self
    }

    /// Sets [`Policy::listen`].
    #[must_use]
    pub const fn with_listen(mut self, listen: Duration) -> Policy {
        self.listen = listen;
        self
    }

    /// Sets [`Policy::on_collision`].
    #[must_use]
    pub const fn with_on_collision(mut self, on_collision: OnCollision) -> Policy {
        self.on_collision = on_collision;
        self
    }

    /// How long process data may be missing in a takeover: the time-out and two cycles (protocol 9.9). A watchdog of a
    /// SubDevice with outputs has to be longer.
    pub fn longest_gap_of(&self, period: Duration) -> Duration {
        self.time_out_of(period).saturating_add(2 * period)
    }

    /// The time-out with cycles of this period.
    pub fn time_out_of(&self, period: Duration) -> Duration {
        (period * self.time_out_cycles.max(LEAST_CYCLES)).max(self.least_time_out)
    }
}

/// Whether bytes 3 to 5 of an address are lower than those of another one.
pub(crate) fn is_lower(MacAddress([.., a, b, c]): MacAddress, MacAddress([.., d, e, f]): MacAddress) -> bool {
    [a, b, c] < [d, e, f]
}

/// What is known when a cycle begins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Situation {
    pub role: MainDeviceRole,
    /// When this MainDevice became INACTIVE.
    pub inactive_since: Instant,
    /// When process data of the other MainDevice came last since then.
    pub partner_data_at: Option<Instant>,
    /// When any frame of another MainDevice came last.
    pub partner_frame_at: Option<Instant>,
    /// The other one, of which a frame came while this one is ACTIVE.
    pub collided_with: Option<MacAddress>,
    /// Whether this one writes into the memory of a SubDevice.
    pub writes: bool,
    /// Whether the other one does.
    pub other_writes: bool,
    /// Whether this one is in permanent standby.
    pub is_held: bool,
}

/// A policy, as it is followed.
#[derive(Debug)]
pub(crate) struct Watch {
    policy: Policy,
    time_out: Duration,
    /// The own main address.
    own: MacAddress,
    dice: Dice,
    /// The random pause, and since when this MainDevice is INACTIVE for which it was chosen.
    pause: (Instant, Duration),
    monitor: ActiveMonitor,
}

impl Watch {
    /// For cycles of this period, of a MainDevice with this main address.
    pub fn new(policy: Policy, period: Duration, main: MacAddress, now: Instant) -> Watch {
        let (time_out, dice) = (policy.time_out_of(period), Dice::new(main, now));
        let (pause, monitor) = ((Instant::NEVER, Duration::ZERO), ActiveMonitor::new(now));
        Watch { policy, time_out, own: main, dice, pause, monitor }
    }

    /// Whether an alarm is to be reported in the cycle that begins now. A MainDevice that takes over gets time to do so
    /// first.
    pub fn look_out(&mut self, situation: &Situation, now: Instant) -> Option<CyclicStandbyEvent> {
        if situation.role == MainDeviceRole::Active {
            self.monitor.is_active(now);
            return None;
        }
        let limit = self.time_out.saturating_mul(if situation.is_held { 1 } else { 3 });
        self.monitor.note(situation.partner_data_at.or(situation.partner_frame_at), limit, now)
    }

    /// What is requested in the cycle that begins now.
    pub fn decide(&mut self, situation: &Situation, now: Instant) -> Option<RoleRequest> {
        match situation.role {
            MainDeviceRole::Active => {
                let other = situation.collided_with?;
                let yields = !situation.writes && self.yields_to(other, situation.other_writes);
                yields.then_some(RoleRequest::Inactive)
            }
            _ => {
                let limit = match situation.partner_data_at {
                    Some(_) => self.time_out,
                    None => self.time_out + self.pause_of(situation.inactive_since),
                };
                // Until it has sent process data, an ACTIVE may be scanning. Then only process data counts.
                let any = situation.partner_frame_at.unwrap_or(Instant(0));
                let silent_since = situation.partner_data_at.unwrap_or(situation.inactive_since.max(any));
                let is_over = !situation.is_held && now.since(silent_since) >= limit;
                is_over.then_some(RoleRequest::Active)
            }
        }
    }

    fn yields_to(&self, other: MacAddress, writes: bool) -> bool {
        match self.policy.on_collision {
            OnCollision::LowerAddressStays => writes || is_lower(other, self.own),
            OnCollision::Yield => true,
            OnCollision::Stay => false,
        }
    }

    /// The random pause of a MainDevice that has received nothing since it became INACTIVE.
    fn pause_of(&mut self, inactive_since: Instant) -> Duration {
        if self.pause.0 != inactive_since {
            self.pause = (inactive_since, self.dice.up_to(self.time_out));
        }
        self.pause.1
    }
}

/// Random times that differ between two controllers.
#[derive(Debug)]
pub(crate) struct Dice(u64);

impl Dice {
    /// Random times of a MainDevice with this main address.
    pub fn new(main: MacAddress, now: Instant) -> Dice {
        let [a, b, c, d, e, f] = main.0;
        let seed = u64::from_be_bytes([1, 0, a, b, c, d, e, f]).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        Dice((seed ^ now.0) | 1)
    }

    /// A time below this one.
    pub fn up_to(&mut self, most: Duration) -> Duration {
        let Dice(state) = self;
        *state ^= *state << 13;
        *state ^= *state >> 7;
        *state ^= *state << 17;
        let most = u64::try_from(most.as_nanos()).unwrap_or(u64::MAX);
        Duration::from_nanos(*state % most.max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const OWN: MacAddress = MacAddress([0, 0, 0x5E, 0, 0x53, 0x11]);

    fn watch(policy: Policy) -> Watch {
        Watch::new(policy, Duration::from_millis(1), OWN, Instant(0))
    }

    fn inactive(partner_data_at: Option<u64>) -> Situation {
        let partner_data_at = partner_data_at.map(|ms| Instant(ms * MS));
        Situation {
            role: MainDeviceRole::Inactive,
            inactive_since: Instant(0),
            partner_data_at,
            partner_frame_at: None,
            collided_with: None,
            writes: false,
            other_writes: false,
            is_held: false,
        }
    }

    fn collided(last: u8) -> Situation {
        let other = MacAddress([0x0A, 0x77, 0x5E, 0, 0x53, last]);
        Situation { role: MainDeviceRole::Active, collided_with: Some(other), ..inactive(None) }
    }

    // covers: standby, MR-08, 9.9
    #[test]
    fn an_inactive_takes_over_after_its_time_out_and_never_in_permanent_standby() {
        let mut watch = watch(Policy::default());
        assert_eq!(watch.decide(&inactive(Some(100)), Instant(115 * MS - 1)), None);
        assert_eq!(watch.decide(&inactive(Some(100)), Instant(115 * MS)), Some(RoleRequest::Active));
        let held = Situation { is_held: true, ..inactive(Some(100)) };
        assert_eq!(watch.decide(&held, Instant(900_000 * MS)), None);
        let least = Policy::default().with_time_out(0, Duration::ZERO);
        assert_eq!(least.time_out_of(Duration::from_millis(4)), Duration::from_millis(12), "a cable may be cut");
    }

    // covers: standby, MR-08
    #[test]
    fn an_active_that_has_sent_no_process_data_yet_may_be_scanning() {
        let mut watch = watch(Policy::default());
        let scans = Situation { partner_frame_at: Some(Instant(90 * MS)), ..inactive(None) };
        assert_eq!(watch.decide(&scans, Instant(105 * MS - 1)), None);
        assert_eq!(watch.decide(&scans, Instant(120 * MS)), Some(RoleRequest::Active), "it has ended");
        let hangs = Situation { partner_frame_at: Some(Instant(114 * MS)), ..inactive(Some(100)) };
        assert_eq!(watch.decide(&hangs, Instant(115 * MS)), Some(RoleRequest::Active), "its cycles hang");
    }

    // covers: standby, 9.9
    #[test]
    fn two_that_hear_nothing_pause_for_different_times_within_another_time_out() {
        let takes_over_at = |main: u8| {
            let mut watch = Watch::new(Policy::default(), Duration::from_millis(1), MacAddress([main; 6]), Instant(7));
            let takes_over = |us: &u64| watch.decide(&inactive(None), Instant(us * 1_000)).is_some();
            (0..40_000).find(takes_over).expect("it takes over")
        };
        let times: Vec<u64> = (1..=20).map(takes_over_at).collect();
        assert!(times.iter().all(|us| (15_000..=30_000).contains(us)), "{times:?}");
        let mut different = times.clone();
        different.sort_unstable();
        different.dedup();
        assert!(different.len() >= 19, "{times:?}");
    }

    // covers: standby, MR-10
    #[test]
    fn of_two_active_the_one_with_the_higher_address_yields_unless_set_otherwise() {
        let decide = |policy: Policy, last| watch(policy).decide(&collided(last), Instant(MS));
        let policy = Policy::default();
        assert_eq!(decide(policy, 0x10), Some(RoleRequest::Inactive));
        assert_eq!(decide(policy, 0x12), None);
        assert_eq!(decide(policy.with_on_collision(OnCollision::Yield), 0x12), Some(RoleRequest::Inactive));
        assert_eq!(decide(policy.with_on_collision(OnCollision::Stay), 0x10), None);
        let alone = Situation { collided_with: None, ..collided(0) };
        assert_eq!(watch(policy).decide(&alone, Instant(MS)), None);
    }

    // covers: standby, MR-10, MR-17
    #[test]
    fn of_two_active_the_one_that_writes_into_a_memory_stays() {
        let decide = |policy: Policy, last, writes, other_writes| {
            watch(policy).decide(&Situation { writes, other_writes, ..collided(last) }, Instant(MS))
        };
        let policy = Policy::default();
        let yields = Policy::default().with_on_collision(OnCollision::Yield);
        for (last, writes, other_writes, expected) in [
            (0x10, true, false, None),
            (0x10, true, true, None),
            (0x12, true, true, None),
            (0x12, false, true, Some(RoleRequest::Inactive)),
            (0x12, false, false, None),
        ] {
            assert_eq!(decide(policy, last, writes, other_writes), expected, "{last:#x}, {writes}, {other_writes}");
        }
        assert_eq!(decide(yields, 0x12, true, false), None);
    }
}
