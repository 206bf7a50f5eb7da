//! `ringcat scan`: the SubDevices on the wire. All of them are in INIT afterwards, unless a daemon has them.

mod pdos;

use clap::Args;
use ringcat::text::{Names, describe};
use ringcat::{Event, MainDevice, Scan};

use crate::access::{Access, AccessArguments};
use crate::descriptions::{Descriptions, EsiArgument, complete};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::scan;
use crate::output::{counted, say, warn};
use crate::surroundings::Surroundings;
use crate::table;
use crate::verdict::{Report, Verdict};

/// What a user should know before.
const ABOUT_SCAN: &str = "\
All SubDevices go to INIT: a segment that is in operation leaves it. So a scan
refuses to begin where another MainDevice uses the interface or sends into the
segment; --force goes on all the same. It waits up to 5 s for the first
SubDevice to answer. Oddities of cables and EEPROMs go to the standard error
output, the table or JSON to the standard output.";

/// Options of `ringcat scan`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_SCAN)]
pub struct ScanArguments {
    #[command(flatten)]
    access: AccessArguments,
    /// List the PDOs of each SubDevice with their entries, as far as they are known
    ///
    /// From its EEPROM; a daemon also knows those of a dictionary that it has read.
    #[arg(long, help_heading = "Output")]
    pdos: bool,
    #[command(flatten)]
    esi: EsiArgument,
}

/// Scans and prints what was found; what happens meanwhile goes to the standard error output.
pub fn run(arguments: &ScanArguments) -> Result<Report, Failure> {
    EndRequest::at_once()?;
    let descriptions = arguments.esi.open()?;
    if arguments.access.master.is_some() {
        return known(arguments, descriptions);
    }
    let AccessArguments { interfaces, thread, recording, .. } = &arguments.access;
    let links = interfaces.open(*thread)?;
    let mut surroundings = Surroundings::watch(interfaces, &links);
    let recording = recording.start(interfaces)?;
    let links = recording.tee(links);
    let _awake = thread.apply();
    let mut main_device = MainDevice::request(links, &interfaces.options());
    let result = main_device.scan_with(|event| match &event.event {
        Event::ScanProgress { .. } | Event::ScanFailed { .. } => {}
        _ => match surroundings.note(&event.event) {
            None => eprintln!("{}", describe(event, &Names::default())),
            Some(words) => words.into_iter().for_each(warn),
        },
    });
    let foreign = main_device.acyclic_counters().foreign;
    let scan = result.map_err(|error| surroundings.explain(error, foreign))?;
    if foreign > 0 {
        eprintln!("{foreign} frames of another MainDevice arrived during the scan: {}", surroundings.senders());
    }
    drop(main_device);
    let data = show(arguments.pdos, descriptions, scan)?;
    let verdict = Verdict::Held(counted(data.subdevices.len(), "SubDevice", "SubDevices")).and(recording.finish());
    Ok(Report { verdict, data: Data::Scan(data) })
}

/// Prints what was found, with the names of descriptions.
fn show(with_pdos: bool, mut descriptions: Option<Descriptions>, mut scan: Scan) -> Result<scan::Scan, Failure> {
    let objects = complete(descriptions.as_mut(), &mut scan.subdevices, &[])?;
    let mut json = table::json(&scan);
    for line in table::lines(&scan) {
        say!("{line}");
    }
    if with_pdos {
        for ((info, names), json) in scan.subdevices.iter().zip(&objects).zip(&mut json.subdevices) {
            let pdos = pdos::json(info, names);
            pdos::lines(info, &pdos).iter().for_each(|line| say!("{line}"));
            json.pdos = Some(pdos);
        }
    }
    Ok(json)
}

/// What a daemon knows of the bus of a master. Nothing is scanned: a daemon does that after each change.
fn known(arguments: &ScanArguments, descriptions: Option<Descriptions>) -> Result<Report, Failure> {
    let access = &arguments.access;
    let Access { supervisor, cyclic, recording, tenure, .. } = access.begin(&access.interfaces.options())?;
    let scan = match tenure.scan() {
        Some(scan) => scan,
        None => supervisor.scan()?,
    };
    drop(cyclic);
    let data = show(arguments.pdos, descriptions, scan)?;
    let verdict = Verdict::Held(counted(data.subdevices.len(), "SubDevice", "SubDevices"));
    let verdict = verdict.and(tenure.end()).and(recording.finish());
    Ok(Report { verdict, data: Data::Scan(data) })
}
