//! One cycle of process data on the wire against the bare wire: what the MainDevice adds to sending and receiving.
//!
//! Both clients send frames of one length and one shape (an LRW and the supervision datagram) through a socket of the
//! same kind, wait in the same way, and have the same echo at the other end. The bare one only puts a new Idx into its
//! frame and checks that it came back; the other runs the whole cyclic half: receive, process, copy between image and
//! frame, queue, send. The clock is read once a cycle. Blocks of both alternate, so that both meet the same machine.

use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use ringcat::packet::PacketLinks;
use ringcat::wire::datagram::OVERHEAD;
use ringcat::wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN};
use ringcat::wire::source_address::{MacCodec, PROCESSED};
use ringcat::{DomainId, DomainState, Instant, Links};
use ringcat_engine::Board;
use ringcat_engine::Identity;
use ringcat_engine::direction::Direction;
use ringcat_engine::exchange::{Exchange, Received};
use ringcat_engine::layout::{AreaSpec, DomainSpec, ImageOrder, Layout};
use ringcat_engine::link::LinkSet;
use ringcat_engine::{Consumer, queue};
use ringcat_link::{PacketOptions, PacketSocket, ReceiveMode, monotonic, wait};

use super::quantile::quantile_us;
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json::bench;
use crate::json::data::Data;
use crate::json::values::Times;
use crate::numbers::number;
use crate::others::{check_frames, check_sockets};
use crate::output::say;
use crate::thread::ThreadArguments;
use crate::verdict::{Report, Verdict};

/// Cycles before the measured ones of a block.
const WARM_UP: usize = 200;
/// A frame that takes longer is lost.
const LOST_AFTER: Duration = Duration::from_secs(1);
/// Bytes of a frame that are not process data: headers, overhead of two datagrams, AL status for the supervision.
const AROUND: usize = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN + 2 * OVERHEAD + 2;
/// Offset of the source address.
const SOURCE: usize = 6;
/// Offset of the first datagram's Idx.
const INDEX: usize = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN + 1;
/// Bits of Idx that the bare client counts in: all but the class.
const COUNT: u8 = 0x7f;
/// Room for events, which are not read.
const EVENTS: usize = 8;

/// Options of `ringcat bench round-trip`.
#[derive(Args, Debug)]
pub struct RoundTripArguments {
    /// Network interface with `ringcat bench echo` at its other end
    #[arg(long, value_name = "IF", help_heading = "Links")]
    main: String,
    /// Go on although another MainDevice uses the interface
    #[arg(long, help_heading = "Links")]
    force: bool,
    /// Bytes of the frame without check sequence, 60 to 1514
    #[arg(
        long,
        value_name = "BYTES",
        default_value = "60",
        help_heading = "Cycle",
        value_parser = number(60u16..=1514, 60)
    )]
    size: u16,
    /// Cycles of each client
    #[arg(
        long,
        help_heading = "Cycle",
        value_name = "CYCLES",
        default_value = "100000",
        value_parser = number(1u32..=10_000_000, 100_000)
    )]
    count: u32,
    /// Pairs of blocks that the cycles are divided into
    ///
    /// With 0 the MainDevice runs alone, without blocks.
    #[arg(
        long,
        value_name = "PAIRS",
        default_value = "20",
        help_heading = "Cycle",
        value_parser = number(0u32..=1000, 20)
    )]
    blocks: u32,
    #[command(flatten)]
    thread: ThreadArguments,
}

