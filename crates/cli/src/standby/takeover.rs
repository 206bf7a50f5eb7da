//! `ringcat standby` with a declaration: INACTIVE it follows, ACTIVE it controls the bus, and the policy decides.
//!
//! A thread joins the ring and then runs the cycles; it forwards meanwhile. The main thread prints events, and ends
//! both in order.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{JoinHandle, sleep};
use std::time::Duration;

use ringcat::packet::PacketLinks;
use ringcat::standby::remote::RemoteServer;
use ringcat::standby::{NotReady, Requester, RoleControl, RoleRequest, StandbyOptions};
use ringcat::{
    AlState, CyclicThread, Instant, LastOutputs, Links, MainDeviceRole, Options, SubDeviceState, SupervisorThread,
};
use ringcat_link::interface;

use super::beating::{BeatingLinks, Beats, Half, HalfLinks, OffAtEnd};
use super::counters::{in_line, same_identity};
use super::ethernet::Ethernet;
use super::event_report::EventReport;
use super::guarding::Guarded;
use super::joining::{Joined, Joiner};
use super::options::StandbyArguments;
use super::schedule::{HAND_OVER_LIMIT, NOT_TAKEN, Schedule, Step};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::interfaces::now;
use crate::json::data::Data;
use crate::json::standby::Standby;
use crate::others::check_sockets;
use crate::output::say;
use crate::run::configured::ConfiguredNetwork;
use crate::run::declared::pdos;
use crate::verdict::{Report, Verdict};

/// Interval at which events are taken.
const LOOK: Duration = Duration::from_millis(2);
/// SubDevices have this long to get to INIT in the end.
const STOP_LIMIT: Duration = Duration::from_secs(5);
/// The last events arrive within this time.
const LAST_EVENTS: Duration = Duration::from_millis(30);
/// A bus that is being brought up when the end comes is finished first, for this long at most: only then is it known
/// what to stop.
const BRING_UP_LIMIT: Duration = Duration::from_secs(20);

/// The program while it is one of two.
struct Controller<'a> {
    arguments: &'a StandbyArguments,
    end: EndRequest,
    until: Instant,
    supervisor: SupervisorThread,
    control: RoleControl,
    beats: Arc<Beats>,
    guarded: Guarded,
    interfaces: [String; 2],
    events: EventReport,
    /// The interface that leads to the other MainDevice.
    ethernet: Option<Ethernet>,
    /// Remote access, until the end.
    remote: Option<RemoteServer>,
    /// Switchovers on a schedule.
    schedule: Option<Schedule>,
}

/// Joins the ring, and runs cycles in the role that the policy gives.
pub fn run(arguments: &StandbyArguments) -> Result<Report, Failure> {
    let end = EndRequest::watch(arguments.thread.priority)?;
    let names = &arguments.links;
    names.check()?;
    let Some(redundant) = names.redundant.as_deref() else {
        return Err(Failure::new("one of two MainDevices has two interfaces: add --redundant"));
    };
    let network = arguments.declared.load(Some(true))?;
    if network.as_ref().is_some_and(|network| network.junctions().is_some()) {
        return Err(Failure::new("the file has rings behind junctions: not with two MainDevices"));
    }
    let thread = arguments.thread;
    let (cyclic, acyclic) = PacketLinks::open_forwarding_halves(&names.main, redundant, thread.mode())?;
    check_sockets(names.all(), arguments.force)?;
    let mut guarded = if arguments.no_guard {
        Guarded::unguarded()
    } else {
        Guarded::start(arguments.guard, thread.priority, [&names.main, redundant])?
    };
    let beats = Arc::new(Beats::default());
    let main = cyclic.addresses().main;
    let beating = |links, half| BeatingLinks::new(links, half, guarded.pulse(), guarded.look(), beats.clone());
    let interfaces = [names.main.clone(), redundant.to_owned()];
    let cyclic = beating(cyclic, Half::Cyclic).with_off_at_end(interfaces.clone());
    let acyclic = beating(acyclic, Half::Acyclic);
    let _awake = thread.prepare_process();
    let standby = StandbyOptions::default().with_max_acyclic(arguments.ethernet.max_acyclic());
    let standby = standby.with_sizes(arguments.sizes.sizes());
    let options = Options::default().with_standby(standby).with_pdos(pdos(network.as_ref()));
    let supervisor = SupervisorThread::start(acyclic, &options, move || thread.prepare_supervisor())?;
    let ethernet = arguments.ethernet.start(&supervisor, main)?;
    let control = supervisor.role_control()?;
    guarded.protect(&control);
    let remote = arguments.remote.start(&supervisor)?;
    let schedule = arguments.policy.switch_every.map(Schedule::new);
    // Nothing else sets it.
    let _ = beats.role.set(control.clone());
    let begin = now();
    let until = arguments.lasts.map_or(Instant::NEVER, |lasts| begin + lasts);
    let events = EventReport::new(begin);
    let controller = Controller {
        arguments,
        end,
        until,
        supervisor,
        control,
        beats,
        guarded,
        interfaces,
        events,
        ethernet,
        remote,
        schedule,
    };
    controller.run(network.map(Arc::new), cyclic)
}

