//! All SubDevices to OP, and process data as fast as the frames come back.
//!
//! A cycle is receive, process, work, queue, send; it begins when all frames of the last one are back, or, with several
//! cycles under way, those of the oldest one. The halves run as in `ringcat run`, the cycles in the thread that
//! measures.

use std::time::Duration;

use clap::Args;
use ringcat::AlState;
use ringcat::packet::PacketLinks;
use ringcat::{
    AcyclicHalf, Application, Declaration, DomainId, LastOutputs, MainDevice, Scan, SiiExtent, SupervisorThread,
    Trigger, automatic,
};
use ringcat_link::monotonic;

use super::quantile::quantile_us;
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::InterfaceArguments;
use crate::json::bench;
use crate::json::data::Data;
use crate::json::values::Times;
use crate::numbers::number;
use crate::output::say;
use crate::resend::ResendArgument;
use crate::thread::ThreadArguments;
use crate::under_way::UnderWayArgument;
use crate::verdict::{Report, Verdict};

/// The domain that `automatic` declares.
pub const DOMAIN: DomainId = DomainId(0);
/// Cycle time until all are in OP.
const START_UP_CYCLE: Duration = Duration::from_millis(1);
/// From activation to OP of the last SubDevice at the most.
const OP_LIMIT: Duration = Duration::from_secs(60);
/// SubDevices have this long to get to INIT in the end.
pub const STOP_LIMIT: Duration = Duration::from_secs(5);
/// Cycles back to back before the measured ones.
const WARM_UP: u32 = 1000;

/// Options of `ringcat bench cycles`.
#[derive(Args, Debug)]
pub struct CyclesArguments {
    #[command(flatten)]
    interfaces: InterfaceArguments,
    #[command(flatten)]
    thread: ThreadArguments,
    /// Cycles to be measured; 0 for the start-up alone
    #[arg(
        long,
        help_heading = "Cycle",
        value_name = "CYCLES",
        default_value = "20000",
        value_parser = number(0u32..=10_000_000, 20_000)
    )]
    count: u32,
    #[command(flatten)]
    under_way: UnderWayArgument,
    #[command(flatten)]
    resend: ResendArgument,
    /// Leave the supervision datagram out
    ///
    /// For a comparison with MainDevices that send process data alone.
    #[arg(long, help_heading = "Cycle")]
    unsupervised: bool,
    /// Run both halves in one thread, as small applications do
    #[arg(long, help_heading = "Thread")]
    one_thread: bool,
}

/// Measures. It has held where every cycle was complete and SubDevices were stopped in order.
pub fn run(arguments: &CyclesArguments) -> Result<Report, Failure> {
    let thread = arguments.thread;
    let end = EndRequest::watch(thread.priority)?;
    let options = arguments.interfaces.options().with_sii_extent(SiiExtent::Operation);
    let options = options.with_supervision(!arguments.unsupervised);
    if arguments.one_thread {
        let links = arguments.interfaces.open(thread)?;
        let _awake = thread.apply();
        let begin = monotonic::now_ns();
        let mut main_device = MainDevice::request(links, &options);
        let scan = main_device.scan()?;
        let (declaration, start_up) = declare(&scan, begin);
        let declaration = arguments.resend.adapt(arguments.under_way.adapt(declaration));
        let mut application = main_device.activate(declaration).map_err(ringcat::Error::from)?;
        let (reasons, data) = exchange(&mut application, arguments.count, start_up, begin, &end);
        let stop = application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).err();
        Ok(report(reasons, stop, arguments.count, data))
    } else {
        let (cyclic, acyclic) = arguments.interfaces.open_halves(thread)?;
        let begin = monotonic::now_ns();
        let supervisor = SupervisorThread::start(acyclic, &options, move || thread.prepare_supervisor())?;
        let _awake = thread.apply();
        let scan = supervisor.scan()?;
        let (declaration, start_up) = declare(&scan, begin);
        let declaration = arguments.resend.adapt(arguments.under_way.adapt(declaration));
        let mut application = supervisor.activate(declaration, cyclic).map_err(ringcat::Error::from)?;
        let (reasons, data) = exchange(&mut application, arguments.count, start_up, begin, &end);
        let stop = application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT).err();
        Ok(report(reasons, stop, arguments.count, data))
    }
}

fn report(mut reasons: Vec<String>, stop: Option<ringcat::Error>, count: u32, data: bench::Cycles) -> Report {
    reasons.extend(stop.map(|error| error.to_string()));
    let verdict = Verdict::of(reasons, format!("{count} cycles, all complete"));
    Report { verdict, data: Data::Cycles(data) }
}