/// Measures. It has held where no frame was lost or came back wrong.
pub fn run(arguments: &RoundTripArguments) -> Result<Report, Failure> {
    let end = EndRequest::watch(arguments.thread.priority)?;
    let main = || std::iter::once(arguments.main.as_str());
    check_sockets(main(), arguments.force)?;
    if !arguments.force {
        check_frames(main())?;
    }
    let _awake = arguments.thread.apply();
    let (mode, size, count) = (arguments.thread.mode(), usize::from(arguments.size), arguments.count as usize);
    let mut whole = Measured::default();
    if arguments.blocks == 0 {
        measure(&mut Cyclic::open(&arguments.main, mode, size)?, count, &mut whole, &end);
        whole.print("MainDevice");
        let verdict = verdict(&[&whole], &end);
        let main_device = whole.json();
        let alone = bench::RoundTrip { frame_bytes: size, blocks: 0, bare: None, main_device, median_ratio: None };
        return Ok(Report { verdict, data: Data::RoundTrip(alone) });
    }
    let (mut bare, mut ratios) = (Measured::default(), Vec::new());
    for _ in 0..arguments.blocks {
        let block = count.div_ceil(arguments.blocks as usize);
        // A socket of its own for each block, so that no other one takes copies of its frames.
        let mut cyclic = Cyclic::open(&arguments.main, mode, size)?;
        let of_whole = measure(&mut cyclic, block, &mut whole, &end);
        let shape = cyclic.shape();
        drop(cyclic);
        let of_bare = measure(&mut Bare::open(&arguments.main, mode, shape)?, block, &mut bare, &end);
        ratios.push(of_whole / of_bare);
        if end.is_asked() {
            break;
        }
    }
    ratios.sort_unstable_by(f64::total_cmp);
    say!("{size} bytes, {}, {} pairs of blocks", arguments.thread.mode_in_words(), ratios.len());
    bare.print("bare echo client");
    whole.print("MainDevice");
    let median_ratio = ratios[ratios.len() / 2];
    say!("median ratio: {median_ratio:.3}");
    let data = bench::RoundTrip {
        frame_bytes: size,
        blocks: ratios.len(),
        bare: Some(bare.json()),
        main_device: whole.json(),
        median_ratio: median_ratio.is_finite().then_some(median_ratio),
    };
    Ok(Report { verdict: verdict(&[&bare, &whole], &end), data: Data::RoundTrip(data) })
}

fn verdict(measured: &[&Measured], end: &EndRequest) -> Verdict {
    let failed: usize = measured.iter().map(|measured| measured.failed).sum();
    let cycles: usize = measured.iter().map(|measured| measured.times_ns.len()).sum();
    let mut reasons = Vec::new();
    if failed > 0 {
        reasons.push(format!("{failed} of {cycles} frames lost or wrong"));
    }
    reasons.extend(end.by().map(|by| format!("ended by {by} after {cycles} cycles")));
    Verdict::of(reasons, format!("{cycles} cycles, none lost"))
}

/// A client that sends frames and waits for each.
trait Client {
    /// One cycle that begins now; the time of its end, and whether the frame came back as expected.
    fn cycle(&mut self, now: u64) -> (u64, bool);
}

/// Times of cycles, and how many frames were lost or wrong.
#[derive(Default)]
struct Measured {
    times_ns: Vec<u64>,
    failed: usize,
}

impl Measured {
    fn print(&mut self, name: &str) {
        self.times_ns.sort_unstable();
        say!("{name} median: {:.3} us", quantile_us(&self.times_ns, 50));
        say!("{name} minimum: {:.3} us", quantile_us(&self.times_ns, 0));
        say!("{name} 99 %: {:.3} us", quantile_us(&self.times_ns, 99));
        say!("{name} lost or wrong: {} of {}", self.failed, self.times_ns.len());
    }

    /// The same as keys of JSON; the times are sorted.
    fn json(&self) -> bench::Measured {
        bench::Measured { cycle_times: Times::of_sorted(&self.times_ns), failed_frames: self.failed }
    }
}

/// A block of cycles; their median in nanoseconds.
fn measure(client: &mut impl Client, count: usize, measured: &mut Measured, end: &EndRequest) -> f64 {
    let mut now = monotonic::now_ns();
    for _ in (0..WARM_UP).take_while(|_| !end.is_asked()) {
        (now, _) = client.cycle(now);
    }
    let first = measured.times_ns.len();
    measured.times_ns.reserve(count);
    for _ in (0..count).take_while(|_| !end.is_asked()) {
        let (ended, right) = client.cycle(now);
        measured.times_ns.push(ended - now);
        measured.failed += usize::from(!right);
        now = ended;
    }
    let mut block = measured.times_ns[first..].to_vec();
    block.sort_unstable();
    quantile_us(&block, 50) * 1e3
}

