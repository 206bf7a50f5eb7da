//! Reading and writing: the declaration of a file, its canonical text, its digest.

use std::time::Duration;

use ringcat_config::network::NetworkFile;
use ringcat_engine::JunctionMode;
use ringcat_engine::config::{
    ConfigAddress, FileRead, FileWrite, IdnRead, MailMessage, StartupAction, Transition, Watchdog,
};
use ringcat_engine::declared::GroupId;
use ringcat_engine::info::Direction;
use ringcat_engine::layout::LrwPolicy;
use ringcat_engine::main_device::Required;
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::mailbox::soe::{Idn, SoeElements};

use crate::WHOLE;

fn whole() -> NetworkFile {
    NetworkFile::read("whole.toml", WHOLE.as_bytes()).expect("the file is valid")
}

// covers: network-file
#[test]
fn a_file_with_all_keys_is_its_own_canonical_text() {
    assert_eq!(whole().to_text(), WHOLE);
}

// covers: network-file
#[test]
fn comments_order_of_keys_and_implied_values_do_not_change_the_digest() {
    let other = WHOLE
        .replace("ringcat_network = 1\n", "# A comment\nringcat_network = 1\n\n\n")
        .replace("position = 0\nvendor = 0x00000c47\n", "vendor = 3143\nrequired = false\n")
        .replace("required = false\n", "optional = false\n")
        .replace("name = \"Drive\"\nposition = 1\n", "position = 0x1\nname = 'Drive'\n")
        .replace("under_way = 2\n", "send_again = false\nunder_way = 2\n");
    let file = NetworkFile::read("other.toml", other.as_bytes()).expect("the file is valid");
    assert_eq!(file.to_text(), WHOLE);
    assert_eq!(file.digest(), whole().digest());
    let changed = WHOLE.replace("period = \"250us\"", "period = \"251us\"");
    let changed = NetworkFile::read("changed.toml", changed.as_bytes()).expect("the file is valid");
    assert_ne!(changed.digest(), whole().digest());
    // The SHA-256 of the canonical text, as `sha256sum` prints it.
    assert_eq!(whole().digest().to_string(), "c2abc93e411b9daf97439aea6ca12f18d61cce21b778700529546dcd237d75c6");
}

