//! `ringcat sim`: a simulated segment behind real network interfaces, for this MainDevice and for those of others.

mod gaps;
mod lateness;
mod mail_orders;
mod names;
mod order_sources;
mod orders;
mod plant;
mod residence;
mod wires;

use std::path::PathBuf;
use std::time::Duration;

use clap::Args;
use ringcat::eni::EniFile;
use ringcat::esi::load_segment;
use ringcat::network::LoadedNetwork;
use ringcat::sim::cable::HostLink;
use ringcat::sim::network::Network;
use ringcat_link::{CarrierWatch, monotonic};

use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::LinkNames;
use crate::json::data::Data;
use crate::json::sim::{LateWakeUps, Sim};
use crate::others::check_sockets;
use crate::output::{counted, say, write_event};
use crate::thread::ThreadArguments;
use crate::verdict::{Report, Verdict};
use order_sources::OrderSources;
use orders::{Outcome, carry_out};
use plant::Plant;
use wires::{Pace, Wires};

/// Period of checks of the carriers.
const CARRIER_PERIOD: Duration = Duration::from_millis(1);

/// Options of `ringcat sim`.
#[derive(Args, Debug)]
// A simulator that sleeps responds late: it spins unless an option says otherwise.
#[command(mut_arg("receive", |receive| receive.default_value("busy")))]
#[command(after_long_help = format!("Orders on the standard input and on the control socket:\n\n{}", orders::HELP))]
pub struct SimArguments {
    #[command(flatten)]
    links: LinkNames,
    /// Go on although another program sends or answers EtherCAT frames there
    #[arg(long, help_heading = "Links")]
    force: bool,
    /// Segment file (see docs/segments.md)
    #[arg(long, value_name = "FILE.toml", help_heading = "Segment")]
    #[arg(required_unless_present_any = ["eni", "network"])]
    segment: Option<PathBuf>,
    /// Make the segment from this ENI
    ///
    /// It has the SubDevices that the file describes, and is a ring with --redundant (see docs/eni.md).
    #[arg(long, value_name = "FILE", conflicts_with = "segment", help_heading = "Segment")]
    eni: Option<PathBuf>,
    /// Make the segment from this network file
    ///
    /// It has the SubDevices of the file in their order, and is a ring with --redundant (see docs/network-file.md).
    #[arg(long, value_name = "FILE.toml", conflicts_with_all = ["segment", "eni"], help_heading = "Segment")]
    network: Option<PathBuf>,
    /// How long frames take
    #[arg(long, value_enum, default_value = "real-time", help_heading = "Segment")]
    pace: Pace,
    /// Unix socket that takes orders
    ///
    /// Each answer ends with a line `ok` or `error: ...`. The standard input takes orders too; with --json its answers
    /// are objects.
    #[arg(long, value_name = "PATH", help_heading = "Output")]
    control: Option<PathBuf>,
    #[command(flatten)]
    thread: ThreadArguments,
}

/// Runs the simulator until an order or a signal ends it.
pub fn run(arguments: &SimArguments) -> Result<Report, Failure> {
    let links = &arguments.links;
    links.check()?;
    let end = EndRequest::watch(arguments.thread.priority)?;
    let mut plant = Plant::new(load(arguments)?);
    let mut wires = Wires::open(&links.main, links.redundant.as_deref(), arguments.thread.mode(), arguments.pace)?;
    let names: Vec<&str> = links.all().collect();
    // Two simulators would both answer each frame.
    check_sockets(names.iter().copied(), arguments.force)?;
    let carriers = CarrierWatch::start(&names, CARRIER_PERIOD)?;
    if links.redundant.is_none() {
        // A ring without its second interface is one whose last cable is not plugged in.
        plant.set_carrier(HostLink::Redundant, false);
    }
    let sources = OrderSources::open(arguments.control.as_deref()).map_err(|error| {
        Failure::new(format!("the control socket cannot be made: {error}; is its directory there?"))
    })?;
    // The threads above stay ordinary ones.
    let _awake = arguments.thread.apply();
    let begin = monotonic::now_ns();
    let say = |now: u64, text: &str| {
        let time = Duration::from_nanos(now.saturating_sub(begin));
        say!("{:>12.3} ms  {text}", time.as_secs_f64() * 1e3);
        write_event(time, None, text);
    };
    say(begin, &format!("{} SubDevices are on the wire", plant.network().devices().len()));
    loop {
        let now = wires.turn(plant.network_mut());
        plant.note_outputs();
        for (place, link) in HostLink::ALL.into_iter().enumerate().take(names.len()) {
            let up = carriers.carrier(place).is_up();
            if plant.set_carrier(link, up) {
                say(now, &format!("{link} interface: carrier {}", if up { "is back" } else { "is gone" }));
            }
        }
        while let Some(order) = sources.next() {
            let (text, quit) = match carry_out(&order.line, &mut plant) {
                Outcome::Answer(text) if order.line.trim() == "status" => {
                    (format!("{}\n{text}", wires.summary()), false)
                }
                Outcome::Answer(text) => (text, false),
                Outcome::Quit => ("ok\n".to_owned(), true),
            };
            // The client may be gone.
            let _ = order.answer.send(text);
            if quit {
                say(now, &wires.summary());
                return Ok(ended(&plant, &wires, "quit"));
            }
        }
        if let Some(by) = end.by() {
            say(now, &wires.summary());
            return Ok(ended(&plant, &wires, &by));
        }
        if let Some(line) = wires.lateness.line(now) {
            say(now, &line);
        }
        wires.wait(plant.network(), now);
    }
}

/// The report of a simulator that an order or a signal has ended.
fn ended(plant: &Plant, wires: &Wires, by: &str) -> Report {
    let subdevices = plant.network().devices().len();
    let count = counted(subdevices, "SubDevice", "SubDevices");
    let ns = |time: Duration| time.as_nanos() as u64;
    let lateness = &wires.lateness;
    let late_wake_ups =
        LateWakeUps { count: lateness.count, longest_ns: ns(lateness.longest), total_ns: ns(lateness.total) };
    let data = Data::Sim(Sim { subdevices, interfaces: wires.json(), late_wake_ups });
    Report { verdict: Verdict::Held(format!("{count} simulated until {by}")), data }
}

fn load(arguments: &SimArguments) -> Result<Network, Failure> {
    let (path, network) = match (&arguments.eni, &arguments.segment, &arguments.network) {
        (Some(path), ..) => {
            let file = EniFile::load(path).map_err(|error| Failure::new(error.to_string()))?;
            (path.display(), file.simulated(arguments.links.redundant.is_some())?)
        }
        (None, Some(path), _) => (path.display(), Network::from_description(load_segment(path)?)?),
        (None, None, Some(path)) => {
            let file = LoadedNetwork::load(path).map_err(|error| Failure::new(error.to_string()))?;
            let simulated = file.simulated(arguments.links.redundant.is_some());
            (path.display(), simulated.map_err(|error| Failure::new(format!("{}: {error}", path.display())))?)
        }
        (None, None, None) => return Err(Failure::new("expected --segment FILE.toml, --eni FILE or --network FILE")),
    };
    if network.host_cable(HostLink::Main).is_none() {
        return Err(Failure::new(format!("{path}: no device is plugged into the main interface")));
    }
    match (network.host_cable(HostLink::Redundant), &arguments.links.redundant) {
        (None, Some(name)) => Err(Failure::new(format!(
            "{path} is no ring, so nothing can be plugged into {name}: give its [segment] table `ring = true`, or \
             leave --redundant out"
        ))),
        (Some(_), _) | (None, None) => Ok(network),
    }
}
