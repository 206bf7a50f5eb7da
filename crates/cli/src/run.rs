//! `ringcat run`: everything on the wire to OP as its SII says, or as an ENI says, process data in a fixed cycle, and
//! an orderly stop.
//!
//! Cycles have a thread of their own, and so has everything else; this one only tells. Outputs stay zero, or what was
//! asked for with an ENI: this command knows of no application. What keeps the cycle from its time is told apart:
//! wake-ups that came late and cycles that were left out are this machine's, lost frames are the wire's.

mod beside;
mod eni;
mod exchange;
mod junction;
mod live;
mod reasons;
mod summary;

use std::ops::ControlFlow;
use std::time::Duration;

use clap::Args;
use ringcat::AlState;
use ringcat::event_log::EventLog;
use ringcat::packet::PacketLinks;
use ringcat::tee::Tee;
use ringcat::text::{Names, address_of_sender, describe};
use ringcat::{
    Application, ClockStatus, CyclicThread, Declaration, Event, Instant, LastOutputs, Links, MAX_UNDER_WAY, Options,
    ReadPdos, Scan, SubDeviceInfo, SupervisorThread, automatic,
};

use crate::clock_options::ClockOptions;
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, ThreadArguments, now};
use crate::output::{counted, say};
use crate::recording::RecordingArguments;
use crate::run_log::RunLog;
use crate::surroundings::Surroundings;
use crate::times::{cycle, in_words, time};
use crate::verdict::Verdict;
use beside::BesideArguments;
use eni::{EniArguments, EniNetwork, Watched};
use exchange::Run;
use junction::{Junctions, junctions};
use live::Live;
use reasons::{Exchanged, Seen};
use summary::{clock_account, final_account, summary};

/// SubDevices have this long to get to INIT in the end.
const STOP_LIMIT: Duration = Duration::from_secs(5);

/// How to read what it prints.
const SUMMARY_HELP: &str = "\
All outputs stay zero. Watchdogs, process data and mailboxes are set up as each SubDevice's EEPROM (SII) says; with
--eni as the file says, and outputs as --set does.

Ctrl-C ends it in order: outputs zero, all SubDevices to INIT; so do SIGTERM and SIGHUP. Exit status 0: all reached OP
and stayed there, every cycle was complete, with two interfaces the ring is closed, and all clocks are locked where
there are any. Otherwise 1, and the last line says what did not hold.

Distributed clocks are brought together with --clocks, or with any of --phase, --bus-shift, --reference and --sync;
--for then counts from their lock. SubDevices with SYNC signals wait for it before OP. `ringcat clocks` tells more about
them.

The summary tells three things apart:
  this machine   wake-ups that came late and cycles that were left out for that. Nothing on the cable is wrong: try
                 --priority 80, a --cpu of its own, a real-time kernel
  the wire       frames that did not come back in time: missing, too late or damaged, each counted once. Cables, plugs,
                 power, other MainDevices; too late they are also where the computer of a simulated segment stalls
  round trips    from sending a frame to the arrival of each of its copies at the interface, by the kernel's receive
                 time: what is left of the cycle is yours";

/// Options of `ringcat run`.
#[derive(Args, Debug)]
#[command(after_help = SUMMARY_HELP)]
pub struct RunArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
    #[command(flatten)]
    recording: RecordingArguments,
    #[command(flatten)]
    beside: BesideArguments,
    /// Cycle time, with its unit: 250us, 1ms; 10us to 1s.
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = cycle)]
    cycle: Duration,
    #[command(flatten)]
    eni: EniArguments,
    /// Cycles that may be under way at once, for a cycle time that is shorter than the way of a frame through segment
    /// and host. Inputs are then as many cycles old as their way takes.
    #[arg(
        long,
        value_name = "CYCLES",
        default_value = "1",
        value_parser = clap::value_parser!(u8).range(1..=i64::from(MAX_UNDER_WAY))
    )]
    under_way: u8,
    /// Tell everything one by one, however often it comes. Otherwise what a bad time makes many of is counted.
    #[arg(long)]
    tell_all: bool,
    /// How long to exchange process data once all are in OP, such as 10s or 5min; until Ctrl-C by default.
    #[arg(long = "for", value_name = "TIME", value_parser = time)]
    lasts: Option<Duration>,
    /// How long all SubDevices may take to OP, and all clocks to their lock; then everything is stopped.
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = time)]
    within: Duration,
    /// Bring the distributed clocks together.
    #[arg(long)]
    clocks: bool,
    #[command(flatten)]
    clock_options: ClockOptions,
    #[arg(long, value_name = "MODE", default_value = "disabled", value_parser = junctions, help = junction::HELP)]
    junction: Junctions,
    /// Take the redundant interface down for a moment, when cables have changed, to find out where IN and OUT of a
    /// SubDevice are swapped. Needs the permission to configure interfaces (CAP_NET_ADMIN).
    #[arg(long)]
    enhanced_line_crossed: bool,
}

