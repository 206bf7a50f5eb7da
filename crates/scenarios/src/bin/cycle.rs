//! Instructions per process-data cycle, counted by callgrind.
//!
//! A cycle is the work of the application's thread: receive all frames, evaluate, copy between image and application,
//! queue, send on the in-memory links. The other end is a double that only writes working counters and the source bit.
//! Cost is the slope between two run lengths, so that start-up is excluded; the double's own slope, measured by running
//! it alone on the same frames, is subtracted. Between the two lengths no function that allocates or locks may be
//! called.
//!
//! These figures leave out the socket, waiting, clock reads and publishing: they must not be compared with those of
//! other stacks, which include all this. Bin `socket_cycle` counts the whole cycle.
//!
//! Run without arguments it prints the table; `run CASE exchange|double CYCLES` is the work that callgrind measures.

use std::io;
use std::process::ExitCode;
use std::thread;

use scenarios::answering_double::Cabling;
use scenarios::callgrind::{Profile, is_installed, profile_self};
use scenarios::cyclic_load::{CyclicLoad, LoadSpec};
use scenarios::figures::{Figures, skipped, verdict};

const SHORT: u64 = 1_000;
const LONG: u64 = 3_000;
/// Maximum instructions of a cycle with one SubDevice on one link, 2 % above what is measured with LWR and LRD, and the
/// goal.
const BAR: f64 = 597.0;
const AIM: f64 = 500.0;
/// Maximum cost of 50 SubDevices, as a multiple of one SubDevice with as many bytes.
const FIFTY_BAR: f64 = 1.3;
/// Most instructions with two links: 2 % above what is measured (decision 0055).
const RING_BARS: [(&str, f64); 8] = [
    ("closed", 1_104.0),
    ("cut-main", 1_105.0),
    ("cut-redundant", 1_142.0),
    ("sixteen-closed", 1_289.0),
    ("sixteen-cut-main", 1_290.0),
    ("sixteen-cut-middle", 1_496.0),
    ("sixteen-cut-redundant", 1_326.0),
    ("fifty-of-2-cut", 1_574.0),
];

struct Case {
    name: &'static str,
    spec: LoadSpec,
}

const fn case(name: &'static str, subdevices: usize, bytes: u16, lrw: bool, cabling: Cabling) -> Case {
    Case { name, spec: LoadSpec { subdevices, bytes, domains: 1, under_way: 1, lrw, supervision: true, cabling } }
}

const fn unsupervised(mut case: Case, name: &'static str) -> Case {
    case.name = name;
    case.spec.supervision = false;
    case
}

const ON_MAIN: Cabling = Cabling::CutRing { before: 1 };
const ON_REDUNDANT: Cabling = Cabling::CutRing { before: 0 };

