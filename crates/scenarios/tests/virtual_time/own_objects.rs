//! Objects of the MainDevice itself at address 0 of the mailbox gateway (protocol 10.1, 10.2).

use std::time::Duration;

use ringcat::{Limits, SubDeviceState};
use ringcat_engine::mail::coe::{self, SdoAddress};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::mailbox::coe::{DiagnosisKind, DiagnosisMessage, DiagnosisParameter};
use ringcat_wire::mailbox::coe::{Indices, InformationOpcode, ListType, SdoInformation};
use ringcat_wire::mailbox::sdo::{AbortCode, SdoRequest, SdoResponse};
use ringcat_wire::mailbox::{Header, Message, Protocol, gateway};
use scenarios::dice::Dice;
use scenarios::segments::{descriptions, ring};
use scenarios::world::World;

const KINDS: [&str; 5] = ["coupler", "digital-input-8", "all-protocols", "digital-output-8", "ethernet-terminal"];
const CLIENT: u64 = 7;
const LIMIT: Duration = Duration::from_secs(5);
/// A long segment, and its last SubDevice.
const COUNT: usize = 260;
const LAST: usize = COUNT - 1;
/// Bytes of a message at address 0.
const MAILBOX: usize = 512;

fn world() -> World {
    let options = NetworkOptions::default().with_detection_delay(Duration::from_micros(10));
    World::in_op(1, ring(descriptions(&KINDS), options))
}

/// Sends a CoE message and takes this many responses; none of them is longer than a mailbox.
fn ask(world: &mut World, client: u64, payload: &[u8], answers: impl Fn(&[Vec<u8>]) -> bool) -> Vec<Vec<u8>> {
    let header = Header { address: 0, ..Header::new(Protocol::Coe, 5, payload.len() as u16) };
    let mut bytes = vec![0; gateway::HEADER_LEN + Header::LEN + payload.len()];
    gateway::encode(&Message { header, payload }, &mut bytes).expect("it fits");
    world.application_mut().engine_mut().relay(client, &bytes);
    let end = world.application().now() + LIMIT;
    let mut got = Vec::new();
    while !answers(&got) {
        assert!(world.application().now() < end, "{got:?}");
        world.cycle();
        while let Some(relayed) = world.application_mut().engine_mut().pop_relayed() {
            assert_eq!(relayed.client, client);
            assert!(relayed.bytes.len() <= gateway::HEADER_LEN + MAILBOX);
            let Message { header, payload } = gateway::decode(&relayed.bytes).expect("a message");
            assert_eq!((header.address, header.counter, header.protocol), (0, 5, Protocol::Coe), "{payload:?}");
            got.push(payload.to_vec());
        }
    }
    got
}

fn sdo<T>(world: &mut World, client: u64, request: SdoRequest<'_>, read: impl FnOnce(SdoResponse<'_>) -> T) -> T {
    let mut payload = vec![0; MAILBOX];
    let length = request.encode(&mut payload).expect("it fits");
    let answers = ask(world, client, &payload[..length], |got| !got.is_empty());
    assert_eq!(answers.len(), 1);
    read(SdoResponse::decode(&answers[0]).expect("an SDO"))
}

/// Reads an entry, or an object with complete access, in segments if necessary.
fn read(world: &mut World, index: u16, sub_index: u8, complete_access: bool) -> Result<Vec<u8>, AbortCode> {
    let request = SdoRequest::Upload { index, sub_index, complete_access };
    let (total, mut data) = sdo(world, CLIENT, request, |response| match response {
        SdoResponse::UploadExpedited { data, .. } => Ok((data.len(), data.to_vec())),
        SdoResponse::UploadNormal { total, data, .. } => Ok((total as usize, data.to_vec())),
        SdoResponse::Abort { code, .. } => Err(code),
        other => panic!("{other:?}"),
    })?;
    let mut toggle = false;
    while data.len() < total {
        sdo(world, CLIENT, SdoRequest::UploadSegment { toggle }, |response| match response {
            SdoResponse::UploadSegment { data: segment, .. } => data.extend_from_slice(segment),
            other => panic!("{other:?}"),
        });
        toggle = !toggle;
    }
    assert_eq!(data.len(), total);
    Ok(data)
}

