//! Process data between both MainDevices in memory of the application: each sees whole cycles of the other one in its
//! own memory, in both roles, over hand-overs and takeovers, and while frames are lost.

use std::fs::File;
use std::os::unix::fs::FileExt;
use std::sync::Mutex;
use std::time::Duration;

use ringcat::simulated::two_hosts::{HostLinks, TwoHosts};
use ringcat::standby::{MasterSizes, PartnerMemoryError, Policy, RoleRequest, StandbyOptions};
use ringcat::{ActivateError, Error, MainDevice, MainDeviceRole, Options, automatic};
use ringcat_sim::cable::{CableId, Host};
use ringcat_sim::fault::Fault;
use scenarios::pair::Pair;
use scenarios::shared_memory;
use scenarios::two::CYCLE;

use super::ring_of_two;

/// More than a frame in each direction, of different lengths.
const TO_INACTIVE: u16 = 3_000;
const TO_ACTIVE: u16 = 2_000;
const ROOM: usize = 3_100;

/// What the application of a host has seen.
#[derive(Clone, Copy, Debug, Default)]
struct Seen {
    /// Cycles in which the memory had data of the other one, by role: INACTIVE, ACTIVE.
    whole: [u32; 2],
    torn: u32,
    went_back: u32,
    last: u8,
    requested: Option<RoleRequest>,
    is_active: bool,
}

static SEEN: [Mutex<Seen>; 2] = [Mutex::new(NONE), Mutex::new(NONE)];
const NONE: Seen = Seen { whole: [0; 2], torn: 0, went_back: 0, last: 0, requested: None, is_active: false };

fn seen(host: Host) -> std::sync::MutexGuard<'static, Seen> {
    SEEN[host as usize].lock().unwrap_or_else(std::sync::PoisonError::into_inner)
}

fn options() -> Options {
    let mut sizes = MasterSizes::default();
    (sizes.to_inactive, sizes.to_active) = (TO_INACTIVE, TO_ACTIVE);
    Options::default().with_standby(StandbyOptions::default().with_sizes(sizes).with_needs_guard(false))
}

/// Memory, and a mapping of it.
fn memory() -> (File, &'static mut [u8]) {
    let memory = shared_memory::make(ROOM).expect("there is memory");
    let mapped = shared_memory::map(&memory).expect("it can be mapped");
    (memory, mapped)
}

/// All bytes of memory, as another process has them.
fn bytes_of(memory: &File) -> Vec<u8> {
    let mut bytes = vec![0; ROOM];
    memory.read_exact_at(&mut bytes, 0).expect("it is as long");
    bytes
}

/// All bytes of a direction have the same value, and those behind it were never written.
fn is_whole(bytes: &[u8], length: u16) -> bool {
    bytes[..length.into()].iter().all(|byte| *byte == bytes[0])
}

/// Joins, and counts on in what it sends to the other one.
fn program(mut links: HostLinks) {
    let host = links.host();
    links.switch(true);
    let policy = Policy::default().with_time_out(3, Duration::ZERO).with_listen(Duration::from_millis(30));
    let ((_, to), (received, from)) = (memory(), memory());
    let mut given = Some((to, from));
    let joined = MainDevice::request(links, &options()).join(&policy, |scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        let (to, from) = given.take().expect("it is declared once");
        declaration.place_partner_data(to, from);
        declaration
    });
    let mut application = joined.unwrap_or_else(|refused| panic!("{host:?}: {}", refused.error));
    let mut number = 0_u8;
    loop {
        let request = seen(host).requested.take();
        if let Some((request, control)) = request.zip(application.role_control()) {
            control.request(request);
        }
        application.cycle(|data| {
            number = number % 250 + 1;
            data.to_partner_mut().fill(number);
            let is_active = data.role() == MainDeviceRole::Active;
            let length = if is_active { TO_ACTIVE } else { TO_INACTIVE };
            let (bytes, has_any) = (bytes_of(&received), !data.from_partner().is_empty());
            let mut seen = seen(host);
            seen.is_active = is_active;
            if has_any {
                assert_eq!(data.from_partner(), &bytes[..length.into()], "it is the memory");
                seen.torn += u32::from(!is_whole(&bytes, length));
                // It counts from 1 to 250.
                let step = (u32::from(bytes[0]) + 250 - u32::from(seen.last)) % 250;
                seen.went_back += u32::from(seen.last != 0 && step > 125);
                seen.last = bytes[0];
                seen.whole[usize::from(is_active)] += 1;
            }
        });
    }
}

