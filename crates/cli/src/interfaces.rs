//! What the commands on network interfaces share: how to wait, what is wrong with an interface, who else uses it.

use std::fmt;
use std::sync::Once;
use std::thread::available_parallelism;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use ringcat::packet::PacketLinks;
use ringcat::{Link, MIN_DATAGRAMS_PER_FRAME, MacCodec, Options};
use ringcat_link::ReceiveMode;
use ringcat_link::interface;
use ringcat_link::realtime::{self, CpuLatency};

use crate::failure::Failure;
use crate::others::{check_frames, check_sockets};

/// A hybrid wait spins for so long: most segments answer within.
const SPIN: Duration = Duration::from_micros(200);
/// A link that was just switched on gets this long to find its partner.
const LINK_UP_LIMIT: Duration = Duration::from_secs(3);
/// Pause between two looks at the carrier.
const LINK_PAUSE: Duration = Duration::from_millis(20);

/// How to wait for frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Receive {
    /// Spinning: fastest, takes a whole processor.
    Busy,
    /// Asleep: saves the processor, costs tens of microseconds per frame.
    Block,
    /// Spinning for 200 us, then asleep.
    Hybrid,
}

/// The options of the thread that sends and receives.
#[derive(Args, Clone, Copy, Debug)]
pub struct ThreadArguments {
    /// How to wait for frames.
    #[arg(long, value_enum, default_value = "busy")]
    receive: Receive,
    /// Real-time priority (SCHED_FIFO) of the thread that sends and receives; memory is locked and processors kept
    /// awake with it. A spinning thread with a priority leaves its processor to no other one. 99 is left to the kernel
    /// and to the thread that takes signals.
    #[arg(long, value_name = "1-98", value_parser = clap::value_parser!(i32).range(1..=98))]
    pub priority: Option<i32>,
    /// Processor to keep that thread on.
    #[arg(long, value_name = "NUMBER")]
    cpu: Option<usize>,
}

impl ThreadArguments {
    /// As the links take it.
    pub fn mode(self) -> ReceiveMode {
        match self.receive() {
            Receive::Busy => ReceiveMode::BusyPoll,
            Receive::Block => ReceiveMode::Blocking,
            Receive::Hybrid => ReceiveMode::Hybrid { spin: SPIN },
        }
    }

    /// The same in words.
    pub fn mode_in_words(self) -> &'static str {
        match self.receive() {
            Receive::Busy => "waiting busy",
            Receive::Block => "waiting blocked",
            Receive::Hybrid => "waiting hybrid",
        }
    }

    /// How frames are really waited for. A thread that spins needs a processor of its own: on the only one it would
    /// keep everything else in this program from running, and with a priority for ever.
    fn receive(self) -> Receive {
        static TOLD: Once = Once::new();
        let processors = available_parallelism().map_or(1, usize::from);
        if self.receive == Receive::Block || processors > 1 {
            return self.receive;
        }
        TOLD.call_once(|| {
            tell("this process may use one processor only, so no thread spins on it: as with --receive block");
        });
        Receive::Block
    }

    /// Gives the calling thread and the process what was asked for. The result keeps processors awake while it lives.
    pub fn apply(self) -> Option<CpuLatency> {
        self.prepare_cycles();
        self.prepare_process()
    }

    /// Gives the calling thread, which runs the cycles, what was asked for, as far as that is permitted; what is not is
    /// told.
    pub fn prepare_cycles(self) {
        realtime::precise_timers();
        if let Some(cpu) = self.cpu {
            let _ = realtime::affinity(cpu).map_err(tell);
        }
        if let Some(priority) = self.priority
            && realtime::fifo(priority).map_err(tell).is_ok()
            && self.receive() == Receive::Busy
            && let Some(warning) = realtime::throttling()
        {
            tell(warning);
        }
    }

    /// Has the calling thread, which does everything but the cycles, run just below those.
    pub fn prepare_supervisor(self) {
        realtime::precise_timers();
        if let Some(priority) = self.priority {
            // Where it is not permitted, the thread of the cycles tells so.
            let _ = realtime::fifo((priority - 1).max(1));
        }
    }

    /// Locks memory and keeps processors awake, where a priority is asked for. The result does that while it lives.
    pub fn prepare_process(self) -> Option<CpuLatency> {
        self.priority?;
        let _ = realtime::lock_memory().map_err(tell);
        CpuLatency::request(0).map_err(tell).ok()
    }
}

fn tell(warning: impl fmt::Display) {
    eprintln!("ringcat: {warning}");
}

