//! Switchovers on a schedule, as proof that the other controller can take over (`--switch-every`).
//!
//! Input: the time, the role, whether a failure of one controller would be tolerated now, why a request was refused.
//! Output: what is to be done or reported. The ACTIVE hands its role over; the new ACTIVE, with the same option, hands
//! it back in its turn.

use std::time::Duration;

use ringcat::standby::{NotReady, RoleCause};
use ringcat::{Instant, MainDeviceRole};

use crate::json::standby::Switchovers;
use crate::times::{in_words, time};

/// The other MainDevice has this long to take the role.
pub const HAND_OVER_LIMIT: Duration = Duration::from_secs(1);
/// The reason if it has not taken it.
pub const NOT_TAKEN: &str = "the other MainDevice did not take the role";
/// Shortest time between two switchovers.
const SHORTEST: Duration = Duration::from_secs(1);

/// The time after which the role is handed over.
pub fn every(text: &str) -> Result<Duration, String> {
    let every = time(text)?;
    if every >= SHORTEST { Ok(every) } else { Err(format!("expected {} or more", in_words(SHORTEST))) }
}

/// State of the schedule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// The other MainDevice is ACTIVE.
    Inactive,
    /// ACTIVE until the next switchover, which is due at this time.
    Waits { due: Instant },
    /// The role was offered.
    Asked { at: Instant },
}

/// The next step.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Request the hand-over.
    Request,
    /// The role was handed over, this long after the request.
    Done(Duration),
    /// It was not handed over, and why.
    Refused(String),
    /// It was not taken in time: the offer is to be withdrawn.
    Withdraw,
}

/// The schedule.
#[derive(Debug)]
pub struct Schedule {
    every: Duration,
    state: State,
    seen: Switchovers,
}

impl Schedule {
    /// A switchover each time this controller has been ACTIVE for this time.
    pub fn new(every: Duration) -> Schedule {
        Schedule { every, state: State::Inactive, seen: Switchovers::default() }
    }

    /// The next step, if there is one now. The last argument: why the last request was refused, which is taken out, and
    /// why this MainDevice has become INACTIVE since the request.
    pub fn step(
        &mut self,
        now: Instant,
        role: MainDeviceRole,
        readiness: NotReady,
        (refused, cause): (&mut Option<String>, Option<RoleCause>),
    ) -> Option<Step> {
        let due = now + self.every;
        let (state, step) = match (self.state, role) {
            // The event about the change comes after it.
            (State::Asked { at }, MainDeviceRole::Inactive) => match cause {
                Some(RoleCause::HandedOver) => (State::Inactive, Some(Step::Done(now.since(at)))),
                Some(cause) => (State::Inactive, Some(Step::Refused(format!("INACTIVE for another reason: {cause}")))),
                None if now.since(at) < HAND_OVER_LIMIT => (self.state, None),
                None => (State::Inactive, Some(Step::Refused("INACTIVE for an unknown reason".to_owned()))),
            },
            (_, MainDeviceRole::Inactive) => (State::Inactive, None),
            (State::Inactive, MainDeviceRole::Active) => (State::Waits { due }, None),
            (State::Waits { due: at }, MainDeviceRole::Active) if now >= at => match readiness {
                NotReady::NOTHING => {
                    *refused = None;
                    (State::Asked { at: now }, Some(Step::Request))
                }
                reasons => (State::Waits { due }, Some(Step::Refused(format!("not ready: {reasons}")))),
            },
            (State::Asked { at }, MainDeviceRole::Active) => {
                let late = (now.since(at) >= HAND_OVER_LIMIT).then_some(Step::Withdraw);
                match refused.take().map(Step::Refused).or(late) {
                    Some(step) => (State::Waits { due }, Some(step)),
                    None => (self.state, None),
                }
            }
            (state, _) => (state, None),
        };
        self.state = state;
        self.count(step.as_ref());
        step
    }

    /// The hand-over could not be requested: it is due again at once.
    pub fn again(&mut self, now: Instant) {
        self.state = State::Waits { due: now };
    }

    fn count(&mut self, step: Option<&Step>) {
        match step {
            Some(Step::Done(time)) => {
                self.seen.done += 1;
                let ns = u64::try_from(time.as_nanos()).unwrap_or(u64::MAX);
                self.seen.longest_ns = Some(self.seen.longest_ns.unwrap_or_default().max(ns));
            }
            Some(Step::Refused(_) | Step::Withdraw) => self.seen.refused += 1,
            Some(Step::Request) | None => {}
        }
    }

