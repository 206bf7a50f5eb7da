//! Choices for devices: what the rules of a description allow, and what they refuse with file, line and device.

use std::time::Duration;

use ringcat_config::esi::{
    Choices, EntryChoice, Esi, MappingChoice, Parameter, PdoChoice, SamplesChoice, SelectedMessage, Transition, select,
};
use ringcat_config::network::NetworkFile;
use ringcat_config::network::model::{At, CheckRevision, SubDevice};

use crate::ACME;
use crate::reading::{acme, acme_of};

const COUPLER: usize = 0;
const OUTPUTS: usize = 1;
const ANALOG: usize = 2;
const DRIVE: usize = 3;
const CYCLE: Duration = Duration::from_millis(1);

fn choices(change: impl FnOnce(&mut Choices)) -> Choices {
    let mut choices = Choices::default();
    change(&mut choices);
    choices
}

/// PDOs by SyncManager.
fn assigned(esi: &Esi, device: usize, choices: &Choices) -> Vec<(u8, Vec<u16>)> {
    let selection = select(esi, &esi.devices[device], choices).unwrap_or_else(|error| panic!("{error}"));
    let list = |of: &ringcat_config::esi::SelectedSyncManager<'_>| of.pdos.iter().map(|pdo| pdo.index.index).collect();
    selection.sync_managers.iter().map(|of| (of.number, list(of))).collect()
}

fn refused(esi: &Esi, device: usize, choices: &Choices) -> String {
    select(esi, &esi.devices[device], choices).map(|_| ()).expect_err("it is refused").to_string()
}

/// A SubDevice of a network file.
fn declared(esi: &Esi, device: usize, choices: &Choices) -> SubDevice {
    let selection = select(esi, &esi.devices[device], choices).unwrap_or_else(|error| panic!("{error}"));
    let from = SubDevice::from_esi(&selection, CYCLE, choices.language).unwrap_or_else(|error| panic!("{error}"));
    let mut file = NetworkFile::empty("machine", CYCLE);
    file.push(from.subdevice.clone());
    let text = file.to_text();
    let again = NetworkFile::read("machine.toml", text.as_bytes()).unwrap_or_else(|error| panic!("{error}\n{text}"));
    assert_eq!(again.to_text(), text);
    from.subdevice
}

/// A line of the file with this text, from 1.
fn line(text: &str) -> usize {
    ACME.lines().position(|line| line.contains(text)).unwrap_or_else(|| panic!("{text}")) + 1
}

// covers: esi-declare, ES-40, ES-47, ES-48
#[test]
fn without_choices_the_assignment_is_that_of_the_file() {
    let esi = acme();
    assert_eq!(assigned(&esi, COUPLER, &Choices::default()), []);
    assert_eq!(assigned(&esi, OUTPUTS, &Choices::default()), [(0, vec![0x1600, 0x1601])]);
    assert_eq!(assigned(&esi, ANALOG, &Choices::default()), [(2, vec![]), (3, vec![0x1A00, 0x1A02])]);
    let selection_of = |device: usize| declared(&esi, device, &Choices::default());
    let outputs = selection_of(OUTPUTS);
    assert_eq!((outputs.vendor, outputs.product, outputs.revision), (Some(0xC47), Some(0x1008), Some(0x12_0000)));
    assert_eq!(outputs.check_revision, CheckRevision::LowEqualHighEqualOrGreater);
    let sm = &outputs.sync_manager[0];
    assert_eq!((sm.start, sm.control, sm.op_only), (Some(0xF00), Some(0x44), true));
    assert_eq!(sm.pdo[0].entries.as_ref().map(|entries| entries[3].name.as_str()), Some("Output 4"));
    let analog = selection_of(ANALOG);
    assert_eq!(analog.timeouts.safeop_op.map(|time| time.0), Some(Duration::from_secs(9)));
    assert_eq!(analog.timeouts.sdo.map(|time| time.0), Some(Duration::from_secs(2)));
    let mailbox = analog.mailbox.expect("CoE");
    assert_eq!((mailbox.write.start, mailbox.read.length), (0x1000, 128));
    assert_eq!(mailbox.boot_read.map(|boot| (boot.start, boot.length)), Some((0x10F4, 0xF4)));
    assert!(mailbox.pdo_assign && !mailbox.pdo_config && mailbox.complete_access);
    assert_eq!((analog.startup[0].at, analog.startup[0].comment.as_deref()), (At::Ps, Some("filter time")));
    let german = choices(|choices| choices.language = 1031);
    assert_eq!(declared(&esi, DRIVE, &german).name, "AM01");
}

