//! From power-on to all in OP in virtual time, and its cost in bytes.
//!
//! Terminals as in [`scenarios::terminals`] are connected to one link; the application cycles after activation. The
//! time is measured from power-on, when the MainDevice begins to scan, until the last SubDevice is in OP, as read
//! inside the devices.
//!
//! # The floor
//!
//! The minimum number of bytes, per SubDevice: for every 4 or 8 bytes of its SII one FPWR of command and word address
//! (6 bytes) and one FPRD that polls and returns the data (6 + 4 or 6 + 8 bytes); its station address (2); its
//! SyncManager (8) and FMMU (16); AL control for PREOP, SAFEOP and OP (2 each). These are sequential steps, each with
//! a datagram (12 bytes besides its data) for every SubDevice, packed into the smallest number of frames (16 bytes of
//! header, at least 60, at most 1,514). Other reads such as AL status, second checks of working counters and process
//! data are not included. The floor is compared with all bytes sent until OP, cyclic frames included, without frame
//! check sequences.
//!
//! # The limit of datagrams per frame
//!
//! Other software processes at most 15 datagrams of a frame. Start-up with that limit is compared with start-up
//! without: a default of 15 is worth having where it costs at most [`LIMIT_BAR`].

use std::process::ExitCode;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Error, MainDevice, Options, automatic};
use ringcat_sim::cable::HostLink;
use ringcat_sim::network::{Network, NetworkOptions};
use ringcat_wire::al::AlState;
use ringcat_wire::datagram::OVERHEAD;
use ringcat_wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, MAX_FRAME, MIN_FRAME};
use scenarios::figures::{Figures, verdict};
use scenarios::segments::{descriptions, line};
use scenarios::terminals::{HOP, Links, segment, sii_bytes_used};

/// Limit of the virtual time of a start.
const LIMIT: Duration = Duration::from_secs(20);
/// Maximum seconds for 1,000 terminals with 8-byte and with 4-byte reads.
const BARS: [(bool, f64); 2] = [(true, 0.6), (false, 1.0)];
/// Datagrams per frame that all known software processes, and what start-up may take with this limit, as a multiple of
/// start-up without, for it to be the default.
const DATAGRAMS: u16 = 15;
const LIMIT_BAR: f64 = 1.01;
/// Cycle time of that comparison with up to a hundred SubDevices, which is how coarse its times are: a hundred servos
/// need 300 us. A thousand terminals need more than a millisecond.
const FINE: Duration = Duration::from_micros(500);
/// Maximum bytes for 1,000 terminals, as a multiple of the floor.
const BYTES_BAR: f64 = 1.5;

/// A name, a function that creates a segment with a number of SubDevices, and the numbers to measure.
type Kind<'a> = (&'static str, &'a dyn Fn(usize) -> Network, &'a [usize]);

/// Cost of a start.
struct Start {
    time: Duration,
    scanned: Duration,
    bytes: u64,
    cyclic_bytes: u64,
}

impl Start {
    fn ratio(&self, floor: u64) -> f64 {
        self.bytes as f64 / floor as f64
    }

    fn describe(&self, floor: u64) -> String {
        let Start { time, scanned, bytes, cyclic_bytes } = self;
        let (time, scanned, ratio) = (time.as_secs_f64(), scanned.as_secs_f64(), self.ratio(floor));
        format!(
            "{time:.3} s (scan {scanned:.3} s), {bytes:>7} bytes ({cyclic_bytes:>4} cyclic), floor {floor:>7}, \
             {ratio:.2} x"
        )
    }
}

pub fn main() -> ExitCode {
    match measure() {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("startup: {error}");
            ExitCode::FAILURE
        }
    }
}

fn measure() -> Result<bool, Error> {
    let mut met = true;
    for (eight_byte_reads, bar) in BARS {
        let width = if eight_byte_reads { 8 } else { 4 };
        let mut figures = Figures::new(&format!("power-on to all in OP, {width}-byte SII reads"));
        for cache in [false, true] {
            for count in [1, 10, 100, 1_000] {
                let network = segment(count, eight_byte_reads, Links::One, HOP);
                let floor = floor(&network, width);
                let options = Options::default().with_sii_cache(cache);
                let start = start(network, &options, period(count))?;
                let name = format!("{count:>5} terminals, SII cache {}", if cache { "on" } else { "off" });
                figures.show(&name, start.describe(floor));
                if count == 1_000 && !cache {
                    figures.at_most("      time", start.time.as_secs_f64(), bar, "s");
                    figures.at_most("      bytes against the floor", start.ratio(floor), BYTES_BAR, "x");
                }
            }
        }
        met &= figures.print();
    }
    datagrams_per_frame()?;
    Ok(met)
}

