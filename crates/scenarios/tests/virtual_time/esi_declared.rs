//! SubDevices declared from descriptions (ESI) and choices: the simulated devices get what was chosen, and every device
//! of the real descriptions reaches OP with its defaults or is refused with a reason.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ringcat::config::esi::{Choices, Esi, Parameter, PdoChoice, select};
use ringcat::config::network::model::SubDevice;
use ringcat::eni::EniImage;
use ringcat::esi::{EsiDevices, load};
use ringcat::network::{LoadedNetwork, NetworkFile};
use ringcat::sim::application::ServedMail;
use ringcat::sim::cable::DeviceIndex;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat::simulated::SimulatedSegment;
use ringcat::text::{Names, describe};
use ringcat::{MainDevice, Options};
use ringcat_wire::al::{AlState, AlStatus};
use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::sdo::SdoRequest;
use scenarios::seeds;

const LIMIT: Duration = Duration::from_secs(30);
const PERIOD: Duration = Duration::from_millis(1);
const ACME: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files");

fn links(text: &str, folder: &Path) -> Result<SimulatedSegment, String> {
    links_of(text, folder, &EsiDevices::default())
}

fn links_of(text: &str, folder: &Path, devices: &EsiDevices) -> Result<SimulatedSegment, String> {
    let segment = Segment::from_toml_with(text, folder, devices).map_err(|error| error.to_string())?;
    Ok(SimulatedSegment::new(Network::from_description(segment).map_err(|error| error.to_string())?))
}

fn push(file: &mut NetworkFile, esi: &Esi, device: usize, choices: &Choices) -> Result<(), String> {
    let selection = select(esi, &esi.devices[device], choices).map_err(|error| error.to_string())?;
    let from = SubDevice::from_esi(&selection, PERIOD, 1033).map_err(|error| error.to_string())?;
    file.push(from.subdevice);
    Ok(())
}

/// Objects that a device got by downloads, each once in a row.
fn written(network: &Network, at: usize) -> Vec<u16> {
    let of = |mail: &ServedMail| match SdoRequest::decode(&mail.payload).ok()? {
        SdoRequest::DownloadExpedited { index, .. } | SdoRequest::DownloadNormal { index, .. } => Some(index),
        _ => None,
    };
    let served = network.device(DeviceIndex(at)).application.served_mail();
    let mut objects: Vec<u16> = served.iter().filter(|mail| mail.protocol == Protocol::Coe).filter_map(of).collect();
    objects.dedup();
    objects
}

const SEGMENT: &str = r#"
[[device]]
esi = "acme.xml"
type = "AK10"

[[device]]
esi = "acme.xml"
type = "AD08"

[[device]]
esi = "acme.xml"
type = "AA02"

[[device]]
esi = "acme.xml"
type = "AM01"
attach = "AK10-1.2"
modules = ["csp axis", "-", "status axis"]
"#;

// covers: esi-declare, ES-47, ES-50, ES-70
#[test]
fn chosen_pdos_modules_and_values_are_in_the_devices_in_op() {
    let esi = load(&Path::new(ACME).join("acme.xml")).unwrap();
    let mut file = NetworkFile::empty("acme", PERIOD);
    let mut analog = Choices::default();
    analog.with = vec![PdoChoice::new(0x1A01, None)];
    analog.without = vec![0x1A00];
    analog.parameters = vec![Parameter::new(0x8000, 3, [0x2C, 1])];
    let mut drive = Choices::default();
    drive.modules = ["csp axis", "-", "status axis"].map(|module| Some(module.to_owned())).to_vec();
    for (device, choices) in [(0, &Choices::default()), (1, &Choices::default()), (2, &analog), (3, &drive)] {
        push(&mut file, &esi, device, choices).unwrap();
    }
    let network = LoadedNetwork::from_bytes("acme.toml", file.to_text().as_bytes()).unwrap();
    let main_device = {
        let mut main_device = MainDevice::request(links(SEGMENT, Path::new(ACME)).unwrap(), &Options::default());
        let scan = main_device.scan().unwrap();
        assert_eq!(network.configuration.compare(&scan.subdevices), []);
        main_device
    };
    let mut application = main_device.activate(network.declaration()).unwrap();
    let mut image = EniImage::new(&network.configuration, application.directory()).unwrap();
    for at in 0..4 {
        application.links_mut().network_mut().device_mut(DeviceIndex(at)).application.record_mail();
    }
    application.wait_until_op(LIMIT).unwrap();
    // The value and the start-up command come after the PDOs, the list of modules before them (ES-125, ES-126).
    assert_eq!(written(application.links().network(), 2), [0x1C13, 0x8000]);
    assert_eq!(written(application.links().network(), 3), [0xF030, 0x6060]);
    let read = |at: usize, index, sub| {
        let dictionary = application.links().network().device(DeviceIndex(at)).application.dictionary();
        let bytes = dictionary.read(index, sub).unwrap_or_else(|code| panic!("{index:#06x}:{sub}: {code}"));
        bytes.iter().rev().fold(0_u32, |number, byte| number << 8 | u32::from(*byte))
    };
    assert_eq!([read(2, 0x1C13, 0), read(2, 0x1C13, 1), read(2, 0x1C13, 2)], [2, 0x1A01, 0x1A02]);
    assert_eq!(read(2, 0x8000, 3), 300, "the value that was chosen comes after that of the file");
    assert_eq!([read(3, 0xF030, 0), read(3, 0xF030, 1), read(3, 0xF030, 3)], [3, 0x1_0001, 0x1_0002]);
    assert_eq!(read(3, 0x6060, 0), 8, "the start-up command of the module in slot 0");
    let target = image.variable("AM01.csp axis/Outputs.Target position").expect("it is named by the module").clone();
    let lamp = image.variable("AD08.Channels 1 to 4.Output 3").expect("it is named by the file").clone();
    image.write(&target, 0x0403_0201);
    image.write(&lamp, 1);
    for _ in 0..20 {
        application.cycle(|data| image.give_outputs(data));
    }
    let device = |at| application.links().network().device(DeviceIndex(at));
    assert_eq!(device(1).outputs(), [0b100]);
    assert_eq!(device(3).outputs()[2..], [1, 2, 3, 4]);
    assert_eq!(device(2).inputs().len(), 4, "two PDOs of a word each");
}

