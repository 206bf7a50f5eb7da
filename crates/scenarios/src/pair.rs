//! Two MainDevices on one simulated segment in virtual time, each with its program: one is ACTIVE, the other one
//! forwards. Checks from inside the SubDevices and on the interfaces run in every cycle, whatever happens to either.
//!
//! A failing test prints the seed and the log.

mod board;
mod member;
mod outputs;
mod programs;
mod states;
mod traffic;

use std::fmt::Display;
use std::sync::Arc;
use std::time::Duration;

use ringcat::simulated::two_hosts::{HostLinks, TwoHosts};
use ringcat::standby::{ForwardingCounters, RoleRequest};
use ringcat::{Instant, Link, RingState};
use ringcat_sim::cable::{CableId, DeviceIndex, Host};
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::host::program::TurnAround;
use ringcat_sim::network::Network;
use ringcat_wire::al::{AlState, AlStatus};

use self::board::{Asked, Board};
pub use self::board::{Phase, Seen};
pub use self::member::TIME_OUT_CYCLES;
use self::outputs::Outputs;
pub use self::programs::CYCLE;
use self::states::States;
use self::traffic::Traffic;

/// Cycles until all SubDevices are in OP and process data is complete.
const SETTLE_LIMIT: u32 = 5_000;

/// Two MainDevices and their segment.
#[derive(Debug)]
pub struct Pair {
    seed: u64,
    hosts: TwoHosts,
    boards: [Arc<Board>; 2],
    outputs: Outputs,
    states: States,
    traffic: Traffic,
    log: Vec<(Instant, String)>,
    /// Ethernet frames per cycle of each program that is started.
    frames_per_cycle: usize,
}

impl Pair {
    /// The network of a ring of two; the first MainDevice is ACTIVE, the second one forwards.
    ///
    /// # Panics
    /// The SubDevices do not reach OP.
    pub fn new(seed: u64, network: Network) -> Pair {
        let mut pair = Pair::without_programs(seed, network);
        pair.start_standby(Host::Second);
        pair.start_active(Host::First);
        pair.settle();
        pair
    }

    /// As [`Pair::new`], with nothing started.
    pub fn without_programs(seed: u64, mut network: Network) -> Pair {
        let count = network.devices().len();
        (0..count).map(DeviceIndex).for_each(|device| network.device_mut(device).controller.log_logical());
        network.log_hosts();
        let (outputs, states) = (Outputs::new(&network, CYCLE), States::new(&network));
        let hosts = TwoHosts::new(network);
        let boards = [Arc::default(), Arc::default()];
        Pair {
            seed,
            hosts,
            boards,
            outputs,
            states,
            traffic: Traffic::new(CYCLE),
            log: Vec::new(),
            frames_per_cycle: 0,
        }
    }

    /// Programs that are started from now on have Ethernet to the other one, and send this number of frames in each
    /// cycle.
    pub fn let_members_send_frames(&mut self, frames: usize) {
        self.frames_per_cycle = frames;
    }

    /// Starts the program of an ACTIVE MainDevice on a host: it scans, activates, and runs cycles.
    pub fn start_active(&mut self, host: Host) {
        self.start(host, Phase::Starting, programs::active);
    }

    /// Starts the program of an INACTIVE MainDevice on a host: it forwards.
    pub fn start_standby(&mut self, host: Host) {
        self.start(host, Phase::Inactive, programs::standby);
    }

    /// As [`Pair::start_standby`], of one that forwards frames of any age, as it must not.
    pub fn start_standby_without_limit(&mut self, host: Host) {
        self.start(host, Phase::Inactive, programs::standby_without_limit);
    }

    /// Starts the program of one of two MainDevices on a host: it listens, and follows or becomes ACTIVE.
    pub fn start_member(&mut self, host: Host) {
        self.start(host, Phase::Inactive, member::member);
    }

    /// As [`Pair::start_member`], of one that does not listen before it becomes ACTIVE for the first time.
    pub fn start_eager_member(&mut self, host: Host) {
        self.start(host, Phase::Inactive, member::eager_member);
    }

