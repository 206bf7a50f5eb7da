//! `ringcat run`: all SubDevices to OP as their SII or a file says, process data in a fixed cycle, and an orderly stop.
//!
//! Cycles have a thread of their own, and so has the acyclic half; the main thread only prints. Outputs stay zero or,
//! with a file, have the values of `--set`. The summary distinguishes why cycles are late: late wake-ups and left out
//! cycles are due to this machine, lost frames to the wire.

pub mod configured;
pub mod declared;
mod exchange;
mod jobs;
mod junction;
mod live;
mod options;
mod pace;
mod reasons;
mod services;
mod summary;
pub mod watched;

use std::ops::ControlFlow;
use std::time::Duration;

use ringcat::AlState;
use ringcat::config::ObjectNames;
use ringcat::event_log::EventLog;
use ringcat::text::{Names, address_of_sender, describe};
use ringcat::{
    ActivateError, Application, CyclicThread, Declaration, Ended, Error, Event, Instant, JobProbe, JunctionConnection,
    JunctionMode, LastOutputs, Links, Options, ProcessData, Scan, SubDeviceId, SupervisorThread, SyncSignals,
};

use crate::access::{Access, WireLinks};
use crate::descriptions::complete_by;
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{LinkNames, now};
use crate::json::data::Data;
use crate::json::run::SentOnce;
use crate::output::{counted, say, warn, write_event};
use crate::run_log::{RunLog, name_of};
use crate::surroundings::Surroundings;
use crate::times::in_words;
use crate::verdict::{Report, Verdict};
use configured::ConfiguredNetwork;
use exchange::Run;
use jobs::Jobs;
use live::Live;
pub use options::RunArguments;
use pace::Seen;
use reasons::Exchanged;
use summary::{End, clock_account, final_account, json, summary};
use watched::Watched;

/// SubDevices have this long to get to INIT in the end.
const STOP_LIMIT: Duration = Duration::from_secs(5);

/// The application of this command, with a possible recording of all frames.
type Recorded = Application<WireLinks, SupervisorThread>;
/// The cycles, the variables of the ENI that are printed, the SubDevices of [`sent_once`], times of jobs.
type Started = (CyclicThread<WireLinks>, Watched, Vec<SentOnce>, Jobs);

