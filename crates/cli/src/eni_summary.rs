//! `ringcat eni FILE`: what an ENI says and what follows from it, without any bus. `ringcat eni export` writes one.

mod details;
mod export;
mod json;
mod words;

use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Subcommand};
use ringcat::Direction;
use ringcat::config::Configuration;
use ringcat::config::eni::{Eni, SubDevice};
use ringcat::eni::EniFile;
use ringcat::{ConfigAddress, GroupId, ReferenceClock, SubDeviceConfig, SyncManagerRole};

use crate::failure::Failure;
use crate::json::data::Data;
use crate::output::{counted, say};
use crate::verdict::{Report, Verdict};
use words::{one_line, ranges, time};

/// How to read what it prints.
const ABOUT_ENI: &str = "\
SyncManagers, start-up commands, watchdogs and clocks are those of the file,
also where the SII of a SubDevice differs. What RingCAT does in its own way
(state changes, addresses on the wire, FMMUs, delays of clocks) is compared with
the file and not listed. What is not followed is listed at the end, with the
reason. An ENI comes from the tool that configured the network: TwinCAT
(EtherCAT device, \"Export Configuration File\"), EC-Engineer (\"Export ENI\").

Exit status: 0 the file can be followed, 1 it describes no SubDevice, 2 it
cannot be followed, with the reason on the standard error output.";

/// Options of `ringcat eni`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_ENI, args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct EniArguments {
    #[command(subcommand)]
    command: Option<EniCommand>,
    /// The ENI
    #[arg(required = true)]
    file: Option<PathBuf>,
    /// List SyncManagers, PDOs, start-up commands and variables too
    ///
    /// JSON always has them.
    #[arg(long, help_heading = "Output")]
    details: bool,
}

#[derive(Debug, Subcommand)]
enum EniCommand {
    /// Writes the ENI of a network file, or of another ENI
    ///
    /// What an ENI cannot express is refused with the reason, or listed. No interface is needed.
    Export(export::ExportArguments),
}

impl EniArguments {
    /// As the command line has it.
    pub const fn name(&self) -> &'static str {
        match self.command {
            Some(EniCommand::Export(_)) => "eni export",
            None => "eni",
        }
    }
}

/// Reads the file and prints what follows.
pub fn run(arguments: &EniArguments) -> Result<Report, Failure> {
    if let Some(EniCommand::Export(arguments)) = &arguments.command {
        return export::run(arguments);
    }
    let file = arguments.file.as_deref().ok_or_else(|| Failure::new("expected the file of an ENI"))?;
    let EniFile { eni: model, configuration, .. } =
        EniFile::load(file).map_err(|error| Failure::new(error.to_string()))?;
    summary(&model, &configuration).iter().for_each(|line| say!("{line}"));
    if arguments.details {
        details::lines(&model, &configuration).iter().for_each(|line| say!("{line}"));
    }
    not_followed(&configuration).iter().for_each(|line| say!("{line}"));
    let data = Data::Eni(Box::new(json::json(&model, &configuration)));
    Ok(Report { verdict: verdict(&configuration), data })
}

/// A file that describes no SubDevice cannot be followed. What is done in another way is printed before.
fn verdict(configuration: &Configuration) -> Verdict {
    let subdevices = configuration.declaration.subdevices.len();
    if subdevices == 0 {
        return Verdict::Failed("the file describes no SubDevice".to_owned());
    }
    let notices = configuration.notices.len();
    let subdevices = counted(subdevices, "SubDevice", "SubDevices");
    Verdict::Held(match notices {
        0 => format!("{subdevices}, everything is followed"),
        _ => format!("{subdevices}, {} done in another way", counted(notices, "thing", "things")),
    })
}

