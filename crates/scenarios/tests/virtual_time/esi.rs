//! Segments made of device descriptions (ESI): they reach OP, with the dictionary and the names of their files.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ringcat::esi::{EsiDevices, load};
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, Position, SubDeviceId, automatic};

const LIMIT: Duration = Duration::from_secs(30);
const PERIOD: Duration = Duration::from_millis(1);
/// A file of an invented vendor and its modules.
const ACME: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files");

fn links(text: &str, folder: &Path) -> Result<SimulatedSegment, String> {
    let segment = Segment::from_toml_with(text, folder, &EsiDevices::default()).map_err(|error| error.to_string())?;
    Ok(SimulatedSegment::new(Network::from_description(segment).map_err(|error| error.to_string())?))
}

/// A segment of all devices of the file.
const SEGMENT: &str = r#"
[[device]]
esi = "acme.xml"
type = "AK10"

[[device]]
esi = "acme.xml"
type = "AD08"
count = 2

[[device]]
esi = "acme.xml"
type = "AA02"

[[device]]
esi = "acme.xml"
type = "AM01"
attach = "AK10-1.2"
modules = ["csp axis", "status axis", "0x00010001"]
"#;

/// Parameters of synchronisation, for the dictionary of the analog terminal.
const SYNCHRONISATION: &str = "<Object><Index>#x1C33</Index><Name>SM input parameter</Name><Type>UINT</Type>\
    <BitSize>16</BitSize><Info><DefaultData>2200</DefaultData></Info><Flags><Access>rw</Access></Flags></Object>";

