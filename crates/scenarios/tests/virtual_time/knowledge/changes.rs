//! The segment changes between the last frame of the former owner and the first one of the next.

use super::*;
use ringcat::{Instant, Link, Links, PerLink};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_wire::al::AlControl;
use ringcat_wire::frame::MacAddress;
use scenarios::segments::describe;

/// Applies faults, with a pause after each, while the segment has no owner.
fn meanwhile(links: &mut Tap, faults: &[Fault]) {
    for fault in faults {
        links.network_mut().apply(fault.clone());
        links.network_mut().advance_by(Duration::from_millis(50));
    }
    links.network_mut().advance_by(Duration::from_millis(50));
}

/// The result of [`Event::Resumed`].
fn result(main_device: &mut MainDevice<Tap>) -> (usize, usize, bool) {
    let resumed = events(main_device).into_iter().find_map(|event| match event {
        Event::Resumed { subdevices, in_state, differs } => Some((subdevices, in_state, differs)),
        _ => None,
    });
    resumed.expect("it is reported")
}

// covers: states
#[test]
fn a_subdevice_that_lost_its_power_is_brought_up_and_the_others_stay() {
    for handover in HANDOVERS {
        for (network, lost) in networks().into_iter().flat_map(|_| 0..MIXED.len()).enumerate() {
            let network = networks().into_iter().nth(network / MIXED.len()).expect("two networks");
            let former = idle(network);
            let bytes = to_bytes(&former);
            let mut links = former.into_links();
            let device = DeviceIndex(lost);
            meanwhile(&mut links, &[Fault::PowerOff(device), Fault::PowerOn(device)]);
            let mut main_device = resumed(links, &bytes, handover);
            assert_eq!(result(&mut main_device), (MIXED.len(), MIXED.len() - 1, true));
            for _ in 0..FOLLOWED.as_millis() {
                main_device.attend(Duration::from_millis(1));
                let now = statuses(&mut main_device);
                assert!(now.iter().enumerate().all(|(at, status)| at == lost || *status == PREOP), "{now:?}");
            }
            assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
            exchange_sdos(&mut main_device);
            settle(&mut activate(main_device));
        }
    }
}

// covers: states
#[test]
fn a_subdevice_that_was_sent_to_init_is_reported_and_brought_back() {
    for handover in HANDOVERS {
        for network in networks() {
            let mut former = idle(network);
            let bytes = to_bytes(&former);
            // Another MainDevice, unknown to this one.
            let init = AlControl::new(AlState::Init).bits();
            former.subdevice(Position(3)).register_write::<u16>(map::AL_CONTROL, init).expect("it is written");
            let mut links = former.into_links();
            meanwhile(&mut links, &[]);
            let mut main_device = resumed(links, &bytes, handover);
            let all = events(&mut main_device);
            let count = MIXED.len();
            assert!(
                all.contains(&Event::Resumed { subdevices: count, in_state: count - 1, differs: false }),
                "{all:?}"
            );
            let is_it = |event: &&Event| matches!(event, Event::UndeclaredState { position: Position(3), .. });
            assert_eq!(all.iter().filter(is_it).count(), 1, "{all:?}");
            main_device.attend(FOLLOWED);
            assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
            exchange_sdos(&mut main_device);
        }
    }
}

// covers: states
#[test]
fn cables_that_were_cut_or_healed_are_followed_without_an_sii() {
    for handover in HANDOVERS {
        for cable in 0..=MIXED.len() {
            let (cut, heal) = (Fault::Cut(CableId(cable)), Fault::Heal(CableId(cable)));
            let mut former = idle(ring(descriptions(&MIXED), NetworkOptions::default()));
            spoil_siis(&mut former);
            let bytes = to_bytes(&former);
            let mut links = former.into_links();
            meanwhile(&mut links, std::slice::from_ref(&cut));
            let mut main_device = resumed(links, &bytes, handover);
            assert_eq!(result(&mut main_device), (MIXED.len(), MIXED.len(), true), "cable {cable}");
            exchange_sdos(&mut main_device);
            let bytes = to_bytes(&main_device);
            let mut links = main_device.into_links();
            meanwhile(&mut links, &[heal]);
            let mut main_device = resumed(links, &bytes, handover);
            assert_eq!(result(&mut main_device), (MIXED.len(), MIXED.len(), true), "cable {cable}");
            assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
            exchange_sdos(&mut main_device);
            settle(&mut activate(main_device));
        }
    }
}

// covers: states
#[test]
fn what_is_behind_a_cut_line_is_missing_and_comes_back() {
    for handover in HANDOVERS {
        for cable in 1..MIXED.len() {
            let former = idle(line(descriptions(&MIXED), NetworkOptions::default()));
            let bytes = to_bytes(&former);
            let mut links = former.into_links();
            meanwhile(&mut links, &[Fault::Cut(CableId(cable))]);
            let mut main_device = resumed(links, &bytes, handover);
            assert_eq!(result(&mut main_device), (cable, cable, true));
            main_device.attend(FOLLOWED);
            main_device.links_mut().network_mut().apply(Fault::Heal(CableId(cable)));
            main_device.attend(FOLLOWED);
            assert_eq!(main_device.subdevices().len(), MIXED.len());
            assert_eq!(statuses(&mut main_device), [PREOP; MIXED.len()]);
            exchange_sdos(&mut main_device);
        }
    }
}