// covers: esi-declare, ES-69, ES-70
#[test]
fn other_modules_than_the_declared_ones_keep_the_device_in_preop() {
    let esi = load(&Path::new(ACME).join("acme.xml")).unwrap();
    let mut file = NetworkFile::empty("acme", PERIOD);
    let mut drive = Choices::default();
    drive.modules = vec![Some("status axis".to_owned())];
    push(&mut file, &esi, 3, &drive).unwrap();
    let network = LoadedNetwork::new(file);
    let text = "[[device]]\nesi = \"acme.xml\"\ntype = \"AM01\"\nmodules = [\"csp axis\"]\n";
    let mut main_device = MainDevice::request(links(text, Path::new(ACME)).unwrap(), &Options::default());
    main_device.scan().unwrap();
    let mut application = main_device.activate(network.declaration()).unwrap();
    let mut said = Vec::new();
    for _ in 0..2_000 {
        application.cycle(|_| ());
        while let Some(event) = application.pop_event() {
            said.push(describe(&event, &Names::default()));
        }
    }
    assert!(said.iter().any(|text| text.contains("0x0070") && text.contains("modules do not match")), "{said:#?}");
    let device = application.links().network().device(DeviceIndex(0));
    assert!(!matches!(device.al_status().al_state(), Some(AlState::SafeOp | AlState::Op)));
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

/// A device alone on a segment, declared from its description with its defaults, to OP; the reason if it is refused.
fn run(file: &Path, esi: &Esi, device: usize, devices: &EsiDevices) -> Result<(), String> {
    let of = &esi.devices[device];
    let mut network = NetworkFile::empty("one", PERIOD);
    push(&mut network, esi, device, &Choices::default())?;
    let network = LoadedNetwork::new(network);
    let name = file.file_name().unwrap().to_string_lossy();
    let (kind, revision) = (of.kind.trim(), of.revision);
    let (esi_keys, product) = (format!("esi = '{name}'\ntype = '''{kind}'''"), of.product_code);
    let text = format!("[[device]]\nname = \"it\"\n{esi_keys}\nrevision = {revision}\nproduct = {product}\n");
    let links = links_of(&text, file.parent().unwrap(), devices)?;
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().map_err(|error| error.to_string())?;
    let differences = network.configuration.compare(&scan.subdevices);
    if let Some(difference) = differences.first() {
        return Err(difference.text.clone());
    }
    let mut application = main_device.activate(network.declaration()).map_err(|error| error.to_string())?;
    let image = EniImage::new(&network.configuration, application.directory()).map_err(|error| error.to_string())?;
    assert_eq!(image.unplaced(), []);
    application.wait_until_op(LIMIT).map_err(|error| error.to_string())?;
    let device = application.links().network().device(DeviceIndex(0));
    assert_eq!(device.al_status(), AlStatus::new(AlState::Op));
    Ok(())
}

/// Why a device is refused, by the beginning of the reason behind the file and the device.
const REASONS: [&str; 1] = ["it has no controller (Invisible): it is no SubDevice of a network"];

/// Devices of real descriptions; a seed is the number of a device.
// covers: esi-declare, esi-use
#[test]
fn declared_devices_of_real_descriptions_reach_op_or_have_a_reason() {
    let files = real();
    let mut by_file: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    let esis: Vec<Esi> = files.iter().map(|file| load(file).unwrap()).collect();
    let all: Vec<(usize, usize)> = esis
        .iter()
        .enumerate()
        .flat_map(|(file, esi)| (0..esi.devices.len()).map(move |device| (file, device)))
        .collect();
    if all.is_empty() {
        return;
    }
    assert_eq!(all.len(), 463);
    for seed in seeds::from_environment().unwrap_or(0..15) {
        // The first seeds are spread over all files.
        let (file, device) = all[(seed as usize * 31) % all.len()];
        by_file.entry(file).or_default().push(device);
    }
    let (mut reached, mut refused, mut failed) = (0, 0, Vec::new());
    let simulated = EsiDevices::default();
    for (file, devices) in by_file {
        for device in devices {
            match run(&files[file], &esis[file], device, &simulated) {
                Ok(()) => reached += 1,
                Err(reason) if REASONS.iter().any(|known| reason.contains(known)) => refused += 1,
                Err(reason) => failed.push(format!("{} device {device}: {reason}", files[file].display())),
            }
        }
    }
    println!("{reached} reached OP, {refused} were refused");
    assert!(failed.is_empty(), "{failed:#?}");
}
