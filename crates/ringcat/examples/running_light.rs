//! A first application: a running light on an output terminal, and a button that stops it.
//!
//! `cargo run -p ringcat --example running_light`
//!
//! The segment is simulated. Another implementation of [`ringcat::Links`] puts the same application on other links.

use std::error::Error;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{
    AlState, Declaration, DomainId, Freshness, LastOutputs, MainDevice, MapError, Options, Output, SubDeviceConfig,
};

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

/// Vendor of the simulator's devices.
const VENDOR: u32 = 0x0000_0C47;
const LIMIT: Duration = Duration::from_secs(10);

fn main() -> Result<(), Box<dyn Error>> {
    let segment = SimulatedSegment::from_toml(SEGMENT)?;
    let mut main_device = MainDevice::request(segment, &Options::default());
    for info in &main_device.scan()?.subdevices {
        println!("{}: {} (product {:#010x})", info.position, info.name, info.identity.product_code);
    }

    // What is expected: vendor and product where it matters, anything at position 0.
    let mut declaration = Declaration::new(Duration::from_millis(1));
    declaration.add(SubDeviceConfig::at_position(0));
    let lamps = declaration.add(SubDeviceConfig::at_position(1).expect_product(VENDOR, 0x07D8_0008));
    let buttons = declaration.add(SubDeviceConfig::at_position(2).expect_product(VENDOR, 0x03F0_0008));
    let mut application = main_device.activate(declaration)?;

    // Process data by index, as in the SubDevice's documentation, and by name.
    let lights: Vec<Output<bool>> =
        (0..8).map(|channel| application.output(lamps, 0x7000 + 0x10 * channel, 1)).collect::<Result<_, MapError>>()?;
    let stop = application.input_named::<bool>(buttons, "Channel 1.Input")?;

    application.wait_until_op(LIMIT)?;
    for _ in 0..500 {
        application.cycle(|data| {
            // Inputs count while they are fresh: those of a SubDevice that does not answer keep their last values.
            let fresh = data.freshness(DomainId(0), buttons) == Freshness::Fresh;
            let stopped = fresh && data.get(stop);
            let lit = (data.cycle() / 50 % 8) as usize;
            for (channel, light) in lights.iter().enumerate() {
                data.set(*light, channel == lit && !stopped);
            }
        });
        while let Some(event) = application.pop_event() {
            println!("{:>9.3} ms  {}", event.at.0 as f64 / 1e6, describe(&event, &Names::default()));
        }
    }
    let status = application.exchange().status(DomainId(0)).ok_or("no such domain")?;
    println!("working counter {} of {} after 500 cycles", status.wkc, status.expected);
    application.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}