// covers: states
#[test]
fn a_segment_that_is_unplugged_for_a_moment_is_waited_for() {
    for handover in HANDOVERS {
        let former = idle(line(descriptions(&MIXED), NetworkOptions::default()));
        let bytes = to_bytes(&former);
        let mut links = former.into_links();
        meanwhile(&mut links, &[Fault::Cut(CableId(0))]);
        let back = links.network().now() + Duration::from_millis(300);
        links.network_mut().schedule(back, Fault::Heal(CableId(0)));
        let mut main_device = resumed(links, &bytes, handover);
        assert_eq!(result(&mut main_device), (MIXED.len(), MIXED.len(), false));
        exchange_sdos(&mut main_device);
    }
}

// covers: states
#[test]
fn subdevices_that_were_exchanged_are_not_taken_for_the_known_ones() {
    let kinds = ["servo", "digital-output-8", "digital-input-8", "servo"];
    for handover in HANDOVERS {
        for is_ring in [false, true] {
            let build = |kinds: &[&str]| match is_ring {
                true => ring(descriptions(kinds), NetworkOptions::default()),
                false => line(descriptions(kinds), NetworkOptions::default()),
            };
            let former = idle(build(&kinds));
            let bytes = to_bytes(&former);
            // Other SubDevices, freshly switched on, at the places of known ones.
            let other = ["digital-output-8", "servo", "digital-input-8", "analog-input-4"];
            let mut main_device = resumed(Tap::new(build(&other)), &bytes, handover);
            assert_eq!(result(&mut main_device), (4, 0, true));
            main_device.attend(Duration::from_secs(1));
            let names: Vec<String> = main_device.subdevices().into_iter().map(|info| info.name).collect();
            assert!(names.iter().zip(other).all(|(name, kind)| name.starts_with(kind)), "{names:?}");
            assert_eq!(statuses(&mut main_device), [PREOP; 4]);
            exchange_sdos(&mut main_device);
        }
    }
}

// covers: states
#[test]
fn other_controllers_at_known_station_addresses_are_not_taken_for_the_known_ones() {
    for handover in HANDOVERS {
        // Another MainDevice has scanned a machine with the same number of other SubDevices.
        let former = idle(line(descriptions(&["servo", "digital-output-8", "servo"]), NetworkOptions::default()));
        let bytes = to_bytes(&former);
        let others = ["servo", "servo", "digital-output-8"].map(|kind| describe(kind, kind));
        let mut other = idle(line(others.into(), NetworkOptions::default()));
        let own = other.subdevices();
        assert_eq!(own[0].station, former.subdevices()[0].station);
        events(&mut other);
        let mut main_device = resumed(other.into_links(), &bytes, handover);
        let (subdevices, _, differs) = result(&mut main_device);
        assert_eq!((subdevices, differs), (3, true));
        main_device.attend(Duration::from_secs(1));
        let identities = |all: &[ringcat::SubDeviceInfo]| all.iter().map(|info| info.identity).collect::<Vec<_>>();
        assert_eq!(identities(&main_device.subdevices()), identities(&own));
        exchange_sdos(&mut main_device);
    }
}

/// A segment whose last cable is cut or healed before each round of reads that compares the segment with the knowledge.
struct Flickering {
    tap: Tap,
    is_cut: bool,
    /// The second round has the same result as the first one: this shows that ports of a crashed owner are not the
    /// cause.
    is_twice: bool,
}

impl Links for Flickering {
    fn now(&self) -> Instant {
        self.tap.now()
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        self.tap.addresses()
    }

    fn send(&mut self, link: Link, frame: &[u8]) {
        // APRD of the first 20 registers.
        let is_compared = |at: &[u8]| at[0] == 1 && at[4..8] == [0, 0, 20, 0x80];
        if link == Link::Main && frame[16..].windows(8).any(is_compared) {
            let last = CableId(self.tap.network().cables().len() - 1);
            self.is_cut = !self.is_cut || std::mem::take(&mut self.is_twice);
            let fault = if self.is_cut { Fault::Cut(last) } else { Fault::Heal(last) };
            self.tap.network_mut().apply(fault);
        }
        self.tap.send(link, frame);
    }

    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.tap.receive(take)
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        self.tap.carrier(link)
    }

    fn wait(&mut self, until: Instant) {
        self.tap.wait(until);
    }
}

// covers: states
#[test]
fn resume_fails_with_a_reason_if_the_segment_changes_after_each_scan() {
    for handover in HANDOVERS {
        let instantly = NetworkOptions::default().with_detection_delay(Duration::ZERO);
        let former = idle(line(descriptions(&["servo", "digital-input-8"]), instantly));
        let bytes = to_bytes(&former);
        let mut tap = former.into_links();
        let begun = tap.now();
        tap.set_limit(begun + Duration::from_secs(10));
        let links = Flickering { tap, is_cut: false, is_twice: handover == Handover::AfterCrash };
        let mut main_device = MainDevice::request(links, &options());
        let knowledge = Knowledge::from_bytes(&bytes).expect("they were written");
        let error = main_device.resume(knowledge, handover).expect_err("it does not become stable");
        let (took, text) = (main_device.now().since(begun), error.to_string());
        assert!(took <= Duration::from_secs(6), "{took:?}: {text}");
        assert!(text.contains("differs again after each of"), "{text}");
    }
}
