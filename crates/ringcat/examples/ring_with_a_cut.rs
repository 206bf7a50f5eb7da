//! Cable redundancy: a cable of the ring is cut and healed while outputs and inputs go on.
//!
//! `cargo run -p ringcat --example ring_with_a_cut` on a simulated ring. On interfaces, `PacketLinks::open("eth1",
//! Some("eth2"), ..)` makes a ring of two; the rest stays as it is.

use std::error::Error;
use std::time::Duration;

use ringcat::sim::cable::DeviceIndex;
use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{
    AlState, Application, Declaration, DomainId, DomainState, LastOutputs, MainDevice, Options, Output, RingState,
    SubDeviceConfig,
};

const SEGMENT: &str = r#"
[segment]
ring = true
[[device]]
type = "coupler"
[[device]]
type = "digital-output-8"
[[device]]
type = "servo"
"#;
const LIMIT: Duration = Duration::from_secs(10);
const DOMAIN: DomainId = DomainId(0);

fn main() -> Result<(), Box<dyn Error>> {
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default());
    main_device.scan()?;
    let mut declaration = Declaration::new(Duration::from_millis(1));
    let [_, lamps, _] = [0, 1, 2].map(|position| declaration.add(SubDeviceConfig::at_position(position)));
    let mut application = main_device.activate(declaration)?;
    let lamp = application.output::<bool>(lamps, 0x7000, 1)?;
    application.wait_until_op(LIMIT)?;
    run(&mut application, lamp, 2_000);
    println!("ring {:?}, redundancy: {:?}", application.ring(), application.ring_status().redundancy);

    // Between the terminal and the drive.
    let network = application.links_mut().network_mut();
    let cable = network.cable_between(DeviceIndex(1), DeviceIndex(2)).ok_or("no such cable")?;
    network.cut(cable);
    let incomplete = run(&mut application, lamp, 2_000);
    println!("{incomplete} incomplete cycles while the cable was cut");
    let status = application.ring_status();
    let place = status.place.map(|cable| Names::default().cable(cable, status.place_ends));
    println!("ring {:?}, broken {}", status.state, place.as_deref().unwrap_or("at an unknown place"));
    if application.ring() != RingState::Open || !application.all_settled() {
        return Err("the break was not noticed, or SubDevices have left OP".into());
    }

    application.links_mut().network_mut().heal(cable);
    run(&mut application, lamp, 2_000);
    if application.ring() != RingState::Closed {
        return Err("the ring is not closed again".into());
    }
    application.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}

/// Runs cycles, shows events, and counts cycles in which not all SubDevices took part.
fn run(application: &mut Application<SimulatedSegment>, lamp: Output<bool>, cycles: u32) -> u32 {
    let mut incomplete = 0;
    for _ in 0..cycles {
        let is_complete = application.cycle(|data| {
            data.set(lamp, data.cycle() / 100 % 2 == 0);
            data.status(DOMAIN).is_ok_and(|status| status.state == DomainState::Complete)
        });
        incomplete += u32::from(!is_complete);
        while let Some(event) = application.pop_event() {
            println!("{:>9.3} ms  {}", event.at.0 as f64 / 1e6, describe(&event, &Names::default()));
        }
    }
    incomplete
}
