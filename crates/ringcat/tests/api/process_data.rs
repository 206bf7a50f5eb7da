//! Process data by index and by name, with types; what is wrong is said before the cycles, with what is mapped.

use std::error::Error as StdError;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{
    Application, Declaration, DomainId, DomainState, Entry, MainDevice, MapError, Options, SubDeviceConfig,
    SubDeviceId, Wanted, WriteError,
};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"servo\"\n[[device]]\ntype = \"digital-output-8\"\n\
                       [[device]]\ntype = \"digital-input-8\"\n";
const PERIOD: Duration = Duration::from_millis(1);
const LIMIT: Duration = Duration::from_secs(20);

struct Plant {
    application: Application<SimulatedSegment>,
    drive: SubDeviceId,
    lamps: SubDeviceId,
    buttons: SubDeviceId,
}

fn plant() -> Result<Plant, Box<dyn StdError>> {
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default());
    main_device.scan()?;
    let mut declaration = Declaration::new(PERIOD);
    let [drive, lamps, buttons] = [0, 1, 2].map(|at| declaration.add(SubDeviceConfig::at_position(at)));
    Ok(Plant { application: main_device.activate(declaration)?, drive, lamps, buttons })
}

// covers: api
#[test]
fn typed_values_arrive_at_the_subdevice_signed_and_come_back() -> Result<(), Box<dyn StdError>> {
    let Plant { mut application, drive, lamps, .. } = plant()?;
    let velocity = application.output::<i32>(drive, 0x60FF, 0)?;
    let mode = application.output_named::<i8>(drive, "Mode of operation")?;
    let shown = application.input_named::<i8>(drive, "Mode display")?;
    let lamp = application.output_named::<bool>(lamps, "Channel 3.Output")?;
    application.wait_until_op(LIMIT)?;
    for _ in 0..20 {
        application.cycle(|data| {
            data.set(velocity, -70_000);
            data.set(mode, 8);
            data.set(lamp, true);
        });
    }
    let outputs: Vec<Vec<u8>> =
        application.links().network().devices().map(|device| device.outputs().to_vec()).collect();
    assert_eq!(outputs[0][6..10], (-70_000i32).to_le_bytes());
    assert_eq!(outputs[1], [0b100]);
    application.cycle(|data| {
        assert_eq!((data.get(velocity), data.get(shown), data.get(lamp)), (-70_000, 8, true));
        // The slice of one SyncManager, and the whole image.
        assert_eq!(data.area(lamps, 0), Some(&[0b100][..]));
        assert!(data.area(lamps, 7).is_none() && data.image(DomainId(0)).len() >= 28);
    });
    Ok(())
}

// covers: api
#[test]
fn inputs_cannot_be_written_and_errors_say_what_is_mapped() -> Result<(), Box<dyn StdError>> {
    let Plant { mut application, drive, lamps, buttons } = plant()?;
    let direction = application.output::<i32>(drive, 0x6064, 0).expect_err("the drive sends it");
    assert_eq!(
        direction.to_string(),
        "SubDevice 0 \"servo-1\": 0x6064:00 \"Feedback.Position\" is an input: the SubDevice sends it, so it cannot be \
         set"
    );
    let width = application.output::<i16>(drive, 0x607A, 0).expect_err("it has 32 bits");
    assert_eq!(
        width.to_string(),
        "SubDevice 0 \"servo-1\": 0x607a:00 \"Command.Target position\": i16 has 16 bits, 32 bits are mapped"
    );
    let missing = application.input::<bool>(buttons, 0x7000, 1).expect_err("it has inputs from 0x6000 on");
    let text = missing.to_string();
    assert!(text.starts_with("SubDevice 2 \""), "{text}");
    assert!(text.contains("0x7000:01 is not mapped; mapped: 0x6000:01 \"Channel 1.Input\" (input, 1 bits)"), "{text}");
    let ambiguous = application.output_named::<bool>(lamps, "Output").expect_err("all channels have one");
    assert!(matches!(ambiguous, MapError::Ambiguous { ref found, .. } if found.len() == 8), "{ambiguous}");
    let nameless = application.output_named::<bool>(lamps, "").expect_err("gaps have no name");
    assert!(matches!(nameless, MapError::NotMapped { wanted: Wanted::Name(_), .. }), "{nameless}");
    let undeclared = application.input::<u8>(SubDeviceId(9), 0x6000, 1).expect_err("three are declared");
    assert_eq!(undeclared.to_string(), "SubDevice 9: not declared: the declaration has 3 SubDevices, from 0");
    assert_eq!(application.mapped(drive)?.len(), 9);
    application.cycle(|data| assert!(data.area_mut(buttons, 0).is_none() && data.area_mut(lamps, 0).is_some()));
    Ok(())
}