// covers: esi-declare, ES-63
#[test]
fn a_shift_adds_time_and_part_of_the_cycle_and_lost_settings_are_reported() {
    let from = |text: &str| {
        let esi = acme_of(text);
        let choices = choices(|choices| choices.mode = Some("DC".to_owned()));
        let selection = select(&esi, &esi.devices[DRIVE], &choices).unwrap_or_else(|error| panic!("{error}"));
        let from = SubDevice::from_esi(&selection, CYCLE, 1033).unwrap_or_else(|error| panic!("{error}"));
        let notices: Vec<String> = from.notices.iter().map(|notice| notice.text.clone()).collect();
        (from.subdevice.sync.map(|sync| sync.sync0_shift.0), notices)
    };
    let shift = |attributes: &str, ns: i32| {
        let text = format!("<ShiftTimeSync0{attributes}>{ns}<");
        from(&ACME.replacen("<ShiftTimeSync0>30000<", &text, 1))
    };
    let (_, plain) = shift("", 30_000);
    let added = |notices: &[String]| notices.iter().filter(|text| !plain.contains(text)).cloned().collect::<Vec<_>>();
    for (attributes, ns, expected) in [("", -20_000, -20_000), (" Factor=\"1\"", -20_000, 980_000)] {
        let (found, notices) = shift(attributes, ns);
        assert_eq!((found, added(&notices).len()), (Some(expected), 0), "{attributes}");
    }
    let (found, notices) = shift(" Factor=\"-4\" Input=\"1\"", 1_000);
    assert_eq!((found, added(&notices).len()), (Some(251_000), 1));
    assert!(added(&notices)[0].contains("the shift of SYNC0 of 251000 ns refers to inputs"), "{notices:?}");
    let loop_only = ACME.replacen("<Dc>", "<Dc TimeLoopControlOnly=\"1\">", 1);
    let (found, notices) = from(&loop_only);
    assert_eq!((found, added(&notices).len()), (None, 1), "{notices:?}");
    let latch = acme_of(&loop_only.replacen("<AssignActivate>#x0<", "<AssignActivate>#x0100<", 1));
    let mode = choices(|choices| choices.mode = Some("FreeRun".to_owned()));
    let writes = |it: &ringcat_config::network::model::Startup| it.write.is_some();
    assert!(!declared(&latch, DRIVE, &mode).startup.iter().any(writes), "no unit is activated");
    let (_, notices) = from(&ACME.replacen("<Dc>", "<Dc Unknown64Bit=\"1\" ExternalRefClock=\"true\">", 1));
    assert_eq!(added(&notices).len(), 2, "{notices:?}");
    let other = "<AlternativeType RevisionNo=\"#x00640001\">AM01-0100</AlternativeType><Name>AM01 Modular";
    let (_, notices) = from(&ACME.replacen("<Name>AM01 Modular", other, 1));
    assert!(added(&notices)[0].starts_with("AlternativeType revision 0x00640001: "), "{notices:?}");
    let lrw = ACME.replace("<Type ProductCode", "<Type UseLrdLwr=\"1\" ProductCode");
    assert!(added(&from(&lrw).1)[0].starts_with("UseLrdLwr: "));
}

