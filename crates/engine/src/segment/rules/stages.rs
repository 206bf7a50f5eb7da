//! The stages of the segment: a scan begins and ends, an application is activated and deactivated.

use alloc::rc::Rc;
use alloc::string::{String, ToString};

use crate::event::Event;
use crate::segment::effect::{Effect, Effects, Task, Watch};
use crate::segment::idle::{Comparison, Work};
use crate::segment::key::SubDeviceKey;
use crate::segment::model::{Declared, Segment};
use crate::segment::observation::More;
use crate::segment::scan::{Found, Scan};
use crate::segment::stage::{Scanned, Stage};
use crate::segment::start::Start;
use crate::segment::subdevices::SubDevices;
use crate::segment::versions::Versions;

impl Segment {
    /// The application has requested a scan. One under way ends: it reconnects no link any more.
    pub(in crate::segment) fn begin_requested_scan(&mut self, effects: &mut Effects) {
        if self.is_scanning() {
            self.link_control.restore(effects);
        }
        self.begin_scan(true);
    }

    /// A scan begins, by request or of idle operation: it assigns new station addresses.
    pub(in crate::segment) fn begin_scan(&mut self, is_requested: bool) {
        if !self.is_active() {
            self.addresses.change();
            self.subdevices = SubDevices::default();
            // It opens all ports.
            self.blocked.clear();
            self.port_controls.clear();
            self.stage = Stage::Scanning { is_requested };
            self.idle.compared = Comparison::Open;
            self.words.scan.begin(None);
        }
    }

    /// A scan has ended. The result of a scan that was given up is refused.
    pub(in crate::segment) fn end_scan(&mut self, result: Result<Scan, String>, effects: &mut Effects) {
        if !self.is_scanning() {
            return;
        }
        self.stage = match result {
            Ok(scan) => {
                let found = Rc::new(Found::from(scan));
                self.subdevices = SubDevices::of_scan(&found).begun(self.addresses.version(), self.first_attempt);
                Stage::Scanned(Scanned { found, registers: Start::Cleared })
            }
            Err(reason) => {
                effects.report(Event::ScanFailed { reason });
                Stage::Unscanned
            }
        };
    }

    /// The segment was scanned again without an application. A result from before a scan or an application is refused.
    pub(in crate::segment) fn find_again(&mut self, versions: Versions, mut found: Rc<Found>) {
        let is_valid = self.are_addresses_as_in(versions);
        self.take_newer_pdos(&mut found);
        if let Stage::Scanned(scanned) = &mut self.stage
            && is_valid
        {
            let now = SubDevices::of_scan(&found).begun(self.addresses.change(), self.first_attempt);
            self.subdevices = now.keeping(core::mem::take(&mut self.subdevices));
            *scanned = Scanned { found, registers: Start::Doubtful };
        }
    }

    /// More data of a scanned SubDevice was read. The list of SubDevices shares its data with the scan, unless there is
    /// other data since then.
    pub(in crate::segment) fn observe_more(&mut self, key: SubDeviceKey, more: More<'_>, effects: &mut Effects) {
        if self.subdevices.at(key.station).is_none_or(|it| it.key != key) {
            return;
        }
        let Some(scanned) = self.stage.scanned_mut() else { return };
        let found = Rc::make_mut(&mut scanned.found);
        let Some(known) = found.subdevices.iter_mut().find(|info| info.station == key.station) else { return };
        let mut info = (**known).clone();
        match more {
            More::Sii(read) => {
                for warning in info.extend(read) {
                    effects.report(Event::SiiWarning { position: info.position, what: warning.to_string() });
                }
            }
            More::DataWords(words) => info.data_words = words,
            More::Alias(alias) => info.alias = alias,
        }
        let before = core::mem::replace(known, Rc::new(info));
        self.subdevices.replace(&before, known);
    }

    /// Single SubDevices are configured before an application is active.
    pub(in crate::segment) fn touch(&mut self) {
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

    /// The procedures of the application begin.
    pub(in crate::segment) fn begin_procedures(&mut self, effects: &mut Effects) {
        self.begin_watches(Watch::Clocks, effects);
        match self.clocks.are_declared() {
            true => self.delay_all(),
            false => self.start_all(effects),
        }
    }

    /// The procedures that run as long as the application begin. `clocks`: that of the clocks.
    pub(in crate::segment) fn begin_watches(&mut self, clocks: Watch, effects: &mut Effects) {
        let (has_clocks, is_supervised) = (self.clocks.are_declared(), self.choices.supervision);
        let watches = [
            (clocks, has_clocks),
            (Watch::Supervision, is_supervised),
            (Watch::Registers, is_supervised),
            (Watch::Errors, is_supervised),
            (Watch::Siis, true),
            (Watch::Mail, true),
            (Watch::Requests, true),
            (Watch::Statistics, true),
        ];
        for (watch, _) in watches.into_iter().filter(|(_, is_needed)| *is_needed) {
            effects.start(Task::Watch(watch));
        }
    }

    /// The application ends, or a scan is given up. What the last scan has found stays, and another declaration may
    /// follow at once.
    pub(in crate::segment) fn deactivate(&mut self, effects: &mut Effects) {
        self.board.post_end();
        // All procedures have ended, also an earlier deactivation.
        self.idle.work = Work::Nothing;
        let scanned = self.stage.scanned().cloned();
        let subdevices = scanned.as_ref().map(|it| SubDevices::of_scan(&it.found)).unwrap_or_default();
        let stage = scanned.map_or(Stage::Unscanned, |it| Stage::Scanned(Scanned { registers: Start::Doubtful, ..it }));
        self.begin(stage, Declared { subdevices, ..Declared::default() });
        self.link_control.restore(effects);
    }

    /// Begins a stage. Nothing of the last declaration remains; findings that were requested before are refused. Ports
    /// that were closed by order stay closed, and are known.
    fn begin(&mut self, stage: Stage, mut declared: Declared) {
        declared.cabling.version = self.cabling.version.wrapping_add(1);
        declared.clocks.changes = self.clocks.changes.of_next();
        let mut addresses = core::mem::take(&mut self.addresses);
        let first_attempt = self.subdevices.next_attempt(self.first_attempt);
        let mut keeping = core::mem::take(&mut self.keeping);
        keeping.is_on &= matches!(stage, Stage::Active(_));
        let before = core::mem::take(&mut self.subdevices);
        let known_clocks = self.known_clocks();
        declared.subdevices = declared.subdevices.begun(addresses.change(), first_attempt);
        if keeping.is_on {
            declared.subdevices = declared.subdevices.keeping(before);
        }
        let slot = match &stage {
            Stage::Active(_) => self.slot.emptied_for_application(),
            Stage::Unscanned | Stage::Scanning { .. } | Stage::Scanned(_) => self.slot.emptied(),
        };
        let (choices, frames_tested_until) = (self.choices, self.frames_tested_until);
        // The procedures that would restore them have ended.
        let altered = self.altered();
        let blocked = core::mem::take(&mut self.blocked);
        let port_controls = self.lasting_controls();
        let (idle, observed, link_control) = (self.idle.renewed(), self.observed, self.link_control);
        *self = Segment {
            stage,
            observed,
            altered,
            blocked,
            port_controls,
            addresses,
            keeping,
            slot,
            link_control,
            idle,
            frames_tested_until,
            first_attempt,
            known_clocks,
            ..Segment::of(declared, choices)
        };
    }
}
