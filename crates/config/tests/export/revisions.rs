//! The rules for revisions (protocol ES-121): what the commands of a written file compare, and what is reported
//! instead.

use ringcat_config::eni::{SubDevice, Target};
use ringcat_config::network::model::CheckRevision;
use ringcat_config::{Export, ExportDetails, ExportOptions, export};
use ringcat_wire::register::map;

use crate::{CELL, again, configured, model, network};

const DRIVE: usize = 1;
const REVISION: u32 = 0x0012_0034;

/// The ENI of a drive with a rule for its revision.
fn exported(rule: CheckRevision) -> Export {
    let mut file = network(CELL);
    file.subdevice[DRIVE].revision = Some(REVISION);
    file.subdevice[DRIVE].check_revision = rule;
    file.to_eni(&ExportOptions::default()).unwrap_or_else(|error| panic!("{rule:?}: {error}"))
}

/// What the commands compare in the words of the revision: the word address and the bytes.
fn compared(subdevice: &SubDevice) -> Vec<(u8, Vec<u8>)> {
    let mut word = 0;
    let mut found = Vec::new();
    for command in &subdevice.init_commands {
        match (command.datagram.target, &command.validate) {
            (Target::Register { ado: map::SII_CONTROL, .. }, None) => word = command.datagram.data[2],
            (Target::Register { ado: map::SII_DATA, .. }, Some(check)) if matches!(word, 0x0C | 0x0D) => {
                assert_eq!(command.datagram.data.len(), check.data.len());
                found.push((word, check.data.clone()));
            }
            _ => {}
        }
    }
    found
}

// covers: ES-121, eni-run
#[test]
fn each_rule_for_a_revision_is_compared_as_far_as_equality_goes() {
    use CheckRevision::{
        Equal, EqualOrGreater, HighEqual, HighEqualLowEqualOrGreater, LowEqual, LowEqualHighEqualOrGreater, None,
    };
    let (low, high) = ((0x0C, vec![0x34, 0x00]), (0x0D, vec![0x12, 0x00]));
    let expected = [
        (None, vec![], false),
        (Equal, vec![(0x0C, vec![0x34, 0x00, 0x12, 0x00])], false),
        (EqualOrGreater, vec![], true),
        (LowEqual, vec![low.clone()], false),
        (LowEqualHighEqualOrGreater, vec![low], true),
        (HighEqual, vec![high.clone()], false),
        (HighEqualLowEqualOrGreater, vec![high], true),
    ];
    for (rule, commands, is_listed) in expected {
        let export = exported(rule);
        let model = model(&export.text);
        assert_eq!(compared(&model.subdevices[DRIVE]), commands, "{rule:?}");
        assert_eq!(model.subdevices[DRIVE].revision, Some(REVISION), "{rule:?}: Info has the whole revision");
        let listed: Vec<_> = export.left_out.iter().filter(|it| it.what == "check_revision").collect();
        assert_eq!(listed.iter().map(|it| it.subdevice).collect::<Vec<_>>(), vec![Some(DRIVE); is_listed.into()]);
        assert!(listed.iter().all(|it| it.reason.contains("0x00120034")), "{listed:?}");
    }
}

// covers: ES-121, ES-142, eni-run
#[test]
fn a_rule_for_a_revision_is_the_same_from_eni_to_eni() {
    for rule in [CheckRevision::Equal, CheckRevision::LowEqual, CheckRevision::HighEqual] {
        let first = exported(rule);
        let read = configured(&first.text).declaration.subdevices[DRIVE].clone();
        let mut file = network(CELL);
        (file.subdevice[DRIVE].revision, file.subdevice[DRIVE].check_revision) = (Some(REVISION), rule);
        assert_eq!(read.expected, file.configuration().declaration.subdevices[DRIVE].expected, "{rule:?}");
        let second = again(&first.text, &ExportOptions::default()).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(second.text, first.text, "{rule:?}");
    }
}

// covers: ES-121, eni-run
#[test]
fn a_lowest_revision_alone_is_the_revision_of_the_file() {
    let mut configuration = configured(&exported(CheckRevision::Equal).text);
    let expected = &mut configuration.declaration.subdevices[DRIVE].expected;
    (expected.revision, expected.minimum_revision) = (None, Some(REVISION));
    let export = export(&configuration, &ExportDetails::default(), &ExportOptions::default())
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(model(&export.text).subdevices[DRIVE].revision, Some(REVISION));
    assert!(export.left_out.iter().any(|it| it.what == "check_revision"));
}
