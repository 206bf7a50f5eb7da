//! One SubDevice controller (ESC), register by register (protocol 2, 3, 4.7, 11.4).
//!
//! Input: frames at ports, link changes, accesses of the application, virtual time. Output: frames at ports, events for
//! the application, deadlines. The network moves frames between controllers; controller and application together are a
//! device. Not modelled: MII management, emulated EEPROMs, loops closed by enhanced link detection (see
//! docs/segments.md).
//!
//! A frame is processed when its last bit has arrived. It passes its whole internal path at once: 0-(EPU)-3-1-2 up to
//! the next open port. Autonomous changes (watchdogs, busy EEPROM, temporary loops) are computed at the next access, so
//! that idle controllers need no computing time.

mod access;
mod clock;
mod clock_registers;
mod compiled;
mod config;
mod counters;
mod event_bits;
mod events;
mod fmmu;
mod logical_log;
mod memory;
mod pass;
mod pdi;
mod ports;
mod processing;
mod registers;
mod reset;
mod sii;
mod spoilt_write;
mod sync_manager;
mod sync_unit;
mod watchdog;

pub use clock::{ClockErrors, Wander};
pub use clock_registers::LatchPin;
pub use config::{ControllerConfig, MAX_UNITS};
pub use logical_log::{LogicalAccess, Moved};
pub use spoilt_write::SpoiltWrite;

use ringcat_wire::address::RegisterAddress;
use ringcat_wire::register::{LoopControl, map};

use crate::frame::{Fcs, Port, SimFrame};
use crate::time::SimTime;
use clock::Clock;
use compiled::Compiled;
use event_bits::EVENT_PROCESS_DATA_WATCHDOG;
use fmmu::Fmmus;
use logical_log::LogicalLog;
use memory::Memory;
use pass::Pass;
use ports::Ports;
use sii::SiiInterface;
use sync_manager::SyncManagers;
use sync_unit::{LatchUnit, SyncUnit};
use watchdog::Watchdog;

/// Result for a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Passage {
    /// The frame leaves through this port. If the port is forced open without a link, the frame is lost.
    Leaves {
        /// The port.
        port: Port,
        /// Whether the frame passed the processing unit.
        processed: bool,
    },
    /// The frame is destroyed.
    Destroyed,
}

/// Exit of frames that enter at a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct InternalPath {
    pub exit: Port,
    /// Whether frames pass the processing unit.
    pub processed: bool,
    /// Valid while [`Controller::stays`] returns true.
    pub port_changes: u32,
}

/// A SubDevice controller.
#[derive(Clone, Debug)]
pub struct Controller {
    config: ControllerConfig,
    powered: bool,
    starts: u32,
    memory: Memory,
    ports: Ports,
    fmmus: Fmmus,
    compiled: Compiled,
    sync_managers: SyncManagers,
    process_data_watchdog: Watchdog,
    pdi_watchdog: Watchdog,
    sii: SiiInterface,
    clock: Clock,
    sync_unit: SyncUnit,
    latch_units: [LatchUnit; 2],
    pass: Pass,
    /// Loop settings as last written, and the settings restored at the end of temporary ones.
    lasting_loops: [LoopControl; 4],
    temporary_loops: Option<(SimTime, [LoopControl; 4])>,
    /// The frame that wrote the last letter of the reset sequence.
    reset_frame: Option<u64>,
    /// STATION_ADDRESS and the alias bit, cached for every datagram.
    station: u16,
    alias_enabled: bool,
    /// Bit 0 of DL_CONTROL, cached for every frame.
    forwarding_rule: bool,
    /// ECAT events that are not masked.
    irq: u16,
    /// Time of the next autonomous change.
    deadline: SimTime,
    /// Counter of updates of the deadline.
    schedules: u32,
    /// Logical datagrams that were answered, if a checker needs them.
    logical_log: LogicalLog,
}