/// Sends and receives, and nothing else.
struct Bare {
    socket: PacketSocket,
    mode: ReceiveMode,
    frame: Vec<u8>,
}

impl Bare {
    fn open(interface: &str, mode: ReceiveMode, frame: Vec<u8>) -> Result<Bare, Failure> {
        let options = PacketOptions::default().with_receive(mode);
        Ok(Bare { socket: PacketSocket::open(interface, &options)?, mode, frame })
    }
}

impl Client for Bare {
    fn cycle(&mut self, now: u64) -> (u64, bool) {
        let Bare { socket, mode, frame } = self;
        frame[INDEX] = frame[INDEX].wrapping_add(1) & COUNT;
        socket.send(frame);
        let mut right = None;
        while right.is_none() {
            if !wait(&[socket], now + LOST_AFTER.as_nanos() as u64, *mode) {
                return (monotonic::now_ns(), false);
            }
            socket.receive(&mut |back| {
                if back.len() == frame.len() && back[INDEX] == frame[INDEX] {
                    right = Some(back[SOURCE] & PROCESSED != 0);
                }
            });
        }
        (monotonic::now_ns(), right == Some(true))
    }
}

/// The cyclic half of a MainDevice with one SubDevice.
struct Cyclic {
    links: PacketLinks,
    exchange: Exchange,
    /// The other end of the queue of events: this bench has no acyclic half.
    _events: Consumer,
}

const DOMAIN: DomainId = DomainId(0);

impl Cyclic {
    fn open(interface: &str, mode: ReceiveMode, size: usize) -> Result<Cyclic, Failure> {
        let links = PacketLinks::open(interface, None, mode)?;
        let data = size.saturating_sub(AROUND);
        let area = |sync_manager, direction, length| AreaSpec { subdevice: 0, sync_manager, direction, length };
        let outputs = (data / 2) as u16;
        let areas = vec![area(2, Direction::Outputs, outputs), area(3, Direction::Inputs, data as u16 - outputs)];
        let spec = DomainSpec { period: LOST_AFTER, under_way: 1, lrw: true, areas, image: ImageOrder::Packed };
        let layout = Layout::new(&[spec], LinkSet::Single, true).map_err(|error| Failure::new(error.to_string()))?;
        let board = Arc::new(Board::new(1));
        board.set_taking_part(0, true);
        let (producer, events) = queue(EVENTS);
        let identity = Identity::new(MacCodec::FlagsFirst, links.addresses().main, None);
        let mut exchange = Exchange::new(identity, LinkSet::Single, &layout, board, producer);
        exchange.set_timeout(DOMAIN, LOST_AFTER);
        Ok(Cyclic { links, exchange, _events: events })
    }

    /// The frame that it sends.
    fn shape(&mut self) -> Vec<u8> {
        let mut shape = Vec::new();
        self.exchange.queue(DOMAIN, Instant::NEVER);
        self.exchange.send(Instant(0), &mut |_, frame| shape = frame.to_vec());
        shape
    }
}

impl Client for Cyclic {
    fn cycle(&mut self, now: u64) -> (u64, bool) {
        let Cyclic { links, exchange, .. } = self;
        let begin = Instant(now);
        // The application's part: outputs change, and answer to an input.
        if let [first, second, .., last] = exchange.image_mut(DOMAIN) {
            *first = first.wrapping_add(1);
            *second = *last;
        }
        exchange.queue(DOMAIN, begin);
        exchange.send(begin, &mut |link, frame| links.send(link, frame));
        let mut taken = false;
        while !taken {
            links.wait(begin + LOST_AFTER);
            let arrived = links.receive(&mut |link, frame| {
                taken = exchange.receive(link, frame, begin) == Received::Taken;
            });
            if !arrived && links.now() >= begin + LOST_AFTER {
                break;
            }
        }
        let end = links.now();
        let status = exchange.process(DOMAIN, end);
        (end.0, status.state == DomainState::Complete)
    }
}
