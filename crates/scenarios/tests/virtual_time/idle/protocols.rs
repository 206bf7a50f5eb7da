//! Mailbox protocols, registers, EEPROM and states by ring position without an application. Ethernet is in
//! `undeclared_networks`.

use ringcat::{AoeRoute, Idn, SoeAddress, Voe};
use ringcat_sim::application::aoe::MEMORY;
use ringcat_wire::mailbox::aoe::{AmsAddress, NetId};

use super::*;

const KINDS: [&str; 3] = ["coupler", "all-protocols", "servo"];
const MAILBOX_DEVICE: Position = Position(1);

fn idle_mailbox_device(is_ring: bool) -> MainDevice<Tap> {
    let network = if is_ring { ring } else { line };
    let network = network(descriptions(&KINDS), NetworkOptions::default());
    let mut main_device = MainDevice::request(Tap::new(network), &options());
    main_device.attend(FOLLOWED);
    main_device
}

fn route() -> AoeRoute {
    let address = |port| AmsAddress { net_id: NetId([5, 18, 2, 3, 2, 1]), port };
    AoeRoute::new(address(1000), address(0x8000))
}

// covers: states, mailbox, soe, aoe, voe, foe, sdo-information
#[test]
fn every_service_answers_by_ring_position_in_idle_operation() {
    for is_ring in [false, true] {
        let mut main_device = idle_mailbox_device(is_ring);
        assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_read::<u32>(0x1018, 1).expect("SDO"), 0x0C47);
        let objects = main_device.subdevice(MAILBOX_DEVICE).sdo_info().expect("SDO information");
        assert!(objects.contains(&0x1018), "{objects:x?}");
        assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_object(0x1018).expect("an object").max_sub_index, 4);
        assert!(main_device.subdevice(MAILBOX_DEVICE).sdo_entry(0x1018, 1).expect("an entry").bit_length == 32);
        let file = vec![0x5A; 3_000];
        main_device.subdevice(MAILBOX_DEVICE).foe_write("any.bin", file.clone()).expect("FoE");
        assert_eq!(main_device.subdevice(MAILBOX_DEVICE).foe_read("any.bin").expect("FoE"), file);
        let position = Idn::standard(0, 47);
        main_device.subdevice(MAILBOX_DEVICE).soe_write(0, position, 5i32).expect("SoE");
        assert_eq!(
            main_device.subdevice(MAILBOX_DEVICE).soe_read_elements(SoeAddress::value(0, position)).expect("SoE"),
            5i32.to_le_bytes()
        );
        main_device.subdevice(MAILBOX_DEVICE).aoe_write(route(), MEMORY, 16, vec![1, 2, 3, 4]).expect("AoE");
        assert_eq!(main_device.subdevice(MAILBOX_DEVICE).aoe_read(route(), MEMORY, 16, 4).expect("AoE"), [1, 2, 3, 4]);
        let message = Voe { vendor_id: 0x0C47, vendor_type: 3, data: vec![9; 40] };
        assert_eq!(main_device.subdevice(MAILBOX_DEVICE).voe_exchange(message.clone()).expect("VoE"), message);
        assert!(main_device.subdevice(MAILBOX_DEVICE).register_read::<u8>(RegisterAddress(0)).expect("a register") > 0);
        main_device.subdevice(MAILBOX_DEVICE).register_write::<u16>(RegisterAddress(0x0F80), 0xCAFE).expect("memory");
        assert_eq!(
            main_device.subdevice(MAILBOX_DEVICE).register_read::<u16>(RegisterAddress(0x0F80)).expect("memory"),
            0xCAFE
        );
        assert!(main_device.subdevice(MAILBOX_DEVICE).sii_read().expect("EEPROM").len() > 128);
        for state in [AlState::SafeOp, AlState::Op, AlState::PreOp, AlState::Boot, AlState::PreOp] {
            main_device.subdevice(MAILBOX_DEVICE).request_state(state).expect("it follows");
            assert_eq!(main_device.subdevice(MAILBOX_DEVICE).state().expect("it answers").status, AlStatus::new(state));
        }
        assert_eq!(main_device.subdevice(MAILBOX_DEVICE).sdo_read::<u32>(0x1018, 1).expect("SDO"), 0x0C47);
    }
}
