//! Networks from ENIs, end to end: the file is read, its segment is simulated, comes to OP as described in the file,
//! and exchanges data through the variables of the file (protocol 8).

mod cables;
mod commands;
mod exported;
mod numbers;
mod on_wire;
mod variants;

use std::path::{Path, PathBuf};
use std::time::Duration;

use ringcat::eni::{EniFile, EniImage, segment};
use ringcat::simulated::SimulatedSegment;
use ringcat::{
    ActivateError, Application, Direction, DomainId, DomainState, Error, Event, Freshness, MainDevice, Options,
    SubDeviceId, SubDeviceInfo,
};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_sim::device::Device;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_sim::sii_image;
use ringcat_wire::al::{AlState, AlStatus};
use scenarios::dice::Dice;
use scenarios::seeds;
use scenarios::segments::{descriptions, line};

/// A RingCAT example: packed outputs, a copy, a drive with its own mapping and SYNC0, one LRW for all.
const MACHINE: &[u8] = include_bytes!("../../../ringcat/examples/machine.eni.xml");
const LAMPS: usize = 1;
const VALVES: usize = 2;
const BUTTONS: usize = 3;
const DRIVE: usize = 4;
/// The output to which another SubDevice's input is copied.
const COPIED: &str = "Valves.Channel 4";
/// Files of tools, with their numbers of SubDevices.
const REAL: [(&str, usize); 5] = [
    ("twincat_mega_ek1100_el2008_el4002_el1809.xml", 4),
    ("rocos_eni.xml", 1),
    ("rocos_bcr_eni.xml", 3),
    ("rocos_eni4.xml", 4),
    ("rocos_eni7.xml", 7),
];

/// A network from a file.
struct Plant {
    file: EniFile,
    application: Application<SimulatedSegment>,
    image: EniImage,
    found: Vec<SubDeviceInfo>,
    events: Vec<Event>,
}

fn machine() -> EniFile {
    EniFile::from_bytes(MACHINE).unwrap_or_else(|error| panic!("{error}"))
}

/// A real file, if present.
fn real(name: &str) -> Option<EniFile> {
    let path: PathBuf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/eni").join(name);
    if !path.exists() {
        println!("skipped: {} is not there", path.display());
        return None;
    }
    Some(EniFile::load(&path).unwrap_or_else(|error| panic!("{error}")))
}

fn activate(file: EniFile, ring: bool, split_lrw: bool) -> Result<Plant, Error> {
    let network = file.simulated(ring).expect("a segment");
    activate_on(network, file, split_lrw)
}

fn activate_on(network: Network, file: EniFile, split_lrw: bool) -> Result<Plant, Error> {
    let plant = start(network, file, split_lrw)?;
    assert_eq!(plant.image.unplaced(), []);
    assert_eq!(plant.file.compare(&plant.found), [], "it is the network of the file");
    Ok(plant)
}

/// Activates a file on a network with any SubDevices.
fn start(network: Network, file: EniFile, split_lrw: bool) -> Result<Plant, Error> {
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let mut scan = main_device.scan()?;
    main_device.read_data_words(&file.configuration.declaration.subdevices, &mut scan);
    let found = scan.subdevices;
    let mut application = main_device.activate(file.declaration(split_lrw))?;
    let image = EniImage::new(&file.configuration, application.directory()).expect("the image fits");
    application.set_copies(image.copies()).expect("copies fit");
    Ok(Plant { file, application, image, found, events: Vec::new() })
}

/// Up to 64 bits of a device's image.
fn bits(image: &[u8], first: u32, count: u32) -> u64 {
    (0..count.min(64)).fold(0, |value, number| {
        let at = first + number;
        let byte = image.get(at as usize / 8).copied().unwrap_or(0);
        value | u64::from(byte >> (at % 8) & 1) << number
    })
}

impl Plant {
    fn cycle(&mut self) {
        let image = &mut self.image;
        self.application.cycle(|data| {
            image.take_inputs(data);
            image.give_outputs(data);
        });
        while let Some(event) = self.application.pop_event() {
            self.events.push(event.event);
        }
    }