const LRW: Case = case("lrw", 1, 2, true, Cabling::Line);
const SPLIT: Case = case("lwr+lrd", 1, 2, false, Cabling::Line);
const CLOSED: Case = case("closed", 1, 2, false, Cabling::ClosedRing);
const CUT_MAIN: Case = case("cut-main", 1, 2, false, ON_MAIN);
const CUT_REDUNDANT: Case = case("cut-redundant", 1, 2, false, ON_REDUNDANT);
const CASES: [Case; 23] = [
    unsupervised(LRW, "lrw-unsupervised"),
    unsupervised(SPLIT, "lwr+lrd-unsupervised"),
    unsupervised(CLOSED, "closed-unsupervised"),
    unsupervised(CUT_MAIN, "cut-main-unsupervised"),
    unsupervised(CUT_REDUNDANT, "cut-redundant-unsupervised"),
    LRW,
    SPLIT,
    CLOSED,
    CUT_MAIN,
    CUT_REDUNDANT,
    case("one-of-100", 1, 100, true, Cabling::Line),
    case("fifty-of-2", 50, 2, true, Cabling::Line),
    case("one-of-100-cut", 1, 100, false, ON_REDUNDANT),
    case("fifty-of-2-cut", 50, 2, false, Cabling::CutRing { before: 25 }),
    case("one-of-20", 1, 20, true, Cabling::Line),
    case("ten-of-2", 10, 2, true, Cabling::Line),
    case("four-of-500", 4, 500, true, Cabling::Line),
    case("thousand-of-2", 1000, 2, true, Cabling::Line),
    case("sixteen-lrw", 16, 2, true, Cabling::Line),
    case("sixteen-closed", 16, 2, false, Cabling::ClosedRing),
    case("sixteen-cut-main", 16, 2, false, Cabling::CutRing { before: 16 }),
    case("sixteen-cut-middle", 16, 2, false, Cabling::CutRing { before: 8 }),
    case("sixteen-cut-redundant", 16, 2, false, Cabling::CutRing { before: 0 }),
];

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] if !is_installed() => Ok(skipped("instructions per cycle, for valgrind is not installed")),
        [] => measure_all().map(|measured| print(&measured)),
        ["run", name, part, cycles] => run(name, part, cycles).map(|()| true),
        _ => Err(io::Error::other("usage: cycle [run CASE exchange|double CYCLES]")),
    };
    match result {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("cycle: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The work that callgrind measures.
fn run(name: &str, part: &str, cycles: &str) -> io::Result<()> {
    let case = CASES.iter().find(|case| case.name == name).ok_or(io::Error::other("no such case"))?;
    let cycles: u64 = cycles.parse().map_err(io::Error::other)?;
    let mut load = CyclicLoad::new(&case.spec).map_err(io::Error::other)?;
    let incomplete = load.exchange_once().state;
    match part {
        "exchange" => {
            for _ in 0..cycles {
                load.answer();
                load.exchange_once();
            }
            let counters = load.exchange.counters();
            let (frames, ..) = case.spec.bytes().map_err(io::Error::other)?;
            let frames = frames as u64;
            let disturbed = counters.lost + counters.late + counters.corrupt + counters.skipped + counters.copies_lost;
            if disturbed != 0 || counters.incomplete != 0 || counters.received != cycles * frames {
                return Err(io::Error::other(format!("first {incomplete:?}, then {counters:?}")));
            }
        }
        "double" => {
            for _ in 0..cycles / 2 {
                load.answer();
                load.answer_back();
            }
        }
        _ => return Err(io::Error::other("no such part")),
    }
    Ok(())
}

/// Slopes of one case.
struct Measured {
    exchange: f64,
    double: f64,
    /// Calls of functions that allocate or lock, within the cycles and in the whole run.
    forbidden: (u64, u64),
}

impl Measured {
    fn net(&self) -> f64 {
        self.exchange - self.double
    }
}

fn measure_all() -> io::Result<Vec<Measured>> {
    // Two at a time: valgrind uses one processor each.
    let (left, right) = CASES.split_at(CASES.len() / 2);
    let measure_half = |cases: &'static [Case]| cases.iter().map(measure).collect::<io::Result<Vec<_>>>();
    let (left, right) = thread::scope(|scope| {
        let right = scope.spawn(move || measure_half(right));
        (measure_half(left), right.join())
    });
    let right = right.map_err(|_| io::Error::other("a measurement panicked"))?;
    Ok(left?.into_iter().chain(right?).collect())
}

fn measure(case: &Case) -> io::Result<Measured> {
    let profile = |part: &str, cycles: u64| {
        profile_self(&["run".to_owned(), case.name.to_owned(), part.to_owned(), cycles.to_string()])
    };
    let (short, long) = (profile("exchange", SHORT)?, profile("exchange", LONG)?);
    let (double_short, double_long) = (profile("double", SHORT)?, profile("double", LONG)?);
    let calls = |profile: &Profile| profile.calls_of(allocates_or_locks);
    Ok(Measured {
        exchange: slope(&short, &long),
        double: slope(&double_short, &double_long),
        forbidden: (calls(&long).abs_diff(calls(&short)), calls(&long)),
    })
}

fn slope(short: &Profile, long: &Profile) -> f64 {
    (long.instructions as f64 - short.instructions as f64) / (LONG - SHORT) as f64
}

/// Functions that allocate, lock or enter the kernel. Rust paths begin with `alloc::` also without an allocation, so
/// the names of the functions called in the end are checked.
fn allocates_or_locks(name: &str) -> bool {
    const PARTS: &str = "malloc calloc realloc memalign __rust_alloc __rust_dealloc _int_free mutex rwlock futex \
                         pthread lll_lock syscall";
    let lower = name.to_ascii_lowercase();
    lower.starts_with("free") || lower.starts_with("cfree") || PARTS.split(' ').any(|part| lower.contains(part))
}

/// Cost of exact freshness: presence datagrams compared with the same bytes in datagrams with one SubDevice each, where
/// the working counter alone is exact.
fn print_exactness<'a>(find: &impl Fn(&str) -> &'a Measured) {
    println!(
        "  what exact freshness costs, one link, 2 + 2 bytes per SubDevice, against as many bytes of few SubDevices:"
    );
    println!("  SubDevices  frames  bytes of frames  of these presence  instructions  more");
    for (name, alone) in
        [("lrw", "lrw"), ("ten-of-2", "one-of-20"), ("fifty-of-2", "one-of-100"), ("thousand-of-2", "four-of-500")]
    {
        let spec = CASES.iter().find(|case| case.name == name).map(|case| case.spec).expect("it is one of them");
        let (frames, bytes, presence) = spec.bytes().expect("it can be laid out");
        let (net, more) = (find(name).net(), find(name).net() - find(alone).net());
        println!("  {:>10}  {frames:>6}  {bytes:>15}  {presence:>17}  {net:>12.0}  {more:>4.0}", spec.subdevices);
    }
}

fn print(measured: &[Measured]) -> bool {
    let find = |name: &str| {
        let at = CASES.iter().position(|case| case.name == name).unwrap_or_default();
        &measured[at]
    };
    let mut figures = Figures::new("instructions per process-data cycle, the double's subtracted");
    println!(
        "  lrw, lwr+lrd: one SubDevice with 2 + 2 bytes on one link. closed, cut-main, cut-redundant: two links, the \
         ring"
    );
    println!(
        "  closed, or cut so that it processes the main or the redundant copy. n-of-b: n SubDevices, b + b bytes each."
    );
    for (case, measured) in CASES.iter().zip(measured) {
        let name =
            format!("{:<28} (with double {:>6.1}, double {:>5.1})", case.name, measured.exchange, measured.double);
        if case.spec.cabling == Cabling::Line && case.spec.subdevices == 1 {
            figures.at_most_towards(&name, measured.net(), BAR, AIM, "instructions");
        } else if let Some((_, bar)) = RING_BARS.iter().find(|(ring, _)| *ring == case.name) {
            figures.at_most(&name, measured.net(), *bar, "instructions");
        } else {
            figures.show(&name, format!("{:.2} instructions", measured.net()));
        }
    }
    let fifty = find("fifty-of-2").net() / find("one-of-100").net();
    figures.at_most("50 SubDevices of 2 + 2 bytes against one of 100 + 100", fifty, FIFTY_BAR, "x");
    print_exactness(&find);
    let forbidden = measured.iter().map(|measured| measured.forbidden.0).sum::<u64>();
    let outside = measured.iter().map(|measured| measured.forbidden.1).sum::<u64>();
    let name = format!("calls that allocate or lock, in the cycles ({outside} at start-up)");
    figures.at_most(&name, forbidden as f64, 0.0, "calls");
    figures.print()
}
