//! `ringcat run --eni FILE` and `--network FILE`: the network is the one of the file, outputs are what `--set` says.

use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use ringcat::Directory;
use ringcat::config::{Configuration, ObjectNames, Variable};
use ringcat::eni::{EniFile, EniImage, EniVariable, VariableType};
use ringcat::network::{LoadedNetwork, NetworkFile};
use ringcat::text::Names;
use ringcat::{
    ActivateError, Declaration, Direction, Error, JunctionConnection, JunctionMode, Scan, StationAddress,
    SubDeviceConfig, SubDeviceId, SubDeviceInfo,
};

use super::watched::{Watched, Work, work};
use crate::failure::Failure;
use crate::output::{say, warn};

/// Similar names in an error: at most this number, at least this alike (1 is equal).
const NEAR: usize = 3;
const LIKE: f64 = 0.6;

/// Options about the file of a network.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Segment")]
pub struct ConfiguredArguments {
    /// Bring the network of this ENI to OP, instead of the SubDevices found
    ///
    /// TwinCAT, EC-Engineer and other tools export an ENI. `ringcat eni FILE` shows what of it is followed; see
    /// docs/eni.md.
    #[arg(long, value_name = "FILE", conflicts_with = "cycle", groups = ["file", "declaration"])]
    eni: Option<PathBuf>,
    /// Bring the network of this network file to OP, instead of the SubDevices found
    ///
    /// `ringcat init` writes one from a scan; see docs/network-file.md.
    #[arg(
        long,
        value_name = "FILE.toml",
        conflicts_with_all = ["cycle", "eni"],
        groups = ["file", "declaration"]
    )]
    network: Option<PathBuf>,
    /// Send LRD and LWR where the file has an LRW over several SubDevices
    ///
    /// With two interfaces that is necessary: a break of the ring would divide the LRW.
    #[arg(long, requires = "eni")]
    split_lrw: bool,
    /// Give this output variable of the file a value from the first cycle on
    ///
    /// May be given several times.
    #[arg(long, value_name = "NAME=VALUE", requires = "file")]
    set: Vec<String>,
    /// Print the value of this variable of the file when it changes
    ///
    /// At most once a second, and in the end. May be given several times.
    #[arg(long, value_name = "NAME", requires = "file")]
    watch: Vec<String>,
}

/// A network from a file.
#[derive(Debug)]
pub struct ConfiguredNetwork {
    file: FileOfNetwork,
    set: Vec<String>,
    watch: Vec<String>,
}

/// The file.
#[derive(Debug)]
enum FileOfNetwork {
    /// An ENI; its LRW may be split.
    Eni { file: Box<EniFile>, split_lrw: bool },
    /// A network file.
    Network(Box<LoadedNetwork>),
}

impl ConfiguredArguments {
    /// Whether there is a file.
    #[cfg(feature = "standby")]
    pub fn is_given(&self) -> bool {
        self.eni.is_some() || self.network.is_some()
    }

    /// Reads the file, if there is one, and prints what of it is not followed. Refuses a ring on one interface, where
    /// the interfaces are known.
    pub fn load(&self, has_redundant: Option<bool>) -> Result<Option<ConfiguredNetwork>, Failure> {
        let failed = |error: &dyn std::fmt::Display| Failure::new(error.to_string());
        let (path, file) = match (&self.eni, &self.network) {
            (Some(path), _) => {
                let file = Box::new(EniFile::load(path).map_err(|error| failed(&error))?);
                (path, FileOfNetwork::Eni { file, split_lrw: self.split_lrw })
            }
            (None, Some(path)) => {
                let file = LoadedNetwork::load(path).map_err(|error| failed(&error))?;
                (path, FileOfNetwork::Network(Box::new(file)))
            }
            (None, None) => return Ok(None),
        };
        let network = ConfiguredNetwork { file, set: self.set.clone(), watch: self.watch.clone() };
        let configuration = network.configuration();
        if configuration.declaration.subdevices.is_empty() {
            return Err(Failure::new(format!("{}: the file describes no SubDevice", path.display())));
        }
        if !configuration.notices.is_empty() {
            say!("{}: not followed, or done in another way:", path.display());
            configuration.notices.iter().for_each(|notice| say!("  {notice}"));
        }
        if configuration.declaration.clocks.as_ref().is_some_and(|clocks| clocks.bus_shift) {
            say!("  the reference clock follows this host (bus shift); with --phase 0us the cycles follow it instead");
        }
        has_redundant.map_or(Ok(()), |has_redundant| network.check_links(has_redundant))?;
        network.check_variables()?;
        Ok(Some(network))
    }
}

