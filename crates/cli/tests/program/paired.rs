//! `ringcat compare` compares modules by SubDevice and not by type; terminals with several samples (oversampling).

use std::fs;
use std::path::Path;

use ringcat::config::network::NetworkFile;

use crate::files::{ACME, Place, ringcat};

/// Real descriptions, where they are present.
const REAL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/esi");

/// A terminal without a dictionary: its SII has the PDOs of both operation modes, and one sample.
const SAMPLES: &str = "<?xml version=\"1.0\"?>\n<EtherCATInfo><Vendor><Id>7</Id><Name>Acme</Name></Vendor>
<Descriptions><Groups><Group><Type>G</Type><Name>G</Name></Group></Groups><Devices>
<Device Physics=\"KK\"><Type ProductCode=\"#x12\" RevisionNo=\"#x1\">AX12</Type><Name>Samples</Name>
<GroupType>G</GroupType>
<Fmmu>Inputs</Fmmu><Sm StartAddress=\"#x1000\" ControlByte=\"#x20\" Enable=\"1\">Inputs</Sm>
<TxPdo Fixed=\"1\" Sm=\"0\"><Index>#x1B00</Index><Name>Count</Name><Entry><Index>#x6800</Index><SubIndex>1</SubIndex>
<BitLen>16</BitLen><Name>Count</Name><DataType>UINT</DataType></Entry></TxPdo>
<TxPdo Fixed=\"1\" Sm=\"0\" OSFac=\"2\" OSMin=\"1\" OSMax=\"8\" OSIndexInc=\"8\"><Index>#x1A00</Index><Name>Input</Name>
<Entry><Index>#x6000</Index><SubIndex>1</SubIndex><BitLen>1</BitLen><Name>Input</Name><DataType>BOOL</DataType></Entry>
</TxPdo><TxPdo Fixed=\"1\" Sm=\"0\"><Index>#x1B16</Index><Name>Gap</Name><Entry>
<Index>0</Index><BitLen>7</BitLen></Entry></TxPdo>
<Dc><OpMode><Name>One</Name><AssignActivate>#x0300</AssignActivate><Sm No=\"0\"><Pdo>#x1B00</Pdo>
<Pdo OSFac=\"1\">#x1A00</Pdo><Pdo>#x1B16</Pdo></Sm></OpMode><OpMode><Name>Eight</Name>
<AssignActivate>#x0300</AssignActivate><Sm No=\"0\"><Pdo>#x1B00</Pdo><Pdo OSFac=\"8\">#x1A00</Pdo></Sm></OpMode></Dc>
</Device></Devices></Descriptions></EtherCATInfo>";

/// A file of a device in an operation mode, and a bus with it.
fn declared(place: &Place, (esi, kind): (&str, &str), mode: &str) -> (String, String) {
    let out = place.path("machine.toml");
    let said = ringcat(&["esi", "declare", esi, "--type", kind, "--mode", mode, "--overwrite", "--out", &out]);
    assert_eq!(said.code, Some(0), "{}", said.all());
    let bus = format!("[[device]]\nesi = \"{esi}\"\ntype = \"{kind}\"\n");
    (out, place.write("bus.toml", &bus))
}

/// Operation modes choose PDOs and the number of samples.
// covers: network-file, ES-47
#[test]
fn pdos_and_samples_of_an_operation_mode_are_no_differences() {
    let place = Place::new("samples");
    let esi = place.write("samples.xml", SAMPLES);
    let compare = |bus: &str, network: &str| ringcat(&["compare", "--sim", bus, "--network", network]);
    for mode in ["One", "Eight"] {
        let (out, bus) = declared(&place, (&esi, "AX12"), mode);
        let said = compare(&bus, &out);
        assert_eq!(said.verdict(), "result: ok: 1 SubDevice, as in the file", "{mode}: {}", said.all());
        // No sample has two bits, and the count has 16.
        for (from, to) in [("bits = 1,", "bits = 2,"), ("bits = 16,", "bits = 8,")] {
            let other = place.write("other.toml", &place.read("machine.toml").replace(from, to));
            let said = compare(&bus, &other);
            assert!(said.out.contains("  pdos"), "{mode} {to} {}", said.all());
        }
    }
    // Without samples the terminal has exactly what its SII lists.
    let (out, _) = declared(&place, (&esi, "AX12"), "One");
    let plain = SAMPLES.replace(" OSFac=\"2\" OSMin=\"1\" OSMax=\"8\" OSIndexInc=\"8\"", "");
    let bus = place.write("bus.toml", "[[device]]\nesi = \"plain.xml\"\ntype = \"AX12\"\n");
    place.write("plain.xml", &plain);
    assert_eq!(compare(&bus, &out).code, Some(0));
    let text = place.read("machine.toml");
    let mut file = NetworkFile::read(&out, text.as_bytes()).expect("it is valid");
    file.subdevice[0].sync_manager[0].pdo.pop();
    let said = compare(&bus, &place.write("fewer.toml", &file.to_text()));
    assert!(said.out.contains("  pdos"), "{}", said.all());
    for (file, kind) in [("beckhoff_el1xxx_155dev.xml", "EL1262"), ("beckhoff_el2xxx_2012.xml", "EL2262")] {
        let esi = format!("{REAL}/{file}");
        if !Path::new(&esi).is_file() {
            println!("skipped: {esi} is not there");
            continue;
        }
        for mode in ["#1", "#5", "#6"] {
            let (out, bus) = declared(&place, (&esi, kind), mode);
            let said = compare(&bus, &out);
            assert_eq!(said.verdict(), "result: ok: 1 SubDevice, as in the file", "{kind} {mode}: {}", said.all());
        }
    }
}

/// Two SubDevices of one type: the file has the modules of only one of them.
// covers: network-file, ES-69
#[test]
fn modules_are_those_of_a_subdevice_and_not_of_its_type() {
    let place = Place::new("by-subdevice");
    fs::create_dir(place.path("modules")).expect("it is writable");
    for name in ["acme.xml", "modules/acme-modules.xml"] {
        place.write(name, &fs::read_to_string(format!("{ACME}/{name}")).expect("it is readable"));
    }
    let esi = place.path("acme.xml");
    place.write("unlisted.xml", &place.read("acme.xml").replace(" DownloadModuleIdentList=\"1\"", ""));
    let out = place.path("one.toml");
    let declare = ["esi", "declare", &esi, "--type", "AM01", "--module", "csp axis", "--out", &out];
    assert_eq!(ringcat(&declare).code, Some(0));
    let mut file = NetworkFile::read(&out, place.read("one.toml").as_bytes()).expect("it is valid");
    let mut second = file.subdevice[0].clone();
    (second.name, second.position) = ("second".to_owned(), Some(1));
    second.startup.clear();
    file.subdevice.push(second);
    let network = place.write("two.toml", &file.to_text());
    let device = |file: &str| format!("[[device]]\nesi = \"{file}\"\ntype = \"AM01\"\nmodules = [\"csp axis\"]\n");
    let compare = |first: &str, second: &str| {
        let bus = place.write("bus.toml", &[device(first), device(second)].concat());
        ringcat(&["compare", "--sim", &bus, "--network", &network, "--json"]).out
    };
    let both = compare("unlisted.xml", "unlisted.xml");
    assert!(both.contains("\"modules_not_compared\":[0]"), "{both}");
    let second = compare("acme.xml", "unlisted.xml");
    assert!(second.contains("\"modules_not_compared\":[]"), "{second}");
}