/// The application of this command: everything it exchanges may be recorded.
type Recorded = Application<Tee<PacketLinks>, SupervisorThread>;

/// Runs cycles. It has held where all SubDevices reached OP and stayed there, and every cycle afterwards was complete.
pub fn run(arguments: &RunArguments) -> Result<Verdict, Failure> {
    arguments.interfaces.check_names()?;
    let network = arguments.eni.load()?;
    let thread = arguments.thread;
    let end = EndRequest::watch(thread.priority)?;
    let (cyclic, acyclic) = arguments.interfaces.open_halves(thread)?;
    let mut surroundings = Surroundings::watch(&arguments.interfaces, &cyclic);
    let recording = arguments.recording.start(&arguments.interfaces)?;
    let (mut cyclic, acyclic) = (recording.tee(cyclic), recording.tee(acyclic));
    let _awake = thread.prepare_process();
    let begin = now();
    let options = options(arguments, network.as_ref());
    let supervisor = SupervisorThread::start(acyclic, &options, move || thread.prepare_supervisor())?;
    let beside = arguments.beside.start(&supervisor, &arguments.interfaces)?;
    let scan = scan(&supervisor, &mut cyclic, &mut surroundings)?;
    let names = match &network {
        Some(network) => network.names(),
        None => Names(scan.subdevices.iter().map(|info| info.name.clone()).collect()),
    };
    let declaration = declare(arguments, network.as_ref(), &scan.subdevices)?;
    let undeclared = network.as_ref().map_or(0, |network| {
        network.tell_cables(&scan);
        network.undeclared(&scan.subdevices)
    });
    let period = declaration.domains.iter().map(|domain| domain.period).min().unwrap_or(arguments.cycle);
    let (domains, clocks) = (declaration.domains.len(), declaration.clocks.is_some());
    say!("{} SubDevices; cycle {} us", scan.subdevices.len(), period.as_micros());
    let application = activate(arguments, network.as_ref(), supervisor, declaration, cyclic)?;
    let (cycles, watched) = start_cycles(arguments, network.as_ref(), application, &end)?;
    let ring = arguments.interfaces.redundant.is_some();
    let log = RunLog::new(EventLog::new(begin, names).one_by_one(arguments.tell_all), surroundings);
    let mut run = Run { cycles, log, live: Live::new(ring, clocks), clocks, domains, beside, watched, recording };
    let reached = run.reach_op(arguments.within, &end);
    let before = Seen::of(run.cycles.news());
    if reached.is_ok() {
        let until = arguments.lasts.map_or(Instant::NEVER, |lasts| now() + lasts);
        run.exchange(until, &end);
    }
    end.no_limit();
    let status = if clocks { run.cycles.supervisor().with(|engine| engine.clocks())? } else { Vec::new() };
    let mut reasons = match reached {
        Ok(()) => {
            let exchanged = Exchanged::look(&run, &before, ring, &status).reasons(run.log.events().names());
            exchanged.into_iter().chain(end.cut_short(arguments.lasts)).collect()
        }
        // It says what has ended the wait.
        Err(reason) => vec![reason],
    };
    if undeclared > 0 {
        reasons.push(format!("the file lacks {} of the bus", counted(undeclared, "SubDevice", "SubDevices")));
    }
    finish(run, &status, &mut reasons);
    let lasted = arguments.lasts.map_or_else(String::new, |lasts| format!(" for {}", in_words(lasts)));
    let subdevices = counted(scan.subdevices.len(), "SubDevice", "SubDevices");
    Ok(Verdict::of(reasons, format!("{subdevices} in OP{lasted}, every cycle complete")))
}

fn options(arguments: &RunArguments, network: Option<&EniNetwork>) -> Options {
    // A file that declares all SyncManagers says what PDOs there are.
    let pdos = if network.is_some_and(EniNetwork::is_complete) { ReadPdos::Never } else { ReadPdos::default() };
    let options = arguments.interfaces.options();
    options
        .with_junctions(arguments.junction.mode)
        .with_enhanced_line_crossed(arguments.enhanced_line_crossed)
        .with_pdos(pdos)
}

/// Scans, and tells meanwhile of the cabling and of other MainDevices.
fn scan(
    supervisor: &SupervisorThread,
    cyclic: &mut impl Links,
    surroundings: &mut Surroundings,
) -> Result<Scan, Failure> {
    let mut others = 0;
    let result = supervisor.scan_while(|| {
        tell_events(supervisor, surroundings);
        others += tell_of_others(cyclic, surroundings);
    });
    result.map_err(|error| surroundings.explain(error, others + supervisor.counters().foreign))
}

