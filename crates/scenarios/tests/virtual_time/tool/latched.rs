//! What controllers have loaded and latched: the words of an EEPROM after a reload, receive times of ports.

use super::*;

/// A register shows the words that the controller has loaded: they are changed in the EEPROM only.
// covers: eeprom
#[test]
fn a_reload_makes_the_controller_load_its_words_again() {
    const AT: usize = 3;
    const PDI_CONFIGURATION_WORD: usize = 2;
    let loaded = |network: &Network| {
        let controller = &network.device(DeviceIndex(AT)).controller;
        let register = |address| u16::from_le_bytes([0, 1].map(|at| controller.register(address, 2)[at]));
        (register(map::PDI_CONFIGURATION), register(map::STATION_ALIAS))
    };
    let change = |network: &mut Network, value: u16| {
        let image = network.device_mut(DeviceIndex(AT)).controller.sii_image_mut();
        image[PDI_CONFIGURATION_WORD..][..2].copy_from_slice(&value.to_le_bytes());
        // The alias is loaded at power on only.
        image[8..10].copy_from_slice(&0x4711_u16.to_le_bytes());
        let mut checked = [0; 14];
        checked.copy_from_slice(&image[..14]);
        image[14] = ringcat_wire::sii::checksum(&checked);
    };
    let mut main_device = idle(ring(descriptions(&KINDS), options()));
    let (before, alias) = loaded(main_device.links_mut().network());
    for value in [0x1234, 0x4321] {
        change(main_device.links_mut().network_mut(), value);
        main_device.attend(Duration::from_millis(200));
        let kept = loaded(main_device.links_mut().network());
        assert_ne!(kept.0, value, "{before:#06x}: nothing is loaded by itself");
        main_device.subdevice(Position(AT as u16)).sii_reload().expect("it is loaded");
        assert_eq!(loaded(main_device.links_mut().network()), (value, alias));
    }
    // A wrong checksum: the call fails, and the controller keeps what it had.
    main_device.links_mut().network_mut().device_mut(DeviceIndex(AT)).controller.sii_image_mut()[2] ^= 0xFF;
    let error = main_device.subdevice(Position(AT as u16)).sii_reload().expect_err("the checksum is wrong");
    assert!(matches!(error, Error::SubDevice(_)), "{error}");
    assert_eq!(loaded(main_device.links_mut().network()), (0x4321, alias));
    change(main_device.links_mut().network_mut(), before);
    main_device.subdevice(Position(AT as u16)).sii_reload().expect("it is loaded");
    // Beside an application, declared or not.
    for declared in [true, false] {
        let count = if declared { KINDS.len() } else { AT };
        let declaration = automatic(&main_device.subdevices()[..count], scenarios::world::CYCLE);
        let mut application = main_device.activate(declaration).map_err(Error::from).expect("it fits");
        (0..500).for_each(|_| application.cycle(|_| ()));
        assert!(application.all_settled());
        change(application.links_mut().network_mut(), 0x0BAD);
        let work = ringcat::SubDevice::new(&mut application, Position(AT as u16)).sii_reload();
        application.cycle_until(work, LIMIT, |_| ()).expect("it is loaded");
        assert_eq!(loaded(application.links().network()), (0x0BAD, alias), "declared {declared}");
        change(application.links_mut().network_mut(), before);
        let work = ringcat::SubDevice::new(&mut application, Position(AT as u16)).sii_reload();
        application.cycle_until(work, LIMIT, |_| ()).expect("it is loaded");
        main_device = application.deactivate(ringcat::LastOutputs::Zero, LIMIT).expect("all follow");
    }
}

/// Receive times of ports are those that the controllers have latched, and differ by the way of the frame.
// covers: registers
#[test]
fn receive_times_of_a_port_report_are_those_that_the_controllers_have_latched() {
    const COUNT: usize = 6;
    for is_ring in [false, true] {
        let mut segment = clocked_segment(COUNT);
        segment[2] = descriptions(&["digital-input-8"])[0].clone();
        segment[2].name = "without-a-clock".into();
        let network = if is_ring { ring(segment, options()) } else { line(segment, options()) };
        let mut main_device = MainDevice::request(Tap::new(network), &Options::default().with_idle_operation(true));
        main_device.attend(FOLLOWED);
        let mut earlier = None;
        for _ in 0..3 {
            let report = main_device.port_report().expect("all answer");
            for (at, it) in report.iter().enumerate() {
                let times = it.ports.map(|port| port.registers.expect("it answers").receive_time_ns);
                let controller = &main_device.links_mut().network().device(DeviceIndex(at)).controller;
                if !controller.config().features.dc {
                    assert_eq!((at, times), (2, [None; 4]));
                    continue;
                }
                let registers = controller.register(map::DC_RECEIVE_TIME, 16);
                let latched = [0, 4, 8, 12].map(|at| {
                    let bytes = [registers[at], registers[at + 1], registers[at + 2], registers[at + 3]];
                    u32::from_le_bytes(bytes)
                });
                assert_eq!(times, latched.map(Some), "SubDevice {at}, ring {is_ring}");
                assert!(times[0] != Some(0), "it was latched");
                if at + 1 < COUNT && !is_ring {
                    // To the end of the line and back.
                    let way = latched[1].wrapping_sub(latched[0]) as i64;
                    let expected = 2 * HOP_NS * (COUNT - 1 - at) as i64;
                    assert!((way - expected).abs() <= HOP_NS, "SubDevice {at}: {way} ns, expected {expected}");
                }
            }
            let first = report[0].ports[0].registers.expect("it answers").receive_time_ns;
            assert_ne!(first, earlier, "each report latches again");
            earlier = first;
            main_device.attend(Duration::from_millis(50));
        }
    }
}
