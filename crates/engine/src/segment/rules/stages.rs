//! The stages of the segment: a scan begins and ends, an application is activated and deactivated.

use alloc::rc::Rc;
use alloc::string::String;

use crate::event::Event;
use crate::segment::effect::{Effect, Effects};
use crate::segment::model::{Declared, Segment};
use crate::segment::scan::Scan;
use crate::segment::stage::{Scanned, Stage};
use crate::segment::start::Start;

impl Segment {
    /// A scan begins: it assigns new station addresses.
    pub(in crate::segment) fn begin_scan(&mut self) {
        if !self.is_active() {
            self.addresses.change();
            self.stage = Stage::Scanning;
        }
    }

    /// A scan has ended. The result of a scan that was given up is refused.
    pub(in crate::segment) fn end_scan(&mut self, result: Result<Scan, String>, effects: &mut Effects) {
        if !self.is_scanning() {
            return;
        }
        self.stage = match result {
            Ok(scan) => Stage::Scanned(Scanned { found: Rc::new(scan.into()), registers: Start::Cleared }),
            Err(reason) => {
                effects.report(Event::ScanFailed { reason });
                Stage::Unscanned
            }
        };
    }

    /// Single SubDevices were configured before an application is active.
    pub(in crate::segment) fn observe_visit(&mut self) {
        if let Stage::Scanned(scanned) = &mut self.stage {
            scanned.registers = Start::Doubtful;
        }
    }

    /// An application declares SubDevices, with their process data.
    pub(in crate::segment) fn activate(&mut self, declared: Declared, effects: &mut Effects) {
        let Stage::Scanned(scanned) = &self.stage else { return };
        let stage = Stage::Active(scanned.clone());
        self.begin(stage, declared);
        effects.0.push(Effect::Occupants(self.occupants()));
    }

    /// The application ends, or a scan is given up. What the last scan has found stays, and another declaration may
    /// follow at once.
    pub(in crate::segment) fn deactivate(&mut self) {
        let scanned = self.stage.scanned().cloned();
        let stage = scanned.map_or(Stage::Unscanned, |it| Stage::Scanned(Scanned { registers: Start::Doubtful, ..it }));
        self.begin(stage, Declared::default());
    }

    /// Begins a stage. Nothing of the last declaration remains; findings that were requested before are refused.
    fn begin(&mut self, stage: Stage, mut declared: Declared) {
        declared.cabling.version = self.cabling.version.wrapping_add(1);
        let mut addresses = core::mem::take(&mut self.addresses);
        addresses.change();
        let (slot, choices, frames_tested_until) = (self.slot.emptied(), self.choices, self.frames_tested_until);
        *self = Segment { stage, addresses, slot, frames_tested_until, ..Segment::of(declared, choices) };
    }
}