// covers: esi-declare, ES-27
#[test]
fn product_code_and_serial_number_are_compared_as_the_file_says() {
    let checked = |attributes: &str| {
        let text = ACME.replacen("ProductCode=\"#x00003001\"", &format!("ProductCode=\"#x00003001\"{attributes}"), 1);
        let subdevice = declared(&acme_of(&text), DRIVE, &Choices::default());
        (subdevice.product, subdevice.serial)
    };
    let product = Some(0x3001);
    for (attributes, expected) in [
        ("", (product, None)),
        (" CheckProductCode=\"EQ\"", (product, None)),
        (" CheckProductCode=\"NONE\"", (None, None)),
        (" SerialNo=\"77\"", (product, None)),
        (" SerialNo=\"77\" CheckSerialNo=\"NONE\"", (product, None)),
        (" SerialNo=\"77\" CheckSerialNo=\"EQ\"", (product, Some(77))),
    ] {
        assert_eq!(checked(attributes), expected, "{attributes}");
    }
}

// covers: esi-declare, ES-53
#[test]
fn each_setting_without_a_place_in_a_network_file_is_a_notice() {
    const CASES: [(&str, &str, &str); 7] = [
        ("<Dc>", "<Dc PotentialReferenceClock=\"1\">", "PotentialReferenceClock: "),
        ("<EoE ", "<AoE InitializeOwnNetId=\"1\"/><EoE ", "AoE InitializeOwnNetId: no AMS NetId is sent"),
        ("<EoE ", "<AoE GenerateOwnNetId=\"1\"/><EoE ", "AoE GenerateOwnNetId: no AMS NetId is chosen"),
        ("<Mailbox", "<Su SeparateSu=\"1\"/><Mailbox", "Su SeparateSu: "),
        ("<Mailbox", "<Su SeparateFrame=\"1\"/><Mailbox", "Su SeparateFrame: "),
        (" ProductCode", " UseLrdLwr=\"1\" ProductCode", "UseLrdLwr: "),
        ("<Name>AM01 M", "<SubDevice ProductCode=\"#x3002\" RevisionNo=\"1\"/><Name>AM01 M", "a further SubDevice"),
    ];
    // The last device of the file.
    let last = ACME.rfind("<Type ProductCode").expect("it has devices");
    let from = |from: &str, to: &str| {
        let at = ACME[last..].find(from).unwrap_or_else(|| panic!("{from}")) + last;
        let text = [&ACME[..at], to, &ACME[at + from.len()..]].concat();
        let esi = acme_of(&text);
        let device = esi.devices.last().expect("it has devices");
        let choices = Choices::default();
        let selection = select(&esi, device, &choices).unwrap_or_else(|error| panic!("{error}"));
        let from = SubDevice::from_esi(&selection, CYCLE, 1033).unwrap_or_else(|error| panic!("{error}"));
        (from.subdevice.eeprom_to_pdi, from.notices.iter().map(ToString::to_string).collect::<Vec<_>>())
    };
    let (assigned, plain) = from("<Type ProductCode", "<Type ProductCode");
    assert!(!assigned);
    for (old, new, expected) in CASES {
        let (_, notices) = from(old, new);
        let added: Vec<&String> = notices.iter().filter(|text| !plain.contains(text)).collect();
        assert_eq!(added.len(), 1, "{new}: {added:?}");
        assert!(added[0].contains(expected), "{new}: {added:?}");
    }
    let (assigned, notices) = from("<Eeprom>", "<Eeprom AssignToPdi=\"1\">");
    assert_eq!((assigned, notices), (true, plain), "the network file says it");
}