fn number(world: &mut World, index: u16, sub_index: u8) -> u32 {
    let mut bytes = read(world, index, sub_index, false).expect("it is there");
    bytes.resize(4, 0);
    u32::from_le_bytes(bytes.try_into().expect("four bytes"))
}

fn write(world: &mut World, index: u16, sub_index: u8, data: &[u8]) -> Result<(), AbortCode> {
    let request = SdoRequest::DownloadExpedited { index, sub_index, complete_access: false, data };
    sdo(world, CLIENT, request, |response| match response {
        SdoResponse::DownloadDone { .. } => Ok(()),
        SdoResponse::Abort { code, .. } => Err(code),
        other => panic!("{other:?}"),
    })
}

// covers: 10.2, own-objects
#[test]
fn objects_show_declared_and_found_subdevices_and_their_states() {
    let mut world = world();
    let mark = world.mark();
    assert_eq!(read(&mut world, 0x1008, 0, false), Ok(b"RingCAT".to_vec()));
    assert_eq!(number(&mut world, 0x1000, 0), 5001);
    assert_eq!(number(&mut world, 0x1018, 0), 4);
    let info = world.application().engine().subdevices()[2].clone();
    let (station, identity) = (info.station.0, info.identity);
    for (index, sub_index, expected) in [
        (0x8002, 1, u32::from(station)),
        (0x8002, 0, 40),
        (0x8002, 4, 0x1389),
        (0x8002, 33, 1024),
        (0x8002, 34, 1024),
        (0x8002, 35, 0),
        (0x8002, 36, 0x11),
        (0x8002, 37, 0),
        (0x8002, 38, 0x11),
        (0x8002, 39, u32::from(info.protocols.0)),
        (0x8002, 40, 1),
        // No mailbox.
        (0x8001, 4, 0),
        (0x8001, 40, 0),
        // A mailbox without history: this is read from it, without an error.
        (0x8004, 40, 0),
        (0xA004, 19, 0),
        (0xA004, 18, 0),
        (0x8004, 37, 1),
        (0x9002, 5, identity.vendor_id),
        (0x9002, 6, identity.product_code),
        (0xA002, 1, 8),
        (0xA002, 3, 0),
        (0xA002, 4, 0x33),
        (0xA002, 6, u32::from(station) - 1),
        (0xA002, 7, u32::from(station) + 1),
        (0xA002, 14, 0),
        (0xA002, 15, 0),
        (0xA002, 17, 0),
        (0xA002, 18, 0),
        (0xA002, 19, 0),
        (0xF000, 1, 1),
        (0xF020, 0, 5),
        (0xF020, 3, u32::from(station)),
        (0xF021, 0, 0),
        (0xF040, 3, u32::from(station)),
        (0xF120, 16, 8),
    ] {
        assert_eq!(number(&mut world, index, sub_index), expected, "{index:#06x}:{sub_index}");
    }
    assert_eq!(read(&mut world, 0x8002, 3, false), Ok(info.name.into_bytes()));
    let complete = read(&mut world, 0x8002, 0, true).expect("texts are filled up");
    let name = &complete[2 + 2 + 64..][..64];
    assert_eq!((complete.len(), complete.last()), (2 + 2 + 2 * 64 + 5 * 4 + 2 * 2 + 3 + 1 + 2 * 2 + 1, Some(&1)));
    assert_eq!((name.starts_with(b"all-protocols"), &name[20..]), (true, &[0; 44][..]));
    let complete = read(&mut world, 0x9002, 0, true).expect("its entries have one length each");
    assert_eq!((complete[..4].to_vec(), complete.len()), ([vec![32, 0], station.to_le_bytes().to_vec()].concat(), 22));
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, vec![]), "process data continues");
}