impl ConfiguredNetwork {
    fn configuration(&self) -> &Configuration {
        match &self.file {
            FileOfNetwork::Eni { file, .. } => &file.configuration,
            FileOfNetwork::Network(network) => &network.configuration,
        }
    }

    /// The network file, where it is one.
    fn network_file(&self) -> Option<&NetworkFile> {
        match &self.file {
            FileOfNetwork::Eni { .. } => None,
            FileOfNetwork::Network(network) => Some(&network.file),
        }
    }

    /// Refuses a ring on one interface.
    pub fn check_links(&self, has_redundant: bool) -> Result<(), Failure> {
        let needs_ring = self.network_file().is_some_and(|file| file.redundancy.ring);
        if needs_ring && !has_redundant {
            return Err(Failure::new("the file declares a ring (redundancy.ring): expected --redundant IF"));
        }
        Ok(())
    }

    /// How rings behind junctions are handled, where the file says it.
    pub fn junctions(&self) -> Option<(JunctionMode, Vec<JunctionConnection>)> {
        let file = self.network_file().filter(|file| file.junction_mode() != JunctionMode::Disabled)?;
        Some((file.junction_mode(), file.junction_connections()))
    }

    /// Names of the SubDevices.
    pub fn names(&self) -> Names {
        Names(self.configuration().names())
    }

    /// The SubDevices that the file declares.
    pub fn declared(&self) -> &[SubDeviceConfig] {
        &self.configuration().declaration.subdevices
    }

    /// Names of the objects of each SubDevice: those of the file, then those of the scan.
    pub fn objects(&self, found: &[SubDeviceInfo], described: Vec<ObjectNames>) -> Vec<ObjectNames> {
        let described: Vec<Arc<ObjectNames>> = described.into_iter().map(Arc::new).collect();
        let places = self.configuration().places(found).into_iter().enumerate();
        let of = |(at, place): (usize, Option<usize>)| {
            let mut names = ObjectNames::default();
            match &self.file {
                FileOfNetwork::Eni { file, .. } => {
                    file.eni.subdevices.get(at).into_iter().for_each(|it| names.add_eni(it))
                }
                FileOfNetwork::Network(network) => {
                    network.file.subdevice.get(at).into_iter().for_each(|it| names.add_declared(it));
                }
            }
            place.and_then(|place| described.get(place)).into_iter().for_each(|found| names.share(found.clone()));
            names
        };
        places.map(of).collect()
    }

    /// Whether the file declares the process data of every SubDevice with all registers.
    pub fn is_complete(&self) -> bool {
        self.configuration().declaration.subdevices.iter().all(|config| config.declared.is_some())
    }

    /// The SubDevice with this station address in the file.
    pub fn at_station(&self, station: StationAddress) -> Option<SubDeviceId> {
        self.configuration().at_station(station)
    }

    /// The declaration of the file.
    pub fn of_file(&self) -> &Declaration {
        &self.configuration().declaration
    }

    /// The declaration, where the SubDevices that were found are those of the file. Prints each difference.
    pub fn declaration(&self, found: &[SubDeviceInfo]) -> Result<Declaration, Failure> {
        if self.has_words_of(found) {
            let differences = self.configuration().compare(found);
            for difference in &differences {
                warn(difference);
            }
            if differences.iter().any(|difference| difference.prevents_op) {
                return Err(Failure::new("the network is not the one of the file: correct the file, or the network"));
            }
        }
        Ok(match &self.file {
            FileOfNetwork::Eni { file, split_lrw } => file.declaration(*split_lrw),
            FileOfNetwork::Network(network) => network.declaration(),
        })
    }

    /// Whether the data words by which the file finds SubDevices were read. A MainDevice that joins a ring declares
    /// before they are read; its activation reads and compares them.
    fn has_words_of(&self, found: &[SubDeviceInfo]) -> bool {
        let words = ringcat::data_words(&self.configuration().declaration.subdevices);
        words.into_iter().all(|word| found.iter().any(|info| info.data_word(word).is_some()))
    }

    /// Number of SubDevices on the bus that the file lacks. [`EniNetwork::declaration`] prints each; they stay in INIT.
    pub fn undeclared(&self, found: &[SubDeviceInfo]) -> usize {
        self.configuration().compare(found).iter().filter(|difference| difference.subdevice.is_none()).count()
    }

