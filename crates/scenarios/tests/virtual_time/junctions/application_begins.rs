//! An application begins while ports are closed for a moment: in a test of a declared connection, or in a scan that
//! examines a ring. Evaluated by the loop settings inside the SubDevices.

use std::time::Duration;

use ringcat::{Application, Error, JunctionConnection, JunctionMode, MainDevice, Options, SubDeviceId, automatic};
use ringcat_sim::cable::CableId;
use ringcat_sim::network::Network;
use ringcat_wire::register::map;
use scenarios::tap::Tap;
use scenarios::world::CYCLE;

use super::{ONE, one_ring};

const SECOND: Duration = Duration::from_secs(1);
/// Time from the start of an application until all ports must be open: a frame that was sent before may still close
/// ports, another one opens them.
const OPENED: Duration = Duration::from_millis(5);
/// Maximum duration of the start of an application.
const STARTED: Duration = Duration::from_millis(300);
/// The cable to the last SubDevice.
const BRANCH: CableId = CableId(7);

fn idle(network: Network) -> MainDevice<Tap> {
    let options = Options::default().with_idle_operation(true).with_junctions(JunctionMode::Automatic);
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    main_device.attend(SECOND);
    main_device
}

fn are_closed(network: &Network) -> bool {
    network.devices().any(|device| device.controller.register(map::DL_CONTROL, 2)[1] != 0)
}

/// Starts an application with the known SubDevices, for this time: no port is closed while it runs, and all reach OP
/// in time. Returns whether ports were closed when it began.
fn begin(main_device: MainDevice<Tap>, time: Duration, what: &str) -> bool {
    let declaration = automatic(&main_device.subdevices(), CYCLE);
    let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
    let was_closed = are_closed(application.links().network());
    let begun = application.now();
    let since = |application: &Application<Tap>| application.now().since(begun);
    while since(&application) < time {
        application.cycle(|_| ());
        let network = application.links().network();
        let is_late = since(&application) > OPENED && are_closed(network);
        assert!(!is_late, "{what}: ports are closed after {:?}", since(&application));
        let is_up = since(&application) < STARTED || application.all_settled();
        assert!(is_up, "{what}: after {:?} {:?}", since(&application), application.states());
    }
    was_closed
}

/// Behind the last SubDevice there is no cable: no frame returns while that connection is tested, and each test takes
/// more than a second.
// covers: JR-05, JR-06, junctions, states
#[test]
fn a_test_of_a_connection_ends_when_an_application_begins() {
    let mut were_closed = 0;
    for (number, after) in [400, 800, 1_200, 1_600, 2_000, 500_000, 1_320_000, 2_000_000].into_iter().enumerate() {
        for wrong in [3, 6] {
            let mut main_device = idle(one_ring());
            main_device.load(automatic(&main_device.subdevices(), CYCLE)).expect("it fits");
            let connection = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(wrong), 1);
            main_device.add_junction_connection(connection).expect("ports that exist");
            let mut check = Some(main_device.engine_mut().start_connection_check());
            main_device.attend(Duration::from_micros(after));
            // The caller may stop waiting for the result.
            check = check.filter(|_| number % 2 == 0);
            were_closed += usize::from(begin(main_device, 2 * SECOND, &format!("{wrong}, {after} us")));
            drop(check);
        }
    }
    assert!(were_closed > 3, "{were_closed}");
}

/// A branch is connected, and the scan that follows examines the ring; the application does not wait for the end of the
/// scan.
// covers: JR-03, junctions, states
#[test]
fn ports_that_a_scan_has_closed_are_opened_when_an_application_begins() {
    for after in [0, 10, 20, 30, 40].map(Duration::from_micros) {
        let mut network = one_ring();
        network.cut(BRANCH);
        network.advance_by(Duration::from_millis(1));
        let mut main_device = idle(network);
        assert_eq!(main_device.subdevices().len(), ONE.len() - 1);
        main_device.links_mut().network_mut().heal(BRANCH);
        let healed = main_device.now();
        while !are_closed(main_device.links_mut().network()) {
            assert!(main_device.now().since(healed) < SECOND, "no ring is examined");
            main_device.attend(Duration::from_micros(5));
        }
        main_device.attend(after);
        begin(main_device, STARTED + OPENED, &format!("{after:?}"));
    }
}
