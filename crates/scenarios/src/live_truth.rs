//! Comparison of the live status with the simulated devices, cycle by cycle.
//!
//! A shown state is one that the device had within the limit: never an invented one. A state that the device keeps
//! longer than the limit is shown. Counts, AL states of all devices together and working counters follow within a few
//! cycles, also for devices without a declaration.

use std::collections::VecDeque;
use std::time::Duration;

use ringcat::{AlStatus, DomainId, DomainState, DomainStatus, Instant, LiveStatus, SubDeviceId};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::Network;

use crate::world::{CYCLE, World};

/// Cycles until counts and working counters show a change: one under way, one that is lost, one that is evaluated.
const CYCLES: u32 = 5;

/// What a device shows: AL status and the code of its error; `None` without power or out of reach.
type Seen = Option<(u16, u16)>;

/// A value of the past.
#[derive(Clone, Copy, Debug)]
struct Past<T> {
    value: T,
    /// When it was replaced.
    until: Instant,
}

/// A device, and what it was.
#[derive(Debug)]
struct Watched {
    device: DeviceIndex,
    now: Seen,
    since: Instant,
    past: VecDeque<Past<Seen>>,
    /// The status has shown the present state.
    is_shown: bool,
}

/// Compares the live status with the devices.
#[derive(Debug)]
pub struct LiveTruth {
    live: LiveStatus,
    /// By SubDevice.
    watched: Vec<Watched>,
    /// Devices in reach, and their AL states ORed, and since when they are so.
    all: (u16, u8),
    all_since: Instant,
    /// Longest time until a state was shown.
    pub slowest: Duration,
    /// States that were compared.
    pub compared: u64,
}

impl LiveTruth {
    /// For an application of which each SubDevice is this device.
    pub fn new(world: &World, devices: &[usize]) -> LiveTruth {
        let live = world.application().live_status();
        assert_eq!(live.subdevice_count(), devices.len());
        let since = world.application().now();
        let watched = devices.iter().map(|device| Watched {
            device: DeviceIndex(*device),
            now: None,
            since,
            past: VecDeque::new(),
            is_shown: false,
        });
        let (watched, slowest) = (watched.collect(), Duration::ZERO);
        LiveTruth { live, watched, all: (0, 0), all_since: since, slowest, compared: 0 }
    }

    /// Compares after a cycle. A state is shown within `limit`; `is_reached` says which devices have a way to a link.
    ///
    /// # Panics
    /// When the status shows something else.
    pub fn look(&mut self, world: &World, limit: Duration, is_reached: impl Fn(DeviceIndex) -> bool) {
        let (now, network) = (world.application().now(), world.network());
        let seen = |device: DeviceIndex| seen(network, device).filter(|_| is_reached(device));
        for (number, watched) in self.watched.iter_mut().enumerate() {
            let is = seen(watched.device);
            watched.follow(is, now, limit);
            let status = self.live.subdevice(SubDeviceId(number)).expect("it is declared");
            let shown = status.online.then(|| status.al_state.map(|state| (state, status.has_error, status.code)));
            let of = |it: (u16, u16)| {
                let al = AlStatus::from_bits(it.0);
                (al.al_state().expect("a state"), al.error, ringcat::AlStatusCode(it.1))
            };
            let age = now.since(watched.since);
            let is_right = shown == is.map(|it| Some(of(it)));
            let was_right = || {
                let past = watched.past.iter().map(|past| past.value).chain([watched.now]);
                match shown {
                    // Not read yet since it came.
                    Some(None) => true,
                    shown => past.map(|it| it.map(|it| Some(of(it)))).any(|past| past == shown),
                }
            };
            assert!(
                is_right || (age < limit && was_right()),
                "SubDevice {number} at {now:?}: {is:x?} for {age:?}, shown is {status:x?}; before: {:x?}\n{}",
                watched.past,
                world.log(),
            );
            if is_right && !std::mem::replace(&mut watched.is_shown, true) {
                self.slowest = self.slowest.max(age);
            }
            self.compared += 1;
            let is_op = is.map(|it| it.0) == Some(8);
            assert!(!status.operational || is_op || age < limit, "SubDevice {number} is not operational: {is:x?}");
            if age > CYCLE * CYCLES && is.is_none() {
                assert_eq!(status.wkc.counted, Some(0), "SubDevice {number} is out of reach");
            }
            if age > CYCLE * CYCLES && is_op && status.operational && is_complete(world) {
                assert!(status.wkc.is_complete(), "SubDevice {number} is in OP: {status:?}\n{}", world.log());
            }
        }
        self.compare_sum(world);
        self.compare_all(world, now, seen);
    }

    /// The shares add up to the working counters of the domains.
    fn compare_sum(&self, world: &World) {
        let shares = (0..self.watched.len()).map(|number| self.live.subdevice(SubDeviceId(number)).map(|it| it.wkc));
        let shares: Vec<_> = shares.flatten().collect();
        let expected: u32 = shares.iter().map(|share| u32::from(share.expected)).sum();
        let statuses = statuses(world);
        assert_eq!(expected, statuses.iter().map(|status| status.expected).sum::<u32>());
        let wkc: u32 = statuses.iter().map(|status| status.wkc).sum();
        let counted: Option<Vec<u32>> = shares.iter().map(|share| Some(share.counted?.into())).collect();
        let Some(counted) = counted.map(|counted| counted.iter().sum::<u32>()) else { return };
        // A SubDevice that processed both copies is counted once.
        assert!(counted == wkc || (counted < wkc && !is_complete(world)), "{counted} of {wkc}\n{}", world.log());
    }

    fn compare_all(&mut self, world: &World, now: Instant, seen: impl Fn(DeviceIndex) -> Seen) {
        let found = (0..world.network().devices().len()).filter_map(|device| seen(DeviceIndex(device)));
        let all = found.fold((0, 0), |(count, states), (status, _)| (count + 1, states | status as u8 & 0x0F));
        if std::mem::replace(&mut self.all, all) != all {
            self.all_since = now;
        }
        if now.since(self.all_since) > CYCLE * CYCLES {
            let segment = self.live.segment();
            assert_eq!((segment.responding, segment.al_states), all, "at {now:?}\n{}", world.log());
        }
    }
}

/// The last states of all domains.
fn statuses(world: &World) -> Vec<DomainStatus> {
    let exchange = world.application().exchange();
    (0..exchange.domain_count()).filter_map(|domain| exchange.status(DomainId(domain))).collect()
}

fn is_complete(world: &World) -> bool {
    statuses(world).iter().all(|status| status.state == DomainState::Complete)
}

impl Watched {
    fn follow(&mut self, is: Seen, now: Instant, limit: Duration) {
        if is != self.now {
            self.past.push_back(Past { value: self.now, until: now });
            (self.now, self.since, self.is_shown) = (is, now, false);
        }
        self.past.retain(|past| now.since(past.until) < limit);
    }
}

/// What the registers of a device show.
fn seen(network: &Network, device: DeviceIndex) -> Seen {
    let device = network.device(device);
    let status = device.al_status();
    let code = if status.error { device.al_status_code().0 } else { 0 };
    device.controller.is_powered().then_some((status.bits() & 0x1F, code))
}
