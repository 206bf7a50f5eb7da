//! Object dictionaries travel: the next owner describes objects without a message for each.

use super::*;

/// Messages to describe all objects of a SubDevice, and their number.
fn described(main_device: &mut MainDevice<Tap>, position: Position) -> (u64, Vec<String>) {
    let written = |main_device: &mut MainDevice<Tap>| {
        main_device.subdevice(position).mailbox_status().expect("it has a mailbox").counters.written
    };
    let before = written(main_device);
    let mut names = Vec::new();
    for index in main_device.subdevice(position).sdo_info().expect("it has SDO information") {
        let object = main_device.subdevice(position).sdo_object(index).expect("it is in the list");
        for sub_index in 0..=object.max_sub_index {
            let entry = main_device.subdevice(position).sdo_entry(index, sub_index);
            names.push(entry.map_or_else(|_| String::new(), |entry| entry.name));
        }
        names.push(object.name);
    }
    (written(main_device) - before, names)
}

// covers: states, sdo-information
#[test]
fn known_object_dictionaries_are_not_read_again_by_the_next_owner() {
    for handover in HANDOVERS {
        for network in networks() {
            let mut former = idle(network);
            let servos = [Position(0), Position(3)];
            let (first, names) = described(&mut former, servos[0]);
            assert!(first > 50, "nothing was known: {first}");
            let mut next = hand_over(former, handover);
            for servo in servos {
                let (messages, same) = described(&mut next, servo);
                assert!(messages <= 6, "the list, the version, and after a crash another object first: {messages}");
                assert_eq!(same, names);
            }
        }
    }
}

/// With all types of the catalogue, the bytes stay within their bar.
// covers: states
#[test]
fn dictionaries_of_all_types_add_less_than_a_mib_to_the_bytes() {
    let kinds = ["servo", "all-protocols", "analog-input-4", "analog-output-4", "soe-drive", "ethernet-terminal"];
    let network = line(descriptions(&kinds), NetworkOptions::default());
    let options = options().with_dictionaries(true);
    let mut main_device = MainDevice::request(Tap::new(network), &options);
    main_device.attend(Duration::from_millis(900));
    let before = to_bytes(&main_device).len();
    main_device.attend(Duration::from_secs(6));
    let knowledge = main_device.knowledge().expect("it is scanned");
    let bytes = knowledge.to_bytes();
    println!("object dictionaries of {} types: {} bytes more than {before}", kinds.len(), bytes.len() - before);
    assert!(bytes.len() > before + 2_000 && bytes.len() < before + (1 << 20), "{before} {}", bytes.len());
    assert_eq!(Knowledge::from_bytes(&bytes), Ok(knowledge));
}