// covers: esi-declare, ES-47, ES-50
#[test]
fn pdos_are_chosen_by_the_rules_of_the_file() {
    let esi = acme();
    let compact = choices(|choices| {
        choices.with = vec![PdoChoice::new(0x1A01, Some(3))];
        choices.without = vec![0x1A00];
    });
    assert_eq!(assigned(&esi, ANALOG, &compact), [(2, vec![]), (3, vec![0x1A01, 0x1A02])]);
    let only = choices(|choices| {
        choices.with = vec![PdoChoice::new(0x1A01, None)];
        choices.without = vec![0x1A00];
    });
    assert_eq!(assigned(&esi, ANALOG, &only), [(2, vec![]), (3, vec![0x1A01, 0x1A02])], "the only one with inputs");
    let with = |index, sm| choices(|choices| choices.with = vec![PdoChoice::new(index, sm)]);
    let without = |index| choices(|choices| choices.without = vec![index]);
    let begin = |text: &str| format!("acme.xml:{}: device ", line(text) - 1);
    for (device, choices, starts, contains) in [
        (
            ANALOG,
            with(0x1A01, Some(3)),
            begin("AI Standard Channel 1"),
            "PDO 0x1a00 \"AI Standard Channel 1\": it excludes PDO 0x1a01",
        ),
        (ANALOG, without(0x1A02), begin("AI Channel 2"), "it is mandatory: it has to be assigned"),
        (ANALOG, with(0x1A01, Some(2)), begin("AI Compact"), "it is a TxPdo, SyncManager 2 (line "),
        (ANALOG, with(0x1A01, Some(9)), begin("AI Compact"), "SyncManager 9 does not exist: the device has 4"),
        (ANALOG, with(0x1A09, None), "acme.xml:".to_owned(), "there is no PDO 0x1a09: expected 0x1a00, 0x1a01, 0x1a02"),
        (ANALOG, without(0x1A01), begin("AI Compact"), "it is not assigned by default"),
        (OUTPUTS, without(0x1600), begin("Channels 1 to 4"), "it is mandatory"),
    ] {
        let error = refused(&esi, device, &choices);
        assert!(error.starts_with(&starts) && error.contains(contains), "{error}");
    }
    for (from, to, choices, contains) in [
        ("PdoAssign=\"true\" ", "", &compact, "the PDOs of SyncManager 3 cannot be chosen: CoE has no PdoAssign"),
        (
            "ControlByte=\"#x20\" Enable=\"1\">Inputs",
            "ControlByte=\"#x20\" Enable=\"1\" FixedAssignment=\"1\">Inputs",
            &compact,
            "are fixed (FixedAssignment)",
        ),
        (
            "<Name>AI Compact Channel 1</Name>",
            "<Name>AI Compact Channel 1</Name><ExcludedSm>3</ExcludedSm>",
            &compact,
            "must not be in SyncManager 3 (ExcludedSm)",
        ),
        (
            "<TxPdo Fixed=\"1\">",
            "<TxPdo Fixed=\"1\" Virtual=\"1\">",
            &compact,
            "it is virtual: the device has no object",
        ),
    ] {
        assert!(ACME.contains(from), "{from}");
        let error = refused(&acme_of(&ACME.replacen(from, to, 1)), ANALOG, choices);
        assert!(error.contains(contains), "{error}");
    }
}

// covers: esi-declare, ES-44, ES-47
#[test]
fn virtual_pdos_and_sync_managers_are_not_exchanged() {
    let text = ACME
        .replacen(
            "<TxPdo Fixed=\"1\" Sm=\"3\">",
            "<TxPdo Virtual=\"1\" Sm=\"3\"><Index>#x1A10</Index><Name>Time</Name></TxPdo><TxPdo Fixed=\"1\" Sm=\"3\">",
            1,
        )
        .replacen(
            "Enable=\"1\">Inputs</Sm>",
            "Enable=\"1\">Inputs</Sm><Sm StartAddress=\"#x990\" Virtual=\"1\">Inputs</Sm>",
            1,
        )
        .replacen(
            "<TxPdo Fixed=\"1\">",
            "<TxPdo Fixed=\"1\" Sm=\"4\"><Index>#x1A11</Index><Name>Next</Name></TxPdo><TxPdo Fixed=\"1\">",
            1,
        );
    let esi = acme_of(&text);
    let selection_of = Choices::default();
    assert_eq!(assigned(&esi, ANALOG, &selection_of), [(2, vec![]), (3, vec![0x1A00, 0x1A02])]);
    let selection = select(&esi, &esi.devices[ANALOG], &selection_of).unwrap();
    let notices: Vec<String> = selection.notices.iter().map(ToString::to_string).collect();
    assert!(notices.iter().any(|text| text.contains("PDO 0x1a10 \"Time\": it is virtual")), "{notices:?}");
    assert!(notices.iter().any(|text| text.contains("PDO 0x1a11 \"Next\": its SyncManager is virtual")), "{notices:?}");
}