    fn run(&mut self, cycles: usize) {
        (0..cycles).for_each(|_| self.cycle());
    }

    fn device(&self, index: usize) -> &Device {
        self.application.links().network().device(DeviceIndex(index))
    }

    fn network_mut(&mut self) -> &mut Network {
        self.application.links_mut().network_mut()
    }

    fn is_complete(&mut self) -> bool {
        self.application.exchange_mut().status(DomainId(0)).expect("it is declared").state == DomainState::Complete
    }

    /// All SubDevices in OP, with all clocks locked.
    fn settle(&mut self) {
        let until = self.application.now() + Duration::from_secs(30);
        let has_clocks = self.file.configuration.declaration.clocks.is_some();
        let is_ready = |application: &Application<SimulatedSegment>| {
            application.all_settled() && (!has_clocks || application.engine().clocks_locked())
        };
        while !is_ready(&self.application) {
            assert!(self.application.now() < until, "not in OP: {:?}", self.events);
            self.cycle();
        }
        self.run(20);
        let network = self.application.links().network();
        assert!(network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Op)));
        assert!(self.is_complete());
        let failed = self.events.iter().find(|event| matches!(event, Event::ConfigurationFailed { .. }));
        assert_eq!(failed, None);
    }

    /// The place of a variable in its SubDevice's process data, from the file alone.
    fn place(&self, variable: usize) -> Option<(usize, Direction, u32, u32)> {
        let variable = &self.image.variables()[variable];
        let subdevice = variable.subdevice?.0;
        let data = self.file.eni.subdevices[subdevice].process_data.as_ref()?;
        let ranges = if variable.direction == Direction::Outputs { &data.send } else { &data.receive };
        let mut before = 0;
        for range in ranges {
            if (range.start..range.start + range.length).contains(&variable.bit) {
                return Some((subdevice, variable.direction, before + variable.bit - range.start, variable.bits));
            }
            before += range.length;
        }
        None
    }

    /// Sets all output variables at random, and compares all variables with the devices. Returns their number.
    fn compare(&mut self, dice: &mut Dice) -> [usize; 2] {
        for number in 0..self.image.variables().len() {
            let variable = self.image.variables()[number].clone();
            if variable.direction == Direction::Outputs {
                assert!(self.image.write(&variable, dice.roll()));
            }
        }
        self.run(4);
        let mut compared = [0; 2];
        for number in 0..self.image.variables().len() {
            let Some((subdevice, direction, first, count)) = self.place(number) else { continue };
            let variable = &self.image.variables()[number];
            if variable.name == COPIED {
                continue;
            }
            let device = self.device(subdevice);
            let bytes = if direction == Direction::Outputs { device.outputs() } else { device.inputs() };
            assert_eq!(self.image.read(variable), bits(bytes, first, count), "{}", variable.name);
            compared[usize::from(direction == Direction::Inputs)] += 1;
        }
        compared
    }
}

// covers: 8, eni-run
#[test]
fn files_of_tools_come_to_op_and_exchange_data_through_their_variables() {
    for (name, count) in REAL {
        let Some(file) = real(name) else { continue };
        let has_clocks = file.configuration.declaration.clocks.is_some();
        let mut plant = activate(file, false, false).unwrap_or_else(|error| panic!("{name}: {error}"));
        plant.settle();
        assert_eq!(plant.application.links().network().devices().len(), count, "{name}");
        let mut dice = Dice::new(7);
        let mut compared = [0; 2];
        for _ in 0..10 {
            compared = plant.compare(&mut dice);
        }
        assert!(compared.iter().all(|count| *count > 0), "{name}: {compared:?}");
        assert_eq!(has_clocks, name.starts_with("rocos"), "{name}");
        println!("{name}: {} outputs and {} inputs by name", compared[0], compared[1]);
    }
}

