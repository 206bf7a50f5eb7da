//! Rare services of a mailbox through the handle of a SubDevice: PDOs, composed messages, pieces of large objects, IP
//! parameters, state and counters.

use std::error::Error as StdError;
use std::path::Path;
use std::time::Duration;

use ringcat::shared_segment::SharedSegment;
use ringcat::sim::application::aoe::MEMORY;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::wire::mailbox::aoe::{AmsAddress, NetId};
use ringcat::wire::mailbox::coe::ListType;
use ringcat::wire::mailbox::soe::SoeElements;
use ringcat::{
    AddressFilter, AoeRoute, AoeStates, Declaration, Error, FoeOptions, Idn, IpSettings, Lane, MainDevice, Options,
    Overflow, PdoMailError, Position, SdoAddress, Sink, SoeAddress, Source, SubDevice, SubDeviceConfig,
    SubDeviceFailure, SubDeviceId, SupervisorThread, Unsolicited, Voe,
};

const SEGMENT: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"all-protocols\"\n\
                       [[device]]\ntype = \"servo\"\n[[device]]\ntype = \"ethernet-terminal\"\n";
const MAILBOX_DEVICE: Position = Position(1);
const DRIVE: Position = Position(2);
const TERMINAL: Position = Position(3);
const LIMIT: Duration = Duration::from_secs(30);

type Bus = MainDevice<SimulatedSegment>;

fn scanned() -> Result<Bus, Error> {
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(SEGMENT)?, &Options::default());
    main_device.scan()?;
    Ok(main_device)
}

fn mailbox_device(bus: &mut Bus) -> SubDevice<&mut Bus> {
    bus.subdevice(MAILBOX_DEVICE)
}

fn failure<T: std::fmt::Debug>(result: Result<T, Error>) -> SubDeviceFailure {
    match result {
        Err(Error::SubDevice(error)) => error.failure,
        other => panic!("expected an error of a SubDevice, got {other:?}"),
    }
}

// covers: api, pdo-mail
#[test]
fn pdos_are_assigned_mapped_and_transferred_by_mailbox() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let assigned = bus.subdevice(DRIVE).pdo_assignment(2)?;
    let [pdo] = assigned.as_slice() else { panic!("one PDO of outputs: {assigned:?}") };
    let entries = bus.subdevice(DRIVE).pdo_mapping(pdo.index)?;
    assert_eq!(pdo.entries.as_ref(), Some(&entries));
    bus.subdevice(DRIVE).set_pdo_assignment(2, Vec::new())?;
    assert!(bus.subdevice(DRIVE).pdo_assignment(2)?.is_empty());
    let fewer = entries[..1].to_vec();
    bus.subdevice(DRIVE).set_pdo_mapping(pdo.index, fewer.clone())?;
    assert_eq!(bus.subdevice(DRIVE).pdo_mapping(pdo.index)?, fewer);
    bus.subdevice(DRIVE).set_pdo_assignment(2, assigned.clone())?;
    assert_eq!(bus.subdevice(DRIVE).pdo_assignment(2)?, assigned);

    let present = bus.subdevice(DRIVE).pdo_receive(0x1600)?;
    bus.subdevice(DRIVE).pdo_send(0x1600, present.clone())?;
    assert_eq!(bus.subdevice(DRIVE).pdo_receive(0x1600)?, present);
    assert!(!bus.subdevice(DRIVE).pdo_receive(0x1A00)?.is_empty());
    let inputs = bus.subdevice(DRIVE).pdo_send(0x1A00, Vec::new()).expect_err("a TxPDO is not written");
    let text = inputs.to_string();
    assert!(
        text.starts_with("SubDevice at position 2 \"") && text.ends_with("0x1a00 is no PDO of this direction"),
        "{text}"
    );
    assert_eq!(failure::<()>(Err(inputs)), SubDeviceFailure::Pdo(PdoMailError::Index { pdo: 0x1A00 }));
    Ok(())
}

// covers: api, sdo-information
#[test]
fn lengths_of_the_object_lists_are_those_of_the_lists() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let lengths = mailbox_device(&mut bus).sdo_list_lengths()?;
    for list in ListType::LISTS {
        let objects = mailbox_device(&mut bus).sdo_list(list)?;
        assert_eq!(lengths.of(list).map(usize::from), Some(objects.len()), "{list}");
    }
    assert_eq!(lengths.of(ListType::Lengths), None);
    Ok(())
}