// covers: esi-declare, ES-32, ES-60
#[test]
fn operation_modes_are_chosen_by_name_and_devices_without_controller_are_refused() {
    let esi = acme();
    let mode = |name: &str| choices(|choices| choices.mode = Some(name.to_owned()));
    assert_eq!(declared(&esi, DRIVE, &mode("FreeRun")).sync, None);
    let sync = declared(&esi, DRIVE, &mode("DC")).sync.expect("SYNC0");
    assert_eq!((sync.assign_activate, sync.sync0_cycle.0, sync.sync0_shift.0), (0x300, 1_000_000, 30_000));
    let sync = declared(&esi, DRIVE, &mode("DC4")).sync.expect("SYNC0 and SYNC1");
    assert_eq!((sync.sync0_cycle.0, sync.sync1_cycle.0), (250_000, 1_000_000));
    let by_module = select(&esi, &esi.devices[DRIVE], &Choices::default()).unwrap().mode.map(|mode| mode.name.clone());
    assert_eq!(by_module.as_deref(), Some("DC"), "the module of slot 0 needs it");
    let error = refused(&esi, DRIVE, &mode("DC9"));
    let known = "expected #1 \"FreeRun\" (no synchronisation), #2 \"DC\" (SYNC0), #3 \"DC4\" (four ";
    assert!(error.contains(&format!("there is no operation mode \"DC9\": {known}")), "{error}");
    let latch = acme_of(&ACME.replacen("<AssignActivate>#x0<", "<AssignActivate>#x0100<", 1));
    let startup = declared(&latch, DRIVE, &mode("FreeRun")).startup;
    let write = startup.iter().find_map(|startup| startup.write.as_ref()).expect("LATCH units are activated");
    assert_eq!((write.address, &write.data.0[..]), (0x0980, &[0, 1][..]));
    let choices = mode("DC4");
    let selection = select(&esi, &esi.devices[DRIVE], &choices).unwrap();
    let odd = SubDevice::from_esi(&selection, Duration::from_nanos(1_000_001), 1033).unwrap_err().to_string();
    assert!(odd.contains("operation mode \"DC4\": a cycle of SYNC0"), "{odd}");
    let invisible = acme_of(&ACME.replacen("<Device Physics=\"YKY\">", "<Device Physics=\"YKY\" Invisible=\"1\">", 1));
    assert!(refused(&invisible, COUPLER, &Choices::default()).contains("it has no controller (Invisible)"));
}

// covers: esi-declare, ES-60
#[test]
fn modes_with_one_name_are_chosen_by_description_or_number() {
    let mode = |text: &str| choices(|choices| choices.mode = Some(text.to_owned()));
    let twice = ACME.replacen("<Name>DC4</Name>", "<Name>DC</Name>", 1);
    let esi = acme_of(&twice);
    let sync = |text: &str| declared(&esi, DRIVE, &mode(text)).sync.map(|sync| sync.assign_activate);
    let several = "several operation modes are \"DC\": choose one by its description or its number: #2 \"DC\" (SYNC0), \
                   #3 \"DC\" (four SYNC0 in a cycle, SYNC1 once)";
    let error = refused(&esi, DRIVE, &mode("DC"));
    assert!(error.contains(several), "{error}");
    assert_eq!([sync("SYNC0"), sync("#2")], [Some(0x300); 2]);
    assert_eq!([sync("four SYNC0 in a cycle, SYNC1 once"), sync(" #3 ")], [Some(0x700); 2]);
    assert_eq!(sync("FreeRun"), None);
    for wrong in ["#0", "#4", "#", "#-1", "four"] {
        let error = refused(&esi, DRIVE, &mode(wrong));
        assert!(error.contains(&format!("there is no operation mode \"{wrong}\"")), "{error}");
    }
}

