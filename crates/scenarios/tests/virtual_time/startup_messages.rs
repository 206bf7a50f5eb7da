//! Start-up commands that read IDNs, transfer files, or send messages of AoE and VoE: checked by what the SubDevice has
//! served.

use ringcat::{
    Event, FileRead, FileWrite, IdnRead, MailMessage, Options, Scan, StartupAction, StartupCommand, StartupSource,
    SubDeviceId, Transition, automatic,
};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::NetworkOptions;
use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::aoe::{AdsErrorCode, AdsRequest, AmsAddress, AmsHeader, NetId};
use ringcat_wire::mailbox::soe::{Idn, SoeElements};
use ringcat_wire::mailbox::voe::VoeMessage;
use scenarios::check::troubles;
use scenarios::segments::{descriptions, line};
use scenarios::world::{CYCLE, World};

const KINDS: [&str; 3] = ["coupler", "all-protocols", "digital-input-8"];
/// The SubDevice with commands.
const DRIVE: usize = 1;

fn try_world(commands: &[(Transition, StartupAction)]) -> Result<World, String> {
    let declare = |scan: &Scan| {
        let mut declaration = automatic(&scan.subdevices, CYCLE);
        for (transition, action) in commands {
            let command = StartupCommand::new(*transition, action.clone()).with_comment("a look".to_owned());
            declaration.subdevices[DRIVE].startup.push(command);
        }
        declaration
    };
    let network = line(descriptions(&KINDS), NetworkOptions::default());
    let mut world = World::with(1, network, &Options::default(), declare).map_err(|error| error.to_string())?;
    world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
    Ok(world)
}

fn world(commands: &[(Transition, StartupAction)]) -> World {
    let mut world = try_world(commands).expect("scan and activation");
    world.settle();
    assert_eq!(troubles(world.events(world.beginning())), Vec::<&Event>::new());
    world
}

/// The reason of the failed configuration.
fn failure(action: StartupAction) -> String {
    let mut world = try_world(&[(Transition::Ps, action)]).expect("scan and activation");
    world.run_cycles(600);
    let reason = world.events(world.beginning()).iter().find_map(|timed| match &timed.event {
        Event::ConfigurationFailed { subdevice: SubDeviceId(DRIVE), reason } => Some(reason.clone()),
        _ => None,
    });
    reason.unwrap_or_else(|| panic!("{:?}", troubles(world.events(world.beginning()))))
}

/// Messages of a protocol that the device has served, with its state.
fn served(world: &World, protocol: Protocol) -> Vec<(AlState, Vec<u8>)> {
    let all = world.network().device(DeviceIndex(DRIVE)).application.served_mail();
    all.iter().filter(|mail| mail.protocol == protocol).map(|mail| (mail.state, mail.payload.clone())).collect()
}

fn read(number: u16) -> IdnRead {
    IdnRead::new(0, Idn::standard(0, number))
}

/// The value of an IDN in the device.
fn value(number: u16) -> Vec<u8> {
    let world = world(&[]);
    let device = world.network().device(DeviceIndex(DRIVE));
    let server = device.application.servers().soe().expect("it supports SoE");
    server.idn(0, Idn::standard(0, number)).expect("it is there").value.clone()
}

// covers: 6.6, startup-commands
#[test]
fn idns_are_read_and_compared_or_reported() {
    let held = value(1);
    let same = StartupAction::IdnRead(read(1).with_expected(held.clone()));
    let world = world(&[(Transition::Ip, same), (Transition::So, StartupAction::IdnRead(read(1)))]);
    let states: Vec<AlState> = served(&world, Protocol::Soe).into_iter().map(|(state, _)| state).collect();
    assert_eq!(states, [AlState::PreOp, AlState::SafeOp]);
    let reports: Vec<_> = world
        .events(world.beginning())
        .iter()
        .filter_map(|timed| match &timed.event {
            Event::StartupRead { subdevice: SubDeviceId(DRIVE), number, source, comment, data } => {
                Some((*number, source.clone(), comment.clone(), data.clone()))
            }
            _ => None,
        })
        .collect();
    let source = StartupSource::Idn { drive: 0, idn: Idn::standard(0, 1) };
    assert_eq!(reports, [(1, source, Some("a look".to_owned()), held)]);
}

// covers: 6.6, startup-commands
#[test]
fn an_idn_with_other_data_and_a_missing_idn_are_reported() {
    let text = failure(StartupAction::IdnRead(read(1).with_expected(vec![0xAA])));
    let begin =
        "start-up command 0 (PREOP to SAFEOP) \"a look\": SoE drive 0 S-0-0001 elements 0x40: expected aa, got ";
    assert!(text.starts_with(begin), "{text}");
    let text = failure(StartupAction::IdnRead(read(4000).with_elements(SoeElements(0x48))));
    assert!(text.contains("SoE drive 0 S-0-4000 elements 0x48: refused by the drive"), "{text}");
}

fn ads(port: u16, request: &AdsRequest<'_>) -> Vec<u8> {
    let mut data = vec![0; 64];
    let length = request.encode(&mut data).expect("it fits");
    let address = |port| AmsAddress { net_id: NetId([5, 6, 7, 8, 3, 1]), port };
    let (flags, error, command) = (AmsHeader::REQUEST, AdsErrorCode::NO_ERROR, request.command());
    let length_32 = length as u32;
    let (target, source) = (address(port), address(0x8000));
    let header = AmsHeader { target, source, command, flags, length: length_32, error, invoke_id: 0x1234 };
    [&header.encode()[..], &data[..length]].concat()
}