impl Controller {
    /// A controller without power and without links.
    pub fn new(config: ControllerConfig) -> Controller {
        Controller {
            powered: false,
            starts: 0,
            memory: Memory::new(&config),
            ports: Ports::new(config.ports),
            fmmus: Fmmus::default(),
            compiled: Compiled::default(),
            sync_managers: SyncManagers::new(config.sync_manager_count.min(MAX_UNITS)),
            process_data_watchdog: Watchdog::new(),
            pdi_watchdog: Watchdog::new(),
            sii: SiiInterface::new(),
            clock: Clock::new(config.clock_start, config.clock_errors),
            sync_unit: SyncUnit::default(),
            latch_units: [LatchUnit::default(); 2],
            pass: Pass::new(),
            lasting_loops: [LoopControl::Auto; 4],
            temporary_loops: None,
            reset_frame: None,
            station: 0,
            alias_enabled: false,
            forwarding_rule: true,
            irq: 0,
            deadline: SimTime::NEVER,
            schedules: 0,
            logical_log: LogicalLog::default(),
            config,
        }
    }

    /// The configuration of the controller.
    pub fn config(&self) -> &ControllerConfig {
        &self.config
    }

    /// Starts the log of logical datagrams that the SubDevice processes.
    pub fn log_logical(&mut self) {
        self.logical_log.turn_on();
    }

    /// Whether logical datagrams are logged.
    pub fn logs_logical(&self) -> bool {
        self.logical_log.is_on()
    }

    /// The newest logical datagrams that the SubDevice processed, oldest first; none without the log.
    pub fn logical_accesses(&self) -> impl Iterator<Item = &LogicalAccess> {
        self.logical_log.accesses()
    }

    /// Sets the result of the link detection of a port. Without power no link is detected.
    pub fn link_changed(&mut self, port: Port, up: bool, now: SimTime) {
        if !self.powered {
            return;
        }
        self.catch_up(now);
        if self.ports.set_link(port, up) {
            self.memory.count(map::LOST_LINK_COUNTER.offset(port.index() as u16));
        }
        self.refresh_dl_status();
    }

    /// Processes a frame whose last bit arrived at `port` at `now`, and returns its exit.
    pub fn receive(&mut self, frame: &mut SimFrame, port: Port, now: SimTime) -> Passage {
        self.receive_between(frame, port, now.back_ns(frame.first_to_last_bit_ns()), now)
    }

    /// [`Controller::receive`] with a known arrival of the first bit.
    #[inline]
    pub(crate) fn receive_between(
        &mut self,
        frame: &mut SimFrame,
        port: Port,
        first_bit: SimTime,
        now: SimTime,
    ) -> Passage {
        if !self.powered || !self.ports.link(port) {
            return Passage::Destroyed;
        }
        self.catch_up(now);
        let good = frame.fcs == Fcs::Good;
        self.count_damage(frame, port);
        let returns = self.ports.closed_by(port, frame.id);
        if !self.ports.passes(port) && !returns {
            if good && self.ports.reopen(port) {
                self.refresh_dl_status();
            }
            return Passage::Destroyed;
        }
        if self.clock.arrived(port, frame.id, first_bit) && good {
            self.store_receive_time(port, first_bit);
        }
        self.travel(frame, port, returns, first_bit, now)
    }

    /// Path 0-(EPU)-3-1-2 from `entry` to the next open port; a frame that closed its entry port itself also leaves
    /// through it.
    fn travel(
        &mut self,
        frame: &mut SimFrame,
        entry: Port,
        returns: bool,
        first_bit: SimTime,
        now: SimTime,
    ) -> Passage {
        // Changes of ports by the frame itself affect only later frames.
        let passing = self.ports.passing() | u8::from(returns) << entry.index();
        let mut processed = false;
        let mut at = entry;
        loop {
            if at == Port::A {
                if processed || !self.process(frame, first_bit, now) {
                    return Passage::Destroyed;
                }
                processed = true;
            }
            at = ports::next(at);
            if passing & 1 << at.index() != 0 {
                return Passage::Leaves { port: at, processed };
            }
        }
    }

    /// The path of frames that enter at a port, if it is the same for all of them; `None` if the controller breaks
    /// circulation.
    pub(crate) fn internal_path(&self, entry: Port) -> Option<InternalPath> {
        let open = self.powered && self.ports.link(entry) && self.ports.passes(entry);
        if !open || self.ports.breaks_circulation() || self.fmmus.reach_registers() {
            return None;
        }
        let (mut at, mut processed) = (entry, false);
        loop {
            if at == Port::A {
                if processed {
                    return None;
                }
                processed = true;
            }
            at = ports::next(at);
            if self.ports.passes(at) {
                return Some(InternalPath { exit: at, processed, port_changes: self.ports.changes() });
            }
        }
    }