/// Start-up with at most [`DATAGRAMS`] in a frame beside start-up with as many as fit.
fn datagrams_per_frame() -> Result<(), Error> {
    let mut figures = Figures::new(&format!("power-on to all in OP, at most {DATAGRAMS} datagrams in a frame"));
    let servos = |count: usize| line(descriptions(&vec!["servo"; count]), NetworkOptions::default());
    let terminals = |count: usize| segment(count, true, Links::One, HOP);
    // A thousand servos (1.10 x) take a while to simulate.
    let kinds: [Kind<'_>; 2] =
        [("servos", &servos, &[1, 10, 50, 100]), ("terminals", &terminals, &[1, 10, 50, 100, 300, 1_000])];
    let mut most: f64 = 0.0;
    for (name, network, counts) in kinds {
        for count in counts.iter().copied() {
            let fine = if count > 100 { period(1_000) } else { FINE };
            let plain = start(network(count), &Options::default(), fine)?;
            let options = Options::default().with_max_datagrams_per_frame(DATAGRAMS);
            let limited = start(network(count), &options, fine)?;
            let ratio = limited.time.as_secs_f64() / plain.time.as_secs_f64();
            most = most.max(ratio);
            let [plain, limited] = [plain, limited].map(|start| start.time.as_secs_f64() * 1e3);
            let text = format!("{limited:.1} ms instead of {plain:.1}, {ratio:.3} x");
            figures.show(&format!("{count:>5} {name}"), text);
        }
    }
    let verdict = if most <= LIMIT_BAR { "15 could be the default" } else { "the default stays: as many as fit" };
    figures.show("largest ratio", format!("{most:.3} x; at most {LIMIT_BAR}: {verdict}"));
    figures.print();
    Ok(())
}

/// The round trip through a thousand terminals takes more than a millisecond.
const fn period(count: usize) -> Duration {
    Duration::from_millis(if count < 1_000 { 1 } else { 4 })
}

fn start(network: Network, options: &Options, period: Duration) -> Result<Start, Error> {
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), options);
    let found = main_device.scan()?;
    let scanned = Duration::from_nanos(main_device.links_mut().network().now().0);
    let mut application = main_device.activate(automatic(&found.subdevices, period))?;
    while !all_in_op(application.links().network()) {
        application.cycle(|_| ());
        let now = Duration::from_nanos(application.now().0);
        assert!(now < LIMIT, "{:?}", application.states());
    }
    // Devices are checked once per cycle: times are up to one period too long.
    Ok(Start {
        time: Duration::from_nanos(application.now().0),
        scanned,
        bytes: application.links().network().statistics().link(HostLink::Main).bytes_sent,
        cyclic_bytes: application.cyclic_counters().bytes,
    })
}

fn all_in_op(network: &Network) -> bool {
    network.devices().all(|device| device.al_status().al_state() == Some(AlState::Op))
}

/// See the module documentation.
fn floor(network: &Network, read_bytes: usize) -> u64 {
    let used: Vec<usize> = network.devices().map(sii_bytes_used).collect();
    let reads = used.iter().map(|used| used.div_ceil(read_bytes)).max().unwrap_or(0);
    let mut floor = 0;
    for read in 0..reads {
        let asked = used.iter().filter(|used| used.div_ceil(read_bytes) > read).count();
        floor += step(asked, 6) + step(asked, 6 + read_bytes);
    }
    let station_address = 2;
    let (sync_manager, fmmu) = (8, 16);
    let al_control = 2;
    for data in [station_address, al_control, sync_manager, fmmu, al_control, al_control] {
        floor += step(used.len(), data);
    }
    floor
}

/// Bytes of the frames with one datagram of this length for each of `count` SubDevices.
fn step(subdevices: usize, data: usize) -> u64 {
    const HEADERS: usize = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN;
    let in_full_frame = (MAX_FRAME - HEADERS) / (OVERHEAD + data);
    let bytes = |datagrams: usize| (HEADERS + datagrams * (OVERHEAD + data)).max(MIN_FRAME);
    let rest = match subdevices % in_full_frame {
        0 => 0,
        rest => bytes(rest),
    };
    (subdevices / in_full_frame * bytes(in_full_frame) + rest) as u64
}
