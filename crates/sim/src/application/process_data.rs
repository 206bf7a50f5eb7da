//! Process data of a simulated SubDevice: reads outputs from the SyncManagers, writes inputs to them.
//!
//! Input: the checked areas ([`Layout`]), AL events, virtual time. Output: the valid outputs (zero in the safe state)
//! and inputs in the buffers. The state machine decides whether outputs may be used.

use ringcat_wire::address::RegisterAddress;

use super::behaviours::{Behaviour, InputSource};
use super::dictionary::Dictionary;
use super::mapping::Mapping;
use super::servo::Servo;
use super::settings::{Area, Layout};
use crate::controller::Controller;
use crate::time::SimTime;

/// Bit of SyncManager 0 in AL_EVENT (protocol 3.5).
const SYNC_MANAGER_EVENT_SHIFT: u32 = 8;

/// The bit of a SyncManager in AL_EVENT.
pub const fn event_bit(sync_manager: u8) -> u32 {
    1 << (SYNC_MANAGER_EVENT_SHIFT + sync_manager as u32)
}

/// Source of the inputs.
#[derive(Clone, Debug)]
enum Source {
    Terminal(InputSource),
    Servo(Box<Servo>),
}

/// Images, areas and event counts.
#[derive(Clone, Debug)]
pub struct ProcessData {
    layout: Layout,
    output_mapping: Mapping,
    input_mapping: Mapping,
    received: Vec<u8>,
    /// Previously received outputs.
    before: Vec<u8>,
    outputs: Vec<u8>,
    inputs: Vec<u8>,
    source: Source,
    latched: u64,
    seen: bool,
}

impl ProcessData {
    /// Nothing mapped yet.
    pub fn new(behaviour: &Behaviour) -> ProcessData {
        let source = match behaviour {
            Behaviour::Terminal(source) => Source::Terminal(source.clone()),
            Behaviour::Servo => Source::Servo(Box::default()),
        };
        ProcessData {
            layout: Layout::default(),
            output_mapping: Mapping::default(),
            input_mapping: Mapping::default(),
            received: Vec::new(),
            before: Vec::new(),
            outputs: Vec::new(),
            inputs: Vec::new(),
            source,
            latched: 0,
            seen: false,
        }
    }

    /// Valid outputs, zero in the safe state, empty below SAFEOP.
    pub fn outputs(&self) -> &[u8] {
        &self.outputs
    }

    /// Inputs as last written to the SyncManagers, empty below SAFEOP.
    pub fn inputs(&self) -> &[u8] {
        &self.inputs
    }

    /// Number of times that outputs were latched in OP.
    pub const fn latched(&self) -> u64 {
        self.latched
    }

    /// Whether outputs were received since SAFEOP was entered, or there are none.
    pub fn outputs_seen(&self) -> bool {
        self.seen || !self.layout.outputs.iter().any(|area| area.event)
    }

    /// Whether missing outputs trip the watchdog.
    pub fn is_watched(&self) -> bool {
        self.layout.outputs.iter().any(|area| area.watchdog)
    }

    /// The areas in use.
    pub const fn layout(&self) -> &Layout {
        &self.layout
    }

    /// The drive, if the device is a drive.
    pub const fn servo(&self) -> Option<&Servo> {
        match &self.source {
            Source::Servo(servo) => Some(servo),
            Source::Terminal(_) => None,
        }
    }

    /// Current value of an object that is mapped or computed by the drive.
    pub fn value(&self, index: u16, sub_index: u8) -> Option<u64> {
        let output = || self.output_mapping.value(index, sub_index, &self.outputs);
        let mapped = self.input_mapping.value(index, sub_index, &self.inputs).or_else(output);
        mapped.or_else(|| self.servo().and_then(|servo| servo.value(index, sub_index)))
    }

    /// Whether the object is part of the outputs.
    pub fn is_output(&self, index: u16, sub_index: u8) -> bool {
        self.output_mapping.find(index, sub_index).is_some()
    }

    /// AL events that require an exchange.
    pub fn events(&self) -> u32 {
        let outputs = self.layout.outputs.iter().filter(|area| area.event);
        let inputs = self.layout.inputs.iter().filter(|area| area.event && self.is_rewritten(area));
        outputs.chain(inputs).fold(0, |mask, area| mask | event_bit(area.sync_manager))
    }

    /// Whether a SyncManager raises no event and has to be checked after each frame.
    pub fn is_polled(&self) -> bool {
        let mut inputs = self.layout.inputs.iter().filter(|area| self.is_rewritten(area));
        self.layout.outputs.iter().any(|area| !area.event) || inputs.any(|area| !area.event)
    }

    /// Whether inputs are written again after they were read: because they vary, or because the only buffer is empty.
    fn is_rewritten(&self, area: &Area) -> bool {
        self.varies() || area.one_buffer
    }

    fn varies(&self) -> bool {
        match &self.source {
            Source::Terminal(source) => source.varies_with_time(),
            Source::Servo(_) => true,
        }
    }