/// The options that name the interfaces.
#[derive(Args, Clone, Debug)]
pub struct InterfaceArguments {
    /// Network interface that the first SubDevice is plugged into.
    #[arg(long, value_name = "IF")]
    pub main: String,
    /// Network interface at the other end of a ring.
    #[arg(long, value_name = "IF")]
    pub redundant: Option<String>,
    /// How frames are marked in their source address: flags-first, or id-last as older MainDevices with two interfaces
    /// do.
    #[arg(long, value_name = "HOW", value_enum, default_value_t = SourceAddress::FlagsFirst)]
    pub source_address: SourceAddress,
    /// Put at most so many datagrams into a frame: some gateways and simulators take no more (often 15).
    #[arg(
        long,
        value_name = "COUNT",
        value_parser = clap::value_parser!(u16).range(i64::from(MIN_DATAGRAMS_PER_FRAME)..)
    )]
    pub max_datagrams: Option<u16>,
    /// Go on although another MainDevice uses the interface. SubDevices then leave its OP.
    #[arg(long)]
    pub force: bool,
}

/// Marks in the source address (protocol 9.7.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum SourceAddress {
    /// Flags and retries in the first byte, the frame's number in the second.
    #[default]
    FlagsFirst,
    /// Flags in the first byte, retries in the second, the frame's number in the last.
    IdLast,
}

impl InterfaceArguments {
    /// Options of a MainDevice on these interfaces.
    pub fn options(&self) -> Options {
        let source_address = match self.source_address {
            SourceAddress::FlagsFirst => MacCodec::FlagsFirst,
            SourceAddress::IdLast => MacCodec::IdLast,
        };
        let options = Options::default().with_source_address(source_address);
        match self.max_datagrams {
            Some(datagrams) => options.with_max_datagrams_per_frame(datagrams),
            None => options,
        }
    }

    /// Opens the interfaces. Refuses where another MainDevice uses one of them, and fails where no cable is plugged in.
    pub fn open(&self, thread: ThreadArguments) -> Result<PacketLinks, Failure> {
        self.check_names()?;
        let links = PacketLinks::open(&self.main, self.redundant.as_deref(), thread.mode())?;
        self.check()?;
        Ok(links)
    }

    /// As [`InterfaceArguments::open`], for a thread of the cycles and one of the supervisor.
    pub fn open_halves(&self, thread: ThreadArguments) -> Result<(PacketLinks, PacketLinks), Failure> {
        self.check_names()?;
        let halves = PacketLinks::open_halves(&self.main, self.redundant.as_deref(), thread.mode())?;
        self.check()?;
        Ok(halves)
    }

    /// Refuses one interface for two links.
    pub fn check_names(&self) -> Result<(), Failure> {
        two_interfaces(&self.main, self.redundant.as_deref())
    }

    /// What there is to find before anything is sent. The sockets are open: of two commands that begin at one time at
    /// least one sees the other.
    fn check(&self) -> Result<(), Failure> {
        check_sockets(self.names(), self.force)?;
        self.await_carrier()?;
        if self.force { Ok(()) } else { check_frames(self.names()) }
    }

    /// Name of the interface of a link.
    pub fn name(&self, link: Link) -> &str {
        match link {
            Link::Main => &self.main,
            Link::Redundant => self.redundant.as_deref().unwrap_or(&self.main),
        }
    }

    /// What to do where a cable of the segment is plugged into an interface that was not named.
    pub fn advice(&self, found: &str) -> String {
        match &self.redundant {
            None => format!("add --redundant {found} to run a ring, or unplug that cable"),
            Some(redundant) => format!("unplug it, or put {found} in the place of {redundant}"),
        }
    }

    /// The interfaces that are in use.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.main.as_str()).chain(self.redundant.as_deref())
    }

    /// Waits a little for a link that was just switched on. One end of a ring may do without.
    fn await_carrier(&self) -> Result<(), Failure> {
        let until = Instant::now() + LINK_UP_LIMIT;
        loop {
            // A driver that cannot tell is believed to have a carrier.
            let (up, down): (Vec<&str>, Vec<&str>) =
                self.names().partition(|name| interface::carrier(name).unwrap_or(true));
            if down.is_empty() {
                return Ok(());
            }
            if Instant::now() >= until {
                let text = down.iter().map(|name| describe_down(name)).collect::<Vec<_>>().join("\n");
                if up.is_empty() {
                    return Err(Failure::new(text));
                }
                eprintln!("ringcat: {text}");
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
        format!("{name} has no link: is the cable plugged in, and has the SubDevice at its other end power?")
    }
}

/// Monotonic time, as the links have it.
pub fn now() -> ringcat::Instant {
    ringcat::Instant(ringcat_link::monotonic::now_ns())
}

/// Refuses one interface for both ends of a ring.
pub fn two_interfaces(main: &str, redundant: Option<&str>) -> Result<(), Failure> {
    if redundant != Some(main) {
        return Ok(());
    }
    Err(Failure::new(format!("--main and --redundant name one interface, {main}: a ring has its ends at two of them")))
}
