//! Tests of declared connections while cables change: no connection is accepted without a test, and no port stays
//! closed.

use std::time::Duration;

use ringcat::{JunctionConnection, JunctionError, JunctionMode, MainDevice, Options, SubDeviceId, automatic};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_wire::register::map;
use scenarios::segments::RING_OF_THREE;
use scenarios::tap::Tap;
use scenarios::world::CYCLE;

use super::{STRICT, one_ring};

const SECOND: Duration = Duration::from_secs(1);
/// Maximum time of a test.
const LIMIT: Duration = Duration::from_secs(20);
/// The members of the ring behind the junction end one SubDevice later.
const WRONG: JunctionConnection = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(3), 1);

fn idle(mode: JunctionMode) -> MainDevice<Tap> {
    let options = Options::default().with_idle_operation(true).with_junctions(mode);
    MainDevice::request(Tap::new(one_ring()), &options)
}

/// Positions of SubDevices with closed ports, or temporary settings.
fn closed(network: &Network) -> Vec<usize> {
    let control = |device: &ringcat_sim::device::Device| device.controller.register(map::DL_CONTROL, 2).to_vec();
    let is_closed = |control: Vec<u8>| control[0] & 2 != 0 || control[1] != 0;
    network.devices().map(control).enumerate().filter(|(_, it)| is_closed(it.clone())).map(|(at, _)| at).collect()
}

/// A cable that is cut, or repaired, at any moment of a test: the test is repeated, or gives no result.
// covers: JR-05, JR-06, junctions
#[test]
fn a_wrong_connection_is_not_accepted_while_cables_change() {
    let mut tested = 0;
    for (after, declared) in (0..20).flat_map(|after| [(after, WRONG), (after, STRICT)]) {
        for cable in [CableId(RING_OF_THREE[1]), CableId(7)] {
            let mut main_device = idle(JunctionMode::Strict);
            main_device.attend(SECOND);
            main_device.load(automatic(&main_device.subdevices(), CYCLE)).expect("it fits");
            main_device.add_junction_connection(declared).expect("ports that exist");
            let mut check = main_device.engine_mut().start_connection_check();
            main_device.attend(Duration::from_micros(150 * after));
            main_device.links_mut().network_mut().apply(Fault::Cut(cable));
            main_device.attend(Duration::from_millis(2));
            main_device.links_mut().network_mut().apply(Fault::Heal(cable));
            let until = main_device.now() + LIMIT;
            let checked = loop {
                main_device.attend(Duration::from_millis(20));
                assert!(main_device.now() < until, "{declared}, {cable:?}, {after}");
                if let Some(checked) = check.take() {
                    break checked;
                }
            };
            main_device.attend(Duration::from_millis(1_400));
            let is_right = match checked {
                Ok(()) => declared == STRICT,
                Err(JunctionError::NotThere { .. }) => declared == WRONG,
                Err(error) => error == JunctionError::NotTested,
            };
            assert!(is_right, "{declared}, {cable:?}, {after}: {checked:?}");
            assert_eq!(closed(main_device.links_mut().network()), [0; 0], "{declared}, {cable:?}, {after}");
            tested += usize::from(checked != Err(JunctionError::NotTested));
        }
    }
    assert!(tested > 50, "{tested} of 80 were tested");
}
