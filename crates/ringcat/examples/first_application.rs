//! A first application: a running light on an output terminal, and a button that stops it.
//!
//! `cargo run -p ringcat --example first_application`
//!
//! The segment is simulated. Another implementation of [`ringcat::Links`] puts the same application on other links.

use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{Declaration, DomainConfig, DomainId, DomainMember, MainDevice, Options, SubDeviceConfig};

const SEGMENT: &str = r#"
[segment]
ring = true
[[device]]
type = "coupler"
[[device]]
type = "digital-output-8"
name = "lamps"
[[device]]
type = "digital-input-8"
name = "buttons"
"#;

/// Indices in the declaration below.
const LAMPS: usize = 1;
const BUTTONS: usize = 2;

fn main() -> Result<(), ringcat::Error> {
    let segment = SimulatedSegment::from_toml(SEGMENT)?;
    let mut main_device = MainDevice::request(segment, &Options::default());
    for info in &main_device.scan()?.subdevices {
        println!("{}: {} (product {:#010x})", info.position, info.name, info.identity.product_code);
    }

    // What is expected: vendor and product where it matters, anything at position 0.
    let catalogue = 0x0000_0C47;
    let subdevices = vec![
        SubDeviceConfig::at_position(0),
        SubDeviceConfig::at_position(1).expect_product(catalogue, 0x07D8_0008),
        SubDeviceConfig::at_position(2).expect_product(catalogue, 0x03F0_0008),
    ];
    let members = [LAMPS, BUTTONS].map(|subdevice| DomainMember { subdevice, sync_managers: None });
    let domains = vec![DomainConfig::new(Duration::from_millis(1), members.into())];
    let mut application = main_device.activate(Declaration { subdevices, domains, ..Declaration::default() })?;

    // Places of PDO entries: object index and subindex, as in the SubDevice's documentation.
    let lamps: Vec<_> = (0..8).filter_map(|channel| application.entry(LAMPS, 0x7000 + 0x10 * channel, 1)).collect();
    let stop = application.entry(BUTTONS, 0x6000, 1);
    assert_eq!(lamps.len(), 8, "the terminal has eight channels");

    for _ in 0..500 {
        application.cycle(|data| {
            let stopped = stop.is_some_and(|stop| data.read(&stop) != 0);
            let lit = (data.cycle() / 50 % 8) as usize;
            for (channel, lamp) in lamps.iter().enumerate() {
                data.write(lamp, u64::from(channel == lit && !stopped));
            }
        });
        while let Some(event) = application.pop_event() {
            println!("{:>9.3} ms  {}", event.at.0 as f64 / 1e6, describe(&event, &Names::default()));
        }
    }
    let status = application.exchange_mut().status(DomainId(0));
    println!("working counter {} of {} after 500 cycles", status.wkc, status.expected);
    Ok(())
}