// covers: 10.2, own-objects
#[test]
fn objects_follow_a_break_damaged_frames_and_a_loss_until_reset() {
    let mut world = world();
    world.evaluate_latched(false);
    world.corrupt(CableId(2), 20);
    world.run_cycles(40);
    assert!(number(&mut world, 0xA002, 10) > 0, "at the port that receives them first");
    world.cut(CableId(3));
    world.run_cycles(50);
    assert_eq!(number(&mut world, 0xA002, 7), 0, "no SubDevice there");
    assert_eq!(number(&mut world, 0x8002, 35), 0x24, "a link is missing at port 1");
    world.heal(CableId(3));
    world.run_cycles(50);
    world.power_off(DeviceIndex(4));
    world.until(LIMIT, "gone", |world| world.application().states()[4] == SubDeviceState::Absent);
    assert_eq!((number(&mut world, 0xA004, 15), number(&mut world, 0xA004, 1)), (1, 0));
    assert_eq!((number(&mut world, 0x8004, 35), number(&mut world, 0xF120, 16)), (1, 0));
    world.power_on(DeviceIndex(4));
    world.until(LIMIT, "back", |world| world.application().all_settled());
    assert_eq!((number(&mut world, 0xA004, 15), number(&mut world, 0xA004, 1)), (1, 8));
    let rate = |world: &mut World, sub_index| {
        number(world, 0xF120, sub_index);
        world.run_cycles(1500);
        number(world, 0xF120, sub_index)
    };
    assert!((900..=1100).contains(&rate(&mut world, 3)), "one frame in each cycle");
    assert!(rate(&mut world, 4) > 0 && number(&mut world, 0xF120, 1) > 0);
    assert_eq!(write(&mut world, 0xF200, 16, &[1]), Ok(()));
    for (index, sub_index) in [(0xA002, 10), (0xA004, 15), (0xF120, 1)] {
        assert_eq!(number(&mut world, index, sub_index), 0, "{index:#06x}:{sub_index}");
    }
}

// covers: 10.2, own-objects
#[test]
fn faults_of_a_subdevice_are_counted_and_kept_in_the_history() {
    let mut world = world();
    world.evaluate_latched(false);
    let seen = |world: &mut World| [14, 17, 18, 19].map(|sub_index| number(world, 0xA002, sub_index));
    let mailbox = world.mailbox(2);
    let limits = Limits::new(LIMIT, LIMIT);
    let refused = world.run(async move { coe::read(&mailbox, SdoAddress::new(0x7777, 0), limits, 8).await });
    assert!(refused.is_err());
    assert!(world.network_mut().device_mut(DeviceIndex(2)).application.diagnose(&message(), &[]));
    assert_eq!(seen(&mut world), [0, 0, 0x0602_0000, 1], "an abort of its, and a message in its own history");
    // Two lost frames with data of all SubDevices.
    world.drop(CableId(0), 2);
    world.drop(CableId(5), 2);
    world.run_cycles(10);
    let wrong = number(&mut world, 0xA002, 14);
    assert!((1..=8).contains(&wrong), "{wrong} datagrams");
    assert_eq!(number(&mut world, 0xA000, 14), 0, "no process data");
    assert_eq!(number(&mut world, 0x10F3, 4), 0, "all that is no incident");

    world.power_off(DeviceIndex(4));
    world.until(LIMIT, "gone", |world| world.application().states()[4] == SubDeviceState::Absent);
    world.power_on(DeviceIndex(4));
    world.until(LIMIT, "back", |world| world.application().all_settled());
    let (first, newest) = (6, number(&mut world, 0x10F3, 2) as u8);
    let kept: Vec<(u16, u8, u16)> = (first..=newest)
        .map(|sub_index| {
            let bytes = read(&mut world, 0x10F3, sub_index, false).expect("a message");
            let kept = DiagnosisMessage::decode(&bytes).expect("a message");
            let station = kept.parameters().next().expect("a station address");
            let DiagnosisParameter::Value(_, station) = station else { panic!("{station:?}") };
            assert_eq!((kept.code, kept.parameter_count), (0xE800 | u32::from(kept.text) << 16, 2));
            assert!(kept.time_ns > 0 && kept.local_time);
            (kept.text, kept.kind.code(), u16::from_le_bytes(station.try_into().expect("two bytes")))
        })
        .collect();
    let station = world.station_of(4);
    assert_eq!(kept.iter().filter(|message| message.0 == 1).collect::<Vec<_>>(), [&(1, 2, station)], "lost: {kept:?}");
    assert_eq!(kept.iter().filter(|message| message.0 == 2).collect::<Vec<_>>(), [&(2, 0, station)], "back: {kept:?}");
    assert_eq!(read(&mut world, 0x10F3, newest + 1, false), Ok(vec![]), "no message");
    assert_eq!(number(&mut world, 0x10F3, 4), 1);
    assert_eq!(write(&mut world, 0x10F3, 3, &[newest]), Ok(()));
    assert_eq!((number(&mut world, 0x10F3, 4), number(&mut world, 0x10F3, 3)), (0, u32::from(newest)));
    assert_eq!(write(&mut world, 0x10F3, 3, &[0]), Ok(()));
    assert_eq!((number(&mut world, 0x10F3, 2), read(&mut world, 0x10F3, first, false)), (0, Ok(vec![])));
    assert_eq!(write(&mut world, 0xF200, 16, &[1]), Ok(()));
    assert_eq!(seen(&mut world), [0, 0, 0, 1], "its own history is not affected");
    let complete = read(&mut world, 0xA002, 0, true).expect("its entries have one length each");
    assert_eq!((complete[0], complete.len(), complete.last()), (19, 2 + 16 + 8 * 4 + 2 + 1, Some(&1)));
}