    /// As [`Pair::start_member`], with a member that takes over on request only.
    pub fn start_permanent_standby(&mut self, host: Host) {
        self.start(host, Phase::Inactive, member::permanent_standby);
    }

    /// As [`Pair::start_member`], with a member that becomes INACTIVE in a collision, whatever the addresses are.
    pub fn start_yielding_member(&mut self, host: Host) {
        self.start(host, Phase::Inactive, member::yielding_member);
    }

    /// Starts both, the first one earlier, and waits until all SubDevices are in OP and the second one follows.
    ///
    /// # Panics
    /// When this takes more than 5 s.
    pub fn of_members(seed: u64, network: Network) -> Pair {
        Pair::without_programs(seed, network).with_members()
    }

    /// As [`Pair::of_members`], of a pair without programs.
    ///
    /// # Panics
    /// When this takes more than 5 s.
    pub fn with_members(mut self) -> Pair {
        self.start_member(Host::First);
        self.run_cycles(5);
        self.start_member(Host::Second);
        self.until_ready(Host::First);
        self
    }

    /// Waits until a host is ACTIVE with all SubDevices in OP, and the other one could take over.
    ///
    /// # Panics
    /// When this takes more than 5 s.
    pub fn until_ready(&mut self, active: Host) {
        for _ in 0..SETTLE_LIMIT {
            self.cycle();
            let seen = self.seen(active);
            if seen.phase == Phase::Active && seen.is_last_complete && seen.is_other_ready && self.all_in_op() {
                return;
            }
        }
        panic!("{active:?} is not ACTIVE with a standby that is ready within {SETTLE_LIMIT} cycles");
    }

    /// Makes the program of a host request a role.
    pub fn request(&mut self, host: Host, request: RoleRequest) {
        self.say(format!("{host:?}: {request:?}"));
        self.boards[host as usize].ask_for(Asked::Role(request));
    }

    /// Makes the program of a host request permanent standby, with the role INACTIVE.
    pub fn request_hold(&mut self, host: Host) {
        self.say(format!("{host:?}: permanent standby"));
        self.boards[host as usize].ask_for(Asked::Hold);
    }

    /// Longest time between outputs that a SubDevice took, since the last call. One that never took any is left out.
    pub fn take_longest_gap(&mut self) -> Duration {
        self.outputs.take_longest_gap()
    }

    fn start(&mut self, host: Host, phase: Phase, program: fn(HostLinks, &Board)) {
        self.say(format!("{host:?} starts: {phase:?}"));
        let board = Arc::new(Board::new(phase));
        board.set_frames_per_cycle(self.frames_per_cycle);
        self.boards[host as usize] = board.clone();
        let started = self.hosts.start(host, move |links| program(links, &board));
        started.unwrap_or_else(|error| panic!("a program cannot be started: {error}"));
    }

    /// Makes the ACTIVE program of a host stop in order: SubDevices go to INIT, links go down.
    pub fn stop(&mut self, host: Host) {
        self.say(format!("{host:?} is to stop"));
        self.boards[host as usize].ask_to_stop();
    }

    /// Runs until all SubDevices are in OP and a cycle of the ACTIVE is complete.
    ///
    /// # Panics
    /// When this takes more than 5 s.
    pub fn settle(&mut self) {
        for _ in 0..SETTLE_LIMIT {
            self.cycle();
            let is_complete = Host::ALL.iter().any(|host| self.seen(*host).is_last_complete);
            if is_complete && self.all_in_op() {
                return;
            }
        }
        panic!("not settled within {SETTLE_LIMIT} cycles");
    }

    /// Lets a cycle pass, and checks what happened in it.
    pub fn cycle(&mut self) {
        self.hosts.run_for(CYCLE);
        let seen = Host::ALL.map(|host| self.seen(host));
        let phases = seen.each_ref().map(|seen| seen.phase);
        let Pair { hosts, outputs, states, traffic, .. } = self;
        let now = hosts.now();
        let steps = hosts.with_network(|network| {
            traffic.check(network.take_host_log(), &seen);
            outputs.check(network);
            states.check(network, outputs, phases)
        });
        self.log.extend(steps.into_iter().map(|step| (now, step)));
    }

