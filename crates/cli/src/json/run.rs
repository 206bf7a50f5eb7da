//! What `ringcat run --json` prints.

use serde::Serialize;

use super::clocks::Clocks;
use super::values::{Ring, State, Times};

/// An exchange of process data.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Run {
    /// Cycle time, in nanoseconds
    pub cycle_ns: u64,
    /// Whether all SubDevices reached OP, and all clocks their lock, within --within
    pub reached_op: bool,
    /// States of the declared SubDevices at the end of the exchange, before they are stopped
    pub states: Vec<State>,
    /// State of the ring then; null with one interface
    pub ring: Option<Ring>,
    /// The cycles
    pub cycles: Cycles,
    /// Frames with process data
    pub process_data: ProcessData,
    /// SubDevices of which not all process data is sent again with a lost frame (--resend always)
    pub sent_once: Vec<SentOnce>,
    /// Frames with everything else
    pub acyclic: Acyclic,
    /// From sending a frame to the arrival of a copy; null where none arrived since OP was reached
    pub round_trips: Option<Times>,
    /// Delays of cycles after the time at which they should begin; null without a cycle since OP was reached
    pub wake_ups: Option<Times>,
    /// Jobs of the cycles with their times, in the order of a cycle (--jobs)
    pub jobs: Vec<Job>,
    /// The distributed clocks; null where they are not in use
    pub clocks: Option<Clocks>,
    /// Frames of the interfaces with process data; empty where the stop failed
    pub interfaces: Vec<Interface>,
    /// Network interfaces for EoE (--eoe)
    pub ethernet: Vec<Ethernet>,
    /// The mailbox gateway; null without --gateway
    pub gateway: Option<Gateway>,
    /// Variables of the ENI (--watch)
    pub variables: Vec<Variable>,
    /// Whether all SubDevices were stopped: outputs zero, then INIT
    pub stopped: bool,
}

/// Times of a job of the cycles.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Job {
    /// `receive`, `process`, `work`, `queue` or `send`
    pub job: &'static str,
    /// Mean, in nanoseconds
    pub mean_ns: u64,
    /// Their distribution; null where it never ran
    pub times: Option<Times>,
}

/// Cycles.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Cycles {
    /// Cycles that began
    pub count: u64,
    /// Incomplete cycles
    pub incomplete: u64,
    /// Cycles whose frames were still out when the next one was due
    pub frames_still_out: u64,
    /// Cycles that this machine left out
    pub left_out: u64,
    /// Wake-ups of this machine that came late
    pub late_wake_ups: u64,
    /// The latest of them, in nanoseconds
    pub longest_delay_ns: u64,
    /// Cycles that began later, so that propagation delays could be measured on an empty wire
    pub postponed: u64,
}

/// Frames with process data.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct ProcessData {
    /// Frames that were sent
    pub sent_frames: u64,
    /// Frames that did not come back
    pub missing_frames: u64,
    /// Frames that came back after their time
    pub late_frames: u64,
    /// Frames that came back damaged
    pub damaged_frames: u64,
    /// Copies lost of frames whose other copy came
    pub lost_copies: u64,
    /// Copies that came after their time
    pub late_copies: u64,
    /// Copies that came damaged
    pub damaged_copies: u64,
    /// Frames of other MainDevices
    pub foreign_frames: u64,
    /// Frames that were sent again within their cycle, once for each further try; `sent_frames` includes them
    pub resent_frames: u64,
    /// Cycles that are complete because a frame was sent again
    pub saved_cycles: u64,
}

/// A SubDevice of which not all process data is sent again with a lost frame.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct SentOnce {
    /// Index in the declaration, from 0
    pub subdevice: usize,
    /// Its name
    pub name: String,
    /// What is sent once, and why
    pub reason: String,
}

/// Frames with everything else.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Acyclic {
    /// Frames that were sent
    pub sent_frames: u64,
    /// Frames that did not come back in time
    pub lost_frames: u64,
    /// Copies lost of frames whose other copy came
    pub lost_copies: u64,
    /// Copies that came after their time
    pub late_copies: u64,
    /// Datagrams in these frames
    pub datagrams: u64,
    /// How many of them were sent again
    pub resent_datagrams: u64,
    /// Mailbox messages that arrived when no read waited for them, and were dropped
    pub dropped_mails: u64,
    /// Frames of other MainDevices
    pub foreign_frames: u64,
}

/// What an interface has carried for process data.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Interface {
    /// `main` or `redundant`
    pub link: &'static str,
    /// Name of the network interface
    pub interface: String,
    /// Frames that left
    pub sent_frames: u64,
    /// Frames that arrived
    pub received_frames: u64,
    /// Frames that found the receive ring full
    pub overrun_frames: u64,
    /// Frames that were not sent: the interface was down, its queue full, or it refused them
    pub unsent_frames: u64,
}

/// A network interface for EoE.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Ethernet {
    /// Its name
    pub interface: String,
    /// Index of the SubDevice in the declaration
    pub subdevice: usize,
    /// Frames to the SubDevice
    pub sent_frames: u64,
    /// Their bytes
    pub sent_bytes: u64,
    /// Frames to the SubDevice that were dropped
    pub dropped_frames: u64,
    /// Frames from the SubDevice
    pub received_frames: u64,
    /// Their bytes
    pub received_bytes: u64,
    /// Frames from the SubDevice that were incomplete or malformed
    pub incomplete_frames: u64,
    /// Frames from the SubDevice that found the queue full
    pub overrun_frames: u64,
    /// Frames that the host did not take
    pub refused_frames: u64,
}

/// The mailbox gateway.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Gateway {
    /// Connections
    pub connections: u64,
    /// Connections that the gateway closed
    pub closed_connections: u64,
    /// Messages of clients
    pub messages: u64,
    /// Answers to clients
    pub answers: u64,
    /// Messages that were refused or malformed
    pub refused_messages: u64,
    /// Messages without an answer
    pub unanswered_messages: u64,
    /// Transfers that were ended because their client is gone
    pub ended_transfers: u64,
}

/// A variable of an ENI.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub struct Variable {
    /// Its name in the file
    pub name: String,
    /// Its last value, as its type writes it
    pub value: String,
}