// covers: 6.3, own-objects
#[test]
fn detection_scans_the_segment_and_long_lists_are_segmented() {
    // So many that their addresses need two lists.
    let inputs = descriptions(&["digital-input-8"; COUNT]);
    let mut world = World::in_op(2, ring(inputs, NetworkOptions::default()));
    world.evaluate_latched(false);
    let stations: Vec<u8> = (0..255_u16).flat_map(|at| (0x1001 + at).to_le_bytes()).collect();
    assert_eq!(read(&mut world, 0xF020, 1, true), Ok(stations.clone()));
    assert_eq!(number(&mut world, 0xF021, 0), 5);
    let mut list = vec![0; SdoInformation::OVERHEAD + 2];
    let request = ListType::All.code().to_le_bytes();
    SdoInformation::whole(InformationOpcode::ListRequest, &request).encode(&mut list).expect("it fits");
    let is_last = |part: &Vec<u8>| !SdoInformation::decode(part).expect("a part").incomplete;
    let parts = ask(&mut world, CLIENT, &list, |got| got.last().is_some_and(is_last));
    let data: Vec<u8> =
        parts.iter().flat_map(|part| SdoInformation::decode(part).expect("a part").data.to_vec()).collect();
    assert_eq!((parts.len(), Indices(&data[2..]).iter().count()), (4, 42 + 3 * COUNT));
    assert!(Indices(&data[2..]).iter().any(|index| index == 0xA000 + LAST as u16));

    world.power_off(DeviceIndex(LAST));
    world.until(LIMIT, "gone", |world| world.application().states()[LAST] == SubDeviceState::Absent);
    assert_eq!(number(&mut world, 0xF041, 0), 5, "as the scan found it");
    assert_eq!(write(&mut world, 0xF002, 1, &[1, 0]), Ok(()));
    assert_eq!(write(&mut world, 0xF002, 1, &[1, 0]), Err(AbortCode::CANNOT_BE_STORED_DEVICE_STATE), "it goes on");
    while number(&mut world, 0xF002, 2) == 255 {}
    assert_eq!((number(&mut world, 0xF002, 2), number(&mut world, 0xF041, 0)), (1, 4));
    assert_eq!(read(&mut world, 0xF040, 1, true), Ok(stations));
}