    /// Warns of cables that are not where the file says. The network works all the same.
    pub fn report_cables(&self, scan: &Scan) {
        for difference in self.configuration().compare_cables(&scan.subdevices, &scan.topology) {
            warn(difference);
        }
    }

    /// Why it cannot be activated, in terms of the file and of this program.
    pub fn explain(&self, error: Error) -> Failure {
        match error {
            Error::Activate(ActivateError::NamedLrwOnTwoLinks(lrw)) => {
                let names = self.names().0;
                let members: Vec<&str> =
                    lrw.subdevices.iter().filter_map(|at| Some(names.get(at.0)?.as_str())).collect();
                Failure::new(format!(
                    "{}: an LRW of {} bytes over {} SubDevices ({}) cannot be used with two interfaces, because a \
                     break of the ring would divide it: add --split-lrw to have it sent as LRD and LWR, or leave \
                     --redundant out",
                    lrw.name,
                    lrw.length,
                    members.len(),
                    members.join(", ")
                ))
            }
            other => Failure::from(other),
        }
    }

    /// Checks all variables of the options before anything is sent.
    fn check_variables(&self) -> Result<(), Failure> {
        self.set.iter().try_for_each(|text| self.assignment(text).map(|_| ()))?;
        self.watch.iter().try_for_each(|name| self.variable("--watch", name, Direction::Inputs).map(|_| ()))
    }

    /// Number of a variable in document order, and what the file says of it. Where an input and an output have one
    /// name, it is the one of this direction.
    fn variable(&self, option: &str, name: &str, wanted: Direction) -> Result<(usize, &Variable), Failure> {
        let variables = &self.configuration().image.variables;
        let mut named = variables.iter().enumerate().filter(|(_, variable)| variable.name == name);
        let first = named.clone().next();
        let found = named.find(|(_, variable)| variable.direction == wanted).or(first);
        let (number, variable) = found.ok_or_else(|| {
            let useful = variables.iter().filter(|variable| variable.subdevice.is_some());
            let near = near(name, useful.map(|variable| variable.name.as_str()));
            let near = if near.is_empty() { String::new() } else { format!("; similar: {}", near.join(", ")) };
            let all = match self.file {
                FileOfNetwork::Eni { .. } => {
                    format!("`ringcat eni --details FILE` lists its {} variables", variables.len())
                }
                FileOfNetwork::Network(_) => format!("it has {} variables", variables.len()),
            };
            Failure::new(format!("{option}: the file has no variable \"{name}\"{near}; {all}"))
        })?;
        if variable.subdevice.is_none() {
            return Err(Failure::new(format!(
                "{option}: \"{name}\" belongs to no SubDevice: nothing writes or reads it"
            )));
        }
        Ok((number, variable))
    }

    /// Number of the variable in `NAME=VALUE`, and the bits that it gets.
    fn assignment(&self, text: &str) -> Result<(usize, u64), Failure> {
        // Names may have an equals sign, values have none.
        let pair = text.rsplit_once('=');
        let (name, value) = pair.ok_or_else(|| Failure::new(format!("--set: expected NAME=VALUE, got \"{text}\"")))?;
        let (number, variable) = self.variable("--set", name, Direction::Outputs)?;
        if variable.direction == Direction::Inputs {
            return Err(Failure::new(format!("--set: \"{name}\" is an input: the SubDevice gives it its value")));
        }
        let length = u16::try_from(variable.bits).ok().filter(|length| *length <= 64);
        let bits = length.and_then(|length| VariableType::named(&variable.data_type).parse(value, length));
        let bits = bits.ok_or_else(|| {
            let (count, kind) = (variable.bits, &variable.data_type);
            let unit = if count == 1 { "bit" } else { "bits" };
            let most = if length.is_none() { ": only up to 64 bits can be set" } else { "" };
            Failure::new(format!(
                "--set: expected a value of {count} {unit} ({kind}) for \"{name}\", got \"{value}\"{most}"
            ))
        })?;
        Ok((number, bits))
    }

    /// The work of the cycles, and the variables to print.
    pub fn work(&self, directory: &Directory) -> Result<(Work, Watched), Failure> {
        let mut image =
            EniImage::new(self.configuration(), directory).map_err(|error| Failure::new(error.to_string()))?;
        for text in &self.set {
            let (number, bits) = self.assignment(text)?;
            let variable = image.variables()[number].clone();
            image.write(&variable, bits);
        }
        for subdevice in image.unplaced() {
            let name = self.names().0.get(subdevice.0).cloned().unwrap_or_default();
            warn(format_args!("SubDevice {subdevice} \"{name}\" has places in the file's image and no process data"));
        }
        let watched = self.watch.iter().map(|name| {
            let (number, _) = self.variable("--watch", name, Direction::Inputs)?;
            Ok(image.variables()[number].clone())
        });
        let watched: Vec<EniVariable> = watched.collect::<Result<_, Failure>>()?;
        Ok(work(image, watched))
    }
}

