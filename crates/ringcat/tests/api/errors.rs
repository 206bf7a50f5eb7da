//! Errors as a program prints them, the whole text at once, and as a program searches them, cause by cause.

use std::error::Error as StdError;
use std::io;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::wire::datagram::Target;
use ringcat::wire::register::map;
use ringcat::{
    ActivateError, BusError, ConfigureError, Declaration, Error, MainDevice, Options, Position, ScanError, SdoFailure,
    ServiceError, StateError, StopError, SubDeviceConfig, SubDeviceFailure, SubDeviceId,
};

const LIMIT: Duration = Duration::from_secs(10);

fn main_device(segment: &str) -> Result<MainDevice<SimulatedSegment>, Box<dyn StdError>> {
    Ok(MainDevice::request(SimulatedSegment::from_toml(segment)?, &Options::default()))
}

/// Errors of a segment as they happen.
fn happened() -> Result<Vec<Box<dyn StdError>>, Box<dyn StdError>> {
    let segment = "[segment]\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n";
    let mut all: Vec<Box<dyn StdError>> = Vec::new();
    let mut device = main_device(segment)?;
    all.push(Box::new(device.subdevice(Position(1)).sdo_read::<u8>(0x1000, 0).expect_err("not scanned")));
    device.scan()?;
    let mut at = |position: u16| device.subdevice(Position(position)).sdo_read::<u32>(0x7777, 0).expect_err("refused");
    all.extend([0, 1, 9].map(|position| Box::new(at(position)) as Box<dyn StdError>));
    let mailbox_device = || Position(1);
    all.push(Box::new(device.subdevice(mailbox_device()).foe_read("missing").expect_err("no such file")));
    all.push(Box::new(
        device.subdevice(mailbox_device()).register_write(map::SII_CONTROL, vec![0; 5_000]).expect_err("long"),
    ));
    let mut wrong = Declaration::new(Duration::from_millis(1));
    wrong.add(SubDeviceConfig::at_position(0).expect_product(1, 2));
    all.push(device.activate(wrong).expect_err("another product"));

    let mut device = main_device(segment)?;
    device.scan()?;
    let mut declaration = Declaration::new(Duration::from_millis(1));
    declaration.add(SubDeviceConfig::at_position(0));
    declaration.add(SubDeviceConfig::at_position(1).sdo(0x7777, 0, [1]));
    let mut application = device.activate(declaration)?;
    all.push(Box::new(application.wait_until_op(LIMIT).expect_err("an object that does not exist")));
    all.push(Box::new(application.input::<u8>(SubDeviceId(1), 0x7777, 0).expect_err("not mapped")));
    all.push(Box::new(SimulatedSegment::from_toml("[segment").expect_err("no TOML")));
    Ok(all)
}

/// Errors inside errors, as far as they go.
fn nested() -> Vec<Box<dyn StdError>> {
    let lost = BusError::Lost { target: Target::Broadcast(map::TYPE), retries: 3 };
    let errors = [
        Error::Scan(ScanError::Bus(lost)),
        Error::Service(ServiceError::Bus(lost)),
        Error::Stop(StopError::Bus(lost)),
        Error::Activate(ActivateError::NoScan),
        Error::Thread(io::Error::other("no more threads")),
        Error::TimedOut { limit: LIMIT },
    ];
    let of_states = [ConfigureError::Bus(lost), ConfigureError::State(StateError::Bus(lost))];
    let of_states = of_states.map(|error| Box::new(SubDeviceFailure::State(error)) as Box<dyn StdError>);
    errors.into_iter().map(|error| Box::new(error) as Box<dyn StdError>).chain(of_states).collect()
}

// covers: api
#[test]
fn the_text_of_an_error_contains_the_text_of_each_cause() -> Result<(), Box<dyn StdError>> {
    let all: Vec<Box<dyn StdError>> = happened()?.into_iter().chain(nested()).collect();
    let mut causes = 0;
    for error in &all {
        let mut level: &dyn StdError = &**error;
        assert!(!level.to_string().is_empty(), "{level:?}");
        while let Some(source) = level.source() {
            assert!(level.to_string().contains(&source.to_string()), "\"{level}\" lacks \"{source}\"");
            (level, causes) = (source, causes + 1);
        }
    }
    assert!(all.len() > 15 && causes > all.len(), "{} errors, {causes} causes", all.len());
    Ok(())
}

/// The causes of an error of this type, outermost first.
fn causes<'a, E: StdError + 'static>(error: &'a (dyn StdError + 'static)) -> Vec<&'a E> {
    let chain = std::iter::successors(Some(error), |level| (*level).source());
    chain.filter_map(|level| level.downcast_ref()).collect()
}

// covers: api
#[test]
fn a_cause_is_found_by_its_type_however_deep_it_is() -> Result<(), Box<dyn StdError>> {
    let lost = BusError::Lost { target: Target::Broadcast(map::TYPE), retries: 3 };
    let deep = SubDeviceFailure::State(ConfigureError::State(StateError::Bus(lost)));
    assert_eq!(causes::<BusError>(&deep), [&lost]);
    let mut device = main_device("[segment]\n[[device]]\ntype = \"all-protocols\"\n")?;
    device.scan()?;
    let error = device.subdevice(Position(0)).sdo_read::<u32>(0x7777, 0).expect_err("refused");
    let aborted = causes::<SdoFailure>(&error);
    assert!(matches!(aborted[..], [SdoFailure::Aborted(_)]), "{error:?}");
    Ok(())
}