// covers: esi-declare, ES-47, ES-50
#[test]
fn entries_are_chosen_from_the_dictionary_where_the_device_takes_them() {
    let free = ACME.replacen("PdoAssign=\"true\"", "PdoAssign=\"true\" PdoConfig=\"true\"", 1).replacen(
        "<TxPdo Fixed=\"1\" Sm=\"3\">",
        "<TxPdo Sm=\"3\">",
        1,
    );
    let map =
        |entries: Vec<EntryChoice>| choices(|choices| choices.mappings = vec![MappingChoice::new(0x1A00, entries)]);
    let value = EntryChoice::new(0x6000, 0x11, None);
    let chosen = map(vec![EntryChoice::new(0x6000, 1, Some(1)), EntryChoice::new(0, 0, Some(7)), value]);
    let analog = declared(&acme_of(&free), ANALOG, &chosen);
    let pdo = &analog.sync_manager[1].pdo[0];
    let entries: Vec<_> =
        pdo.entries.iter().flatten().map(|it| (it.index, it.sub, it.bits, it.name.as_str())).collect();
    assert_eq!(entries, [(0x6000, 1, 1, "Underrange"), (0, 0, 7, ""), (0x6000, 0x11, 16, "Value")]);
    for (text, choices, contains) in [
        (ACME, map(vec![value]), "its entries are fixed (Fixed)"),
        (&free, map(vec![EntryChoice::new(0x8000, 3, None)]), "cannot be mapped to a TxPdo (PdoMapping)"),
        (&free, map(vec![EntryChoice::new(0x6000, 0x11, Some(8))]), "expected 16 bits, got 8"),
        (&free, map(vec![EntryChoice::new(0x6099, 0, None)]), "has no such object"),
        (&free, map(vec![EntryChoice::new(0, 0, None)]), "a gap needs its number of bits"),
        (&free.replacen("PdoConfig=\"true\"", "", 1), map(vec![value]), "CoE has no PdoConfig"),
        (&free, choices(|it| it.mappings = vec![MappingChoice::new(0x1A01, vec![value])]), "it is not assigned"),
        (
            &free.replacen(
                "<Entry><Index>#x6000</Index><SubIndex>1<",
                "<Entry Fixed=\"1\"><Index>#x6000</Index><SubIndex>1<",
                1,
            ),
            map(vec![value]),
            "its entry 0x6000:01 is fixed: it has to stay",
        ),
    ] {
        let error = refused(&acme_of(text), ANALOG, &choices);
        assert!(error.contains(contains) && error.contains("acme.xml:"), "{error}");
    }
}

// covers: esi-declare, ES-47
#[test]
fn oversampled_pdos_are_repeated_at_their_distance() {
    let text = ACME.replacen(
        "<TxPdo Fixed=\"1\" Mandatory=\"1\" Sm=\"3\">",
        "<TxPdo Fixed=\"1\" Mandatory=\"1\" Sm=\"3\" OSFac=\"2\" OSMin=\"1\" OSMax=\"8\" OSIndexInc=\"16\">",
        1,
    );
    let esi = acme_of(&text);
    let samples = |factor| choices(|choices| choices.samples = vec![SamplesChoice::new(0x1A02, factor)]);
    assert_eq!(assigned(&esi, ANALOG, &Choices::default())[1].1, [0x1A00, 0x1A02, 0x1A12]);
    assert_eq!(assigned(&esi, ANALOG, &samples(3))[1].1, [0x1A00, 0x1A02, 0x1A12, 0x1A22]);
    assert!(refused(&esi, ANALOG, &samples(9)).contains("an oversampling factor of 9: expected 1 to 8"));
    assert!(refused(&acme(), ANALOG, &samples(2)).contains("it has no oversampling (OSFac)"));
    let far = acme_of(&text.replacen("OSIndexInc=\"16\"", "OSIndexInc=\"4294967295\"", 1));
    assert!(refused(&far, ANALOG, &samples(3)).contains("copy 1 has an index above 0xffff"));
    let same = acme_of(&text.replacen("OSIndexInc=\"16\"", "OSIndexInc=\"0\"", 1));
    let choices = samples(2);
    let selection = select(&same, &same.devices[ANALOG], &choices).unwrap();
    let twice = SubDevice::from_esi(&selection, CYCLE, 1033).unwrap_err().to_string();
    assert!(twice.starts_with("acme.xml:") && twice.contains("0x1a02 is also the index of pdo[1]"), "{twice}");
    let analog = declared(&esi, ANALOG, &samples(3));
    assert_eq!(analog.sync_manager[1].pdo.len(), 4);
}

