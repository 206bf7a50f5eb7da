//! A network of each device of the real descriptions (`../shared/data/esi` beside the repository): made from a scan of
//! the simulated device, written, read again, exported as an ENI, and compared with the same bus.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ringcat::config::network::model::SubDevice;
use ringcat::config::{Configuration, Difference, ExportOptions, FoundNetwork, StatedProperties, esi};
use ringcat::eni::EniFile;
use ringcat::esi::{EsiDevices, load};
use ringcat::network::{LoadedNetwork, NetworkFile, ScanOptions};
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::{MainDevice, Options, PdoMapping, Scan};

const PERIOD: Duration = Duration::from_millis(1);

/// Real descriptions beside the repository; `None`, with a line that says so, without them.
fn real() -> Option<Vec<PathBuf>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/esi");
    let Ok(entries) = fs::read_dir(&folder) else {
        println!("SKIPPED: {} is not there", folder.display());
        return None;
    };
    let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    Some(files)
}

/// The scan of a segment with this device alone.
fn scan_of(text: &str, folder: &Path, devices: &EsiDevices) -> Result<Scan, String> {
    let segment = Segment::from_toml_with(text, folder, devices).map_err(|error| error.to_string())?;
    let links = SimulatedSegment::new(Network::from_description(segment).map_err(|error| error.to_string())?);
    MainDevice::request(links, &Options::default()).scan().map_err(|error| error.to_string())
}

fn differences(configuration: &Configuration, stated: &[StatedProperties], scan: &Scan) -> Result<(), String> {
    let found = FoundNetwork::new(&scan.subdevices, &scan.topology);
    let found: Vec<Difference> = configuration.differences(found, stated);
    let texts: Vec<&str> = found.iter().map(|it| it.text.as_str()).collect();
    if texts.is_empty() { Ok(()) } else { Err(texts.join("; ")) }
}

/// The PDOs of each SyncManager with process data, as the declaration states them.
fn pdos(configuration: &Configuration) -> BTreeMap<u8, Vec<PdoMapping>> {
    let of = &configuration.declaration.subdevices[0];
    let plain = |pdos: &[PdoMapping]| pdos.iter().map(|pdo| pdo.clone().with_fixed(false)).collect();
    let assigned = of.pdos.iter().flatten().map(|it| (it.sync_manager, plain(&it.pdos)));
    let declared = of.declared.iter().flatten().filter(|it| it.area().is_some());
    assigned.chain(declared.map(|it| (it.index, plain(&it.pdos)))).collect()
}

/// The names, types and lengths of the variables.
fn variables(configuration: &Configuration) -> Vec<(String, String, u32)> {
    let of = configuration.image.variables.iter().map(|it| (it.name.clone(), it.data_type.clone(), it.bits));
    let mut all: Vec<_> = of.collect();
    all.sort();
    all
}

fn same<T: PartialEq + std::fmt::Debug>(what: &str, expected: &T, got: &T) -> Result<(), String> {
    if expected == got { Ok(()) } else { Err(format!("{what}: expected {expected:?}, got {got:?}")) }
}

/// Errors in the files of a network of this device alone.
fn check(scan: &Scan) -> Result<(), String> {
    let made = NetworkFile::from_scan(&scan.subdevices, &scan.topology, &ScanOptions::new("one", PERIOD));
    let network = LoadedNetwork::from_bytes("one.toml", made.to_text().as_bytes()).map_err(|it| it.to_string())?;
    let configuration = &network.configuration;
    same("text of the network file", &made.to_text(), &network.file.to_text())?;
    same("declaration", &format!("{:?}", made.configuration()), &format!("{configuration:?}"))?;
    differences(configuration, &network.stated(), scan)?;

    let export = network.file.to_eni(&ExportOptions::default()).map_err(|it| format!("export: {it}"))?;
    let eni = EniFile::from_bytes(export.text.as_bytes()).map_err(|it| format!("ENI: {it}"))?;
    same("declaration of the ENI", &format!("{:?}", export.configuration), &format!("{:?}", eni.configuration))?;
    same("PDOs", &pdos(configuration), &pdos(&eni.configuration))?;
    same("variables", &variables(configuration), &variables(&eni.configuration))?;
    differences(&eni.configuration, &eni.stated(), scan).map_err(|it| format!("compared with the ENI: {it}"))
}

/// Differences between a declaration made from the description alone and the simulated device of that description.
fn check_declared(scan: &Scan, esi: &esi::Esi, device: &esi::Device) -> Result<(), String> {
    let choices = esi::Choices::default();
    // A device that cannot be declared without choices has nothing to compare.
    let Ok(selection) = esi::select(esi, device, &choices) else { return Ok(()) };
    let Ok(from) = SubDevice::from_esi(&selection, PERIOD, choices.language) else { return Ok(()) };
    let mut file = NetworkFile::empty("one", PERIOD);
    file.push(from.subdevice);
    differences(&file.configuration(), &file.stated(), scan)
}

/// Calls `check` for the newest revision of each device of the real descriptions. Returns the number of devices and
/// what is wrong with them.
fn of_each_device(
    check: impl Fn(&Scan, &esi::Esi, &esi::Device) -> Result<(), String>,
) -> Option<(usize, Vec<String>)> {
    let files = real()?;
    let devices = EsiDevices::default();
    let (mut checked, mut failed) = (0, Vec::new());
    for file in files {
        let esi = load(&file).unwrap_or_else(|error| panic!("{error}"));
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        let mut newest: BTreeMap<(&str, u32), &esi::Device> = BTreeMap::new();
        for of in esi.devices.iter().filter(|device| !device.is_invisible) {
            let known = newest.entry((of.kind.trim(), of.product_code)).or_insert(of);
            *known = if of.revision > known.revision { of } else { *known };
        }
        for ((kind, product), device) in newest {
            let revision = device.revision;
            let keys = format!("esi = '{name}'\ntype = '''{kind}'''\nproduct = {product}\nrevision = {revision}\n");
            let text = format!("[[device]]\nname = \"it\"\n{keys}");
            let scan = scan_of(&text, file.parent().unwrap(), &devices);
            let result = scan.and_then(|scan| check(&scan, &esi, device));
            checked += 1;
            failed.extend(result.err().map(|error| format!("{name} {kind}: {error}")));
        }
    }
    println!("{checked} devices");
    Some((checked, failed))
}

// covers: network-file, esi-use, ES-47
#[test]
fn a_declaration_from_a_description_is_no_difference_to_its_device() {
    let Some((checked, mut failed)) = of_each_device(check_declared) else { return };
    // Their operation modes assign other PDOs than the SII lists.
    let modes = ["EL1262:", "EL1262-0050:", "EL1264:", "EL2262:"];
    // The file has a category of the SII that contradicts its elements.
    let contradictory = ["its CoE has complete access", "expected ports \"YY\", got \"YYYY\""];
    failed.retain(|text| !modes.iter().any(|kind| text.contains(kind)));
    failed.retain(|text| !contradictory.iter().all(|words| text.contains(words)));
    assert!(failed.is_empty(), "{} of {checked}: {failed:#?}", failed.len());
    assert!(checked > 200, "{checked}");
}

// covers: network-file, eni-run, esi-use
#[test]
fn networks_of_all_described_devices_are_the_same_in_a_file_an_eni_and_the_bus() {
    let Some((checked, failed)) = of_each_device(|scan, _, _| check(scan)) else { return };
    assert!(failed.is_empty(), "{} of {checked}: {failed:#?}", failed.len());
    assert!(checked > 200, "{checked}");
}