    /// What has happened.
    pub fn seen(&self) -> Switchovers {
        self.seen.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ACTIVE: MainDeviceRole = MainDeviceRole::Active;
    const INACTIVE: MainDeviceRole = MainDeviceRole::Inactive;
    const READY: NotReady = NotReady::NOTHING;

    fn at(ms: u64) -> Instant {
        Instant(ms * 1_000_000)
    }

    // covers: standby, MR-07
    #[test]
    fn the_role_is_handed_over_each_time_this_one_was_active_for_the_time() {
        let mut schedule = Schedule::new(Duration::from_millis(100));
        let mut none = None;
        let mut step = |ms, role| schedule.step(at(ms), role, READY, (&mut none, Some(RoleCause::HandedOver)));
        assert_eq!((step(0, INACTIVE), step(500, ACTIVE), step(599, ACTIVE)), (None, None, None));
        assert_eq!((step(600, ACTIVE), step(602, ACTIVE)), (Some(Step::Request), None));
        assert_eq!(step(606, INACTIVE), Some(Step::Done(Duration::from_millis(6))));
        assert_eq!((step(700, INACTIVE), step(900, ACTIVE)), (None, None), "the other one has handed it back");
        assert_eq!(step(1_000, ACTIVE), Some(Step::Request));
        schedule.again(at(1_000));
        let request = schedule.step(at(1_002), ACTIVE, READY, (&mut None, None));
        assert_eq!(request, Some(Step::Request), "another request was pending");
        let Switchovers { done, refused, longest_ns } = schedule.seen();
        assert_eq!((done, refused, longest_ns), (1, 0, Some(6_000_000)));
    }

    // covers: standby, MR-07
    #[test]
    fn a_switchover_is_refused_when_not_ready_when_refused_and_when_late() {
        let mut schedule = Schedule::new(Duration::from_millis(100));
        let mut refused = Some("of another request".to_owned());
        schedule.step(at(0), ACTIVE, READY, (&mut refused, None));
        let not_ready =
            schedule.step(at(100), ACTIVE, NotReady::LINK.with(NotReady::GUARD, true), (&mut refused, None));
        assert_eq!(not_ready, Some(Step::Refused("not ready: a link is down, no guard".to_owned())));
        assert_eq!(schedule.step(at(200), ACTIVE, READY, (&mut refused, None)), Some(Step::Request));
        assert_eq!(schedule.step(at(201), ACTIVE, READY, (&mut refused, None)), None);
        refused = Some("kept".to_owned());
        assert_eq!(schedule.step(at(202), ACTIVE, READY, (&mut refused, None)), Some(Step::Refused("kept".to_owned())));
        assert_eq!(schedule.step(at(302), ACTIVE, READY, (&mut refused, None)), Some(Step::Request));
        let late = schedule.step(at(1_302), ACTIVE, READY, (&mut refused, None));
        assert_eq!(late, Some(Step::Withdraw));
        assert_eq!((schedule.seen().done, schedule.seen().refused), (0, 3));
    }

    // covers: standby, MR-07
    #[test]
    fn a_role_that_is_lost_for_another_reason_is_no_switchover() {
        let mut schedule = Schedule::new(Duration::from_millis(100));
        let mut step = |ms, role, cause| schedule.step(at(ms), role, READY, (&mut None, cause));
        assert_eq!((step(0, ACTIVE, None), step(100, ACTIVE, None)), (None, Some(Step::Request)));
        assert_eq!(step(101, INACTIVE, None), None, "the event has not arrived");
        let lost = step(102, INACTIVE, Some(RoleCause::LinksLost));
        assert_eq!(lost, Some(Step::Refused("INACTIVE for another reason: all links lost".to_owned())));
        assert_eq!(step(103, INACTIVE, Some(RoleCause::LinksLost)), None);
        assert_eq!((step(200, ACTIVE, None), step(300, ACTIVE, None)), (None, Some(Step::Request)));
        assert!(matches!(step(1_300, INACTIVE, None), Some(Step::Refused(_))), "the event never arrives");
        assert_eq!((schedule.seen().done, schedule.seen().refused), (0, 2));
    }

    // covers: standby, MR-07
    #[test]
    fn less_than_a_second_between_switchovers_is_refused() {
        assert_eq!(every("1s"), Ok(Duration::from_secs(1)));
        assert_eq!(every("999ms"), Err("expected 1s or more".to_owned()));
    }
}