/// All present files, besides those above: `sim --eni` and `run --eni` of each, as one program.
// covers: eni-run
#[test]
fn every_present_eni_reaches_op_or_reports_a_reason() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/eni");
    let Ok(entries) = std::fs::read_dir(&directory) else {
        println!("skipped: {} is not there", directory.display());
        return;
    };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    let mut complete = 0;
    for path in &paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let outcome = bring_up(path);
        println!(
            "{name}: {}",
            outcome.as_ref().map_or_else(String::clone, |wkc| format!("in OP, working counter {wkc}"))
        );
        match outcome {
            Ok(wkc) => {
                complete += 1;
                assert!(wkc > 0, "{name}: something is exchanged");
            }
            // A reason names the place in the file, or the SubDevice and its fault.
            Err(reason) => {
                let is_named = ["line ", "this is ", "SubDevice "].iter().any(|mark| reason.contains(mark));
                assert!(is_named, "{name}: {reason}");
            }
        }
    }
    let tools = REAL.iter().filter(|(name, _)| paths.iter().any(|path| path.ends_with(name))).count();
    assert!(complete >= tools, "{complete} of {} files come to OP", paths.len());
}

/// The working counter of the process data in OP, or the reason.
fn bring_up(path: &Path) -> Result<u32, String> {
    let file = EniFile::load(path).map_err(|error| error.to_string())?;
    let mut plant = activate(file, false, false).map_err(|error| error.to_string())?;
    let until = plant.application.now() + Duration::from_secs(30);
    while !plant.application.all_settled() || !plant.is_complete() {
        let reason = plant.events.iter().find_map(|event| match event {
            Event::ConfigurationFailed { subdevice, reason } => Some(format!("SubDevice {subdevice}: {reason}")),
            Event::StateError { subdevice, code, .. } => Some(format!("SubDevice {subdevice}: {code}")),
            _ => None,
        });
        if let Some(reason) = reason {
            return Err(reason);
        }
        assert!(plant.application.now() < until, "neither in OP nor a reason: {:?}", plant.events);
        plant.cycle();
    }
    plant.run(20);
    let network = plant.application.links().network();
    assert!(network.devices().all(|device| device.al_status() == AlStatus::new(AlState::Op)));
    let status = plant.application.exchange_mut().status(DomainId(0)).expect("it is declared");
    assert_eq!((status.wkc, status.state), (status.expected, DomainState::Complete));
    Ok(status.wkc)
}

// covers: 8, eni-run
#[test]
fn packed_bits_copies_and_a_mapping_of_a_file_work_on_line_and_ring() {
    for ring in [false, true] {
        let mut plant = activate(machine(), ring, ring).expect("it fits");
        plant.settle();
        let mut dice = Dice::new(3);
        for _ in 0..10 {
            // The copy overrides one bit.
            let copied = plant.image.variable("Buttons.Channel 4").cloned().expect("it is there");
            let target = plant.image.variable(COPIED).cloned().expect("it is there");
            let pressed = dice.roll() % 2;
            plant.network_mut().device_mut(DeviceIndex(BUTTONS)).set_inputs(&[(pressed as u8) << 3 | 0x05]);
            plant.run(4);
            assert_eq!(plant.image.read(&copied), pressed);
            assert_eq!(bits(plant.device(VALVES).outputs(), 3, 1), pressed);
            plant.image.write(&target, 1 - pressed);
            plant.run(4);
            assert_eq!(bits(plant.device(VALVES).outputs(), 3, 1), pressed, "copied, not written");
        }
        for (name, value, subdevice, bytes) in [
            ("Lamps.Channel 2", 1, LAMPS, &[0x02][..]),
            ("Valves.Channel 1", 1, VALVES, &[0x01]),
            ("Drive.Target velocity", 0x0403_0201, DRIVE, &[1, 2, 3, 4, 0, 0]),
        ] {
            plant.image.outputs_mut().fill(0);
            plant.network_mut().device_mut(DeviceIndex(BUTTONS)).set_inputs(&[0]);
            let variable = plant.image.variable(name).cloned().expect("it is there");
            plant.image.write(&variable, value);
            plant.run(4);
            assert_eq!(plant.device(subdevice).outputs(), bytes, "{name}");
            // The drive's inputs are what its outputs were.
            let position = plant.image.variable("Drive.Position").cloned().expect("it is there");
            assert_eq!(plant.image.read(&position), if subdevice == DRIVE { value } else { 0 });
        }
    }
}