    /// Lets cycles pass.
    pub fn run_cycles(&mut self, cycles: u32) {
        (0..cycles).for_each(|_| self.cycle());
    }

    /// What the program of a host has seen.
    pub fn seen(&self, host: Host) -> Seen {
        self.boards[host as usize].seen()
    }

    /// Cycles of the ACTIVE on a host whose process data was not complete, since its start.
    pub fn incomplete(&self, host: Host) -> u64 {
        self.seen(host).incomplete
    }

    /// State of the ring in the ACTIVE on a host.
    pub fn ring(&self, host: Host) -> RingState {
        self.seen(host).ring
    }

    /// Frames that the INACTIVE on a host has forwarded since its start.
    pub fn forwarded(&self, host: Host) -> ForwardingCounters {
        self.seen(host).forwarded
    }

    /// Whether all SubDevices are in OP, by their own registers.
    pub fn all_in_op(&self) -> bool {
        self.not_in_op().is_empty()
    }

    /// The SubDevices that are not in OP, by their own registers.
    pub fn not_in_op(&self) -> Vec<usize> {
        let op = AlStatus::new(AlState::Op);
        let left = |(number, device): (usize, &Device)| (device.al_status() != op).then_some(number);
        self.hosts.with_network(|network| network.devices().enumerate().filter_map(left).collect())
    }

    /// Areas of outputs that were checked inside the SubDevices.
    pub fn checked_outputs(&self) -> u64 {
        self.outputs.checked()
    }

    /// Passes of frames over the interfaces of INACTIVE MainDevices that were checked.
    pub fn checked_passes(&self) -> u64 {
        self.traffic.passes()
    }

    /// Oldest outputs that a SubDevice took since the last call.
    pub fn take_oldest_outputs(&mut self) -> Duration {
        self.outputs.take_oldest()
    }

    /// Outputs that are older than this number of cycles when a SubDevice takes them fail the test.
    pub fn allow_age(&mut self, cycles: u32) {
        self.outputs.allow_age(cycles);
    }

    /// The hosts.
    pub fn hosts(&mut self) -> &mut TwoHosts {
        &mut self.hosts
    }

    /// Kills the program of a host. Its interfaces stay up.
    pub fn kill(&mut self, host: Host) {
        self.say(format!("{host:?} is killed"));
        self.hosts.kill(host);
    }

    /// A fault, after a time.
    pub fn fault_in(&mut self, delay: Duration, fault: Fault) {
        self.say(format!("in {} us: {fault:?}", delay.as_micros()));
        self.hosts.apply_in(delay, fault);
    }

    /// A fault, now.
    pub fn fault(&mut self, fault: Fault) {
        self.say(format!("{fault:?}"));
        self.hosts.apply(fault);
    }

    /// Cuts a cable.
    pub fn cut(&mut self, cable: usize) {
        self.fault(Fault::Cut(CableId(cable)));
    }

    /// Repairs a cable.
    pub fn heal(&mut self, cable: usize) {
        self.fault(Fault::Heal(CableId(cable)));
    }

    /// Whether a link of a host has a carrier.
    pub fn carrier(&self, host: Host, link: Link) -> bool {
        self.hosts.with_network(|network| network.carrier(host.links()[link.index()]))
    }

    /// Sets the turn-around time of both hosts.
    pub fn set_turn_around(&mut self, turn_around: TurnAround) {
        Host::ALL.into_iter().for_each(|host| self.hosts.set_turn_around(host, turn_around));
    }

    /// Puts a line into the log.
    pub fn say(&mut self, what: impl Display) {
        self.log.push((self.hosts.now(), format!("> {what}")));
    }

    /// The log as text.
    pub fn log(&self) -> String {
        let line = |(at, what): &(Instant, String)| format!("{:>12.3} us  {what}\n", at.0 as f64 / 1e3);
        let lines: String = self.log.iter().map(line).collect();
        let sides = Host::ALL.map(|host| format!("{host:?}: {:?}\n", self.seen(host)));
        lines + &sides.concat()
    }
}

impl Drop for Pair {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("seed {}, at {} ns; what happened:\n{}", self.seed, self.hosts.now().0, self.log());
        }
    }
}
