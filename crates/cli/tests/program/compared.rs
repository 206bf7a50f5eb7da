//! `ringcat compare` of networks whose devices have descriptions: other PDOs, modules.

use std::fs;

use crate::files::{ACME, Place, Said, ringcat};

/// A text without line breaks.
fn folded(said: &Said) -> String {
    said.out.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The descriptions, changed by a function, with their modules.
fn descriptions(place: &Place, change: impl Fn(&str) -> String) -> String {
    fs::create_dir(place.path("modules")).expect("it is writable");
    let modules = fs::read_to_string(format!("{ACME}/modules/acme-modules.xml")).expect("it is writable");
    place.write("modules/acme-modules.xml", &modules);
    let text = fs::read_to_string(format!("{ACME}/acme.xml")).expect("it is writable");
    let changed = change(&text);
    place.write("acme.xml", &changed)
}

// covers: network-file
#[test]
fn another_assignment_of_a_device_with_coe_is_named_in_both_directions() {
    let place = Place::new("assignment");
    let acme = descriptions(&place, str::to_owned);
    let bus = place.write("bus.toml", "[[device]]\nesi = \"acme.xml\"\ntype = \"AA02\"\n");
    let out = place.path("machine.toml");
    let compare = |choices: &[&str]| {
        let declare = [&["esi", "declare", &acme, "--type", "AA02", "--overwrite", "--out", &out], choices].concat();
        assert_eq!(ringcat(&declare).code, Some(0));
        ringcat(&["compare", "--sim", &bus, "--network", &out])
    };
    let same = compare(&[]);
    assert_eq!(same.verdict(), "result: ok: 1 SubDevice, as in the file", "{}", same.all());
    for (choices, expected) in [
        (&["--without", "0x1A00"][..], "SM 3: PDO 0x1a00 \"AI Standard Channel 1\" is assigned, but not in the file"),
        (&["--without", "0x1A00", "--with", "0x1A01"], "SM 3: expected PDO 0x1a01 \"AI Compact Channel 1\", got"),
    ] {
        let differs = compare(choices);
        assert!(folded(&differs).contains(expected), "{choices:?}: {}", differs.all());
        let verdict = "result: FAILED: 1 difference from the file, 0 of them prevent OP";
        assert_eq!(differs.verdict(), verdict, "{}", differs.all());
    }
    let text = fs::read_to_string(&acme).expect("it is writable");
    place.write("fewer.xml", &text.replacen("<TxPdo Fixed=\"1\" Sm=\"3\">", "<TxPdo Fixed=\"1\">", 1));
    let fewer = place.write("fewer.toml", "[[device]]\nesi = \"fewer.xml\"\ntype = \"AA02\"\n");
    compare(&[]);
    let differs = ringcat(&["compare", "--sim", &fewer, "--network", &out]);
    let expected = "SM 3: PDO 0x1a00 \"AI Standard Channel 1\" is in the file, but not assigned";
    assert!(folded(&differs).contains(expected) && !differs.out.contains('!'), "{}", differs.all());
}

/// Modules are compared by slot: with the names of the description, by network file and by ENI. A warning names a
/// device without a list.
// covers: network-file, ES-69, ES-70
#[test]
fn modules_that_are_not_those_of_the_file_are_named_by_slot() {
    let place = Place::new("modules");
    let acme = descriptions(&place, str::to_owned);
    let text = fs::read_to_string(&acme).expect("it is readable");
    place.write("unlisted.xml", &text.replace(" DownloadModuleIdentList=\"1\"", ""));
    let bus = |file: &str, modules: &str| {
        let text = format!("[[device]]\nesi = \"{file}\"\ntype = \"AM01\"\nmodules = [{modules}]\n");
        place.write("bus.toml", &text)
    };
    let (out, eni) = (place.path("machine.toml"), place.path("machine.eni.xml"));
    let modules = ["--module", "csp axis", "--module", "-", "--module", "status axis"];
    let declare = [&["esi", "declare", &acme, "--type", "AM01", "--out", &out][..], &modules].concat();
    assert_eq!(ringcat(&declare).code, Some(0));
    assert_eq!(ringcat(&["eni", "export", "--network", &out, "--out", &eni]).code, Some(0));
    let both = [["--network", &out], ["--eni", &eni]];
    let same = bus("acme.xml", "\"csp axis\", \"-\", \"status axis\"");
    let compare = |file: &[&str; 2], more: &[&str]| ringcat(&[&["compare", "--sim", &same][..], file, more].concat());
    for file in &both {
        let said = compare(file, &[]);
        assert_eq!(said.verdict(), "result: ok: 1 SubDevice, as in the file", "{}", said.all());
    }
    bus("acme.xml", "\"csp axis\"");
    for file in &both {
        let said = compare(file, &[]);
        let expected = "slot 3: expected module 0x00010002, got no module";
        assert!(said.out.starts_with("! modules") && folded(&said).contains(expected), "{}", said.all());
        let named = folded(&compare(file, &["--esi", &acme]));
        assert!(named.contains("slot 3: expected module 0x00010002 \"status axis\", got no module"), "{named}");
    }
    bus("unlisted.xml", "\"csp axis\"");
    let said = compare(&both[0], &[]);
    let verdict = "result: ok: 1 SubDevice, as in the file; the modules of 1 SubDevice are not compared";
    assert_eq!(said.verdict(), verdict, "{}", said.all());
    assert!(said.all().contains("its modules are not compared: it does not list them (0xF050)"), "{}", said.all());
    let json = compare(&both[0], &["--json"]).out;
    assert!(json.contains("\"modules_not_compared\":[0]"), "{json}");
}

/// As `run` and the activation decide: a ring on one interface, and a closing cable that is not there.
// covers: network-file, junctions
#[test]
fn rings_that_do_not_exist_are_named() {
    let place = Place::new("rings");
    let ring = include_str!("../../../sim/segments/junction-ring.toml");
    let (bus, out) = (place.write("bus.toml", ring), place.path("machine.toml"));
    assert_eq!(ringcat(&["init", "--sim", &bus, "--out", &out]).code, Some(0));
    let made = place.read("machine.toml");
    let compare = |redundancy: &str| {
        let network = place.write("changed.toml", &format!("{made}\n[redundancy]\n{redundancy}"));
        ringcat(&["compare", "--sim", &bus, "--network", &network])
    };
    let to = |tail: &str| {
        format!(
            "junctions = \"strict\"\n[[redundancy.connection]]\nhead = \"junction\"\nhead_port = 1\ntail = \"{tail}\"\n\
             tail_port = 1\n"
        )
    };
    assert_eq!(compare(&to("block 3")).code, Some(0));
    for (redundancy, expected) in [
        (to("block 2"), "! ring junction connection 1:1-3:1: SubDevice 3 port 1 does not lead back to"),
        ("ring = true\n".to_owned(), "! ring the file declares a ring (redundancy.ring), but the network is a line"),
    ] {
        let said = compare(&redundancy);
        assert!(folded(&said).starts_with(expected), "{}", said.all());
        let verdict = "result: FAILED: 1 difference from the file, 1 of them prevent OP";
        assert_eq!(said.verdict(), verdict, "{}", said.all());
    }
}

/// The EEPROM of a device with slots lists the PDOs of its head; those of its modules are no differences.
// covers: network-file, ES-69
#[test]
fn pdos_of_modules_that_the_eeprom_cannot_list_are_no_differences() {
    let place = Place::new("of-modules");
    let head = "<TxPdo Fixed=\"1\" Sm=\"3\"><Index>#x1BF0</Index><Name>Head</Name><Entry><Index>#xF100</Index>\
                <SubIndex>1</SubIndex><BitLen>16</BitLen><Name>State</Name><DataType>UINT</DataType></Entry></TxPdo>\
                <Mailbox DataLinkLayer=\"1\"><EoE IP=\"1\" MAC=\"1\"/>";
    let acme = descriptions(&place, |text| {
        text.replace("<Mailbox DataLinkLayer=\"1\"><EoE IP=\"1\" MAC=\"1\"/>", head)
            .replace(" DownloadModuleIdentList=\"1\"", "")
    });
    place.write(
        "listed.xml",
        &fs::read_to_string(&acme)
            .expect("it is writable")
            .replace("MaxSlotCount=\"4\"", "MaxSlotCount=\"4\" DownloadModuleIdentList=\"1\""),
    );
    for file in ["acme.xml", "listed.xml"] {
        let device = format!("[[device]]\nesi = \"{file}\"\ntype = \"AM01\"\nmodules = [\"csp axis\"]\n");
        let (bus, out) = (place.write("bus.toml", &device), place.path("machine.toml"));
        let declare = ["--type", "AM01", "--module", "csp axis", "--overwrite", "--out", &out];
        let declared = ringcat(&[&["esi", "declare", &place.path(file)], &declare[..]].concat());
        assert_eq!(declared.code, Some(0), "{}", declared.all());
        assert_eq!(place.read("machine.toml").contains("0xf030"), file == "listed.xml");
        // Without commands that name the modules: the object that lists them, or else the description.
        let text = place.read("machine.toml");
        let end = text.find("[[subdevice.startup]]").unwrap_or(text.len());
        let bare = place.write("bare.toml", &text[..end]);
        let esi: &[&str] = if file == "listed.xml" { &[] } else { &["--esi", &acme] };
        for network in [&out, &bare] {
            let same = ringcat(&[&["compare", "--sim", &bus, "--network", network], esi].concat());
            assert_eq!(same.verdict(), "result: ok: 1 SubDevice, as in the file", "{file}: {}", same.all());
        }
    }
}

/// A device refuses to change the mapping of a PDO that its SII marks as fixed: the file of a scan declares the PDO as
/// `fixed`, and its ENI has no command that writes the mapping.
// covers: network-file, eni-run
#[test]
fn pdos_that_the_sii_marks_as_fixed_are_fixed_in_the_file_of_a_scan() {
    let place = Place::new("fixed");
    let bus = place.write("bus.toml", "[[device]]\nesi = \"acme.xml\"\ntype = \"AA02\"\n");
    let (machine, eni) = (place.path("machine.toml"), place.path("machine.xml"));
    for (coe, fixed) in [("PdoAssign=\"true\" PdoConfig=\"true\"", 2), ("PdoAssign=\"true\"", 0)] {
        place.write(
            "acme.xml",
            &fs::read_to_string(format!("{ACME}/acme.xml"))
                .expect("it is readable")
                .replace("<CoE SdoInfo=\"true\" PdoAssign=\"true\"", &format!("<CoE SdoInfo=\"true\" {coe}")),
        );
        let init = ringcat(&["init", "--sim", &bus, "--overwrite", "--out", &machine]);
        assert_eq!(init.code, Some(0), "{}", init.all());
        assert_eq!(place.read("machine.toml").matches("fixed = true").count(), fixed, "{coe}");
        let export = ringcat(&["eni", "export", "--network", &machine, "--overwrite", "--out", &eni]);
        assert_eq!(export.code, Some(0), "{}", export.all());
        let text = place.read("machine.xml");
        assert!(text.contains("assign pdo 0x1a00"), "PDOs are assigned: {coe}");
        assert!(!text.contains("clear pdo 0x1a0"), "no mapping is written: {coe}");
    }
}
