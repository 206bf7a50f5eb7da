//! From power-on to all in OP in virtual time, and its cost in bytes (issue 2, "What it must reach").
//!
//! Terminals as in [`scenarios::terminals`] are connected to one link; the application cycles after activation. The
//! time is measured from power-on, when the MainDevice begins to scan, until the last SubDevice is in OP, as read
//! inside the devices.
//!
//! # The floor
//!
//! The minimum number of bytes, per SubDevice: for every 4 or 8 bytes of its SII one FPWR of command and word address
//! (6 bytes) and one FPRD that polls and returns the data (6 + 4 or 6 + 8 bytes); its station address (2); its
//! SyncManager (8) and FMMU (16); AL control for PREOP, SAFEOP and OP (2 each). These are sequential steps, each with a
//! datagram (12 bytes besides its data) for every SubDevice, packed into the smallest number of frames (16 bytes of
//! header, at least 60, at most 1,514). Other reads such as AL status, second checks of working counters and process
//! data are not included. The floor is compared with all bytes sent until OP, cyclic frames included, without frame
//! check sequences.

use std::process::ExitCode;
use std::time::Duration;

use ringcat::simulated::SimulatedSegment;
use ringcat::{Error, MainDevice, Options, automatic};
use ringcat_sim::cable::HostLink;
use ringcat_sim::network::Network;
use ringcat_wire::al::AlState;
use ringcat_wire::datagram::OVERHEAD;
use ringcat_wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, MAX_FRAME, MIN_FRAME};
use scenarios::figures::{Figures, verdict};
use scenarios::terminals::{HOP, Links, segment, sii_bytes_used};

/// Limit of the virtual time of a start.
const LIMIT: Duration = Duration::from_secs(20);
/// Maximum seconds for 1,000 terminals with 8-byte and with 4-byte reads.
const BARS: [(bool, f64); 2] = [(true, 0.6), (false, 1.0)];
/// Maximum bytes for 1,000 terminals, as a multiple of the floor.
const BYTES_BAR: f64 = 1.5;

/// Cost of a start.
struct Start {
    time: Duration,
    scanned: Duration,
    bytes: u64,
    cyclic_bytes: u64,
    floor: u64,
}

impl Start {
    fn ratio(&self) -> f64 {
        self.bytes as f64 / self.floor as f64
    }

    fn describe(&self) -> String {
        let Start { time, scanned, bytes, cyclic_bytes, floor } = self;
        let (time, scanned, ratio) = (time.as_secs_f64(), scanned.as_secs_f64(), self.ratio());
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
                let start = start(count, eight_byte_reads, cache)?;
                let name = format!("{count:>5} terminals, SII cache {}", if cache { "on" } else { "off" });
                figures.show(&name, start.describe());
                if count == 1_000 && !cache {
                    figures.at_most("      time", start.time.as_secs_f64(), bar, "s");
                    figures.at_most("      bytes against the floor", start.ratio(), BYTES_BAR, "x");
                }
            }
        }
        met &= figures.print();
    }
    Ok(met)
}

/// The round trip through a thousand terminals takes more than a millisecond.
const fn period(count: usize) -> Duration {
    Duration::from_millis(if count < 1_000 { 1 } else { 4 })
}

fn start(count: usize, eight_byte_reads: bool, cache: bool) -> Result<Start, Error> {
    let network = segment(count, eight_byte_reads, Links::One, HOP);
    let floor = floor(&network, if eight_byte_reads { 8 } else { 4 });
    let options = Options::default().with_sii_cache(cache);
    let mut main_device = MainDevice::request(SimulatedSegment::new(network), &options);
    let found = main_device.scan()?;
    let scanned = Duration::from_nanos(main_device.links_mut().network().now().0);
    let mut application = main_device.activate(automatic(&found.subdevices, period(count)))?;
    while !all_in_op(application.links().network()) {
        application.cycle(|_| ());
        let now = Duration::from_nanos(application.now().0);
        assert!(now < LIMIT, "{count} terminals: {:?}", application.states());
    }
    // Devices are checked once per cycle: times are up to one period too long.
    Ok(Start {
        time: Duration::from_nanos(application.now().0),
        scanned,
        bytes: application.links().network().statistics().link(HostLink::Main).bytes_sent,
        cyclic_bytes: application.cyclic_counters().bytes,
        floor,
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
