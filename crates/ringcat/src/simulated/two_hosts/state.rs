//! Which one runs now: the caller, or the program of one of two hosts.
//!
//! In: until when each of them waits. Out: which of them is next; virtual time has then reached its moment. Of several
//! with one moment the caller is first, then the first host.

use std::any::Any;
use std::collections::VecDeque;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use ringcat_engine::link::Link;
use ringcat_sim::cable::Host;
use ringcat_sim::host::Received;
use ringcat_sim::host::program::{TurnAround, TurnArounds};
use ringcat_sim::network::{HostCondition, Network};
use ringcat_sim::time::SimTime;

/// Frames that wait for a program, as in the rings of two sockets with all classes of frames. Further ones are lost.
const RING: usize = 512;

/// What has a turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Turn {
    Caller,
    Host(Host),
}

impl Turn {
    const fn index(self) -> usize {
        match self {
            Turn::Caller => 2,
            Turn::Host(host) => host as usize,
        }
    }
}

/// What the program of a host does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Program {
    /// The host has no program.
    None,
    /// It has the turn, or will have it.
    Runs,
    /// It waits for a time.
    Sleeps(SimTime),
    /// It waits for a frame, at most until a time.
    Listens(SimTime),
}

/// What takes the links of a host down when its program does not run any more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Guard {
    None,
    /// It acts when the program has not run for this time.
    Armed(Duration),
    /// It has acted: what the program sends does not leave.
    HasActed,
}

/// One host.
#[derive(Debug)]
pub(super) struct Slot {
    pub program: Program,
    /// The program ends where it is, and sends nothing more.
    pub is_killed: bool,
    /// When the last program ended.
    pub ended_at: SimTime,
    pub guard: Guard,
    pub turn_around: TurnArounds,
    pub arrived: VecDeque<(Link, Received)>,
    /// Frames that found no room.
    pub overruns: u64,
    /// The panic of the program.
    pub panic: Option<Box<dyn Any + Send>>,
}

/// The segment and the hosts.
#[derive(Debug)]
pub(super) struct State {
    pub network: Network,
    pub slots: [Slot; 2],
    pub caller_until: SimTime,
    turn: Turn,
}

/// The same for the threads of all programs.
#[derive(Debug)]
pub(super) struct Shared {
    state: Mutex<State>,
    turns: [Condvar; 3],
}

impl Shared {
    pub(super) fn new(network: Network) -> Shared {
        let seed = network.options().seed;
        let slot = |host: Host| Slot {
            program: Program::None,
            is_killed: false,
            ended_at: SimTime::ZERO,
            guard: Guard::None,
            turn_around: TurnArounds::new(TurnAround::default(), seed ^ (host as u64 + 1)),
            arrived: VecDeque::with_capacity(RING),
            overruns: 0,
            panic: None,
        };
        let now = network.now();
        let state = State { network, slots: Host::ALL.map(slot), caller_until: now, turn: Turn::Caller };
        Shared { state: Mutex::new(state), turns: Default::default() }
    }

    pub(super) fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the turn to the next one, and waits until it is back.
    pub(super) fn take_turns<'a>(&'a self, state: MutexGuard<'a, State>, me: Turn) -> MutexGuard<'a, State> {
        let mut state = state;
        let next = state.proceed();
        self.give(&mut state, next);
        self.await_turn(state, me)
    }

    /// Gives the turn away.
    pub(super) fn give(&self, state: &mut State, next: Turn) {
        state.turn = next;
        self.turns[next.index()].notify_one();
    }

    /// Waits for the turn.
    pub(super) fn await_turn<'a>(&'a self, state: MutexGuard<'a, State>, me: Turn) -> MutexGuard<'a, State> {
        let mut state = state;
        while state.turn != me {
            state = self.turns[me.index()].wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        state
    }
}

impl State {
    pub(super) fn slot(&mut self, host: Host) -> &mut Slot {
        &mut self.slots[host as usize]
    }

    /// The program of a host has ended.
    pub(super) fn end(&mut self, host: Host, panic: Option<Box<dyn Any + Send>>) {
        let now = self.network.now();
        if panic.is_some() {
            self.caller_until = now;
        }
        let slot = self.slot(host);
        (slot.program, slot.is_killed, slot.ended_at, slot.panic) = (Program::None, false, now, panic);
    }

    /// Lets time pass up to the moment of the next one.
    pub(super) fn proceed(&mut self) -> Turn {
        loop {
            self.collect();
            self.guard();
            let now = self.network.now();
            let (turn, at) = self.next();
            if at <= now {
                return turn;
            }
            self.network.advance_until_received(at.min(self.guard_due()));
        }
    }

    /// Takes what the interfaces have received.
    fn collect(&mut self) {
        let State { network, slots, .. } = self;
        for host in Host::ALL {
            let (slot, condition) = (&mut slots[host as usize], network.condition(host));
            if condition == HostCondition::Off {
                slot.is_killed |= slot.program != Program::None;
                slot.arrived.clear();
            }
            if condition != HostCondition::Runs {
                continue;
            }
            for (link, from) in Link::ALL.into_iter().zip(host.links()) {
                while let Some(received) = network.receive(from) {
                    if let Err(lost) = slot.take(link, received) {
                        network.give_back(lost.bytes);
                    }
                }
            }
        }
    }

    /// The guards that are due act.
    fn guard(&mut self) {
        for host in Host::ALL {
            if self.guard_due_of(host) <= self.network.now() {
                self.slot(host).guard = Guard::HasActed;
                host.links().into_iter().for_each(|link| self.network.disconnect(link, true));
            }
        }
    }

    /// When the next guard acts.
    fn guard_due(&self) -> SimTime {
        Host::ALL.into_iter().map(|host| self.guard_due_of(host)).min().unwrap_or(SimTime::NEVER)
    }

    fn guard_due_of(&self, host: Host) -> SimTime {
        let slot = &self.slots[host as usize];
        let Guard::Armed(limit) = slot.guard else { return SimTime::NEVER };
        match self.network.condition(host) {
            HostCondition::Off => SimTime::NEVER,
            HostCondition::Stopped => self.network.condition_since(host) + limit,
            HostCondition::Runs if slot.program == Program::None => slot.ended_at + limit,
            HostCondition::Runs => SimTime::NEVER,
        }
    }

    /// What is next, and when.
    fn next(&self) -> (Turn, SimTime) {
        let mut next = (Turn::Caller, self.caller_until);
        for host in Host::ALL {
            let slot = &self.slots[host as usize];
            if slot.is_killed && slot.program != Program::None {
                return (Turn::Host(host), SimTime::ZERO);
            }
            let at = match slot.program {
                Program::None => continue,
                Program::Runs => self.network.now(),
                Program::Sleeps(at) | Program::Listens(at) => at,
            };
            if self.network.condition(host) == HostCondition::Runs && at < next.1 {
                next = (Turn::Host(host), at);
            }
        }
        next
    }
}

impl Slot {
    /// A frame arrives: a program that listens reacts to it after its turn-around time.
    fn take(&mut self, link: Link, received: Received) -> Result<(), Received> {
        if self.program == Program::None || self.arrived.len() == RING {
            self.overruns += u64::from(self.program != Program::None);
            return Err(received);
        }
        if let Program::Listens(until) = &mut self.program {
            *until = (*until).min(received.at + self.turn_around.next_time());
        }
        self.arrived.push_back((link, received));
        Ok(())
    }
}
