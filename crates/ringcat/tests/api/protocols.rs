//! Drives, ADS devices, messages of vendors, diagnosis and urgent writes through the handle of a SubDevice.

use std::error::Error as StdError;

use ringcat::sim::application::aoe::MEMORY;
use ringcat::sim::cable::DeviceIndex;
use ringcat::simulated::SimulatedSegment;
use ringcat::wire::mailbox::aoe::{AmsAddress, NetId};
use ringcat::wire::mailbox::coe::DiagnosisMessage;
use ringcat::wire::mailbox::soe::SoeElements;
use ringcat::{
    AoeRoute, Error, Idn, MainDevice, Options, Position, RegisterAddress, SoeAddress, SubDevice, SubDeviceFailure, Voe,
};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n";
const COUPLER: Position = Position(0);
const MAILBOX_DEVICE: Position = Position(1);
/// Memory that nothing uses.
const USER_RAM: RegisterAddress = RegisterAddress(0x0F80);

type Bus = MainDevice<SimulatedSegment>;

fn scanned() -> Result<Bus, Error> {
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default());
    main_device.scan()?;
    Ok(main_device)
}

fn mailbox_device(bus: &mut Bus) -> SubDevice<&mut Bus> {
    bus.subdevice(MAILBOX_DEVICE)
}

// covers: api
#[test]
fn elements_of_an_idn_are_read_and_a_procedure_command_runs_until_it_is_ended() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let (drive, position) = (0, Idn::standard(0, 47));
    mailbox_device(&mut bus).soe_write(drive, position, 5i32)?;
    let value = mailbox_device(&mut bus).soe_read_elements(SoeAddress::value(drive, position))?;
    assert_eq!(value, 5i32.to_le_bytes());
    let name = SoeAddress { elements: SoeElements::NAME, ..SoeAddress::value(drive, position) };
    assert!(!mailbox_device(&mut bus).soe_read_elements(name)?.is_empty());
    let command = Idn::standard(0, 99);
    assert!(!mailbox_device(&mut bus).soe_command_state(drive, command)?.is_set());
    mailbox_device(&mut bus).soe_command(drive, command)?;
    assert!(mailbox_device(&mut bus).soe_command_state(drive, command)?.is_running());
    mailbox_device(&mut bus).soe_abort_command(drive, command)?;
    assert!(!mailbox_device(&mut bus).soe_command_state(drive, command)?.is_set());
    Ok(())
}

// covers: api
#[test]
fn an_ads_device_says_what_it_is_and_its_memory_is_written_and_read() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let address = |port| AmsAddress { net_id: NetId([5, 18, 2, 3, 2, 1]), port };
    let route = AoeRoute::new(address(1000), address(0x8000));
    assert!(!mailbox_device(&mut bus).aoe_device_info(route)?.name.is_empty());
    mailbox_device(&mut bus).aoe_write(route, MEMORY, 16, vec![1, 2, 3, 4])?;
    assert_eq!(mailbox_device(&mut bus).aoe_read(route, MEMORY, 16, 4)?, [1, 2, 3, 4]);
    let nowhere = mailbox_device(&mut bus).aoe_read(route, MEMORY + 1, 16, 4).expect_err("no such group");
    let Error::SubDevice(nowhere) = nowhere else { panic!("{nowhere:?}") };
    assert!(matches!(nowhere.failure, SubDeviceFailure::Aoe(_)), "{nowhere:?}");
    Ok(())
}

// covers: api
#[test]
fn messages_of_a_vendor_are_sent_and_exchanged() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let message = |vendor_type| Voe { vendor_id: 0x0C47, vendor_type, data: vec![9; 40] };
    assert_eq!(mailbox_device(&mut bus).voe_exchange(message(3))?, message(3));
    mailbox_device(&mut bus).voe_send(message(4))?;
    Ok(())
}

// covers: api
#[test]
fn messages_of_the_diagnosis_history_are_read_and_acknowledged() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let message = DiagnosisMessage::decode(&[0, 0xE8, 0x34, 0x12, 2, 0, 7, 0, 0, 0, 0, 0, 0, 0, 0, 0])?;
    assert!(mailbox_device(&mut bus).diagnosis()?.messages.is_empty());
    let device = bus.links_mut().network_mut().device_mut(DeviceIndex(1));
    assert!(device.application.diagnose(&message, &[]));
    let history = mailbox_device(&mut bus).diagnosis()?;
    assert_eq!((history.messages.len(), history.new_available), (1, true));
    mailbox_device(&mut bus).acknowledge_diagnosis(history.newest)?;
    assert!(!mailbox_device(&mut bus).diagnosis()?.new_available);
    mailbox_device(&mut bus).acknowledge_diagnosis(0)?;
    assert!(mailbox_device(&mut bus).diagnosis()?.messages.is_empty());
    Ok(())
}

// covers: api
#[test]
fn an_urgent_write_reaches_the_register() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    bus.subdevice(COUPLER).register_write_urgently(USER_RAM, 0xCAFEu16)?;
    assert_eq!(bus.subdevice(COUPLER).register_read::<u16>(USER_RAM)?, 0xCAFE);
    Ok(())
}
