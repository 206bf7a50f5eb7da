//! Object dictionaries are read once for each type of SubDevice, and kept as long as the type is the same.

use ringcat::{Object, ObjectEntry};
use ringcat_sim::application::dictionary::{Access, Object as SimulatedObject};
use ringcat_sim::application::foe::firmware;
use ringcat_sim::description::DeviceDescription;
use scenarios::segments::describe;

use super::*;

/// Time in which all dictionaries of a few types are read.
const READ: Duration = Duration::from_secs(4);
const SERVO: Position = Position(1);

/// All descriptions of the objects of a SubDevice.
type Described = Vec<(Object, Vec<Option<ObjectEntry>>)>;

fn begin(devices: Vec<DeviceDescription>, in_background: bool) -> MainDevice<Tap> {
    let options = options().with_dictionaries(in_background);
    let mut main_device = MainDevice::request(Tap::new(line(devices, NetworkOptions::default())), &options);
    main_device.attend(if in_background { READ } else { FOLLOWED });
    main_device
}

fn describe_all(main_device: &mut MainDevice<Tap>, position: Position) -> Described {
    let indices = main_device.subdevice(position).sdo_info().expect("it has SDO information");
    let mut all = Vec::new();
    for index in indices {
        let object = main_device.subdevice(position).sdo_object(index).expect("it is in the list");
        let last = object.max_sub_index;
        let entries = (0..=last).map(|at| main_device.subdevice(position).sdo_entry(index, at).ok());
        all.push((object, entries.collect()));
    }
    all
}

/// Messages to a SubDevice so far.
fn written(main_device: &mut MainDevice<Tap>, position: Position) -> u64 {
    main_device.subdevice(position).mailbox_status().expect("it has a mailbox").counters.written
}

/// Messages that a full description takes, and the description.
fn cost(main_device: &mut MainDevice<Tap>, position: Position) -> (u64, Described) {
    let before = written(main_device, position);
    let described = describe_all(main_device, position);
    (written(main_device, position) - before, described)
}

fn servos() -> Vec<DeviceDescription> {
    descriptions(&["coupler", "servo", "servo", "all-protocols", "servo"])
}

/// A servo with one more object, and this version.
fn servo_with(name: &str, object: &str, version: &str) -> DeviceDescription {
    let mut device = describe("servo", name);
    device.objects.push(SimulatedObject::variable(0x2F00, object, 5, Access::ReadWrite, &[1]));
    device.objects.push(SimulatedObject::variable(0x100A, "Software version", 9, Access::ReadOnly, version.as_bytes()));
    device
}

// covers: states, sdo-information
#[test]
fn descriptions_of_a_type_are_read_once_for_all_its_subdevices() {
    let mut main_device = begin(servos(), false);
    let (first, described) = cost(&mut main_device, SERVO);
    assert!(first > 50, "nothing was known: {first}");
    for position in [SERVO, Position(2), Position(4)] {
        let (cost, same) = cost(&mut main_device, position);
        assert!(cost <= 2, "the list, and once the version: {cost}");
        assert_eq!(same, described);
    }
    let (other, all_protocols) = cost(&mut main_device, Position(3));
    assert!(other > 50 && all_protocols != described, "another type: {other}");
}

// covers: states, sdo-information
#[test]
fn dictionaries_are_read_in_the_background_and_stay_through_applications() {
    let mut asked = begin(servos(), false);
    let expected: Vec<Described> = [1, 2, 3, 4].map(|at| describe_all(&mut asked, Position(at))).into();
    let mut main_device = begin(servos(), true);
    let described = |main_device: &mut MainDevice<Tap>| {
        let all = [1, 2, 3, 4].map(|at| cost(main_device, Position(at)));
        let messages: u64 = all.iter().map(|(messages, _)| messages).sum();
        assert_eq!(all.into_iter().map(|(_, described)| described).collect::<Vec<_>>(), expected);
        messages
    };
    assert_eq!(described(&mut main_device), 4, "a list each: the rest was read");
    let mut application = activate(main_device, &[1, 2]);
    cycles(&mut application, 300);
    let mut ended = application.deactivate(LastOutputs::Zero, LIMIT).expect("all follow");
    let messages = described(&mut ended);
    assert!(messages <= 8, "new sessions: a list and a version each: {messages}");
}

