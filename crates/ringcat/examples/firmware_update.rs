//! New firmware for one SubDevice while the others stay in OP.
//!
//! `cargo run -p ringcat --example firmware_update`
//!
//! The segment is simulated: its boot loader takes the file `firmware.bin` and checks it before it is used.

use std::error::Error;
use std::time::Duration;

use ringcat::sim::application::foe::firmware;
use ringcat::simulated::SimulatedSegment;
use ringcat::{
    AlState, Application, Declaration, FoeOptions, FoeProgress, LastOutputs, MainDevice, Options, SubDeviceConfig,
    SubDeviceId,
};

const SEGMENT: &str = r#"
[segment]
[[device]]
type = "coupler"
[[device]]
type = "all-protocols"
[[device]]
type = "digital-output-8"
"#;
const LIMIT: Duration = Duration::from_secs(60);

fn main() -> Result<(), Box<dyn Error>> {
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default());
    main_device.scan()?;
    let mut declaration = Declaration::new(Duration::from_millis(1));
    let [_, device, _] = [0, 1, 2].map(|position| declaration.add(SubDeviceConfig::at_position(position)));
    let mut application = main_device.activate(declaration)?;
    application.wait_until_op(LIMIT)?;
    println!("version {}", version(&mut application, device)?);

    let boot = application.subdevice(device).request_state(AlState::Boot);
    application.cycle_until(boot, LIMIT, |_| ())?;
    let image = firmware::image("2.7", &[0x5A; 20_000]);
    let progress = |progress| {
        if let FoeProgress::Busy { done, entire, text } = progress {
            println!("busy: {done} of {entire} {text}");
        }
    };
    let written = application.subdevice(device).foe_write_with("firmware.bin", image, FoeOptions::default(), progress);
    let bytes = application.cycle_until(written, LIMIT, |_| ())?;
    println!("{bytes} bytes written");

    // Its configuration is written again on the way up.
    let back = application.subdevice(device).request_state(AlState::Op);
    application.cycle_until(back, LIMIT, |_| ())?;
    let version = version(&mut application, device)?;
    println!("version {version}");
    application.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    if version == "2.7" { Ok(()) } else { Err("the new firmware does not run".into()) }
}

fn version(application: &mut Application<SimulatedSegment>, device: SubDeviceId) -> Result<String, ringcat::Error> {
    let read = application.subdevice(device).sdo_read::<String>(0x100A, 0);
    application.cycle_until(read, LIMIT, |_| ())
}