/// Runs cycles. It has held where all SubDevices reached OP and stayed there, and every cycle afterwards was complete.
pub fn run(arguments: &RunArguments) -> Result<Report, Failure> {
    arguments.access.interfaces.links.check()?;
    let mut descriptions = arguments.esi.open()?;
    let end = EndRequest::watch(arguments.access.thread.priority)?;
    let (access, network) = begin(arguments)?;
    let Access { interfaces, supervisor, mut cyclic, mut surroundings, recording, daemon_bus, awake: _awake } = access;
    let begin = now();
    let services = arguments.services.start(&supervisor, &interfaces)?;
    let mut scan = match daemon_bus.scan() {
        Some(scan) => scan,
        None => scan(&supervisor, &mut cyclic, &mut surroundings, begin)?,
    };
    network.iter().try_for_each(|network| supervisor.read_data_words(network.declared(), &mut scan))?;
    let described = complete_by(&supervisor, descriptions.as_mut(), &mut scan.subdevices)?;
    let (names, objects) = names(network.as_ref(), &scan, described);
    let declaration = arguments.declared.declare(network.as_ref(), &scan.subdevices)?;
    let declaration = arguments.resend.adapt(arguments.under_way.adapt(declaration));
    let undeclared = network.as_ref().map_or(0, |network| {
        network.report_cables(&scan);
        network.undeclared(&scan.subdevices)
    });
    let period = declaration.domains.iter().map(|domain| domain.period).min().unwrap_or(arguments.declared.cycle);
    let (domains, clocks) = (declaration.domains.len(), declaration.clocks.is_some());
    let signals: Vec<Option<SyncSignals>> = declaration.subdevices.iter().map(|config| config.sync).collect();
    say!("{} SubDevices; cycle {} us", scan.subdevices.len(), period.as_micros());
    let application = activate(arguments, network.as_ref(), &objects, supervisor, declaration, cyclic)?;
    let (cycles, watched, sent_once, jobs) = start_cycles(arguments, network.as_ref(), application, &names, &end)?;
    let ring = interfaces.links.redundant.is_some();
    let events = EventLog::new(begin, names).with_every_event(arguments.all_events);
    let log = RunLog::new(begin, events, surroundings).with_objects(objects);
    let mut run = Run { cycles, log, live: Live::new(ring, clocks), clocks, domains, services, watched, recording };
    let reached = run.reach_op(arguments.within, &end);
    let before = Seen::of(run.cycles.cyclic_status());
    if reached.is_ok() {
        let until = arguments.lasts.map_or(Instant::NEVER, |lasts| now() + lasts);
        run.exchange(until, &end);
    }
    end.no_limit();
    let status = if clocks { run.cycles.supervisor().clocks()? } else { Vec::new() };
    let exchanged = Exchanged::of(&run, &before, ring, &status);
    let mut at_end = End { cycle: period, reached_op: reached.is_ok(), signals, sent_once, exchanged };
    let mut reasons = match reached {
        Ok(()) => {
            let reasons = at_end.exchanged.reasons(run.log.events().names());
            reasons.into_iter().chain(end.cut_short(arguments.lasts)).collect()
        }
        // The reason is what has ended the wait.
        Err(reason) => vec![reason],
    };
    if undeclared > 0 {
        reasons.push(format!("the file lacks {} of the bus", counted(undeclared, "SubDevice", "SubDevices")));
    }
    let data = finish(run, &mut at_end, &jobs, &interfaces.links, &mut reasons);
    reasons.extend(daemon_bus.end());
    let lasted = arguments.lasts.map_or_else(String::new, |lasts| format!(" for {}", in_words(lasts)));
    let subdevices = counted(scan.subdevices.len(), "SubDevice", "SubDevices");
    let verdict = Verdict::of(reasons, format!("{subdevices} in OP{lasted}, every cycle complete"));
    Ok(Report { verdict, data })
}

/// Opens the segment. The network of a file depends on whether it is a ring; with a daemon the bus shows that.
fn begin(arguments: &RunArguments) -> Result<(Access, Option<ConfiguredNetwork>), Failure> {
    let ring = match arguments.access.master {
        Some(_) => None,
        None => Some(arguments.access.interfaces.links.redundant.is_some()),
    };
    // A wrong file shows before anything is opened.
    let network = arguments.declared.load(ring)?;
    let access = arguments.access.begin(&options(arguments, network.as_ref()))?;
    if let Some(network) = &network {
        network.check_links(access.interfaces.links.redundant.is_some())?;
    }
    Ok((access, network))
}

fn options(arguments: &RunArguments, network: Option<&ConfiguredNetwork>) -> Options {
    let options = arguments.access.interfaces.options();
    let junctions = junctions(arguments, network);
    options
        .with_junctions(junctions.map_or(arguments.junction.mode, |(mode, _)| mode))
        .with_enhanced_line_crossed(arguments.enhanced_line_crossed)
        .with_pdos(declared::pdos(network))
}

/// How rings behind junctions are handled where the file says it and the command line does not.
fn junctions(
    arguments: &RunArguments,
    network: Option<&ConfiguredNetwork>,
) -> Option<(JunctionMode, Vec<JunctionConnection>)> {
    network.filter(|_| arguments.junction.mode == JunctionMode::Disabled).and_then(ConfiguredNetwork::junctions)
}

/// Scans, and meanwhile reports warnings about the cabling and other MainDevices.
fn scan(
    supervisor: &SupervisorThread,
    cyclic: &mut impl Links,
    surroundings: &mut Surroundings,
    begin: Instant,
) -> Result<Scan, Failure> {
    let mut others = 0;
    let result = supervisor.scan_while(|| {
        report_events(supervisor, surroundings, begin);
        others += report_others(cyclic, surroundings);
    });
    result.map_err(|error| surroundings.explain(error, others + supervisor.counters().foreign))
}