/// Activates what is declared, with the connections of junctions and what makes cycles begin.
fn activate(
    arguments: &RunArguments,
    network: Option<&EniNetwork>,
    supervisor: SupervisorThread,
    declaration: Declaration,
    cyclic: Tee<PacketLinks>,
) -> Result<Recorded, Failure> {
    let trigger = declaration.clocks.as_ref().map(|clocks| arguments.clock_options.trigger(clocks.bus_shift));
    supervisor.load(declaration)?;
    let at_station = |station| network.and_then(|network| network.at_station(station));
    for connection in &arguments.junction.connections {
        let connection = connection.resolve(at_station).map_err(Failure::new)?;
        supervisor.add_junction_connection(connection)?;
    }
    let mut application = supervisor.apply(cyclic).map_err(|error| match network {
        Some(network) => network.explain(error.into()),
        None => Failure::from(ringcat::Error::from(error)),
    })?;
    if let Some(trigger) = trigger {
        application.set_trigger(trigger);
    }
    Ok(application)
}

/// Gives the cycles a thread, with the work that a file asks for; also the variables of the file that are told.
fn start_cycles(
    arguments: &RunArguments,
    network: Option<&EniNetwork>,
    mut application: Recorded,
    end: &EndRequest,
) -> Result<(CyclicThread<Tee<PacketLinks>>, Watched), Failure> {
    let (mut work, watched) = match network {
        Some(network) => {
            let (work, watched) = network.work(application.directory())?;
            application.set_copies(work.copies()).map_err(|error| Failure::new(error.to_string()))?;
            (Some(work), watched)
        }
        None => (None, Watched::default()),
    };
    let (thread, asked) = (arguments.thread, end.clone());
    let cycles = application.start_cycles(
        move || thread.prepare_cycles(),
        move |data| {
            if let Some(work) = &mut work {
                work.cycle(data);
            }
            // Here too: this thread runs whatever starves.
            if asked.is_asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        },
    )?;
    Ok((cycles, watched))
}

/// Ends the cycles, tells how it went, and stops all SubDevices. What of that does not work is a reason.
fn finish(run: Run, clocks: &[ClockStatus], reasons: &mut Vec<String>) {
    let application = run.cycles.end().unwrap_or_else(|panicked| {
        reasons.push(panicked.to_string());
        panicked.application
    });
    summary(&application, run.log.surroundings());
    if run.clocks {
        clock_account(clocks, application.news(), run.log.events().names());
    }
    run.watched.account();
    run.beside.account();
    match application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT) {
        Ok((supervisor, mut links)) => {
            final_account(&mut links, &supervisor);
            say!("  stopped: outputs zero, all SubDevices in INIT");
        }
        Err(error) => reasons.push(error.to_string()),
    }
    reasons.extend(run.recording.finish());
}

/// What is to be activated: the file's network, or what was found as its SIIs say.
fn declare(
    arguments: &RunArguments,
    network: Option<&EniNetwork>,
    found: &[SubDeviceInfo],
) -> Result<Declaration, Failure> {
    let options = &arguments.clock_options;
    let asked = arguments.clocks || options.are_given();
    let declaration = match network {
        Some(network) => {
            let mut declaration = network.declaration(found)?;
            options.adapt(&mut declaration, asked)?;
            declaration
        }
        None => {
            let mut declaration = automatic(found, arguments.cycle);
            if asked {
                options.declare(&mut declaration, found)?;
            }
            declaration
        }
    };
    Ok(declaration.with_under_way(arguments.under_way))
}

/// Tells of other MainDevices and of the cabling among the events of a scan.
fn tell_events(supervisor: &SupervisorThread, surroundings: &mut Surroundings) {
    while let Some(event) = supervisor.pop_event() {
        if let Event::JunctionLearned { .. }
        | Event::LineCrossed { .. }
        | Event::InterfacesSwapped
        | Event::UnconnectedPort0 { .. }
        | Event::CannotDisconnect { .. } = event.event
        {
            say!("{}", describe(&event, &Names::default()));
        }
        surroundings.note(&event.event).iter().flatten().for_each(|words| eprintln!("ringcat: {words}"));
    }
}

/// Frames that arrive for the cyclic half before it sends any are those of other MainDevices. Returns how many.
fn tell_of_others(links: &mut impl Links, surroundings: &mut Surroundings) -> u64 {
    let mut count = 0;
    while links.receive(&mut |link, frame| {
        count += 1;
        if let Some(source) = address_of_sender(frame) {
            surroundings.tell_sender(link, source);
        }
    }) {}
    count
}
