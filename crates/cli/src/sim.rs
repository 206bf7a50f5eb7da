//! `ringcat sim`: a simulated segment behind real network interfaces, for this MainDevice and for those of others.

mod doors;
mod lateness;
mod mail_orders;
mod names;
mod orders;
mod plant;
mod wires;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use ringcat::eni::EniFile;
use ringcat::sim::cable::HostLink;
use ringcat::sim::network::Network;
use ringcat::sim::segment::Segment;
use ringcat_link::{CarrierWatch, monotonic};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::{ThreadArguments, two_interfaces};
use crate::others::check_sockets;
use crate::output::{counted, say};
use crate::verdict::Verdict;
use doors::Doors;
use orders::{Outcome, carry_out};
use plant::Plant;
use wires::{Pace, Wires};

/// The carriers of the interfaces are looked at so often.
const CARRIER_PERIOD: Duration = Duration::from_millis(1);

/// Options of `ringcat sim`.
#[derive(Args, Debug)]
#[command(after_help = format!("Orders on the standard input and on the control socket:\n\n{}", orders::HELP))]
pub struct SimArguments {
    /// Network interface that the segment's main host cable ends at.
    #[arg(long, value_name = "IF")]
    main: String,
    /// Network interface of the redundant host cable, for a segment that is a ring.
    #[arg(long, value_name = "IF")]
    redundant: Option<String>,
    /// Segment file (see docs/segments.md).
    #[arg(long, value_name = "FILE.toml", required_unless_present = "eni")]
    segment: Option<PathBuf>,
    /// Make the segment from this ENI, with the SubDevices that it describes; a ring with --redundant (see
    /// docs/eni.md).
    #[arg(long, value_name = "FILE", conflicts_with = "segment")]
    eni: Option<PathBuf>,
    /// Unix socket at which orders are taken; each answer ends with a line `ok` or `error: ...`.
    #[arg(long, value_name = "PATH")]
    control: Option<PathBuf>,
    /// How long frames take: as long as at 100 Mbit/s through real SubDevices, or as long as this machine needs to
    /// compute the answer. Timers of SubDevices then run a little ahead of the clock, never behind it.
    #[arg(long, value_enum, default_value = "real-time")]
    pace: Pace,
    /// Go on although another program answers or sends EtherCAT frames on the interface.
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    thread: ThreadArguments,
}

/// Runs the simulator until it is told to end.
pub fn run(arguments: &SimArguments) -> Result<Verdict, Failure> {
    two_interfaces(&arguments.main, arguments.redundant.as_deref())?;
    let end = EndRequest::watch(arguments.thread.priority)?;
    let mut plant = Plant::new(load(arguments)?);
    let mut wires =
        Wires::open(&arguments.main, arguments.redundant.as_deref(), arguments.thread.mode(), arguments.pace)?;
    let names: Vec<&str> = std::iter::once(arguments.main.as_str()).chain(arguments.redundant.as_deref()).collect();
    // Two simulators would both answer each frame.
    check_sockets(names.iter().copied(), arguments.force)?;
    let carriers = CarrierWatch::start(&names, CARRIER_PERIOD)?;
    if arguments.redundant.is_none() {
        // A ring without its second interface is one whose last cable is not plugged in.
        plant.set_carrier(HostLink::Redundant, false);
    }
    let doors = Doors::open(arguments.control.as_deref()).map_err(|error| {
        Failure::new(format!("the control socket cannot be made: {error}; is its directory there?"))
    })?;
    // The threads above stay ordinary ones.
    let _awake = arguments.thread.apply();
    let begin = monotonic::now_ns();
    let say = |now: u64, text: &str| say!("{:>12.3} ms  {text}", now.saturating_sub(begin) as f64 / 1e6);
    say(begin, &format!("{} SubDevices are on the wire", plant.network().devices().len()));
    loop {
        let now = wires.turn(plant.network_mut());
        for (place, link) in HostLink::ALL.into_iter().enumerate().take(names.len()) {
            let up = carriers.carrier(place).is_up();
            if plant.set_carrier(link, up) {
                say(now, &format!("{link} interface: carrier {}", if up { "is back" } else { "is gone" }));
            }
        }
        while let Some(order) = doors.next() {
            let (text, quit) = match carry_out(&order.line, &mut plant) {
                Outcome::Answer(text) if order.line.trim() == "status" => {
                    (format!("{}\n{text}", wires.summary()), false)
                }
                Outcome::Answer(text) => (text, false),
                Outcome::Quit => ("ok\n".to_owned(), true),
            };
            // Whoever asked may have gone.
            let _ = order.answer.send(text);
            if quit {
                say(now, &wires.summary());
                return Ok(ended(&plant, "quit"));
            }
        }
        if let Some(by) = end.by() {
            say(now, &wires.summary());
            return Ok(ended(&plant, &by));
        }
        if let Some(line) = wires.lateness.line(now) {
            say(now, &line);
        }
        wires.wait(plant.network(), now);
    }
}

/// A simulator ends when it is told to.
fn ended(plant: &Plant, by: &str) -> Verdict {
    let count = counted(plant.network().devices().len(), "SubDevice", "SubDevices");
    Verdict::Held(format!("{count} simulated until {by}"))
}

fn load(arguments: &SimArguments) -> Result<Network, Failure> {
    let (path, network) = match (&arguments.eni, &arguments.segment) {
        (Some(path), _) => {
            let file = EniFile::load(path).map_err(|error| Failure::new(error.to_string()))?;
            (path.display(), file.simulated(arguments.redundant.is_some())?)
        }
        (None, Some(path)) => (path.display(), Network::from_description(Segment::load(path)?)?),
        (None, None) => return Err(Failure::new("expected --segment FILE.toml or --eni FILE")),
    };
    if network.host_cable(HostLink::Main).is_none() {
        return Err(Failure::new(format!("{path}: no device is plugged into the main interface")));
    }
    match (network.host_cable(HostLink::Redundant), &arguments.redundant) {
        (None, Some(name)) => Err(Failure::new(format!(
            "{path} is no ring, so nothing can be plugged into {name}: give its [segment] table `ring = true`, or \
             leave --redundant out"
        ))),
        (Some(_), _) | (None, None) => Ok(network),
    }
}
