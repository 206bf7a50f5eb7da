//! The program of one of two MainDevices: it joins, and takes over by the policy of the library.

use std::ops::Range;
use std::time::Duration;

use ringcat::simulated::two_hosts::HostLinks;
use ringcat::standby::{Joining, Next, OnCollision, PartnerEndpoint, Policy, StandbyEvent, StandbyOptions};
use ringcat::{
    Application, DomainId, DomainState, Error, Event, Links, MainDevice, MainDeviceRole, Options, ProcessData, Scan,
    ScanError, automatic,
};
use ringcat_wire::frame::MacAddress;

use super::board::{Asked, Board, Phase};
use super::programs::{CYCLE, outputs_of};
use crate::ethernet_peer::EthernetPeer;

/// Cycles without the ACTIVE after which the other one takes over.
pub const TIME_OUT_CYCLES: u32 = 3;
/// Acyclic master frames per cycle, with Ethernet.
const MAX_ACYCLIC: u8 = 4;
/// How long it listens before it decides again what follows.
const SLICE: Duration = Duration::from_millis(1);
/// How long it listens at its start.
const LISTEN: Duration = Duration::from_millis(30);

/// Joins, and writes the number of the cycle to all outputs, in either role.
pub(super) fn member(links: HostLinks, board: &Board) {
    run(links, board, LISTEN, policy());
}

/// As [`member`], but it does not listen before it becomes ACTIVE for the first time.
pub(super) fn eager_member(links: HostLinks, board: &Board) {
    run(links, board, Duration::ZERO, policy());
}

/// As [`member`], but it takes over on request only.
pub(super) fn permanent_standby(links: HostLinks, board: &Board) {
    let mut policy = policy();
    policy.takes_over = false;
    run(links, board, LISTEN, policy);
}

/// As [`member`], but in a collision it becomes INACTIVE whatever the addresses are.
pub(super) fn yielding_member(links: HostLinks, board: &Board) {
    run(links, board, LISTEN, policy().with_on_collision(OnCollision::Yield));
}

fn policy() -> Policy {
    Policy::default().with_time_out(TIME_OUT_CYCLES, Duration::ZERO).with_listen(LISTEN)
}

fn run(mut links: HostLinks, board: &Board, listen: Duration, policy: Policy) {
    links.switch(true);
    let failure = exchange(links, board, listen, policy).err();
    board.note(|seen| {
        seen.phase = Phase::Ended;
        seen.failure = failure.map(|error| error.to_string());
    });
}

/// Ethernet frames to and from the other one.
struct EthernetTraffic {
    endpoint: Option<PartnerEndpoint>,
    peer: EthernetPeer,
}

impl EthernetTraffic {
    fn new(main_device: &mut MainDevice<HostLinks>) -> EthernetTraffic {
        let MacAddress([.., last]) = main_device.links_mut().addresses().main;
        let peer = EthernetPeer::new(last >> 4 & 1, (main_device.now().0 / CYCLE.as_nanos() as u64) as u16);
        EthernetTraffic { endpoint: main_device.partner_endpoint(), peer }
    }

    fn step(&mut self, board: &Board) {
        let Some(endpoint) = &mut self.endpoint else { return };
        self.peer.receive(endpoint);
        self.peer.send(endpoint, board.frames_per_cycle());
        board.note(|seen| seen.ethernet = self.peer.clone());
    }
}

/// What a cycle has shown.
struct Shown {
    role: MainDeviceRole,
    is_complete: bool,
    is_other_ready: bool,
    /// Cycles since the outputs were written that the image had.
    age: Option<u64>,
}

fn exchange(links: HostLinks, board: &Board, listen: Duration, policy: Policy) -> Result<(), Error> {
    let most = if board.frames_per_cycle() > 0 { MAX_ACYCLIC } else { 0 };
    let options =
        Options::default().with_standby(StandbyOptions::default().with_max_acyclic(most).with_needs_guard(false));
    let mut main_device = MainDevice::request(links, &options);
    let mut ethernet = EthernetTraffic::new(&mut main_device);
    let joining = Joining::begin(&main_device, &policy.with_listen(listen));
    let mut application = join(main_device, joining, &policy, board, &mut ethernet)?;
    application.set_policy(Some(policy));
    let outputs = outputs_of(&application, application.states().len());
    let mut is_running = application.role() == MainDeviceRole::Inactive;
    while !board.is_asked_to_stop() {
        if let Some((request, control)) = board.take_request().zip(application.role_control()) {
            match request {
                Asked::Role(request) => control.request(request),
                Asked::Hold => control.request_hold(false),
            }
        }
        let shown = application.cycle(|data| {
            let phase = match data.role() {
                MainDeviceRole::Active if is_running => Phase::Active,
                MainDeviceRole::Active => Phase::Starting,
                _ => Phase::Inactive,
            };
            // Before the frames of this cycle leave.
            board.note(|seen| seen.begin(phase, data.now()));
            work(data, &outputs)
        });
        ethernet.step(board);
        is_running |= application.all_settled() && shown.is_complete;
        // All SubDevices are configured again.
        is_running &= !note(board, &mut application, &shown);
    }
    application.into_links().switch(false);
    Ok(())
}