/// Names of the declared SubDevices, and of their objects.
fn names(network: Option<&ConfiguredNetwork>, scan: &Scan, described: Vec<ObjectNames>) -> (Names, Vec<ObjectNames>) {
    match network {
        Some(network) => (network.names(), network.objects(&scan.subdevices, described)),
        None => (Names(scan.subdevices.iter().map(|info| info.name.clone()).collect()), described),
    }
}

/// Activates what is declared, with the connections of junctions and what makes cycles begin.
fn activate(
    arguments: &RunArguments,
    network: Option<&ConfiguredNetwork>,
    objects: &[ObjectNames],
    supervisor: SupervisorThread,
    declaration: Declaration,
    cyclic: WireLinks,
) -> Result<Recorded, Failure> {
    let trigger = arguments.declared.trigger(&declaration);
    supervisor.load(declaration).map_err(|error| explain(error, network, objects))?;
    let at_station = |station| network.and_then(|network| network.at_station(station));
    for connection in &arguments.junction.connections {
        let connection = connection.resolve(at_station).map_err(Failure::new)?;
        supervisor.add_junction_connection(connection)?;
    }
    for connection in junctions(arguments, network).into_iter().flat_map(|(_, connections)| connections) {
        supervisor.add_junction_connection(connection)?;
    }
    let refused = |error: Box<ringcat::Refused<_>>| explain(error.into(), network, objects);
    let mut application = supervisor.apply(cyclic).map_err(refused)?;
    if let Some(trigger) = trigger {
        application.set_trigger(trigger);
    }
    Ok(application)
}

/// Why nothing was activated, with the names of the objects that the reason mentions.
fn explain(error: Error, network: Option<&ConfiguredNetwork>, objects: &[ObjectNames]) -> Failure {
    let of = match &error {
        Error::Activate(ActivateError::Setup { subdevice, .. }) => objects.get(subdevice.0),
        _ => None,
    };
    let failure = match network {
        Some(network) => network.explain(error),
        None => Failure::from(error),
    };
    match of {
        Some(names) => Failure::new(names.annotate(&failure.to_string())),
        None => failure,
    }
}

/// The SubDevices of which not all process data is sent again with a lost frame, if lost frames are sent again at all;
/// prints them.
fn sent_once(application: &Recorded, names: &Names) -> Vec<SentOnce> {
    if !application.exchange().sends_again() {
        return Vec::new();
    }
    let of = |(subdevice, reason): (SubDeviceId, ringcat::SentOnce)| {
        let name = names.0.get(subdevice.0).cloned().unwrap_or_default();
        say!("lost frames: SubDevice {subdevice} \"{name}\": {reason}");
        SentOnce { subdevice: subdevice.0, name, reason: reason.to_string() }
    };
    application.directory().sent_once().map(of).collect()
}

/// Gives the cycles a thread, with the work of a file; also the variables of the file that are printed, and the
/// SubDevices of [`sent_once`].
fn start_cycles(
    arguments: &RunArguments,
    network: Option<&ConfiguredNetwork>,
    mut application: Recorded,
    names: &Names,
    end: &EndRequest,
) -> Result<Started, Failure> {
    let sent_once = sent_once(&application, names);
    let (mut work, watched) = match network {
        Some(network) => {
            let (work, watched) = network.work(application.directory())?;
            application.set_copies(work.copies()).map_err(|error| Failure::new(error.to_string()))?;
            (Some(work), watched)
        }
        None => (None, Watched::default()),
    };
    let (thread, asked) = (arguments.access.thread, end.clone());
    let prepare = move || thread.prepare_cycles();
    let work = move |data: &mut ProcessData<'_>| {
        if let Some(work) = &mut work {
            work.cycle(data);
        }
        // Here too: this thread runs where others get no processor time.
        if asked.is_asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let probe = arguments.jobs.then(JobProbe::default);
    let jobs = Jobs(probe.as_ref().map(|probe| probe.times().clone()));
    let cycles = match probe {
        Some(probe) => application.start_cycles_probed(probe, prepare, work)?,
        None => application.start_cycles(prepare, work)?,
    };
    Ok((cycles, watched, sent_once, jobs))
}