// covers: 6.7, 6.8, startup-commands
#[test]
fn messages_of_aoe_and_voe_arrive_as_they_were_declared() {
    let aoe = ads(1000, &AdsRequest::ReadState);
    let vendor_id = descriptions(&KINDS)[DRIVE].identity.vendor_id;
    let mut voe = vec![0; VoeMessage::OVERHEAD + 3];
    VoeMessage { vendor_id, vendor_type: 7, data: &[1, 2, 3] }.encode(&mut voe).expect("it fits");
    let mut world = world(&[
        (Transition::Ps, StartupAction::Mail(MailMessage::Aoe(aoe.clone()))),
        (Transition::So, StartupAction::Mail(MailMessage::Voe(voe.clone()))),
    ]);
    let expected = ([(AlState::PreOp, aoe)], [(AlState::SafeOp, voe)]);
    let both = |world: &World| (served(world, Protocol::Aoe), served(world, Protocol::Voe));
    let expected = (expected.0.to_vec(), expected.1.to_vec());
    assert_eq!(both(&world), expected);
    // Again after its return.
    world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
    world.power_off(DeviceIndex(DRIVE));
    world.run_cycles(20);
    world.power_on(DeviceIndex(DRIVE));
    world.settle();
    assert_eq!(both(&world), expected);
}

// covers: 6.7, startup-commands
#[test]
fn a_refused_message_of_aoe_and_messages_without_a_header_are_reported() {
    let text = failure(StartupAction::Mail(MailMessage::Aoe(ads(999, &AdsRequest::ReadState))));
    assert!(text.starts_with("start-up command 0 (PREOP to SAFEOP) \"a look\": AoE: not delivered: "), "{text}");
    for message in [MailMessage::Aoe(vec![0; 31]), MailMessage::Voe(vec![0; 5])] {
        let refused = try_world(&[(Transition::Ps, StartupAction::Mail(message))]).expect_err("it was taken");
        assert!(refused.contains("no header of its protocol"), "{refused}");
    }
    let early = try_world(&[(Transition::Ii, StartupAction::IdnRead(read(1)))]).expect_err("it was taken");
    assert!(early.contains("INIT has no mailbox"), "{early}");
}

/// A file in the device.
fn held(world: &World, name: &str) -> Option<Vec<u8>> {
    let files = world.network().device(DeviceIndex(DRIVE)).application.files();
    files.file(name.as_bytes()).map(<[u8]>::to_vec)
}

// covers: 6.4, startup-commands
#[test]
fn files_are_written_at_each_return_and_read_for_an_event() {
    // No packet, a full one, and more than one packet of the mailbox.
    for length in [0, 116, 1000] {
        let contents: Vec<u8> = (0..length).map(|byte| byte as u8).collect();
        let mut world = world(&[
            (Transition::Ip, StartupAction::FileWrite(FileWrite::new("gains.txt", contents.clone()))),
            (Transition::Ps, StartupAction::FileRead(FileRead::new("log.txt"))),
        ]);
        assert_eq!(held(&world, "gains.txt"), Some(contents.clone()));
        let read: Vec<_> = world
            .events(world.beginning())
            .iter()
            .filter_map(|timed| match &timed.event {
                Event::StartupRead { subdevice: SubDeviceId(DRIVE), number, source, comment, data } => {
                    Some((*number, source.clone(), comment.clone(), data.clone()))
                }
                _ => None,
            })
            .collect();
        let source = StartupSource::File { name: "log.txt".to_owned() };
        let log = b"nothing happened\n".repeat(100);
        assert_eq!(read, [(1, source, Some("a look".to_owned()), log)]);
        world.network_mut().device_mut(DeviceIndex(DRIVE)).application.record_mail();
        world.power_off(DeviceIndex(DRIVE));
        world.run_cycles(20);
        world.power_on(DeviceIndex(DRIVE));
        world.settle();
        let first = served(&world, Protocol::Foe).into_iter().next();
        let request = [&[2, 0, 0, 0, 0, 0][..], b"gains.txt"].concat();
        assert_eq!(first, Some((AlState::PreOp, request)));
        assert_eq!(held(&world, "gains.txt"), Some(contents));
    }
}

// covers: 6.4, startup-commands
#[test]
fn a_missing_and_a_refused_file_are_reported() {
    let text = failure(StartupAction::FileRead(FileRead::new("none.txt")));
    assert!(text.starts_with("start-up command 0 (PREOP to SAFEOP) \"a look\": FoE \"none.txt\": "), "{text}");
    // It is written in BOOT only.
    let text = failure(StartupAction::FileWrite(FileWrite::new("firmware.bin", [0; 10])));
    assert!(text.starts_with("start-up command 0 (PREOP to SAFEOP) \"a look\": FoE \"firmware.bin\": "), "{text}");
    let early = try_world(&[(Transition::Ii, StartupAction::FileRead(FileRead::new("log.txt")))]);
    assert!(early.expect_err("it was taken").contains("INIT has no mailbox"));
}