// covers: esi-declare, ES-64, ES-67, ES-70, ES-71
#[test]
fn modules_bring_pdos_commands_and_the_list_of_their_idents() {
    let esi = acme();
    let modules =
        |list: &[&str]| choices(|choices| choices.modules = list.iter().map(|it| Some((*it).to_owned())).collect());
    let two = modules(&["csp axis", "-", "status axis"]);
    assert_eq!(assigned(&esi, DRIVE, &two), [(2, vec![0x1600]), (3, vec![0x1A00, 0x1A20])]);
    let selection = select(&esi, &esi.devices[DRIVE], &two).unwrap();
    let sent: Vec<_> = selection
        .commands
        .iter()
        .filter_map(|it| match &it.message {
            SelectedMessage::Sdo(index, sub, false, data) => Some((it.transition, *index, *sub, data.clone())),
            _ => None,
        })
        .collect();
    let ident = |number: u32| number.to_le_bytes().to_vec();
    let list = [
        (Transition::Ps, 0xF030, 0, vec![0]),
        (Transition::Ps, 0xF030, 1, ident(0x1_0001)),
        (Transition::Ps, 0xF030, 2, ident(0)),
        (Transition::Ps, 0xF030, 3, ident(0x1_0002)),
        (Transition::Ps, 0xF030, 0, vec![3]),
    ];
    assert_eq!(sent[..5], list);
    assert!(sent[5..].iter().any(|(_, index, ..)| *index == 0x6060), "the command of slot 0: {sent:?}");
    // Two owners of one index.
    let text = ACME.replacen("SlotPdoIncrement=\"#x10\"", "SlotPdoIncrement=\"0\"", 1);
    let error = refused(&acme_of(&text), DRIVE, &modules(&["csp axis", "csp axis"]));
    assert!(error.contains("slot 1 brings it, and slot 0 has it already") && error.contains("modules.xml:"), "{error}");
    let error = refused(&esi, DRIVE, &modules(&["x"]));
    assert!(error.contains("there is no module \"x\""), "{error}");
}

// covers: esi-declare, ES-55, ES-72, ES-73
#[test]
fn start_up_values_are_within_the_limits_of_their_objects() {
    let esi = acme();
    let set = |parameter: Parameter| choices(|choices| choices.parameters = vec![parameter]);
    let filter = declared(&esi, ANALOG, &set(Parameter::new(0x8000, 3, [0xE8, 3]))).startup;
    let last = filter.last().expect("it is last");
    assert_eq!(last.comment.as_deref(), Some("AI Settings Ch.1: Filter time"));
    for (device, parameter, contains) in [
        (ANALOG, Parameter::new(0x8000, 3, [0xE9, 3]), "expected 1 to 1000, got 1001"),
        (ANALOG, Parameter::new(0x8000, 3, [1]), "expected 2 bytes, got 1"),
        (ANALOG, Parameter::new(0x8000, 9, [1]), "has no such object"),
        (ANALOG, Parameter::new(0x8000, 3, []), "expected a value, got no bytes"),
        (ANALOG, Parameter::new(0x8000, 2, [1, 0]).at(Transition::So), "it cannot be written in SAFEOP"),
        (ANALOG, Parameter::new(0x1000, 0, [1, 0, 0, 0]), "it cannot be written in PREOP"),
        (OUTPUTS, Parameter::new(0x8000, 3, [1]), "the device has no CoE"),
    ] {
        let error = refused(&esi, device, &set(parameter));
        assert!(error.contains(contains) && error.starts_with("acme.xml:"), "{error}");
    }
}