/// Ends the cycles, prints the summary, and stops all SubDevices. What of that fails is a reason.
fn finish(run: Run, end: &mut End, jobs: &Jobs, links: &LinkNames, reasons: &mut Vec<String>) -> Data {
    let application = run.cycles.end().unwrap_or_else(|panicked| {
        reasons.push(panicked.to_string());
        panicked.application
    });
    let names = run.log.events().names();
    summary(&application, run.log.surroundings());
    jobs.account();
    if run.clocks {
        clock_account(end.exchanged.clocks(), application.cyclic_status(), names);
    }
    run.watched.account();
    run.services.account();
    let mut json = json(&application, end, names, run.clocks);
    json.ethernet = run.services.json_ethernet();
    json.gateway = run.services.json_gateway();
    json.variables = run.watched.json();
    json.jobs = jobs.json();
    match application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT) {
        Ok(Ended { supervisor, links: mut tee, .. }) => {
            json.interfaces = final_account(&mut tee, &supervisor, links);
            json.acyclic = supervisor.counters().into();
            json.stopped = true;
            say!("  stopped: outputs zero, all SubDevices in INIT");
        }
        Err(error) => reasons.push(error.to_string()),
    }
    reasons.extend(run.recording.finish());
    Data::Run(Box::new(json))
}

/// Reports other MainDevices and warnings about the cabling among the events of a scan.
fn report_events(supervisor: &SupervisorThread, surroundings: &mut Surroundings, begin: Instant) {
    while let Some(event) = supervisor.pop_event() {
        if let Event::JunctionLearned { .. }
        | Event::LineCrossed { .. }
        | Event::InterfacesSwapped
        | Event::UnconnectedPort0 { .. }
        | Event::CannotDisconnect { .. } = event.event
        {
            let text = describe(&event, &Names::default());
            say!("{text}");
            write_event(event.at.since(begin), Some(name_of(&event.event)), &text);
        }
        surroundings.note(&event.event).iter().flatten().for_each(warn);
    }
}

/// Frames that arrive for the cyclic half before it sends any are those of other MainDevices. Returns their number.
fn report_others(links: &mut impl Links, surroundings: &mut Surroundings) -> u64 {
    let mut count = 0;
    while links.receive(&mut |link, frame| {
        count += 1;
        if let Some(source) = address_of_sender(frame) {
            surroundings.report_sender(link, source);
        }
    }) {}
    count
}

#[cfg(test)]
mod tests {
    use ringcat::config::network::model::{Pdo, SubDevice, SyncManager};
    use ringcat::{SetupError, SubDeviceConfig, SubDeviceInfo, plan};

    use super::*;

    // covers: esi-use
    #[test]
    fn a_refused_activation_names_the_objects_of_its_subdevice() {
        let mut info = SubDeviceInfo::default();
        info.identity.vendor_id = 2;
        let error = plan(&SubDeviceConfig::default().sdo(0x8000, 1, [1]), &info).unwrap_err();
        let mut names = ObjectNames::default();
        let pdo = Pdo { index: 0x8000, name: "Settings".to_owned(), ..Pdo::default() };
        let sm = SyncManager { pdo: vec![pdo], ..SyncManager::default() };
        names.add_declared(&SubDevice { sync_manager: vec![sm], ..SubDevice::default() });
        let refused = ActivateError::Setup { subdevice: SubDeviceId(1), error: SetupError::Plan(error) };
        let text = explain(Error::Activate(refused), None, &[ObjectNames::default(), names]).to_string();
        assert!(text.contains("object 0x8000:01 \"Settings\" is to be written"), "{text}");
    }
}
