//! Instructions per cycle of an ACTIVE MainDevice with a standby, against those of a ring alone, counted by callgrind.
//!
//! Both have two links, 33 SubDevices, 5 kB of process data and a closed ring; with a standby also the master frames of
//! default sizes, which an INACTIVE fills. Only the cycle of the application's thread is counted, without the socket.
//!
//! Run without arguments it prints the figures; `run alone|standby CYCLES` is the work that callgrind measures.

use std::io;
use std::process::ExitCode;

use ringcat_engine::domain::DomainState;
use ringcat_engine::role::Partner;
use scenarios::answering_double::Cabling;
use scenarios::callgrind::{is_installed, profile_self_within};
use scenarios::cyclic_load::{CyclicLoad, LoadSpec};
use scenarios::cyclic_pair::CyclicPair;
use scenarios::figures::{Figures, skipped, verdict};

const SHORT: u64 = 200;
const LONG: u64 = 1_200;
/// A standby may cost so many times the instructions of a ring alone.
const BAR: f64 = 2.0;
/// 33 SubDevices with 76 + 76 bytes: 5,016 bytes.
const SPEC: LoadSpec = LoadSpec {
    subdevices: 33,
    bytes: 76,
    domains: 1,
    under_way: 1,
    lrw: false,
    supervision: true,
    cabling: Cabling::ClosedRing,
};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let result = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [] if !is_installed() => Ok(skipped("instructions with a standby, for valgrind is not installed")),
        [] => measure(),
        ["run", "alone", cycles] => alone(cycles).map(|()| true),
        ["run", "standby", cycles] => with_standby(cycles).map(|()| true),
        _ => Err(io::Error::other("usage: standby_cycle [run alone|standby CYCLES]")),
    };
    match result {
        Ok(met) => verdict(met),
        Err(error) => {
            eprintln!("standby_cycle: {error}");
            ExitCode::FAILURE
        }
    }
}

fn alone(cycles: &str) -> io::Result<()> {
    let cycles: u64 = cycles.parse().map_err(io::Error::other)?;
    let mut load = CyclicLoad::new(&SPEC).map_err(io::Error::other)?;
    load.exchange_once();
    let mut last = DomainState::Zero;
    for _ in 0..cycles {
        load.answer();
        last = load.exchange_once().state;
    }
    check(&load, last)
}

fn with_standby(cycles: &str) -> io::Result<()> {
    let cycles: u64 = cycles.parse().map_err(io::Error::other)?;
    let mut pair = CyclicPair::new(&SPEC).map_err(io::Error::other)?;
    pair.exchange_of_two();
    let mut last = DomainState::Zero;
    for _ in 0..cycles {
        pair.pass_ring();
        last = pair.exchange_of_two().state;
    }
    match pair.partner() {
        Partner::Alive { is_consistent: true, .. } => check(&pair.active, last),
        other => Err(io::Error::other(format!("the standby does not follow: {other:?}"))),
    }
}

/// All frames have come back in each cycle.
fn check(load: &CyclicLoad, last: DomainState) -> io::Result<()> {
    let counters = load.exchange.counters();
    let disturbed = counters.lost + counters.late + counters.corrupt + counters.skipped + counters.copies_lost;
    if last != DomainState::Complete || disturbed != 0 || counters.incomplete != 0 {
        return Err(io::Error::other(format!("{last:?}, {counters:?}")));
    }
    Ok(())
}

/// Instructions of a cycle.
fn cost(function: &str, what: &str) -> io::Result<f64> {
    let profile = |cycles: u64| profile_self_within(function, &["run".to_owned(), what.to_owned(), cycles.to_string()]);
    let (short, long) = (profile(SHORT)?, profile(LONG)?);
    Ok((long.instructions as f64 - short.instructions as f64) / (LONG - SHORT) as f64)
}

fn measure() -> io::Result<bool> {
    let alone = cost("*CyclicLoad*exchange_once*", "alone")?;
    let with_standby = cost("*CyclicPair*exchange_of_two*", "standby")?;
    let mut figures = Figures::new("instructions per cycle, ring of 33 SubDevices with 5 kB of process data");
    figures.show("ring alone", format!("{alone:.0} instructions"));
    figures.show("ACTIVE with a standby that follows", format!("{with_standby:.0} instructions"));
    figures.at_most("with a standby against alone", with_standby / alone, BAR, "x");
    Ok(figures.print())
}