/// As [`MainDevice::join`], and notes when it becomes ACTIVE.
fn join(
    mut main_device: MainDevice<HostLinks>,
    mut joining: Joining,
    policy: &Policy,
    board: &Board,
    ethernet: &mut EthernetTraffic,
) -> Result<Application<HostLinks>, Error> {
    let declare = |scan: &Scan| automatic(&scan.subdevices, CYCLE);
    loop {
        main_device.listen(SLICE)?;
        ethernet.step(board);
        while let Some(event) = main_device.pop_event() {
            if let Event::Standby(event) = event.event {
                board.note(|seen| seen.events.push(format!("{event:?}")));
            }
        }
        match joining.next(&mut main_device) {
            Next::Follow => return Ok(main_device.follow(declare)?),
            Next::BecomeActive => {
                let now = main_device.now();
                board.note(|seen| seen.begin(Phase::Starting, now));
                if !main_device.become_active() {
                    board.note(|seen| seen.begin(Phase::Inactive, now));
                    joining = Joining::begin(&main_device, policy);
                    continue;
                }
                match main_device.bring_up(declare) {
                    Ok(application) => return Ok(application),
                    Err(refused) if matches!(refused.error, Error::Scan(ScanError::RoleChanged)) => {
                        main_device = refused.main_device;
                        let now = main_device.now();
                        board.note(|seen| seen.begin(Phase::Inactive, now));
                        joining = Joining::begin(&main_device, policy);
                    }
                    Err(refused) => return Err(refused.error),
                }
            }
            _ => main_device.attend(SLICE),
        }
    }
}

fn work(data: &mut ProcessData<'_>, outputs: &[Range<usize>]) -> Shown {
    let number = (data.now().0 / CYCLE.as_nanos() as u64) as u16;
    let mut age = None;
    for area in outputs.iter().cloned() {
        let bytes = data.outputs_mut(DomainId(0), area).expect("they are outputs");
        if let [low, high, ..] = *bytes
            && (low, high) != (0, 0)
        {
            age = Some(u64::from(number.wrapping_sub(u16::from_le_bytes([low, high]))));
        }
        let pattern = number.to_le_bytes().into_iter().cycle();
        bytes.iter_mut().zip(pattern).for_each(|(byte, value)| *byte = value);
    }
    let status = data.status(DomainId(0)).expect("it is declared");
    Shown {
        role: data.role(),
        is_complete: status.state == DomainState::Complete && status.wkc == status.expected,
        is_other_ready: data.partner().is_ready(),
        age,
    }
}

/// Shows a cycle on the board. Returns whether it took over through INIT.
fn note(board: &Board, application: &mut Application<HostLinks>, shown: &Shown) -> bool {
    let mut events = Vec::new();
    let mut is_cold = false;
    while let Some(event) = application.pop_event() {
        if let Event::Standby(event) = event.event {
            is_cold |= matches!(event, StandbyEvent::TookOver { is_hot: false, .. });
            events.push(format!("{event:?}"));
        }
    }
    let is_active = shown.role == MainDeviceRole::Active;
    board.note(|seen| {
        let has_process_data = seen.phase == Phase::Active;
        seen.cycles += u64::from(has_process_data);
        seen.incomplete += u64::from(has_process_data && !shown.is_complete);
        seen.is_last_complete = shown.is_complete;
        seen.ring = application.ring();
        seen.is_other_ready = is_active && shown.is_other_ready;
        if !is_active {
            seen.followed += 1;
            seen.oldest_followed = seen.oldest_followed.max(shown.age.unwrap_or(0));
        }
        seen.forwarded = application.forwarded();
        seen.events.extend(events);
        seen.cold_takeovers += u32::from(is_cold);
    });
    is_cold
}