/// Counts pieces, and keeps nothing but their sum.
#[derive(Debug, Default)]
struct Sum {
    pieces: usize,
    bytes: u64,
    sum: u64,
}

impl Sink for Sum {
    fn begin(&mut self, _: Option<u64>) -> Result<(), Overflow> {
        *self = Sum::default();
        Ok(())
    }

    fn take(&mut self, bytes: &[u8]) -> Result<(), Overflow> {
        self.pieces += 1;
        self.bytes += bytes.len() as u64;
        self.sum += bytes.iter().map(|byte| u64::from(*byte)).sum::<u64>();
        Ok(())
    }
}

/// So many bytes of 7, made as they are needed.
struct Sevens(u64);

impl Source for Sevens {
    fn total(&self) -> Option<u64> {
        Some(self.0)
    }

    fn fill(&mut self, buffer: &mut [u8]) -> usize {
        let count = buffer.len().min(usize::try_from(self.0).unwrap_or(usize::MAX));
        buffer[..count].fill(7);
        self.0 -= count as u64;
        count
    }
}

// covers: api, sdo, foe
#[test]
fn large_objects_and_files_pass_piece_by_piece() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let object = SdoAddress::new(0x2002, 0);
    let before = mailbox_device(&mut bus).sdo_read::<Vec<u8>>(0x2002, 0)?;
    mailbox_device(&mut bus).sdo_write_from(object, Sevens(before.len() as u64))?;
    let sum = mailbox_device(&mut bus).sdo_read_into(object, Sum::default())?;
    assert_eq!((sum.bytes, sum.sum), (before.len() as u64, 7 * before.len() as u64));
    assert!(sum.pieces > 1, "{sum:?}");

    let options = FoeOptions::default();
    assert_eq!(mailbox_device(&mut bus).foe_write_from("large", Sevens(50_000), options, |_| ())?, 50_000);
    let sum = mailbox_device(&mut bus).foe_read_into("large", Sum::default(), options, |_| ())?;
    assert_eq!((sum.bytes, sum.sum), (50_000, 350_000));
    assert!(sum.pieces > 10, "{sum:?}");
    Ok(())
}

// covers: api, aoe, soe
#[test]
fn ads_states_and_elements_of_idns_are_written_too() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let address = |port| AmsAddress { net_id: NetId([5, 18, 2, 3, 2, 1]), port };
    let route = AoeRoute::new(address(1000), address(0x8000));
    let written = vec![4, 3, 2, 1];
    assert_eq!(mailbox_device(&mut bus).aoe_read_write(route, MEMORY, 16, written.clone(), 4)?, written);
    // Run in PREOP, then stop.
    assert_eq!(mailbox_device(&mut bus).aoe_states(route)?, AoeStates::new(5, 2));
    mailbox_device(&mut bus).aoe_set_states(route, AoeStates::new(6, 0), Vec::new())?;
    assert_eq!(mailbox_device(&mut bus).aoe_states(route)?.ads, 6);

    let position = SoeAddress::value(0, Idn::standard(0, 47));
    mailbox_device(&mut bus).soe_write_elements(position, 9i32.to_le_bytes().to_vec())?;
    assert_eq!(mailbox_device(&mut bus).soe_read::<i32>(0, Idn::standard(0, 47))?, 9);
    let name = SoeAddress { elements: SoeElements::NAME, ..position };
    let refused = mailbox_device(&mut bus).soe_write_elements(name, b"other".to_vec());
    assert!(matches!(failure(refused), SubDeviceFailure::Soe(_)));
    Ok(())
}