/// Names similar to an unknown one, the most similar first, in quotation marks.
fn near<'a>(wanted: &str, names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let wanted = wanted.to_lowercase();
    let likeness = |name: &str| {
        let name = name.to_lowercase();
        if name.contains(&wanted) { 1.0 } else { strsim::normalized_damerau_levenshtein(&wanted, &name) }
    };
    let mut near: Vec<(f64, &str)> =
        names.map(|name| (likeness(name), name)).filter(|(like, _)| *like >= LIKE).collect();
    near.sort_by(|a, b| b.0.total_cmp(&a.0));
    near.dedup_by_key(|(_, name)| *name);
    near.into_iter().take(NEAR).map(|(_, name)| format!("\"{name}\"")).collect()
}

#[cfg(test)]
mod tests {
    use ringcat::simulated::SimulatedSegment;
    use ringcat::{DataWord, Instant, MainDevice, Options, RegisterAddress};

    use super::*;

    const MACHINE: &[u8] = include_bytes!("../../files/machine.eni.xml");

    fn network(set: &[&str], watch: &[&str]) -> ConfiguredNetwork {
        let strings = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect();
        let file = Box::new(EniFile::from_bytes(MACHINE).unwrap());
        let file = FileOfNetwork::Eni { file, split_lrw: false };
        ConfiguredNetwork { file, set: strings(set), watch: strings(watch) }
    }

    // covers: eni-run
    #[test]
    fn variables_are_set_and_printed_and_unknown_ones_are_refused_by_name() {
        let segment = SimulatedSegment::new(EniFile::from_bytes(MACHINE).unwrap().simulated(false).unwrap());
        let mut main_device = MainDevice::request(segment, &Options::default());
        let found = main_device.scan().unwrap().subdevices;
        let declaration = network(&[], &[]).declaration(&found).unwrap();
        let mut application = main_device.activate(declaration).map_err(Error::from).unwrap();
        let good = network(&["Lamps.Channel 2=on", "Drive.Target velocity=-5"], &["Drive.Position"]);
        good.check_variables().unwrap();
        let (mut work, mut watched) = good.work(application.directory()).unwrap();
        for _ in 0..400 {
            application.cycle(|data| work.cycle(data));
        }
        assert_eq!(application.links().network().device(ringcat::sim::cable::DeviceIndex(1)).outputs(), [2]);
        assert_eq!(watched.changes(Instant(1)), ["Drive.Position = -5"]);
        assert_eq!(watched.changes(Instant(2)), [""; 0], "at most once a second");
        assert_eq!(watched.changes(Instant(2_000_000_000)), [""; 0], "when it changes");

        assert!(network(&["Lamps.Channel 2=on"], &["Lamp"]).check_variables().is_err());
    }

    // covers: eni-run
    #[test]
    fn errors_of_variables_show_before_anything_is_sent_with_similar_names() {
        let refused = |set: &str| network(&[set], &[]).check_variables().unwrap_err().to_string();
        let unknown = refused("Lamp.Channel 2=1");
        let expected = "--set: the file has no variable \"Lamp.Channel 2\"; similar: \"Lamps.Channel 2\", ";
        assert!(unknown.starts_with(expected), "{unknown}");
        assert!(unknown.ends_with("; `ringcat eni --details FILE` lists its 16 variables"), "{unknown}");
        let part = refused("velocity=1");
        assert!(part.contains("; similar: \"Drive.Target velocity\";"), "{part}");
        assert!(refused("completely different=1").contains("\"completely different\"; `ringcat eni"));
        assert!(refused("Buttons.Channel 1=1").contains("is an input"));
        let value = refused("Drive.Target velocity=fast");
        assert!(value.contains("a value of 32 bits (DINT) for \"Drive.Target velocity\", got \"fast\""), "{value}");
        assert!(refused("Lamps.Channel 1=2").contains("expected a value of 1 bit (BOOL)"));
        assert!(refused("Lamps.Channel 1").contains("expected NAME=VALUE"));
    }