fn summary(model: &Eni, configuration: &Configuration) -> Vec<String> {
    let declaration = &configuration.declaration;
    let count = declaration.subdevices.len();
    let subdevices = counted(count, "SubDevice", "SubDevices");
    let mut lines = vec![format!("network     \"{}\", {subdevices}", one_line(&model.main_device.name))];
    if let Some(made_by) = &model.made_by {
        lines.push(format!("made by     {}", one_line(made_by)));
    }
    let image = &configuration.image;
    lines.push(format!(
        "image       inputs {}, outputs {}, {}, {}",
        counted(image.inputs_len, "byte", "bytes"),
        counted(image.outputs_len, "byte", "bytes"),
        counted(image.variables.len(), "variable", "variables"),
        counted(image.copies.len(), "copy", "copies")
    ));
    for domain in &declaration.domains {
        let members: Vec<usize> = domain.members.iter().map(|member| member.subdevice.0).collect();
        let period = time(domain.period);
        let assumed = if configuration.cycle.is_none() { " (the file has no cycle time)" } else { "" };
        lines.push(format!("task        every {period}{assumed}: SubDevices {}", ranges(&members)));
    }
    for lrw in &declaration.explicit_lrw {
        let subdevices: Vec<usize> = lrw.subdevices.iter().map(|subdevice| subdevice.0).collect();
        lines.push(format!("LRW         {}: SubDevices {}", lrw.name, ranges(&subdevices)));
    }
    if let Some(clocks) = &declaration.clocks {
        let reference = match clocks.reference {
            ReferenceClock::Declared(index) => format!("SubDevice {index}"),
            _ => "the first one with a clock".to_owned(),
        };
        let follows = if clocks.bus_shift { "follows this computer (bus shift)" } else { "runs free" };
        lines.push(format!("clocks      {reference} is the reference and {follows}"));
    }
    for (number, name) in configuration.groups.iter().enumerate() {
        let of_group = |index: &usize| declaration.subdevices[*index].group == Some(GroupId(number));
        let members: Vec<usize> = (0..count).filter(of_group).collect();
        lines.push(format!("group       \"{}\": SubDevices {}", one_line(name), ranges(&members)));
    }
    lines.push(String::new());
    lines.push(
        " nr  PhysAddr  at                vendor      product       out bits  in bits  mailbox  start-up  clock    name"
            .to_owned(),
    );
    let pairs = declaration.subdevices.iter().zip(&model.subdevices).enumerate();
    lines.extend(pairs.map(|(index, (config, subdevice))| row(index, config, subdevice, configuration)));
    lines
}

fn row(index: usize, config: &SubDeviceConfig, subdevice: &SubDevice, configuration: &Configuration) -> String {
    let id = |expected: Option<u32>, said: Option<u32>| match expected.or(said) {
        // In brackets: in the file, but not compared.
        Some(id) if expected.is_none() => format!("({id:#x})"),
        Some(id) => format!("{id:#010x}"),
        None => "-".to_owned(),
    };
    let mailbox = config.declared.iter().flatten().find(|sm| sm.role == SyncManagerRole::MailboxOut);
    let mailbox = mailbox.map_or("-".to_owned(), |sm| sm.register.length.to_string());
    format!(
        "{index:>3}  {:>8}  {:<16}  {:<10}  {:<12} {:>9} {:>8} {mailbox:>8} {:>9}  {:<7}  {}",
        subdevice.station.map_or("-".to_owned(), |station| station.to_string()),
        place(config.address),
        id(config.expected.vendor_id, subdevice.vendor_id),
        id(config.expected.product_code, subdevice.product_code),
        bits(index, Direction::Outputs, configuration),
        bits(index, Direction::Inputs, configuration),
        config.startup.len(),
        config.sync.map_or("-".to_owned(), |signals| time(Duration::from_nanos(signals.sync0_cycle_ns.into()))),
        one_line(&subdevice.name),
    )
}

/// Bits of process data in the image.
fn bits(subdevice: usize, direction: Direction, configuration: &Configuration) -> u64 {
    let areas = configuration.image.areas.iter();
    areas.filter(|a| a.subdevice == subdevice && a.direction == direction).map(|area| u64::from(area.bits)).sum()
}