// covers: 6.3, own-objects
#[test]
fn invalid_requests_at_address_0_are_aborted_with_their_code() {
    let mut world = world();
    for (index, sub_index, complete, code) in [
        (0x2000, 0, false, AbortCode::OBJECT_DOES_NOT_EXIST),
        (0x8005, 1, false, AbortCode::OBJECT_DOES_NOT_EXIST),
        (0xA000, 20, false, AbortCode::SUB_INDEX_DOES_NOT_EXIST),
        (0xF020, 6, false, AbortCode::SUB_INDEX_DOES_NOT_EXIST),
        (0x9000, 5, true, AbortCode::SUB_INDEX_DOES_NOT_EXIST),
        (0x1008, 0, true, AbortCode::COMPLETE_ACCESS_NOT_SUPPORTED),
        (0x10F3, 0, true, AbortCode::COMPLETE_ACCESS_NOT_SUPPORTED),
        (0x10F3, 56, false, AbortCode::SUB_INDEX_DOES_NOT_EXIST),
    ] {
        assert_eq!(read(&mut world, index, sub_index, complete), Err(code), "{index:#06x}:{sub_index}");
    }
    for (index, sub_index, data, code) in [
        (0xF020, 1, &[1, 0][..], AbortCode::READ_ONLY),
        (0xF200, 16, &[1, 0][..], AbortCode::LENGTH_TOO_LONG),
        (0xF002, 1, &[1][..], AbortCode::LENGTH_TOO_SHORT),
        (0x10F3, 1, &[1][..], AbortCode::READ_ONLY),
        (0x10F3, 3, &[6][..], AbortCode::VALUE_TOO_HIGH),
        (0x10F3, 5, &[1, 0][..], AbortCode::VALUE_RANGE),
        (0x2000, 0, &[1][..], AbortCode::OBJECT_DOES_NOT_EXIST),
    ] {
        assert_eq!(write(&mut world, index, sub_index, data), Err(code), "{index:#06x}:{sub_index}");
    }
    let aborted = |response: SdoResponse<'_>| match response {
        SdoResponse::Abort { code, .. } => code,
        other => panic!("{other:?}"),
    };
    let next = SdoRequest::UploadSegment { toggle: false };
    assert_eq!(sdo(&mut world, CLIENT, next, aborted), AbortCode::UNKNOWN_COMMAND, "nothing is under way");
}

/// A warning for the history of a SubDevice.
fn message() -> DiagnosisMessage<'static> {
    let kind = DiagnosisKind::Warning;
    let (code, parameters) = (0xE800, &[][..]);
    DiagnosisMessage { code, kind, local_time: true, reserved: 0, text: 1, time_ns: 1, parameter_count: 0, parameters }
}

/// A random CoE message, mostly almost valid.
fn anything(dice: &mut Dice) -> Vec<u8> {
    let index =
        *dice.pick(&[0x1000, 0x1008, 0x10F3, 0x8001, 0x9004, 0xA002, 0xF002, 0xF020, 0xF040, 0xF120, 0xF200, 0xFFFF]);
    let [low, high] = u16::to_le_bytes(index);
    let sub_index = *dice.pick(&[0, 1, 2, 16, 255]);
    let mut payload = match dice.below(3) {
        0 => vec![0, 0x20, dice.roll() as u8, low, high, sub_index],
        1 => vec![0, 0x80, dice.below(8) as u8, 0, 0, 0, low, high, sub_index],
        _ => Vec::new(),
    };
    payload.extend((0..dice.below(30)).map(|_| dice.roll() as u8));
    payload
}

// covers: own-objects
#[test]
fn random_bytes_at_address_0_leave_the_next_request_working_seeds_0_to_9() {
    let mut world = world();
    let mark = world.mark();
    for seed in 0..10 {
        let mut dice = Dice::new(seed);
        for _ in 0..200 {
            let (client, payload) = (CLIENT + dice.below(3), anything(&mut dice));
            let header = Header { address: 0, ..Header::new(Protocol::Coe, 1, payload.len() as u16) };
            let mut bytes = vec![0; gateway::HEADER_LEN + Header::LEN + payload.len()];
            gateway::encode(&Message { header, payload: &payload }, &mut bytes).expect("it fits");
            let engine = world.application_mut().engine_mut();
            engine.relay(client, &bytes);
            if dice.one_in(20) {
                engine.forget_client(client);
            }
            if dice.one_in(4) {
                world.cycle();
            }
        }
        world.run_cycles(100);
        while world.application_mut().engine_mut().pop_relayed().is_some() {}
        assert_eq!(read(&mut world, 0x1008, 0, false), Ok(b"RingCAT".to_vec()), "seed {seed}");
    }
    assert_eq!((world.incomplete(mark), world.left_op(mark)), (0, vec![]));
}