/// A drive with another default mapping than the file's (SOEM#958).
// covers: 8, eni-run
#[test]
fn a_mapping_that_differs_from_the_sii_is_set_by_the_file() {
    let file = machine();
    let mut segment = segment(&file.eni, &file.configuration, false);
    let drive = &mut segment.devices[DRIVE];
    // As delivered: other PDOs, of other lengths, in its dictionary and in its SII.
    for pdo in &mut drive.pdos {
        pdo.entries.swap(0, 1);
        pdo.entries.truncate(1);
    }
    drive.objects.extend([0x60FF, 0x6064].map(|index| {
        use ringcat_sim::application::dictionary::{Access, Object};
        Object::variable(index, "", ringcat_sim::description::data_type::U32, Access::ReadWrite, &[0; 4])
    }));
    for sync_manager in drive.sync_managers.iter_mut().skip(2) {
        sync_manager.length = 2;
    }
    drive.sii_image = Some(sii_image::build(drive));
    let network = Network::from_description(segment).expect("cables fit");
    let mut plant = activate_on(network, file, false).expect("it fits");
    plant.settle();
    let velocity = plant.image.variable("Drive.Target velocity").cloned().expect("it is there");
    plant.image.write(&velocity, 0x0403_0201);
    plant.run(4);
    assert_eq!(plant.device(DRIVE).outputs(), [1, 2, 3, 4, 0, 0]);
}

// covers: CR-16, 9.2.2, eni-run
#[test]
fn an_lrw_of_a_file_is_refused_on_two_links_by_name_unless_it_may_be_split() {
    let files = std::iter::once(("machine", Some(machine()), vec![1, 2, 3, 4]));
    let real = [("rocos_bcr_eni.xml", vec![0, 1, 2]), ("rocos_eni7.xml", (0..7).collect())];
    let files = files.chain(real.into_iter().map(|(name, subdevices)| (name, self::real(name), subdevices)));
    for (name, file, subdevices) in files {
        let Some(file) = file else { continue };
        let Err(Error::Activate(error)) = activate(file.clone(), true, false) else { panic!("{name} was taken") };
        let ActivateError::NamedLrwOnTwoLinks(lrw) = &error else { panic!("{name}: {error}") };
        assert_eq!(lrw.subdevices.iter().map(|subdevice| subdevice.0).collect::<Vec<_>>(), subdevices, "{name}");
        assert!(!lrw.name.is_empty() && error.to_string().contains(&lrw.name), "{name}: {error}");
        let mut plant = activate(file, true, true).expect("split it is allowed");
        plant.settle();
        // A break and its repair, with everything in OP.
        let last = plant.application.links().network().devices().len() - 1;
        for fault in [Network::cut, Network::heal] {
            fault(plant.network_mut(), CableId(last));
            plant.run(200);
            assert!(plant.is_complete() && plant.application.all_settled(), "{name}");
        }
        plant.compare(&mut Dice::new(5));
    }
}

// covers: eni-run
#[test]
fn a_network_that_differs_from_the_file_is_reported_per_subdevice() {
    let file = machine();
    let mut other = segment(&file.eni, &file.configuration, false);
    other.devices[LAMPS].identity.product_code = 0x4711;
    other.devices[BUTTONS].identity.vendor_id = 0xBEC;
    let network = Network::from_description(other).expect("cables fit");
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let found = main_device.scan().expect("a scan").subdevices;
    let reports: Vec<String> = file.compare(&found).iter().map(ToString::to_string).collect();
    assert_eq!(reports.len(), 2, "{reports:?}");
    assert!(
        reports[0].contains("\"Lamps (1002)\"")
            && reports[0].contains("expected product code 0x00000002, got 0x00004711")
    );
    assert!(
        reports[1].contains("\"Buttons (1004)\"")
            && reports[1].contains("expected vendor id 0x00000c47, got 0x00000bec")
    );
    assert!(
        file.compare(&found[..4])
            .iter()
            .any(|difference| difference.prevents_op && difference.subdevice == Some(SubDeviceId(DRIVE)))
    );
}