    // covers: eni-run
    #[test]
    fn variables_without_an_owner_are_refused_and_shared_names_mean_the_right_one() {
        let changed = |from: &str, to: &str, set: &[&str], watch: &[&str]| {
            let text = std::str::from_utf8(MACHINE).unwrap();
            assert!(text.contains(from));
            let file = Box::new(EniFile::from_bytes(text.replace(from, to).as_bytes()).unwrap());
            let file = FileOfNetwork::Eni { file, split_lrw: false };
            let strings = |texts: &[&str]| texts.iter().map(|text| (*text).to_owned()).collect();
            ConfiguredNetwork { file, set: strings(set), watch: strings(watch) }
        };
        // Byte 1 of the images belongs to no SubDevice.
        let unowned = "<BitOffs>8</BitOffs>";
        let free = changed("<BitOffs>0</BitOffs>", unowned, &["Lamps.Channel 1=1"], &[]);
        assert!(free.check_variables().unwrap_err().to_string().contains("belongs to no SubDevice"));
        let free = changed("<BitOffs>0</BitOffs>", unowned, &[], &["Buttons.Channel 1"]);
        assert!(free.check_variables().unwrap_err().to_string().contains("belongs to no SubDevice"));
        let free = changed("<BitOffs>0</BitOffs>", unowned, &["uttons.Channel 1=1"], &[]);
        let text = free.check_variables().unwrap_err().to_string();
        assert!(text.contains("similar: ") && !text.contains("\"Buttons.Channel 1\""), "{text}");
        let same = changed("Lamps.Channel 1", "Buttons.Channel 1", &["Buttons.Channel 1=1"], &["Buttons.Channel 1"]);
        let (number, bits) = same.assignment("Buttons.Channel 1=1").unwrap();
        assert_eq!((same.configuration().image.variables[number].direction, bits), (Direction::Outputs, 1));
        let (_, watched) = same.variable("--watch", "Buttons.Channel 1", Direction::Inputs).unwrap();
        assert_eq!(watched.direction, Direction::Inputs);
    }

    // covers: esi-use
    #[test]
    fn objects_have_the_names_of_the_file_then_those_of_the_scan() {
        let segment = SimulatedSegment::new(EniFile::from_bytes(MACHINE).unwrap().simulated(false).unwrap());
        let mut main_device = MainDevice::request(segment, &Options::default());
        let found = main_device.scan().unwrap().subdevices;
        let network = network(&[], &[]);
        let declared = network.configuration().declaration.subdevices.len();
        let described = found.iter().map(|_| ObjectNames::default()).collect();
        let objects = network.objects(&found, described);
        assert_eq!(objects.len(), declared);
        let drive = network.names().0.iter().position(|name| name.starts_with("Drive")).unwrap();
        assert_eq!(objects[drive].entry(0x6064, 0), Some("Position"), "{:?}", objects[drive]);
        assert_eq!(network.objects(&[], Vec::new()).len(), declared, "nothing was found");
    }

    // covers: network-file
    #[test]
    fn a_network_with_a_data_word_is_declared_before_the_word_is_read() {
        let text = "ringcat_network = 1\n[[domain]]\nname = \"d\"\nperiod = \"1ms\"\n[[subdevice]]\nname = \"A\"\n\
                    identification = 7\nidentification_word = 0x1000\n";
        let file = LoadedNetwork::from_bytes("a.toml", text.as_bytes()).unwrap();
        let file = FileOfNetwork::Network(Box::new(file));
        let network = ConfiguredNetwork { file, set: Vec::new(), watch: Vec::new() };
        let mut found = SubDeviceInfo::default();
        assert!(network.declaration(&[found.clone()]).is_ok(), "the activation compares");
        for (value, fits) in [(7, true), (8, false)] {
            found.data_words = vec![DataWord::new(RegisterAddress(0x1000), value)];
            assert_eq!(network.declaration(&[found.clone()]).is_ok(), fits, "{value}");
        }
    }

    // covers: CR-16
    #[test]
    fn an_lrw_that_is_refused_is_explained_with_subdevices_and_the_way_out() {
        let network = network(&[], &[]);
        let lrw = network.configuration().declaration.explicit_lrw[0].clone();
        let text = network.explain(Error::Activate(ActivateError::NamedLrwOnTwoLinks(lrw))).to_string();
        let members = "(Lamps (1002), Valves (1003), Buttons (1004), Drive (1005))";
        assert!(text.contains(members) && text.contains("add --split-lrw"), "{text}");
    }
}