// covers: api, eoe
#[test]
fn ip_parameters_and_address_filters_are_set_and_read() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let settings = IpSettings::default()
        .with_mac([2, 0, 0, 0, 0, 9])
        .with_address(std::net::Ipv4Addr::new(192, 168, 9, 2))
        .with_mask(std::net::Ipv4Addr::new(255, 255, 255, 0));
    bus.subdevice(TERMINAL).eoe_set_ip(0, settings.clone())?;
    let read = bus.subdevice(TERMINAL).eoe_ip(0)?;
    assert_eq!((read.mac, read.address, read.mask), (settings.mac, settings.address, settings.mask));
    let filter = AddressFilter::new(&[[2, 0, 0, 0, 0, 9]], &[], true).expect("one address fits");
    bus.subdevice(TERMINAL).eoe_set_filter(0, filter)?;
    assert_eq!(bus.subdevice(TERMINAL).eoe_filter(0)?, filter);
    let long = settings.with_name(vec![b'a'; 33]);
    let refused = bus.subdevice(TERMINAL).eoe_set_ip(0, long).expect_err("32 bytes at most");
    assert!(refused.to_string().contains("EoE port 0: a name of 33 bytes"), "{refused}");
    assert!(matches!(failure::<()>(Err(refused)), SubDeviceFailure::Eoe(_)));
    Ok(())
}

/// SDO upload of 0x1000:00.
const UPLOAD: [u8; 10] = [0x00, 0x20, 0x40, 0x00, 0x10, 0, 0, 0, 0, 0];

// covers: api, pdo-mail
#[test]
fn composed_messages_get_the_next_mail_or_none() -> Result<(), Box<dyn StdError>> {
    let mut bus = scanned()?;
    let answer = mailbox_device(&mut bus).mail_exchange(Lane::Coe, UPLOAD.to_vec())?;
    assert_eq!(answer[..6], [0x00, 0x30, 0x43, 0x00, 0x10, 0x00]);
    let status = mailbox_device(&mut bus).mailbox_status().expect("it has one");
    assert!(status.is_open && status.is_idle && status.counters.written >= 1, "{status:?}");
    assert!(bus.subdevice(Position(0)).mailbox_status().is_none_or(|status| !status.is_open));

    let message = Voe { vendor_id: 0x0C47, vendor_type: 1, data: vec![0xAA, 0xBB] };
    let payload = [0x47, 0x0C, 0, 0, 1, 0, 0xAA, 0xBB];
    mailbox_device(&mut bus).mail_send(Lane::Voe, payload.to_vec())?;
    assert_eq!(mailbox_device(&mut bus).voe_receive_directly()?, message);
    mailbox_device(&mut bus).mail_send(Lane::Voe, payload.to_vec())?;
    assert_eq!(mailbox_device(&mut bus).voe_receive()?, message);
    assert_eq!(mailbox_device(&mut bus).unsolicited_overruns(Unsolicited::Voe), Some(0));

    let refused = mailbox_device(&mut bus).mail_exchange(Lane::Coe, vec![0x00, 0x90]);
    assert!(matches!(failure(refused), SubDeviceFailure::Mailbox(_)));
    let status = mailbox_device(&mut bus).mailbox_status().expect("it has one");
    assert_ne!(status.last_protocol_error, 0, "{status:?}");
    Ok(())
}

// covers: api, jobs
#[test]
fn rare_services_have_every_form() -> Result<(), Box<dyn StdError>> {
    // In the cycles of one thread.
    let (declaration, [_, all, _]) = declaration();
    let mut application = scanned()?.activate(declaration)?;
    application.wait_until_op(LIMIT)?;
    let pending = application.subdevice(all).mail_exchange(Lane::Coe, UPLOAD.to_vec());
    assert_eq!(application.cycle_until(pending, LIMIT, |_| ())?[2], 0x43);
    // In a thread of its own, with and without waiting.
    let network = Network::from_description(Segment::from_toml(SEGMENT, Path::new("."))?)?;
    let (_cyclic, acyclic) = SharedSegment::halves(network);
    let supervisor = SupervisorThread::start(acyclic, &Options::default(), || ())?;
    supervisor.scan()?;
    let lengths = supervisor.background().subdevice(MAILBOX_DEVICE).sdo_list_lengths();
    let assigned = supervisor.subdevice(DRIVE).pdo_assignment(3)?;
    assert_eq!(assigned.len(), 1);
    assert!(lengths.finish()?.of(ListType::All).is_some_and(|count| count > 10));
    Ok(())
}

fn declaration() -> (Declaration, [SubDeviceId; 3]) {
    let mut declaration = Declaration::new(Duration::from_millis(2));
    let subdevices = [0, 1, 2].map(|at| declaration.add(SubDeviceConfig::at_position(at)));
    (declaration, subdevices)
}