    /// Whether a frame that enters at a port may pass the processing unit.
    pub(crate) fn may_process(&self, entry: Port) -> bool {
        entry == Port::A || !self.ports.passes(Port::A)
    }

    /// Whether a frame that enters at a port reaches the processing unit without leaving before: all loops on the path
    /// to it are closed.
    pub(crate) fn returns_to_unit(&self, entry: Port) -> bool {
        let mut at = entry;
        while at != Port::A {
            at = ports::next(at);
            if self.ports.passes(at) {
                return false;
            }
        }
        entry != Port::A
    }

    /// Whether ports and all other properties stay unchanged up to and including a time, without external access.
    #[inline]
    pub(crate) fn stays(&self, port_changes: u32, until: SimTime) -> bool {
        self.ports.changes() == port_changes && self.deadline > until
    }

    /// See [`InternalPath`].
    pub(crate) fn port_changes(&self) -> u32 {
        self.ports.changes()
    }

    /// Processes a good frame on a path found by [`Controller::internal_path`].
    #[inline]
    pub(crate) fn process_on_path(&mut self, frame: &mut SimFrame, first_bit: SimTime, now: SimTime) {
        let goes_on = self.process(frame, first_bit, now);
        debug_assert!(goes_on, "internal paths break no circulation");
    }

    /// Whether the loop of a port is closed, as DL status shows it.
    pub fn loop_closed(&self, port: Port) -> bool {
        self.ports.loop_closed(port)
    }

    /// Time of the next autonomous change that requires a reaction of the application: a watchdog expires, or the
    /// EEPROM is loaded or has finished a command of the PDI.
    pub fn next_deadline(&self) -> Option<SimTime> {
        let sii = self.sii.is_loading() || self.sii_owned_by_pdi();
        let sii = if sii { self.sii.deadline() } else { SimTime::NEVER };
        let next = sii.min(self.process_data_watchdog.deadline()).min(self.pdi_watchdog.deadline());
        (self.powered && next != SimTime::NEVER).then_some(next)
    }

    /// Applies all autonomous changes up to now.
    pub fn tick(&mut self, now: SimTime) {
        if !self.powered {
            return;
        }
        if now >= self.sii.deadline() {
            self.finish_sii_task();
        }
        if self.process_data_watchdog.expire(now) {
            self.memory.count(map::WATCHDOG_COUNTER_PROCESS_DATA);
            self.set_al_event(EVENT_PROCESS_DATA_WATCHDOG);
            self.refresh_watchdog_status();
        }
        if self.pdi_watchdog.expire(now) {
            self.memory.count(map::WATCHDOG_COUNTER_PDI);
            self.refresh_dl_status();
        }
        if self.temporary_loops.is_some_and(|(until, _)| now >= until) {
            self.end_temporary_loops();
        }
        self.schedule();
    }

    /// Counter of updates: equal counters mean an equal [`Controller::next_deadline`].
    pub(crate) fn schedules(&self) -> u32 {
        self.schedules
    }

    /// Applies due changes.
    pub(crate) fn catch_up(&mut self, now: SimTime) {
        if now >= self.deadline {
            self.tick(now);
        }
    }

    /// Computes the time of the next autonomous change.
    fn schedule(&mut self) {
        self.schedules = self.schedules.wrapping_add(1);
        let loops = self.temporary_loops.map_or(SimTime::NEVER, |(until, _)| until);
        self.deadline = (self.sii.deadline())
            .min(self.process_data_watchdog.deadline())
            .min(self.pdi_watchdog.deadline())
            .min(loops);
    }

    /// The local clock in nanoseconds (protocol 3.12).
    pub fn local_time(&self, now: SimTime) -> u64 {
        self.clock.local(now)
    }

    /// Registers and RAM without side effects of reading; values computed on reads may be outdated. Empty if the range
    /// exceeds the address space.
    pub fn register(&self, address: RegisterAddress, len: usize) -> &[u8] {
        self.memory.span(address.0.into(), len)
    }
}

#[cfg(test)]
mod tests;
