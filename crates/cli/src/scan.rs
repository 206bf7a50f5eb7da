//! `ringcat scan`: the SubDevices on the wire. All of them are in INIT afterwards, unless a daemon has them.

mod pdos;

use clap::Args;
use ringcat::config::ObjectNames;
use ringcat::text::{Names, describe};
use ringcat::{Event, MainDevice, Scan, SubDeviceInfo};

use crate::access::{Access, AccessArguments};
use crate::bus::{Wanted, read_besides};
use crate::descriptions::{Descriptions, EsiArgument, complete, complete_by};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::scan;
use crate::output::{complain, counted, say, warn};
use crate::surroundings::Surroundings;
use crate::table;
use crate::verdict::{Report, Verdict};
use crate::warnings::SiiWarnings;

/// Text at the end of the long help.
const ABOUT_SCAN: &str = "\
All SubDevices go to INIT: a segment that is in operation leaves it. So a scan
refuses to begin where another MainDevice uses the interface or sends into the
segment; --force goes on all the same. It waits up to 5 s for the first
SubDevice to answer. Warnings about cables and EEPROMs go to the standard error
output, the table or JSON to the standard output.";

/// Options of `ringcat scan`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_SCAN)]
pub struct ScanArguments {
    #[command(flatten)]
    access: AccessArguments,
    /// List the PDOs of each SubDevice with their entries, as far as they are known
    ///
    /// From its EEPROM; a daemon also has those of a dictionary that it has read.
    #[arg(long, help_heading = "Output")]
    pdos: bool,
    #[command(flatten)]
    esi: EsiArgument,
}

/// Scans and prints what was found; what happens meanwhile goes to the standard error output.
pub fn run(arguments: &ScanArguments) -> Result<Report, Failure> {
    EndRequest::at_once()?;
    let mut descriptions = arguments.esi.open()?;
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
    let mut warnings = SiiWarnings::default();
    let result = main_device.scan_with(|event| match &event.event {
        Event::ScanProgress { .. } | Event::ScanFailed { .. } => {}
        _ if warnings.keep(event) => {}
        _ => match surroundings.note(&event.event) {
            None => complain(describe(event, &Names::default())),
            Some(words) => words.into_iter().for_each(warn),
        },
    });
    let foreign = main_device.acyclic_counters().foreign;
    let mut scan = result.map_err(|error| {
        warnings.print(&[]);
        surroundings.explain(error, foreign)
    })?;
    if foreign > 0 {
        complain(format_args!(
            "{foreign} frames of another MainDevice arrived during the scan: {}",
            surroundings.senders()
        ));
    }
    let wanted = Wanted { firmware: false, modules: true };
    let mut modules = |info: &SubDeviceInfo| match descriptions.as_mut().is_some_and(|it| it.has_modules(info)) {
        true => read_besides(&mut main_device, info, wanted).1.idents,
        false => Vec::new(),
    };
    let idents: Vec<Vec<u32>> = scan.subdevices.iter().map(&mut modules).collect();
    drop(main_device);
    let objects = complete(descriptions.as_mut(), &mut scan.subdevices, &idents)?;
    warnings.print(&objects);
    let data = show(arguments.pdos, &objects, &scan);
    let verdict = Verdict::Held(counted(data.subdevices.len(), "SubDevice", "SubDevices")).and(recording.finish());
    Ok(Report { verdict, data: Data::Scan(data) })
}

/// Prints what was found, with the names of its objects.
fn show(with_pdos: bool, objects: &[ObjectNames], scan: &Scan) -> scan::Scan {
    let mut json = table::json(scan);
    for line in table::lines(scan) {
        say!("{line}");
    }
    if with_pdos {
        for ((info, names), json) in scan.subdevices.iter().zip(objects).zip(&mut json.subdevices) {
            let pdos = pdos::json(info, names);
            pdos::lines(info, &pdos).iter().for_each(|line| say!("{line}"));
            json.pdos = Some(pdos);
        }
    }
    json
}

/// Knowledge of a daemon about the bus of a master. Nothing is scanned: a daemon does that after each change.
fn known(arguments: &ScanArguments, mut descriptions: Option<Descriptions>) -> Result<Report, Failure> {
    let access = &arguments.access;
    let Access { supervisor, cyclic, recording, daemon_bus, .. } = access.begin(&access.interfaces.options())?;
    let mut scan = match daemon_bus.scan() {
        Some(scan) => scan,
        None => supervisor.scan()?,
    };
    let objects = complete_by(&supervisor, descriptions.as_mut(), &mut scan.subdevices)?;
    drop(cyclic);
    let data = show(arguments.pdos, &objects, &scan);
    let verdict = Verdict::Held(counted(data.subdevices.len(), "SubDevice", "SubDevices"));
    let verdict = verdict.and(daemon_bus.end()).and(recording.finish());
    Ok(Report { verdict, data: Data::Scan(data) })
}