fn place(address: ConfigAddress) -> String {
    match address {
        ConfigAddress::Position(position) => format!("position {position}"),
        ConfigAddress::Alias { alias, offset } => format!("alias {alias} + {offset}"),
        ConfigAddress::Identification { value, offset } => format!("id {value} + {offset}"),
        ConfigAddress::DataWord { register, value, offset } => format!("word {value} at {register} + {offset}"),
        other => other.to_string(),
    }
}

fn not_followed(configuration: &Configuration) -> Vec<String> {
    if configuration.notices.is_empty() && !configuration.declaration.subdevices.is_empty() {
        return vec![String::new(), "everything in the file is followed".to_owned()];
    }
    if configuration.notices.is_empty() {
        return Vec::new();
    }
    let mut lines = vec![String::new(), "not followed as written:".to_owned()];
    for notice in &configuration.notices {
        let concerned = match &notice.subdevices[..] {
            [] => String::new(),
            some => format!(" [SubDevice {}]", ranges(some)),
        };
        lines.push(format!("  {}{concerned}", one_line(&notice.to_string())));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = include_str!("../files/small.eni.xml");

    fn small() -> (Eni, Configuration) {
        let EniFile { eni, configuration, .. } = EniFile::from_bytes(SMALL.as_bytes()).unwrap();
        (eni, configuration)
    }

    // covers: 8.1, eni-run
    #[test]
    fn a_file_is_shown_in_a_table_with_what_is_not_followed() {
        let (model, configuration) = small();
        let lines = summary(&model, &configuration);
        assert_eq!(lines[0], "network     \"Small\", 4 SubDevices");
        assert!(
            lines.contains(&"image       inputs 8 bytes, outputs 10 bytes, 6 variables, 2 copies".to_owned()),
            "{lines:#?}"
        );
        assert!(lines.contains(&"task        every 2ms: SubDevices 1-3".to_owned()));
        assert!(lines.contains(&"clocks      SubDevice 3 is the reference and runs free".to_owned()));
        let drive = lines.last().unwrap();
        let columns: Vec<&str> = drive.split_whitespace().collect();
        let expected = ["3", "1004", "position", "3", "(0x9a)", "(0x30924)", "48", "48", "128", "9", "1ms", "Drive"];
        assert_eq!(columns, expected);
        // A register that RingCAT controls itself.
        let ports = SMALL.replace("<Ado>3840</Ado>", "<Ado>256</Ado>");
        let notices = not_followed(&EniFile::from_bytes(ports.as_bytes()).unwrap().configuration);
        assert!(notices.iter().any(|line| line.contains("ports and forwarding") && line.ends_with("[SubDevice 3]")));
        let details = details::lines(&model, &configuration);
        assert!(
            details
                .iter()
                .any(|line| line.contains("SDO 0x1c12:00, complete access = 01 00 00 16") && line.contains("assign"))
        );
        assert!(details.iter().any(|line| line.contains("outputs  0x1100      6 bytes")), "{details:#?}");
        // Four bits, of which two belong to each terminal.
        let copies = details.iter().skip_while(|line| !line.starts_with("copies: "));
        let copies: Vec<Vec<&str>> = copies.skip(1).map(|line| line.split_whitespace().collect()).collect();
        assert_eq!(copies, [["2", "8", "18"], ["2", "10", "20"]]);
    }

    // covers: eni-run
    #[test]
    fn the_same_is_there_as_json() {
        let (model, configuration) = small();
        let json = serde_json::to_value(json::json(&model, &configuration)).unwrap();
        assert_eq!(json["subdevices"][3]["station"], 1004);
        assert_eq!(json["subdevices"][3]["sync_managers"][2]["length"], 6);
        assert_eq!(json["subdevices"][3]["startup"].as_array().unwrap().len(), 9);
        assert_eq!(json["image"]["areas"][1]["image_bit"], 20);
        assert_eq!(json["image"]["copies"][1]["output_bit"], 20);
        assert_eq!(json["tasks"][0]["cycle_ns"], 2_000_000);
        assert_eq!(json["lrw"][0]["subdevices"][0], 3);
        assert_eq!(json["not_followed"].as_array().unwrap().len(), configuration.notices.len());
    }
}