// covers: eni-run
#[test]
fn variables_have_the_freshness_of_their_subdevice() {
    let mut plant = activate(machine(), false, false).expect("it fits");
    plant.settle();
    let variable = |plant: &Plant, name: &str| plant.image.variable(name).cloned().expect("it is there");
    let (button, position) = (variable(&plant, "Buttons.Channel 1"), variable(&plant, "Drive.Position"));
    plant.network_mut().power_off(DeviceIndex(DRIVE));
    plant.run(50);
    let Plant { application, image, .. } = &mut plant;
    application.cycle(|data| {
        let (button, position) = (image.freshness(&button, data), image.freshness(&position, data));
        assert_eq!(button, Freshness::Fresh);
        assert_ne!(position, Freshness::Fresh);
    });
    plant.network_mut().power_on(DeviceIndex(DRIVE));
    plant.run(20);
    plant.settle();
}

/// Written by hand, with more output bits than the eight bits of the SubDevice's SII.
const BY_HAND: &str = r#"<EtherCATConfig><Config>
<Slave><Info><Name>Outputs</Name><PhysAddr>1001</PhysAddr>
<VendorId>3143</VendorId><ProductCode>131596296</ProductCode></Info>
<ProcessData><Send><BitStart>0</BitStart><BitLength>BITS</BitLength></Send></ProcessData></Slave>
<Cyclic><CycleTime>1000</CycleTime></Cyclic>
<ProcessImage><Outputs><ByteSize>2</ByteSize></Outputs></ProcessImage>
</Config></EtherCATConfig>"#;

// covers: eni-run
#[test]
fn places_for_more_than_a_subdevice_has_are_refused_with_both_numbers() {
    let image = |bits: &str, outputs_len: usize| {
        let mut file = EniFile::from_bytes(BY_HAND.replace("BITS", bits).as_bytes()).expect("it is an ENI");
        file.configuration.image.outputs_len = outputs_len;
        let network = line(descriptions(&["digital-output-8"]), NetworkOptions::default());
        let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
        main_device.scan().expect("a scan");
        let application = main_device.activate(file.declaration(false)).expect("the SII says how");
        EniImage::new(&file.configuration, application.directory())
    };
    assert!(image("8", 2).is_ok());
    let text = image("16", 2).expect_err("eight are there").to_string();
    assert_eq!(text, "SubDevice 0: the file has places for 16 bits of outputs, the SubDevice has 8");
    let text = image("8", 0).expect_err("there is no image").to_string();
    assert_eq!(text, "SubDevice 0: its outputs end at bit 8 of the process image, which has 0");
}

/// Changed files of each seed.
const FILES: usize = 40;

/// With any numbers in a file, the segment starts or an error states the reason.
// covers: eni-run
#[test]
fn files_with_wrong_numbers_are_refused_or_followed_without_harm() {
    let text = std::str::from_utf8(MACHINE).expect("it is text");
    let places = numbers::of(text);
    let (mut refused, mut started) = (0, 0);
    for seed in seeds::from_environment().unwrap_or(1..2) {
        let mut dice = Dice::new(seed);
        for _ in 0..FILES {
            let changed = numbers::replaced(text, &places, &mut dice);
            match EniFile::from_bytes(changed.as_bytes()) {
                Ok(file) => started += usize::from(starts(&file, dice.one_in(2))),
                Err(_) => refused += 1,
            }
        }
    }
    println!("{refused} refused, {started} started");
    assert!(refused > 0 && started > 0);
}

/// Whether a file is followed as far as cycles; each step may refuse it.
fn starts(file: &EniFile, ring: bool) -> bool {
    let Ok(network) = file.simulated(ring) else { return false };
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &Options::default());
    let Ok(scan) = main_device.scan() else { return false };
    file.compare(&scan.subdevices);
    let Ok(mut application) = main_device.activate(file.declaration(ring)) else { return false };
    let Ok(mut image) = EniImage::new(&file.configuration, application.directory()) else { return false };
    let _ = application.set_copies(image.copies());
    for _ in 0..30 {
        application.cycle(|data| {
            image.take_inputs(data);
            image.give_outputs(data);
        });
    }
    true
}