/// Everything as its SII says. Prints how long the scan took; also returns it.
pub fn declare(scan: &Scan, begin: u64) -> (Declaration, bench::StartUp) {
    let (subdevices, scanned_after_ns) = (scan.subdevices.len(), monotonic::now_ns() - begin);
    say!("SubDevices: {subdevices}");
    say!("scanned after: {:.1} ms", scanned_after_ns as f64 / 1e6);
    let start_up = bench::StartUp { subdevices, scanned_after_ns, op_after_ns: None };
    (automatic(&scan.subdevices, START_UP_CYCLE), start_up)
}

/// Cycles until all are in OP; how long that took, in nanoseconds.
///
/// # Errors
/// Why that does not come, in words.
pub fn reach_op<H: AcyclicHalf>(
    application: &mut Application<PacketLinks, H>,
    begin: u64,
    end: &EndRequest,
) -> Result<u64, String> {
    let until = application.now() + OP_LIMIT;
    while !application.all_settled() {
        application.cycle(|_| ());
        if let Some(by) = end.by() {
            return Err(format!("ended by {by} before all SubDevices were in OP"));
        }
        if application.now() >= until {
            return Err("not all SubDevices get to OP; `ringcat run` shows which, and why".to_owned());
        }
    }
    let after_ns = application.now().0 - begin;
    say!("all in OP after: {:.1} ms", after_ns as f64 / 1e6);
    Ok(after_ns)
}

/// To OP, then cycles back to back; what did not hold, and what was measured.
fn exchange<H: AcyclicHalf>(
    application: &mut Application<PacketLinks, H>,
    count: u32,
    start_up: bench::StartUp,
    begin: u64,
    end: &EndRequest,
) -> (Vec<String>, bench::Cycles) {
    let mut data = bench::Cycles {
        start_up,
        cycle_times: None,
        rate_hz: None,
        cpu_ns_per_cycle: None,
        incomplete_cycles: None,
        resent_frames: None,
    };
    match reach_op(application, begin, end) {
        Ok(after_ns) => data.start_up.op_after_ns = Some(after_ns),
        Err(reason) => return (vec![reason], data),
    }
    if count == 0 {
        return (Vec::new(), data);
    }
    application.set_trigger(Trigger::FramesReturned { at_least: Duration::ZERO });
    for _ in 0..WARM_UP {
        one_cycle(application);
    }
    let mut times_ns = Vec::with_capacity(count as usize);
    let (before, cpu_before) = (application.cyclic_counters(), monotonic::process_cpu_ns());
    let first = one_cycle(application);
    let mut last = first;
    for _ in (0..count).take_while(|_| !end.is_asked()) {
        let now = one_cycle(application);
        times_ns.push(now - last);
        last = now;
    }
    let (after, cpu) = (application.cyclic_counters(), monotonic::process_cpu_ns() - cpu_before);
    // A cycle that was skipped sent nothing.
    let incomplete = after.incomplete - before.incomplete + after.skipped - before.skipped;
    let cycles = times_ns.len();
    times_ns.sort_unstable();
    let rate_hz = cycles as f64 * 1e9 / (last - first).max(1) as f64;
    data.cycle_times = Times::of_sorted(&times_ns);
    data.rate_hz = (cycles > 0).then_some(rate_hz);
    data.cpu_ns_per_cycle = cpu.checked_div(cycles as u64);
    data.incomplete_cycles = (cycles > 0).then_some(incomplete);
    data.resent_frames = (cycles > 0).then_some(after.sent_again - before.sent_again);
    say!("cycles per second: {rate_hz:.0}");
    say!("cycle median: {:.2} us", quantile_us(&times_ns, 50));
    say!("cycle minimum: {:.2} us", quantile_us(&times_ns, 0));
    let share = 100.0 * cpu as f64 / (last - first).max(1) as f64;
    say!("CPU per cycle: {:.2} us, {share:.0} % of a processor", cpu as f64 / 1e3 / cycles.max(1) as f64);
    say!("incomplete: {incomplete} of {cycles}");
    say!("sent again: {} frames", after.sent_again - before.sent_again);
    let mut reasons = Vec::new();
    if incomplete > 0 {
        reasons.push(format!("{incomplete} of {cycles} cycles incomplete"));
    }
    reasons.extend(end.by().map(|by| format!("ended by {by} after {cycles} of {count} cycles")));
    (reasons, data)
}

/// A cycle with an application's part: an output changes, and answers to an input. Returns when it began, in
/// nanoseconds.
fn one_cycle<H: AcyclicHalf>(application: &mut Application<PacketLinks, H>) -> u64 {
    application.cycle(|data| {
        let last = data.image(DOMAIN).last().copied().unwrap_or_default();
        if let Ok([first, second]) = data.outputs_mut(DOMAIN, 0..2) {
            *first = first.wrapping_add(1);
            *second = last;
        }
        data.now().0
    })
}