impl Controller<'_> {
    fn run(mut self, network: Option<Arc<ConfiguredNetwork>>, cyclic: HalfLinks) -> Result<Report, Failure> {
        let arguments = self.arguments;
        let joiner = Joiner {
            supervisor: self.supervisor.clone(),
            policy: arguments.policy.policy(arguments.guard),
            declared: Arc::new(arguments.declared.clone()),
            network,
            thread: arguments.thread,
            partner_ready: Arc::new(AtomicBool::new(false)),
            beats: self.beats.clone(),
            names: self.events.names.clone(),
        };
        let ready = joiner.partner_ready.clone();
        let _off = OffAtEnd(self.interfaces.clone());
        self.interfaces.iter().try_for_each(|name| interface::switch(name, true))?;
        let joining = joiner.start(cyclic)?;
        say!(
            "INACTIVE: forwarding between {} and {}, listening; Ctrl-C ends it",
            self.interfaces[0],
            self.interfaces[1]
        );
        let Some(mut joined) = self.await_joined(joining)? else {
            self.guarded.end();
            let unguarded = self.switch_off()?;
            let reason = unguarded.unwrap_or_else(|| format!("no ACTIVE was followed: {}", self.cause()));
            return Ok(self.report(vec![reason], &Standby::default(), "inactive"));
        };
        self.events.seen.has_joined = true;
        self.events.say(now(), &format!("{}: cycles run", self.control.role()));
        self.watch(&mut joined);
        self.finish(joined.cycles, &ready)
    }

    /// Whether the time has come.
    fn is_over(&mut self) -> bool {
        self.guarded.note_acted(self.beats.has_acted.load(Ordering::Relaxed));
        self.guarded.check(now());
        if self.guarded.has_fault() {
            self.control.set_not_ready(NotReady::GUARD.0, true);
        }
        self.end.is_asked() || now() >= self.until || self.beats.has_acted.load(Ordering::Relaxed)
    }

    /// Whether the program ends because watchdogs of SubDevices are too short for a takeover (`--strict`).
    fn refuses_watchdogs(&self) -> bool {
        self.arguments.policy.strict && !self.events.short_watchdogs.is_empty()
    }

    /// Prints what has happened.
    fn report_events(&mut self) {
        self.events.report(&self.supervisor, now());
        if let Some(ethernet) = &mut self.ethernet {
            ethernet.report(&self.supervisor, &self.events, now());
        }
        let Some(schedule) = &mut self.schedule else { return };
        let (role, readiness) = (self.control.role(), self.control.readiness());
        let answers = (&mut self.events.refused, self.events.cause);
        let words = match schedule.step(now(), role, readiness, answers) {
            Some(Step::Request) => {
                self.events.cause = None;
                if !self.control.request_as(RoleRequest::HandOver, Requester::Schedule) {
                    // Another request takes effect first.
                    return schedule.again(now());
                }
                "switchover on schedule: the role is offered".to_owned()
            }
            Some(Step::Done(time)) => {
                format!("switchover on schedule: handed over within {:.3} ms", time.as_secs_f64() * 1e3)
            }
            Some(Step::Refused(why)) => format!("switchover on schedule REFUSED: {why}"),
            Some(Step::Withdraw) => {
                // The offer ends, and so does the request if it has not taken effect. Another request ends it as well.
                let _ = self.control.request_as(RoleRequest::Withdraw, Requester::Schedule);
                format!("switchover on schedule REFUSED: {NOT_TAKEN}, the offer is withdrawn")
            }
            None => return,
        };
        self.events.say(now(), &words);
    }

    /// Why it ends, in words.
    fn cause(&self) -> String {
        self.end.by().map_or_else(|| "the time was over".to_owned(), |by| format!("ended by {by}"))
    }

    /// Prints events until cycles run; `None` if the end comes before, as INACTIVE.
    fn await_joined(&mut self, joining: JoinHandle<Result<Joined, Failure>>) -> Result<Option<Joined>, Failure> {
        let mut limit = None;
        while !joining.is_finished() {
            self.report_events();
            if self.is_over() {
                let is_late = now() >= *limit.get_or_insert_with(|| now() + BRING_UP_LIMIT);
                if is_late
                    || self.control.role() != MainDeviceRole::Active
                    || self.beats.has_acted.load(Ordering::Relaxed)
                {
                    return Ok(None);
                }
            }
            sleep(LOOK);
        }
        match joining.join() {
            Ok(joined) => joined.map(Some),
            Err(_) => Err(Failure::new("the thread that joins the ring has panicked")),
        }
    }

    /// Prints events until the end comes.
    fn watch(&mut self, joined: &mut Joined) {
        let mut in_op = false;
        while !self.is_over() && !self.refuses_watchdogs() && !joined.cycles.has_ended() {
            self.report_events();
            joined.watched.changes(now()).iter().for_each(|line| self.events.say(now(), line));
            let settled = self.supervisor.all_settled();
            if settled && !in_op {
                let role = self.control.role();
                self.events.say(now(), &format!("{role}: all SubDevices are in OP"));
            }
            in_op = settled;
            sleep(LOOK);
        }
    }

    /// Hands the role over, if the other MainDevice is ready for it. The reason, if it is refused.
    fn hand_over(&mut self, ready: &AtomicBool) -> Option<String> {
        if self.control.role() != MainDeviceRole::Active || !ready.load(Ordering::Relaxed) {
            return None;
        }
        self.events.refused = None;
        self.control.request(RoleRequest::HandOver);
        let limit = now() + HAND_OVER_LIMIT;
        while self.control.role() == MainDeviceRole::Active && self.events.refused.is_none() && now() < limit {
            self.events.report(&self.supervisor, now());
            sleep(LOOK);
        }
        self.events.seen.handed_over = self.control.role() != MainDeviceRole::Active;
        if self.events.seen.handed_over {
            // Frames of the new ACTIVE arrive before this one leaves.
            sleep(LAST_EVENTS);
            self.events.report(&self.supervisor, now());
            return None;
        }
        let refused = self.events.refused.take();
        Some(refused.unwrap_or_else(|| NOT_TAKEN.to_owned()))
    }

    /// Ends the cycles in order.
    fn finish(mut self, cycles: CyclicThread<HalfLinks>, ready: &AtomicBool) -> Result<Report, Failure> {
        self.remote = None;
        self.events.report(&self.supervisor, now());
        self.events.seen.not_ready = self.control.readiness().reasons().collect();
        let switchovers = self.schedule.as_ref().map(Schedule::seen);
        let mut reasons: Vec<String> = self.end.cut_short(self.arguments.lasts).into_iter().collect();
        let refused = switchovers.as_ref().map_or(0, |seen| seen.refused);
        reasons.extend((refused > 0).then(|| format!("switchovers on schedule that were refused: {refused}")));
        self.events.seen.switchovers = switchovers;
        let role = self.control.role();
        self.events.seen.partner_ready = role == MainDeviceRole::Active && ready.load(Ordering::Relaxed);
        let has_acted = self.beats.has_acted.load(Ordering::Relaxed);
        if role == MainDeviceRole::Active {
            reasons.extend(self.not_in_op());
        }
        if !has_acted && !cycles.has_ended() {
            reasons.extend(self.hand_over(ready));
        }
        self.guarded.end();
        let is_active = self.control.role() == MainDeviceRole::Active;
        if !is_active {
            // Cycles forward until the interfaces are off.
            self.off()?;
        }
        let application = cycles.end().unwrap_or_else(|panicked| {
            reasons.push(panicked.to_string());
            panicked.application
        });
        let counters = application.forwarded();
        if is_active && !has_acted {
            match application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT) {
                Ok(_) => {
                    self.events.seen.stopped = true;
                    say!("stopped: outputs zero, all SubDevices in INIT");
                }
                Err(error) => reasons.push(error.to_string()),
            }
        }
        self.events.report(&self.supervisor, now());
        reasons.extend(self.switch_off()?);
        if self.arguments.policy.strict {
            reasons.append(&mut self.events.short_watchdogs);
        }
        reasons.extend(self.events.reasons());
        reasons.extend(same_identity(&counters));
        say!("{}", in_line(&counters));
        self.ethernet.iter().for_each(Ethernet::summary);
        let role = if role == MainDeviceRole::Active { "active" } else { "inactive" };
        Ok(self.report(reasons, &Standby::from(&counters), role))
    }

    /// SubDevices that are not in OP, in words.
    fn not_in_op(&self) -> Option<String> {
        let states = self.supervisor.states();
        let others = states.iter().filter(|state| **state != SubDeviceState::Settled(AlState::Op)).count();
        (others > 0).then(|| format!("{others} of {} SubDevices were not in OP at the end", states.len()))
    }

    fn off(&self) -> Result<(), Failure> {
        let switched = self.interfaces.iter().map(|name| interface::switch(name, false));
        Ok(switched.fold(Ok(()), Result::and)?)
    }

    /// Switches both interfaces off; why this program was not guarded as it should be.
    fn switch_off(&mut self) -> Result<Option<String>, Failure> {
        self.off()?;
        say!("{} and {} are switched off", self.interfaces[0], self.interfaces[1]);
        Ok(std::mem::replace(&mut self.guarded, Guarded::none()).release())
    }

    fn report(mut self, reasons: Vec<String>, standby: &Standby, role: &'static str) -> Report {
        self.events.seen.role = role;
        let seen = self.events.seen.clone();
        let end = match (role, seen.handed_over) {
            ("active", true) => "handed the role over",
            ("active", false) => "stopped the bus as ACTIVE",
            _ => "left as INACTIVE",
        };
        let verdict = Verdict::of(reasons, format!("{end}, takeovers: {}", seen.takeovers));
        let data = Standby { takeover: Some(seen), ..standby.clone() };
        Report { verdict, data: Data::Standby(data) }
    }
}
