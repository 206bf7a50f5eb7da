//! The network interfaces of a command: their names, how frames are marked, checks before anything is sent.

use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use ringcat::packet::PacketLinks;
use ringcat::{Link, MIN_DATAGRAMS_PER_FRAME, MacCodec, Options};
use ringcat_link::interface;

use crate::failure::Failure;
use crate::numbers::number;
use crate::others::{check_frames, check_sockets};
use crate::output::warn;
use crate::thread::ThreadArguments;

/// Time for a link that was just switched on to get a carrier.
const LINK_UP_LIMIT: Duration = Duration::from_secs(3);
/// Pause between two checks of the carrier.
const LINK_PAUSE: Duration = Duration::from_millis(20);

/// The names of the interfaces.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Links")]
pub struct LinkNames {
    /// Network interface of the main link
    ///
    /// The first SubDevice of the segment is behind it.
    #[arg(long, value_name = "IF")]
    pub main: String,
    /// Network interface at the other end of a ring
    #[arg(long, value_name = "IF")]
    pub redundant: Option<String>,
}

impl LinkNames {
    /// Refuses one interface for both ends of a ring.
    pub fn check(&self) -> Result<(), Failure> {
        let main = &self.main;
        if self.redundant.as_ref() != Some(main) {
            return Ok(());
        }
        Err(Failure::new(format!(
            "--main and --redundant name one interface, {main}: a ring has its ends at two of them"
        )))
    }

    /// The interfaces, the main one first.
    pub fn all(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.main.as_str()).chain(self.redundant.as_deref())
    }

    /// Name of the interface of a link.
    pub fn of(&self, link: Link) -> &str {
        match link {
            Link::Main => &self.main,
            Link::Redundant => self.redundant.as_deref().unwrap_or(&self.main),
        }
    }

    /// What to do where a cable of the segment is plugged into an interface that the command line does not name.
    pub fn advice(&self, found: &str) -> String {
        match &self.redundant {
            None => format!("add --redundant {found} to run a ring, or unplug that cable"),
            Some(redundant) => format!("unplug it, or put {found} in the place of {redundant}"),
        }
    }
}

/// The options of the interfaces of a MainDevice.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Links")]
pub struct InterfaceArguments {
    #[command(flatten)]
    pub links: LinkNames,
    /// How frames are marked in their source address
    #[arg(long, value_name = "FORMAT", value_enum, default_value_t = SourceAddress::FlagsFirst)]
    pub source_address: SourceAddress,
    /// Put at most this number of datagrams into a frame
    ///
    /// Some gateways and simulators accept no more than 15.
    #[arg(
        long,
        value_name = "COUNT",
        value_parser = number(MIN_DATAGRAMS_PER_FRAME..=u16::MAX, 15)
    )]
    pub max_datagrams: Option<u16>,
    /// Go on although another MainDevice uses the interface
    ///
    /// Its SubDevices then leave OP.
    #[arg(long)]
    pub force: bool,
}

/// Marks in the source address (protocol 9.7.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SourceAddress {
    /// Flags and retries in the first byte, the frame's number in the second
    #[default]
    FlagsFirst,
    /// Flags in the first byte, retries in the second, the frame's number in the last, as in older MainDevices with two
    /// interfaces
    IdLast,
}

impl InterfaceArguments {
    /// Where the marks of a frame are in its source address.
    pub fn codec(&self) -> MacCodec {
        match self.source_address {
            SourceAddress::FlagsFirst => MacCodec::FlagsFirst,
            SourceAddress::IdLast => MacCodec::IdLast,
        }
    }

    /// Options of a MainDevice on these interfaces.
    pub fn options(&self) -> Options {
        let options = Options::default().with_source_address(self.codec());
        match self.max_datagrams {
            Some(datagrams) => options.with_max_datagrams_per_frame(datagrams),
            None => options,
        }
    }

    /// Opens the interfaces. Refuses where another MainDevice uses one of them, and fails where no cable is plugged in.
    pub fn open(&self, thread: ThreadArguments) -> Result<PacketLinks, Failure> {
        self.links.check()?;
        let links = PacketLinks::open(&self.links.main, self.links.redundant.as_deref(), thread.mode())?;
        self.check()?;
        Ok(links)
    }

    /// As [`InterfaceArguments::open`], for a thread of the cycles and one of the supervisor.
    pub fn open_halves(&self, thread: ThreadArguments) -> Result<(PacketLinks, PacketLinks), Failure> {
        self.links.check()?;
        let links = &self.links;
        let halves = PacketLinks::open_halves(&links.main, links.redundant.as_deref(), thread.mode())?;
        self.check()?;
        Ok(halves)
    }

    /// Looks for other MainDevices before anything is sent. The sockets are open already: of two commands that begin at
    /// one time at least one detects the other.
    fn check(&self) -> Result<(), Failure> {
        check_sockets(self.links.all(), self.force)?;
        self.await_carrier()?;
        if self.force { Ok(()) } else { check_frames(self.links.all()) }
    }

    /// Waits for the carrier of links that were just switched on. One end of a ring may be without.
    fn await_carrier(&self) -> Result<(), Failure> {
        let until = Instant::now() + LINK_UP_LIMIT;
        loop {
            // A driver that does not report a carrier is assumed to have one.
            let (up, down): (Vec<&str>, Vec<&str>) =
                self.links.all().partition(|name| interface::carrier(name).unwrap_or(true));
            if down.is_empty() {
                return Ok(());
            }
            if Instant::now() >= until {
                let text = down.iter().map(|name| describe_down(name)).collect::<Vec<_>>().join("\n");
                if up.is_empty() {
                    return Err(Failure::new(text));
                }
                warn(text);
                return Ok(());
            }
            std::thread::sleep(LINK_PAUSE);
        }
    }
}

/// Why an interface has no link.
pub fn describe_down(name: &str) -> String {
    let switched_off = interface::list().iter().any(|found| found.name == name && !found.up);
    if switched_off {
        format!("{name} is switched off: sudo ip link set {name} up")
    } else {
        format!("{name} has no link: is the cable plugged in, and does the SubDevice at its other end have power?")
    }
}

/// Monotonic time, the one of the links.
pub fn now() -> ringcat::Instant {
    ringcat::Instant(ringcat_link::monotonic::now_ns())
}
