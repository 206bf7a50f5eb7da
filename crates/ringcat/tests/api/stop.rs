//! Orderly stops and the grid of cycles, on a simulated segment in virtual time.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Application, LastOutputs, MainDevice, Options, automatic};
use ringcat_sim::network::Network;
use ringcat_sim::time::SimTime;
use ringcat_wire::al::{AlState, AlStatus};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\n\
                       type = \"digital-output-8\"\n\
                       [[device]]\ntype = \"emulated-output-8\"\n[[device]]\ntype = \"servo\"\n";
const LIMIT: Duration = Duration::from_secs(1);

fn in_op() -> Application<SimulatedSegment> {
    let links = SimulatedSegment::from_toml(SEGMENT).expect("a good segment");
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("four SubDevices");
    let declaration = automatic(&scan.subdevices, Duration::from_millis(1));
    let mut application = main_device.activate(declaration).expect("fits a frame");
    for _ in 0..5_000 {
        if application.all_settled() {
            break;
        }
        application.cycle(|data| data.fill_outputs(0xFF));
    }
    assert!(application.all_settled());
    for _ in 0..5 {
        application.cycle(|data| data.fill_outputs(0xFF));
    }
    assert_eq!(outputs(application.links().network())[0], [0xFF]);
    application
}

fn outputs(network: &Network) -> Vec<Vec<u8>> {
    let all = network.devices().map(|device| device.outputs().to_vec());
    all.filter(|bytes| !bytes.is_empty()).collect()
}

// covers: stop
#[test]
fn an_orderly_stop_zeroes_outputs_and_sets_all_to_init() {
    let application = in_op();
    let before = application.acyclic_counters();
    let mut main_device = application.stop(LastOutputs::Zero, AlState::Init, LIMIT).expect("all go to INIT");
    let after = main_device.acyclic_counters();
    assert!(before.sent > 0 && after.sent > before.sent && after.received > before.received, "counted on: {after:?}");
    let network = main_device.links_mut().network();
    assert!(network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Init)));
    assert!(outputs(network).iter().flatten().all(|byte| *byte == 0));
    assert_eq!(main_device.scan().expect("a stopped MainDevice scans again").subdevices.len(), 4);
}

// covers: stop
#[test]
fn a_stop_may_leave_the_outputs_alone_and_end_in_safeop() {
    let mut main_device = in_op().stop(LastOutputs::Held, AlState::SafeOp, LIMIT).expect("all go to SAFEOP");
    let network = main_device.links_mut().network();
    assert!(network.devices().all(|device| device.al_status() == AlStatus::new(AlState::SafeOp)));
}

// covers: cycles
#[test]
fn cycles_that_a_stall_has_passed_over_are_left_out_and_counted() {
    let mut application = in_op();
    let before = application.pace();
    assert_eq!((before.late, before.skipped), (0, 0));
    let stalled_until = application.now() + Duration::from_micros(3_500);
    application.links_mut().network_mut().advance(SimTime(stalled_until.0));
    application.cycle(|_| ());
    let pace = application.pace();
    assert_eq!((pace.cycles, pace.late, pace.skipped), (before.cycles + 1, 1, 2));
    assert_eq!(pace.last_delay, Duration::from_micros(2_500));
    application.cycle(|_| ());
    assert_eq!(application.pace().last_delay, Duration::ZERO);
}
