//! Two controllers at one simulated ring, in virtual time: one is ACTIVE, the other one follows. The ACTIVE is killed,
//! a guard takes its links down, and the other one goes on with its process data. No SubDevice leaves OP.

use std::time::Duration;

use ringcat::sim::cable::Host;
use ringcat::sim::catalogue;
use ringcat::sim::device::Device;
use ringcat::sim::network::Network;
use ringcat::sim::network::builder::SegmentBuilder;
use ringcat::simulated::two_hosts::{HostLinks, TwoHosts};
use ringcat::standby::{Policy, StandbyOptions};
use ringcat::text::{Names, describe};
use ringcat::{AlState, AlStatus, Error, Event, MainDevice, Options, automatic};

const CYCLE: Duration = Duration::from_millis(1);

/// The program of each controller. The one that listens for a shorter time becomes ACTIVE first.
fn controller(mut links: HostLinks, listen: Duration) -> Result<(), Error> {
    let host = links.host();
    // Links are up only while the program forwards or is ACTIVE.
    links.switch(true);
    let options = Options::default().with_standby(StandbyOptions::default().with_needs_guard(false));
    let policy = Policy::default().with_time_out(3, Duration::ZERO).with_listen(listen);
    let main_device = MainDevice::request(links, &options);
    let mut application = main_device.join(&policy, |scan| automatic(&scan.subdevices, CYCLE))?;
    println!("{host:?} begins {}", application.role());
    loop {
        // The same in both roles: what it writes to outputs leaves as ACTIVE only.
        application.cycle(|_data| ());
        while let Some(event) = application.pop_event() {
            if matches!(event.event, Event::Standby(_)) {
                println!("{host:?}: {}", describe(&event, &Names::default()));
            }
        }
    }
}

fn in_op(network: &mut Network) -> usize {
    network.devices().filter(|device| device.al_status() == AlStatus::new(AlState::Op)).count()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let kinds = ["coupler", "digital-output-8", "digital-input-8", "servo"];
    let devices = kinds.iter().filter_map(|kind| catalogue::by_name(kind)).map(Device::new).collect();
    let mut hosts = TwoHosts::new(SegmentBuilder::ring_of_two(devices, Host::First).build()?);
    for (host, listen) in [(Host::First, Duration::from_millis(10)), (Host::Second, Duration::from_millis(500))] {
        hosts.start(host, move |links| {
            if let Err(error) = controller(links, listen) {
                eprintln!("{error}");
            }
        })?;
    }
    hosts.run_for(Duration::from_secs(1));
    println!("{} SubDevices in OP; the first controller dies", hosts.with_network(in_op));
    hosts.guard(Host::First, CYCLE);
    hosts.kill(Host::First);
    hosts.run_for(Duration::from_secs(1));
    println!("{} SubDevices in OP, by the second controller", hosts.with_network(in_op));
    Ok(())
}