// covers: network-file
#[test]
fn every_key_is_in_the_declaration() {
    let file = whole();
    let configuration = file.configuration();
    let declaration = &configuration.declaration;
    let [coupler, drive, tool, second, switch] = &declaration.subdevices[..] else { panic!("five SubDevices") };
    assert_eq!(coupler.expected.minimum_revision, Some(0x10_0000));
    assert_eq!((coupler.expected.serial, coupler.expected.identification), (Some(77), Some(3)));
    assert_eq!((drive.address, drive.optional), (ConfigAddress::Position(1), true));
    assert_eq!(drive.expected.revision, Some(0x10_0000));
    assert_eq!((tool.address, tool.group), (ConfigAddress::Alias { alias: 5, offset: 0 }, Some(GroupId(0))));
    assert_eq!((second.address, second.group), (ConfigAddress::Alias { alias: 5, offset: 1 }, Some(GroupId(0))));
    let word = ConfigAddress::DataWord { register: RegisterAddress(0x1000), value: 9, offset: 2 };
    assert_eq!(switch.address, word);
    assert_eq!(configuration.groups, ["tool 1"]);
    assert_eq!((declaration.required, declaration.lrw), (Required::All, LrwPolicy::PerSubDevice));
    let pdos = drive.pdos.as_ref().expect("PDOs");
    let shape: Vec<_> = pdos.iter().map(|it| (it.sync_manager, it.direction, it.pdos.len())).collect();
    assert_eq!(shape, [(2, Direction::Outputs, 1), (3, Direction::Inputs, 2)]);
    assert_eq!(pdos[1].pdos.iter().map(|pdo| pdo.fixed).collect::<Vec<_>>(), [true, false]);
    assert!(pdos[1].pdos[1].entries.is_none(), "the entries of the SII");
    assert_eq!(drive.sync_managers.iter().map(|it| it.watchdog).collect::<Vec<_>>(), [Watchdog::Off]);
    assert!(tool.pdos.is_none(), "a length alone declares no PDOs");
    let sync = drive.sync.expect("SYNC signals");
    assert_eq!((sync.sync0_cycle_ns, sync.sync0_shift_ns), (250_000, -20_000));
    assert_eq!((sync.sync1_cycle_ns, sync.sync1_shift_ns), (1_000_000, 10_000));
    assert_eq!((drive.timeouts.preop, drive.timeouts.eoe), (Duration::from_secs(5), Duration::from_secs(4)));
    assert_eq!(drive.wait_before_safeop, Duration::from_millis(100));
    assert!(drive.sii_to_pdi);
    let transitions: Vec<Transition> = drive.startup.iter().map(|command| command.transition).collect();
    use Transition::{Bi, Ii, Ip, Os, Pi, Pp, Ps, So, Sp, Ss};
    assert_eq!(transitions, [Ip, Ps, Ps, So, Ps, Os, Sp, Ps, Pi, Bi, Ss, Ii, Pp, Ip, Ps]);
    let read = IdnRead::new(2, Idn(11)).with_elements(SoeElements(0x48)).with_expected(vec![1, 2]);
    assert_eq!(drive.startup[8].action, StartupAction::IdnRead(read));
    assert!(matches!(&drive.startup[9].action, StartupAction::Mail(MailMessage::Aoe(data)) if data.len() == 32));
    let voe = MailMessage::Voe(vec![0x47, 0x0C, 0, 0, 7, 0]);
    assert_eq!(drive.startup[10].action, StartupAction::Mail(voe));
    assert_eq!(drive.startup[12].action, StartupAction::IdnRead(IdnRead::new(0, Idn(11))));
    let gains = FileWrite::new("gains.txt", b"1\n").with_password(0x0102_0304);
    assert_eq!(drive.startup[13].action, StartupAction::FileWrite(gains));
    assert_eq!(drive.startup[14].action, StartupAction::FileRead(FileRead::new("log.txt")));
    let after: Vec<usize> = (0..15).filter(|number| drive.startup[*number].is_after_pdos()).collect();
    assert_eq!(after, [14]);
    assert!(matches!(&drive.startup[1].action, StartupAction::Sdo(sdo) if sdo.complete_access));
    assert_eq!(drive.startup[0].comment.as_deref(), Some("ramp of \\ 1 s"));
    let members: Vec<Vec<(usize, Option<Vec<u8>>)>> = declaration
        .domains
        .iter()
        .map(|domain| domain.members.iter().map(|it| (it.subdevice.0, it.sync_managers.clone())).collect())
        .collect();
    let fast = vec![(0, None), (1, Some(vec![2])), (2, None), (4, None)];
    assert_eq!(members, [fast, vec![(1, Some(vec![3])), (3, None)]]);
    assert_eq!(configuration.cycle, Some(Duration::from_micros(250)));
    let (mode, connections) = (file.junction_mode(), file.junction_connections());
    assert_eq!((mode, connections.len()), (JunctionMode::Strict, 1));
    assert!(declaration.clocks.as_ref().is_some_and(|clocks| clocks.bus_shift && clocks.sync_window_ns == 500));
}

// covers: network-file
#[test]
fn variables_have_unique_names_and_bytes_of_their_own() {
    let configuration = whole().configuration();
    let image = &configuration.image;
    let variables: Vec<(&str, u32, u32)> =
        image.variables.iter().map(|it| (it.name.as_str(), it.image_bit, it.bits)).collect();
    // The SII has the entries of the second PDO: SyncManager 3 has no place in the image.
    assert_eq!(variables, [("Drive.Command.Controlword", 0, 16), ("Drive.Command.Target", 16, 32)]);
    assert_eq!((image.outputs_len, image.inputs_len), (7, 0));
    let twice = WHOLE
        .replace("name = \"Target\"", "name = \"Controlword\"")
        .replace("\n[[subdevice.sync_manager.pdo]]\nindex = 0x1a01\n", "");
    let file = NetworkFile::read("twice.toml", twice.as_bytes()).expect("the file is valid");
    let names: Vec<String> = file.configuration().image.variables.into_iter().map(|it| it.name).collect();
    assert_eq!(names, ["Drive.Command.Controlword", "Drive.Command.Controlword 2", "Drive.6041:00"]);
}

// covers: network-file
#[test]
fn the_example_of_the_documentation_is_valid() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/network-file.md");
    let Ok(page) = std::fs::read_to_string(path) else {
        println!("skipped: {path} is not there");
        return;
    };
    let example = page.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next()).expect("an example");
    let file = NetworkFile::read("example.toml", example.as_bytes()).expect("the example is valid");
    assert_eq!(file.subdevice.len(), 2);
}
