//! Editions of the schema (protocol ES-09): what each added is read or named as not used, and none changes what the
//! others state; what no edition has is a notice, at any element.

use ringcat_config::esi::{self, Transition};

use crate::ACME;

/// The notices of the file with a text replaced.
fn notices(from: &str, to: &str) -> Vec<String> {
    assert!(ACME.contains(from), "{from}");
    let text = ACME.replacen(from, to, 1);
    let esi = esi::read("edition.xml", text.as_bytes()).unwrap_or_else(|error| panic!("{from}: {error}"));
    let plain = esi::read("edition.xml", ACME.as_bytes()).unwrap();
    let identities = |esi: &esi::Esi| {
        let of = |it: &esi::Device| (it.kind.clone(), it.product_code, it.revision, it.rx_pdos.len(), it.tx_pdos.len());
        esi.devices.iter().map(of).collect::<Vec<_>>()
    };
    assert_eq!(identities(&esi), identities(&plain), "{to}");
    esi.notices.iter().map(ToString::to_string).collect()
}

/// Edition, place, the place with what it added, the notice or nothing.
const ADDED: [(&str, &str, &str, &str); 24] = [
    ("before 2011", "<GroupType>AcmeDrives<", "<OpMode/><GroupType>AcmeDrives<", "Device/OpMode is not used"),
    ("before 2011", "ControlByte=\"#x44\"", "ControlByte=\"#x44\" OneByteMode=\"0\" Watchdog=\"1\"", ""),
    (
        "2011-05",
        "-2000</EBusCurrent></Electrical>",
        "-2000</EBusCurrent></Electrical><IdentificationAdo>#x0134</IdentificationAdo>",
        "",
    ),
    ("2011-05", "<RxPdo Fixed", "<RxPdo SRA_Parameter=\"1\" Fixed", ""),
    (
        "2011-08",
        "-2000</EBusCurrent></Electrical>",
        "-2000</EBusCurrent></Electrical><IdentificationReg134>1</IdentificationReg134>",
        "",
    ),
    (
        "2011-08",
        "<DataTypes>",
        "<UnitTypes><UnitType><NotationIndex>0</NotationIndex></UnitType></UnitTypes><DataTypes>",
        "",
    ),
    ("2011-08", "<ProfileNo>5001", "<DiagMessages><DiagMessage/></DiagMessages><ProfileNo>5001", ""),
    (
        "2013-03",
        "<ShiftTimeSync0>",
        "<ShiftTimeSync0 InputDelayTime=\"1\" OutputDelayTime=\"2\">",
        "ShiftTimeSync0@InputDelayTime is not used",
    ),
    ("2013-03", "<Category><CatNo>2", "<Category PreserveOnlineData=\"1\"><CatNo>2", ""),
    ("2013-03", "<Name>Channels 1 to 4</Name>", "<Name>Channels 1 to 4</Name><ExcludedSm>1</ExcludedSm>", ""),
    ("2013-03", "<Slot MinInstances=\"1\"", "<SlotSelections/><Slot MinInstances=\"1\"", ""),
    ("2013-03", "DownloadModuleIdentList", "DownloadModuleAddressList=\"0\" DownloadModuleIdentList", ""),
    ("2013-03", "Enable=\"1\" OpOnly", "FixedAssignment=\"1\" Enable=\"1\" OpOnly", ""),
    ("2013-03", "<Device Physics=\"YKY\">", "<Device Physics=\"YKY\" Crc32=\"#x1\">", ""),
    (
        "2013-03",
        "<GroupType>AcmeDrives<",
        "<SubDevice PreviousDevice=\"0\" PreviousPortNo=\"1\">x</SubDevice><GroupType>AcmeDrives<",
        "",
    ),
    ("1.12", "<Dc>", "<Dc PotentialReferenceClock=\"1\" TimeLoopControlOnly=\"0\">", ""),
    ("1.12", "DownloadModuleIdentList", "DownloadModuleListTransition=\"PS\" DownloadModuleIdentList", ""),
    (
        "1.14",
        "<ProfileNo>5001",
        "<ChannelInfo ChannelGroup=\"1\"><ProfileNo>1</ProfileNo></ChannelInfo><ProfileNo>5001",
        "",
    ),
    ("1.14", "<RxPdo Fixed", "<RxPdo SafetyPdoType=\"FSoESlave\" SafetyConnNumber=\"1\" Fixed", ""),
    (
        "1.17",
        "<Type ProductCode=\"#x00001001",
        "<Sci><Any/></Sci><Type ShowHideableSubDevices=\"1\" ProductCode=\"#x00001001",
        "",
    ),
    ("1.17", "<CoE SdoInfo=\"true\"", "<CoE SdoUploadWithMaxLength=\"1\" TimeDistribution=\"1\" SdoInfo=\"true\"", ""),
    (
        "1.17",
        "<Slot MinInstances=\"1\"",
        "<Slot Default=\"1\" Fallback=\"1\" MinInstances=\"1\"",
        "Slot@Default is not used",
    ),
    ("later", "<Dc>", "<Dc PdoOversampling=\"1\">", ""),
    (
        "later",
        "<CycleTimeSync1 Factor=\"-1\">",
        "<CycleTimeSync2>0</CycleTimeSync2><CycleTimeSync1 Factor=\"-1\">",
        "OpMode/CycleTimeSync2 is not used",
    ),
];