// covers: api
#[test]
fn a_value_that_does_not_fit_is_an_error_and_changes_nothing() -> Result<(), Box<dyn StdError>> {
    let Plant { mut application, lamps, drive, .. } = plant()?;
    let lamp = application.output_bits(lamps, 0x7010, 1)?;
    let mode = application.output_bits(drive, 0x6060, 0)?;
    application.cycle(|data| {
        assert_eq!(data.set_bits(lamp, 1), Ok(()));
        let error = data.set_bits(lamp, 2).expect_err("one bit");
        assert_eq!(error.to_string(), "SubDevice 1: 0x7010:01: 2 does not fit into 1 bits");
        assert_eq!(data.read(&lamp.entry()), 1);
        assert_eq!(data.set_signed_bits(mode, -128), Ok(()));
        assert!(data.set_signed_bits(mode, -129).is_err() && data.set_signed_bits(mode, 128).is_err());
        assert_eq!(data.read_signed(&mode.entry()), -128);
    });
    Ok(())
}

// covers: api
#[test]
fn a_cycle_is_driven_in_its_parts_by_a_loop_of_the_applications_own() -> Result<(), Box<dyn StdError>> {
    let Plant { mut application, lamps, .. } = plant()?;
    let lamp = application.output::<bool>(lamps, 0x7000, 1)?;
    let domain = DomainId(0);
    let mut complete = 0;
    for _ in 0..4_000 {
        application.receive();
        let status = application.process(domain);
        complete = if status.state == DomainState::Complete { complete + 1 } else { 0 };
        application.process_data().set(lamp, true);
        assert!(application.queue(domain), "the cycle before has ended");
        application.send();
        application.links_mut().network_mut().advance_by(PERIOD);
        while let Some(event) = application.pop_event() {
            assert!(!matches!(event.event, ringcat::Event::ConfigurationFailed { .. }), "{event:?}");
        }
    }
    assert!(application.all_settled() && complete > 1_000, "{complete} complete cycles in a row");
    let outputs = application.links().network().devices().nth(1).map(|device| device.outputs().to_vec());
    assert_eq!(outputs, Some(vec![1]));
    Ok(())
}

// covers: api
#[test]
fn writing_inputs_values_that_do_not_fit_and_places_beyond_the_image_is_an_error() -> Result<(), Box<dyn StdError>> {
    let Plant { mut application, drive, lamps, buttons } = plant()?;
    application.wait_until_op(LIMIT)?;
    let domain = DomainId(0);
    let entry = |subdevice, index, sub_index| application.entry(subdevice, index, sub_index).expect("it is mapped");
    let [lamp, button, target] = [(lamps, 0x7000, 1), (buttons, 0x6000, 1), (drive, 0x607A, 0)]
        .map(|(subdevice, index, sub_index)| entry(subdevice, index, sub_index));
    application.cycle(|data| {
        let before = data.image(domain).to_vec();
        let input = data.write(&button, 1);
        assert!(matches!(input, Err(WriteError::NotAnOutput { start, .. }) if start == button.bit_offset.into()));
        assert!(input.unwrap_err().to_string().starts_with("SubDevice 2: 0x6000:01: domain 0, bit "));
        assert_eq!(data.status(domain).map(|status| status.state), Ok(DomainState::Complete));
        let undeclared = data.status(DomainId(1)).expect_err("one is declared");
        assert_eq!(undeclared.to_string(), "domain 1: not declared: the declaration has 1 domains, from 0");
        let too_large = data.write(&lamp, 2);
        assert_eq!(too_large.unwrap_err().to_string(), "SubDevice 1: 0x7000:01: 2 does not fit into 1 bits");
        assert!(matches!(data.write_signed(&target, i64::MAX), Err(WriteError::DoesNotFit(_))));
        let beyond = Entry { bit_offset: before.len() as u32 * 8, ..lamp };
        assert!(matches!(data.write(&beyond, 1), Err(WriteError::Outside { .. })));
        let elsewhere = Entry { domain: DomainId(1), ..lamp };
        assert!(matches!(data.write(&elsewhere, 1), Err(WriteError::Outside { image_bits: 0, .. })));
        let both = Entry { bit_length: 65, ..target };
        assert!(matches!(data.write(&both, 1), Err(WriteError::Length { bits: 65 } | WriteError::NotAnOutput { .. })));
        assert!(data.outputs_mut(domain, 0..before.len()).is_err(), "there are inputs among them");
        assert!(matches!(data.outputs_mut(domain, 0..before.len() + 1), Err(WriteError::Outside { .. })));
        assert!(data.area_mut(buttons, 0).is_none(), "a SyncManager of inputs");
        assert_eq!(data.image(domain), before, "nothing was changed");
    });
    application.cycle(|data| {
        data.write(&lamp, 1).expect("it fits");
        data.write_signed(&target, -2).expect("it fits");
        assert_eq!((data.read(&lamp), data.read_signed(&target)), (1, -2));
        let at = target.byte_offset();
        data.outputs_mut(domain, at..at + 4).expect("they are outputs").fill(0x11);
        assert_eq!(data.read(&target), 0x1111_1111);
    });
    Ok(())
}
