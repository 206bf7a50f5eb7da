//! Waiting for OP ends: with success, or with the SubDevices that are missing and why.

use std::error::Error as StdError;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

use ringcat::shared_segment::SharedSegment;
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{
    ActivateError, AlState, Declaration, Ended, Error, Event, LastOutputs, MainDevice, Options, Reason, Refused,
    SubDeviceConfig, SubDeviceId, SupervisorThread,
};

const SEGMENT: &str = "[segment]\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"servo\"\n\
                       [[device]]\ntype = \"digital-output-8\"\n";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);
const SHORT: Duration = Duration::from_secs(2);

/// The drive is reported to set an object that it does not have.
fn declaration() -> Declaration {
    let mut declaration = Declaration::new(PERIOD);
    declaration.add(SubDeviceConfig::at_position(0));
    declaration.add(SubDeviceConfig::at_position(1).sdo(0x7777, 0, [1]));
    declaration.add(SubDeviceConfig::at_position(2));
    declaration
}

fn main_device() -> Result<MainDevice<SimulatedSegment>, Error> {
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default());
    main_device.scan()?;
    Ok(main_device)
}

// covers: api
#[test]
fn waiting_for_op_says_which_subdevice_is_missing_and_why() -> Result<(), Box<dyn StdError>> {
    let mut application = main_device()?.activate(declaration())?;
    application.links_mut().network_mut().power_off(DeviceIndex(2));
    let begin = application.now();
    let error = application.wait_until_op(SHORT).expect_err("one cannot be configured, one is off");
    let waited = application.now().since(begin);
    assert!((SHORT..SHORT + 2 * PERIOD).contains(&waited), "{waited:?}");
    let Error::NotReady(not_ready) = &error else { return Err(error.into()) };
    let [(drive, failed), (lamps, absent)] = &not_ready.subdevices[..] else { panic!("two are missing: {error}") };
    assert!(drive.to_string().starts_with("SubDevice 1 \""), "{drive}");
    assert!(lamps.to_string().starts_with("SubDevice 2 \""), "{lamps}");
    assert!(matches!(failed, Reason::Configuring { failed: Some(text) } if text.contains("0x7777")), "{failed}");
    assert_eq!(*absent, Reason::Absent);
    // The application goes on, and has missed no event.
    let events: Vec<Event> = std::iter::from_fn(|| application.pop_event()).map(|timed| timed.event).collect();
    assert!(events.iter().any(|event| matches!(event, Event::ConfigurationFailed { subdevice: SubDeviceId(1), .. })));
    assert!(events.iter().any(|event| matches!(event, Event::Lost { subdevice: SubDeviceId(2) })), "{events:?}");
    Ok(())
}

#[test]
fn another_thread_waits_for_op_with_a_limit() -> Result<(), Box<dyn StdError>> {
    let segment = Segment::from_toml(SEGMENT, Path::new("."))?;
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment)?);
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    supervisor.scan()?;
    let application = supervisor.activate(declaration(), cyclic)?;
    let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    let error = cycles.supervisor().wait_until_op(SHORT).expect_err("the drive cannot be configured");
    let text = error.to_string();
    assert!(text.contains("SubDevice 1") && !text.contains("SubDevice 0"), "{text}");
    let Ended { supervisor, links: cyclic, .. } = cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    supervisor.scan()?;
    let mut good = declaration();
    good.subdevices[1].startup.clear();
    let cycles = supervisor.activate(good, cyclic)?.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    cycles.supervisor().wait_until_op(LIMIT)?;
    cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?;
    Ok(())
}

#[test]
fn a_refused_activation_is_an_error_like_any_other_and_names_the_subdevice() -> Result<(), Box<dyn StdError>> {
    fn activate() -> Result<(), Box<dyn StdError>> {
        let mut wrong = declaration();
        wrong.subdevices[1] = SubDeviceConfig::at_position(1).expect_product(1, 2);
        main_device()?.activate(wrong)?;
        Ok(())
    }
    let error = activate().expect_err("another product");
    assert!(error.to_string().starts_with("activation: SubDevice 1: "), "{error}");
    let refused = error.downcast_ref::<Box<Refused<MainDevice<SimulatedSegment>>>>().expect("its own type");
    assert!(matches!(refused.error, Error::Activate(ActivateError::Config { .. })), "{refused:?}");
    Ok(())
}