/// Starts on both hosts; the first one is ACTIVE.
fn start() -> TwoHosts {
    let mut hosts = TwoHosts::new(ring_of_two(4, Host::First));
    for host in Host::ALL {
        *seen(host) = NONE;
        hosts.start(host, program).expect("a thread starts");
        hosts.run_for(Duration::from_millis(400));
    }
    hosts.run_for(Duration::from_secs(1));
    hosts
}

fn request(host: Host, request: RoleRequest) {
    seen(host).requested = Some(request);
}

// covers: REQ046, FR-12, FR-15, 9.8, standby
#[test]
fn data_of_the_other_one_is_whole_in_memory_of_the_application_in_both_roles() {
    let mut hosts = start();
    let rounds = 6;
    for round in 0..rounds {
        let (active, other) = match round % 2 {
            0 => (Host::First, Host::Second),
            _ => (Host::Second, Host::First),
        };
        assert!(seen(active).is_active && !seen(other).is_active, "round {round}");
        // Lost frames leave a cycle of the other one incomplete.
        for cable in 0..2 {
            hosts.apply(Fault::Drop { cable: CableId(cable), direction: None, count: 7 });
            hosts.run_for(20 * CYCLE);
        }
        let before = Host::ALL.map(|host| seen(host).whole);
        hosts.run_for(100 * CYCLE);
        let after = Host::ALL.map(|host| seen(host).whole);
        for (host, role) in [(active, 1), (other, 0)] {
            let count = after[host as usize][role] - before[host as usize][role];
            assert!(count >= 95, "round {round}, {host:?}: {count} of 100 cycles");
        }
        request(active, RoleRequest::HandOver);
        hosts.run_for(30 * CYCLE);
    }
    for host in Host::ALL {
        let seen = *seen(host);
        assert_eq!((seen.torn, seen.went_back), (0, 0), "{host:?}: {seen:?}");
    }
    // The ACTIVE fails, and the other one goes on: what has arrived before stays in the memory.
    hosts.guard(Host::First, CYCLE);
    hosts.kill(Host::First);
    hosts.run_for(50 * CYCLE);
    let seen = *seen(Host::Second);
    assert!(seen.is_active && seen.torn == 0 && seen.last != 0, "{seen:?}");
}

// covers: REQ046, standby
#[test]
fn memory_that_is_too_short_is_refused_and_comes_back_and_so_does_a_used_one() {
    let mut pair = Pair::without_programs(23, ring_of_two(3, Host::First));
    pair.start_standby(Host::Second);
    let (sender, results) = std::sync::mpsc::channel();
    let program = move |mut links: HostLinks| {
        links.switch(true);
        let mut main_device = MainDevice::request(links, &options());
        assert!(main_device.become_active());
        let scan = main_device.scan().expect("all are there");
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.place_partner_data(Vec::leak(vec![1; ROOM]), Vec::leak(vec![2; 2_999]));
        let refused = main_device.activate(declaration.clone()).expect_err("a copy has the memory");
        let is_shared =
            matches!(refused.error, Error::Activate(ActivateError::PartnerMemory(PartnerMemoryError::Shared)));
        assert!(is_shared, "{}", refused.error);
        let refused = refused.main_device.activate(declaration).expect_err("it is too short");
        let words = refused.error.to_string();
        let mut main_device = refused.main_device;
        let unused = main_device.unused_partner_memory().expect("it comes back");
        let lengths = [unused.to_partner.len(), unused.from_partner.len()];
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        declaration.place_partner_data(unused.to_partner, Vec::leak(vec![0; ROOM]));
        let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("it fits");
        let first = application.cycle(|data| data.to_partner_mut().to_vec());
        assert_eq!(first, [1; TO_INACTIVE as usize], "the content that it has at the activation");
        application.cycle(|data| data.to_partner_mut().fill(7));
        let back = application.give_partner_memory_back().expect("it was given");
        assert_eq!(back.to_partner, [7; TO_INACTIVE as usize]);
        let is_own = application.give_partner_memory_back().is_none();
        application.cycle(|data| data.to_partner_mut().fill(9));
        sender.send((words, lengths, is_own, back.to_partner[0])).expect("the test waits");
    };
    pair.hosts().start(Host::First, program).expect("a thread starts");
    pair.hosts().run_for(Duration::from_secs(3));
    let (words, lengths, is_own, kept) = results.try_recv().expect("it ends within three seconds");
    assert_eq!(words, "activation: process data between both MainDevices has 3000 bytes, the memory for it 2999");
    assert_eq!((lengths, is_own, kept), ([ROOM, 2_999], true, 7));
}