// covers: esi-use
#[test]
fn parameters_of_synchronisation_are_those_of_the_description() {
    let text = fs::read_to_string(Path::new(ACME).join("acme.xml")).unwrap();
    let object = "<Object><Index>#x8010</Index>";
    let folder = std::env::temp_dir().join(format!("ringcat-esi-synchronisation-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let text = text.replacen(object, &format!("{SYNCHRONISATION}{object}"), 1);
    fs::write(folder.join("acme.xml"), text).unwrap();
    let segment = "[[device]]\nesi = \"acme.xml\"\ntype = \"AA02\"\n";
    let links = links(segment, &folder).unwrap();
    fs::remove_dir_all(&folder).unwrap();
    let mut main_device = MainDevice::request(links, &Options::default());
    main_device.scan().unwrap();
    assert_eq!(main_device.subdevice(Position(0)).sdo_read::<u16>(0x1C33, 0).unwrap(), 0x22);
}

// covers: esi-use, ES-33, ES-38, ES-48, ES-64, ES-67, ES-69, ES-75
#[test]
fn a_segment_of_described_devices_reaches_op_with_dictionary_and_modules() {
    let mut main_device = MainDevice::request(links(SEGMENT, Path::new(ACME)).unwrap(), &Options::default());
    let scan = main_device.scan().unwrap();
    let names: Vec<&str> = scan.subdevices.iter().map(|info| info.name.as_str()).collect();
    let outputs = "AD08 8Ch. Digital Output";
    assert_eq!(names, ["AK10 Coupler", outputs, outputs, "AA02 2Ch. Analog Input", "AM01 Modular drive"]);
    let mut read = |at, index, sub| main_device.subdevice(Position(at)).sdo_read::<u32>(index, sub).unwrap();
    assert_eq!(read(3, 0x1000, 0), 0x012C_1389);
    assert_eq!([read(4, 0xF050, 1), read(4, 0xF050, 2)], [0x1_0001, 0x1_0002]);
    assert_eq!([read(4, 0x6502, 0), read(4, 0x7502, 0)], [0x80, 0x80], "slots 0 and 2");
    let mut setting = |index, sub| main_device.subdevice(Position(3)).sdo_read::<u16>(index, sub).unwrap();
    assert_eq!([setting(0x8000, 3), setting(0x8010, 2)], [100, 20], "the defaults of the file");
    let declaration = automatic(&scan.subdevices, PERIOD);
    let mut application = main_device.activate(declaration).unwrap();
    application.wait_until_op(LIMIT).unwrap();
    let drive = SubDeviceId(4);
    for index in [0x6064, 0x7064] {
        assert!(application.input::<i32>(drive, index, 0).is_ok(), "the position of the axis in slots 0 and 2");
    }
}

// covers: esi-use, ES-65, ES-66, ES-71
#[test]
fn wrong_descriptions_in_a_segment_file_name_line_device_and_key() {
    let refused = |keys: &str| links(&format!("[[device]]\n{keys}\n"), Path::new(ACME)).map(|_| ()).unwrap_err();
    for (keys, expected) in [
        ("esi = \"gone.xml\"\ntype = \"AD08\"", "line 2: device \"AD08-1\": esi: "),
        (
            "esi = \"acme.xml\"\ntype = \"AD09\"",
            "line 3: device \"AD09-1\": type: expected one of AA02, AD08, AK10, AM01, got",
        ),
        ("esi = \"acme.xml\"", "line 2: device \"acme-1\": esi: expected a key type, one of AA02,"),
        (
            "esi = \"acme.xml\"\ntype = \"AD08\"\nrevision = 7",
            "line 4: device \"AD08-1\": revision: expected one of 0x00120000",
        ),
        (
            "esi = \"acme.xml\"\ntype = \"AD08\"\nproduct = 7",
            "line 4: device \"AD08-1\": product: expected one of 0x00001008",
        ),
        ("esi = \"acme.xml\"\ntype = \"AD08\"\nmodules = [\"a\"]", "line 4: device \"AD08-1\": modules: "),
        ("esi = \"acme.xml\"\ntype = \"AM01\"\nmodules = [\"-\"]", "slot 0 \"Axis 1\" has to be filled: expected"),
        ("esi = \"acme.xml\"\ntype = \"AM01\"\nmodules = [\"x\"]", "there is no module \"x\": expected \"csp axis\""),
        ("esi = \"acme.xml\"\nsii = \"a.bin\"", "expected either esi or sii, got both"),
        (
            "type = \"coupler\"\nrevision = 1",
            "line 3: device \"coupler-1\": revision: expected a device of a description",
        ),
        ("esi = \"outputs.xml\"\nrevision = \"x\"", "revision"),
    ] {
        let error = refused(keys);
        assert!(error.contains(expected), "{keys}: {error}");
    }
    let text = "[[device]]\nesi = \"acme.xml\"\ntype = \"AD08\"\n";
    let without = Segment::from_toml(text, Path::new(ACME)).unwrap_err().to_string();
    assert!(without.contains("this program reads no device descriptions"), "{without}");
}

/// Real descriptions beside the repository.
fn real() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/esi");
    let Ok(entries) = fs::read_dir(&folder) else {
        println!("skipped: {} is not there", folder.display());
        return Vec::new();
    };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

/// One SubDevice to OP; the reason if it does not get there.
fn reaches_op(file: &Path, kind: &str, (revision, product): (u32, u32)) -> Result<(), String> {
    let name = file.file_name().unwrap().to_string_lossy();
    let identity = format!("revision = {revision}\nproduct = {product}");
    let text = format!("[[device]]\nname = \"it\"\nesi = '{name}'\ntype = '''{kind}'''\n{identity}\n");
    let mut main_device = MainDevice::request(links(&text, file.parent().unwrap())?, &Options::default());
    let scan = main_device.scan().map_err(|error| error.to_string())?;
    if scan.subdevices.len() != 1 {
        return Err(format!("{} SubDevices found", scan.subdevices.len()));
    }
    let declaration = automatic(&scan.subdevices, PERIOD);
    let mut application = main_device.activate(declaration).map_err(|error| error.to_string())?;
    application.wait_until_op(LIMIT).map_err(|error| error.to_string())
}

/// The newest device of each real file, and its first one.
// covers: esi-use
#[test]
fn devices_of_real_descriptions_reach_op() {
    let (mut reached, mut failed) = (0, Vec::new());
    for file in real() {
        let esi = load(&file).unwrap();
        let devices: Vec<_> = esi.devices.iter().filter(|device| !device.is_invisible).collect();
        for device in [devices.first(), devices.last()].into_iter().flatten() {
            match reaches_op(&file, device.kind.trim(), (device.revision, device.product_code)) {
                Ok(()) => reached += 1,
                Err(error) => failed.push(format!("{} {}: {error}", file.display(), device.kind.trim())),
            }
        }
    }
    failed.iter().for_each(|line| println!("{line}"));
    assert!(failed.is_empty(), "{reached} reached OP, {} did not: {failed:#?}", failed.len());
}
