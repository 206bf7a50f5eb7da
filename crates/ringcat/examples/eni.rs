//! An application over an ENI: variables by the names of the file, on a segment that is simulated from it.
//!
//! `cargo run -p ringcat --example eni [FILE]`
//!
//! Without a file it is the machine in `machine.eni.xml`. Another implementation of [`ringcat::Links`] puts the same
//! application on a real network; `ringcat run --eni FILE` does so without a line of code.

use std::error::Error;
use std::path::Path;

use ringcat::eni::{EniFile, EniImage};
use ringcat::simulated::SimulatedSegment;
use ringcat::text::describe;
use ringcat::{Direction, MainDevice, Options};

const MACHINE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/machine.eni.xml");

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| MACHINE.to_owned());
    let file = EniFile::load(Path::new(&path))?;
    for notice in &file.configuration.notices {
        println!("not followed: {notice}");
    }
    let mut main_device = MainDevice::request(SimulatedSegment::new(file.simulated(false)?), &Options::default());
    let found = main_device.scan()?.subdevices;
    for difference in file.compare(&found) {
        println!("{difference}");
    }
    let mut application = main_device.activate(file.declaration(false)).map_err(ringcat::Error::from)?;
    let mut image = EniImage::new(&file.configuration, application.directory())?;
    application.set_copies(image.copies())?;
    // Names are looked up once; in a cycle only places count.
    let outputs: Vec<_> =
        image.variables().iter().filter(|variable| variable.direction == Direction::Outputs).cloned().collect();

    let mut cycle = 0_u64;
    while cycle < 2_000 || !application.all_settled() {
        application.cycle(|data| {
            image.take_inputs(data);
            for (number, variable) in (0..).zip(&outputs) {
                image.write(variable, cycle / 100 + number);
            }
            image.give_outputs(data);
        });
        while let Some(event) = application.pop_event() {
            println!("{:>9.3} ms  {}", event.at.0 as f64 / 1e6, describe(&event, &file.names()));
        }
        cycle += 1;
        if cycle > 60_000 {
            return Err("not all SubDevices are in OP after a minute".into());
        }
    }
    for variable in image.variables() {
        let value = image.value(variable).map_or_else(|| "...".to_owned(), |value| value.to_string());
        println!("{} {} = {value}", variable.direction, variable.name);
    }
    Ok(())
}