    /// Starts the process data, with outputs in the safe state.
    pub fn start(&mut self, layout: Layout, dictionary: &Dictionary, controller: &mut Controller, now: SimTime) {
        let total = |areas: &[Area]| areas.iter().map(|area| usize::from(area.length)).sum::<usize>();
        self.output_mapping = Mapping::new(&layout.outputs, dictionary);
        self.input_mapping = Mapping::new(&layout.inputs, dictionary);
        self.received = vec![0; total(&layout.outputs)];
        self.outputs = vec![0; total(&layout.outputs)];
        self.inputs = vec![0; total(&layout.inputs)];
        self.layout = layout;
        self.seen = false;
        self.refresh(controller, now);
    }

    /// Stops the process data.
    pub fn stop(&mut self, now: SimTime) {
        self.outputs.fill(0);
        self.release_drive(now);
        self.layout = Layout::default();
        self.output_mapping = Mapping::default();
        self.input_mapping = Mapping::default();
        self.received.clear();
        self.outputs.clear();
        self.inputs.clear();
        self.seen = false;
    }

    /// Sets outputs to the safe state.
    pub fn make_safe(&mut self, controller: &mut Controller, now: SimTime) {
        self.outputs.fill(0);
        self.received.fill(0);
        self.seen = false;
        self.release_drive(now);
        self.refresh(controller, now);
    }

    /// Restarts a drive after power-on.
    pub fn power_on(&mut self, now: SimTime) {
        if let Source::Servo(servo) = &mut self.source {
            servo.power_on(now);
        }
    }

    /// Moves a drive up to `now`, with or without process data.
    pub fn advance(&mut self, now: SimTime) {
        if let Source::Servo(servo) = &mut self.source {
            servo.advance(now);
        }
    }

    fn release_drive(&mut self, now: SimTime) {
        match &mut self.source {
            Source::Servo(servo) => servo.release(now),
            Source::Terminal(_) => {}
        }
    }

    /// Starts OP: the last received outputs become valid.
    pub fn operate(&mut self, dictionary: &Dictionary, controller: &mut Controller, now: SimTime) {
        if self.outputs.is_empty() {
            return;
        }
        self.latch(dictionary, now);
        self.refresh(controller, now);
    }

    /// Takes new outputs and updates the inputs, after AL `events`.
    pub fn exchange(
        &mut self,
        dictionary: &Dictionary,
        controller: &mut Controller,
        events: u32,
        operating: bool,
        now: SimTime,
    ) {
        let fresh = self.receive(controller, events, now);
        if fresh && operating {
            self.latch(dictionary, now);
        }
        let is_read = |area: &&Area| !area.event || events & event_bit(area.sync_manager) != 0;
        let read = self.layout.inputs.iter().any(|area| is_read(&area));
        let is_empty = self.layout.inputs.iter().filter(is_read).any(|area| area.one_buffer);
        let due = match &self.source {
            Source::Terminal(InputSource::Constant(_)) => false,
            Source::Terminal(InputSource::Outputs) => fresh && operating,
            Source::Terminal(InputSource::Function(_)) | Source::Servo(_) => fresh || read,
        };
        if due || is_empty {
            self.refresh(controller, now);
        }
    }

    fn receive(&mut self, controller: &mut Controller, events: u32, now: SimTime) -> bool {
        let mut fresh = false;
        let mut rest = self.received.as_mut_slice();
        for area in &self.layout.outputs {
            let (image, tail) = rest.split_at_mut(usize::from(area.length).min(rest.len()));
            rest = tail;
            let address = RegisterAddress(area.start);
            if area.event {
                if events & event_bit(area.sync_manager) != 0 {
                    fresh |= controller.pdi_read(address, image, now);
                }
            } else {
                self.before.clear();
                self.before.extend_from_slice(image);
                fresh |= controller.pdi_read(address, image, now) && *image != *self.before;
            }
        }
        self.seen |= fresh;
        fresh
    }

    fn latch(&mut self, dictionary: &Dictionary, now: SimTime) {
        self.outputs.copy_from_slice(&self.received);
        self.latched += 1;
        match &mut self.source {
            Source::Servo(servo) => servo.command(now, &self.output_mapping, &self.outputs, dictionary),
            Source::Terminal(_) => {}
        }
    }

    /// Computes inputs and writes them to the SyncManagers.
    fn refresh(&mut self, controller: &mut Controller, now: SimTime) {
        match &mut self.source {
            Source::Terminal(source) => source.fill(now, &self.outputs, &mut self.inputs),
            Source::Servo(servo) => servo.report(now, &self.input_mapping, &mut self.inputs),
        }
        let mut rest = self.inputs.as_slice();
        for area in &self.layout.inputs {
            let (image, tail) = rest.split_at(usize::from(area.length).min(rest.len()));
            rest = tail;
            controller.pdi_write(RegisterAddress(area.start), image, now);
        }
    }

    /// Sets the source of the inputs. A drive computes its own inputs and ignores it.
    pub fn set_source(&mut self, new: InputSource, controller: &mut Controller, now: SimTime) {
        match &mut self.source {
            Source::Terminal(source) => *source = new,
            Source::Servo(_) => return,
        }
        self.refresh(controller, now);
    }
}