/// The same identity with another list, or with another version: each has its own descriptions.
// covers: states, sdo-information
#[test]
fn another_version_or_another_list_is_another_dictionary() {
    let devices = vec![
        servo_with("first", "old name", "1.0"),
        servo_with("second", "new name", "2.0"),
        describe("servo", "third"),
        servo_with("fourth", "old name", "1.0"),
    ];
    for in_background in [false, true] {
        let mut main_device = begin(devices.clone(), in_background);
        let mut name = |at| main_device.subdevice(Position(at)).sdo_object(0x2F00).map(|object| object.name).ok();
        let names = [0, 1, 2, 3].map(&mut name);
        assert_eq!(
            names.each_ref().map(Option::as_deref),
            [Some("old name"), Some("new name"), None, Some("old name")]
        );
        for at in [0, 1, 3] {
            describe_all(&mut main_device, Position(at));
        }
        let mut name = |at| main_device.subdevice(Position(at)).sdo_object(0x2F00).map(|object| object.name).ok();
        assert_eq!([0, 1, 2, 3].map(&mut name), names);
    }
}

// covers: states, sdo-information
#[test]
fn firmware_with_another_version_has_its_descriptions_read_again() {
    let mut main_device = begin(descriptions(&["coupler", "all-protocols"]), true);
    assert_eq!(cost(&mut main_device, SERVO).0, 1, "the list");
    main_device.subdevice(SERVO).request_state(AlState::Boot).expect("it has a boot loader");
    let image = firmware::image("2.7", &[0x5A; 2_000]);
    main_device.subdevice(SERVO).foe_write("firmware.bin", image).expect("it takes it");
    main_device.subdevice(SERVO).request_state(AlState::PreOp).expect("it leaves the boot loader");
    // In the background, or by this request.
    let before = written(&mut main_device, SERVO);
    describe_all(&mut main_device, SERVO);
    main_device.attend(READ);
    assert!(written(&mut main_device, SERVO) - before > 50, "it was read again");
    assert_eq!(cost(&mut main_device, SERVO).0, 1, "the list");
}

/// Objects of a modular SubDevice depend on its modules.
// covers: states, sdo-information
#[test]
fn objects_of_a_modular_subdevice_are_read_each_time() {
    let mut device = describe("servo", "modular");
    device.objects.push(SimulatedObject::variable(0xF050, "Detected modules", 7, Access::ReadOnly, &[0; 4]));
    let mut main_device = begin(vec![device.clone(), device], true);
    for _ in 0..2 {
        for position in [Position(0), SERVO] {
            assert!(cost(&mut main_device, position).0 > 50);
        }
    }
}

/// While dictionaries of 40 SubDevices are read, each request is answered at once.
// covers: states
#[test]
fn requests_do_not_wait_while_dictionaries_are_read() {
    let options = options().with_dictionaries(true);
    let network = ring(descriptions(&["servo"; 40]), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    main_device.attend(Duration::from_millis(1_050));
    let mut were_read = 0;
    for round in 0..200u16 {
        let at = Position(round % 40);
        were_read += u32::from((0..40).any(|at| written(&mut main_device, Position(at)) > 30));
        let begun = main_device.now();
        main_device.subdevice(at).sdo_read::<u32>(0x1018, 1).expect("it answers");
        let took = main_device.now().since(begun);
        assert!(took < Duration::from_millis(5), "{took:?} at {at}");
        main_device.attend(Duration::from_millis(3));
    }
    assert!(were_read > 0, "dictionaries were being read meanwhile");
}