// covers: esi-read, ES-65
#[test]
fn more_slots_than_a_device_has_are_noted() {
    let found = notices("<Slot MinInstances=\"1\"", "<Slot MinInstances=\"300\"");
    assert!(found.iter().any(|text| text.contains("MinInstances 300: a device has at most 255 slots")), "{found:?}");
}

// covers: ES-09, ES-10, esi-read
#[test]
fn each_edition_of_the_schema_is_read_and_what_is_not_used_is_named() {
    assert_eq!(notices("Version=\"1.6\"", "Version=\"1.17\""), notices("Version=\"1.6\"", ""));
    for (edition, from, to, expected) in ADDED {
        let found = notices(from, to);
        match expected {
            "" => assert_eq!(found, [""; 0], "{edition}: {to}"),
            _ => assert!(found.iter().any(|notice| notice.contains(expected)), "{edition}: {found:?}"),
        }
    }
}

// covers: ES-10, esi-read
#[test]
fn unknown_elements_and_attributes_are_noted_wherever_they_are() {
    for (from, to, expected) in [
        ("<Entry><Index>#x7000", "<Entry Foo=\"1\"><Index>#x7000", "Entry@Foo is not known: not used"),
        ("<CoE SdoInfo=\"true\"", "<CoE Foo=\"1\" SdoInfo=\"true\"", "CoE@Foo is not known"),
        ("<Slot MinInstances=\"1\"", "<Slot Foo=\"1\" MinInstances=\"1\"", "Slot@Foo is not known"),
        ("<InitCmd><Transition>", "<InitCmd><Foo/><Transition>", "InitCmd/Foo is not known"),
        ("<Object><Index>#x1000", "<Object><Foo/><Index>#x1000", "Object/Foo is not known"),
        ("<SubIdx>17</SubIdx>", "<SubIdx>17</SubIdx><Foo/>", "SubItem/Foo is not known"),
        ("<Group SortOrder", "<Group Foo=\"1\" SortOrder", "Group@Foo is not known"),
        ("<Vendor>", "<Vendor><Foo/>", "Vendor/Foo is not known"),
        ("<Su FrameRepeat", "<Su Foo=\"1\" FrameRepeat", "Su@Foo is not known"),
        ("<ByteSize>512", "<Foo/><ByteSize>512", "Eeprom/Foo is not known"),
        ("<PreopTimeout>", "<Foo/><PreopTimeout>", "Timeout/Foo is not known"),
    ] {
        let found = notices(from, to);
        assert!(found.len() == 1 && found[0].starts_with("line ") && found[0].contains(expected), "{found:?}");
    }
}

// covers: ES-53, ES-54, ES-70
#[test]
fn features_of_mailboxes_and_the_time_of_the_list_of_modules_are_kept() {
    let text = ACME
        .replacen(
            "<CoE SdoInfo=\"true\"",
            "<AoE GenerateOwnNetId=\"1\"/><CoE EdsFile=\"a.eds\" TimeDistribution=\"1\" SdoInfo=\"true\"",
            1,
        )
        .replacen("DownloadModuleIdentList", "DownloadModuleListTransition=\"SO\" DownloadModuleIdentList", 1);
    let esi = esi::read("acme.xml", text.as_bytes()).unwrap();
    let mailbox = esi.devices[2].mailbox.as_ref().unwrap();
    let (aoe, coe) = (mailbox.aoe.as_ref().unwrap(), mailbox.coe.as_ref().unwrap());
    assert!(aoe.generate_net_id && !aoe.initialize_net_id && coe.time_distribution && !coe.upload_with_max_length);
    assert_eq!(coe.eds_file.as_deref(), Some("a.eds"));
    assert_eq!(esi.devices[3].slots.as_ref().unwrap().download_transition, Transition::So);
    let printed = text.replacen("Transition=\"SO\"", "Transition=\"SP\"", 1);
    let esi = esi::read("acme.xml", printed.as_bytes()).unwrap();
    assert_eq!(esi.devices[3].slots.as_ref().unwrap().download_transition, Transition::Ps, "a slip of an edition");
}
