//! PDOs of the dictionaries: what was read or written replaces what was known, in the list and in the last scan.

use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::al::AlState;

use crate::event::Event;
use crate::info::{PdoSource, SubDeviceInfo};
use crate::segment::choices::ReadPdos;
use crate::segment::effect::{Effects, Task};
use crate::segment::key::SubDeviceKey;
use crate::segment::model::Segment;
use crate::segment::pdo_finding::PdoFinding;
use crate::segment::scan::Found;
use crate::segment::undeclared::{PdoReading, Upkeep, UpkeepProgress};

/// Dictionaries of SubDevices in their states that are read at once: requests of the application do not wait for those
/// of 100.
const READ_AT_ONCE: usize = 8;

impl Segment {
    /// Processes a finding about the PDOs of the SubDevice with a station address.
    pub(in crate::segment) fn observe_pdos(
        &mut self,
        station: StationAddress,
        finding: PdoFinding<'_>,
        effects: &mut Effects,
    ) {
        let Some(before) = self.subdevices.at(station).and_then(|it| it.knowledge.info()).cloned() else { return };
        let mut info = (*before).clone();
        match finding {
            PdoFinding::Outdated => info.pdo_source = PdoSource::Outdated,
            PdoFinding::Unreadable => return,
            PdoFinding::Held(held) => {
                for warning in info.take_dictionary(held) {
                    effects.report(Event::SiiWarning { position: info.position, what: warning.to_string() });
                }
            }
        }
        let now = if info == *before { before.clone() } else { Rc::new(info) };
        self.subdevices.replace(&before, &now);
        self.tell_scan(&before, &now);
    }

    /// Copies what is known now of the PDOs of a SubDevice to the last scan. If the list and the last scan share their
    /// data, they share it afterwards as well.
    fn tell_scan(&mut self, before: &Rc<SubDeviceInfo>, now: &Rc<SubDeviceInfo>) {
        let Some(scanned) = self.stage.scanned_mut() else { return };
        let is_it = |it: &Rc<SubDeviceInfo>| it.station == now.station && it.identity == now.identity;
        let Some(at) = scanned.found.subdevices.iter().position(is_it) else { return };
        let known = &scanned.found.subdevices[at];
        let known = if Rc::ptr_eq(known, before) {
            now.clone()
        } else if (known.pdo_source, &known.pdos) != (now.pdo_source, &now.pdos) {
            Rc::new(SubDeviceInfo { pdos: now.pdos.clone(), pdo_source: now.pdo_source, ..(**known).clone() })
        } else {
            return;
        };
        Rc::make_mut(&mut scanned.found).subdevices[at] = known;
    }

    /// The same for a member whose data was replaced by other data.
    pub(in crate::segment) fn tell_scan_of_member(&mut self, index: usize) {
        if let Some(info) = self.member(index).and_then(|member| member.info).cloned() {
            self.tell_scan(&info, &info);
        }
    }

    /// A mailbox message has changed the PDOs of a SubDevice that has left the list. The SubDevice may come back with
    /// the same station address, and then the last scan describes it.
    fn doubt_scanned(&mut self, station: StationAddress) {
        let Some(scanned) = self.stage.scanned_mut() else { return };
        if let Some(at) = scanned.found.subdevices.iter().position(|it| it.station == station) {
            Rc::make_mut(&mut Rc::make_mut(&mut scanned.found).subdevices[at]).pdo_source = PdoSource::Outdated;
        }
    }

    /// A scan began with what was known then: what was written or read of a dictionary since then counts in what it
    /// found, too.
    pub(in crate::segment) fn take_newer_pdos(&self, found: &mut Rc<Found>) {
        let scanned = self.stage.scanned().map(|it| it.found.subdevices.as_slice()).unwrap_or_default();
        let newer_of = |info: &SubDeviceInfo| {
            let listed = self.subdevices.at(info.station).and_then(|it| it.knowledge.info());
            let known = listed.or_else(|| scanned.iter().find(|known| known.station == info.station))?;
            let is_newer = known.pdo_source != PdoSource::Sii
                && (known.pdo_source, &known.pdos) != (info.pdo_source, &info.pdos)
                && known.identity == info.identity;
            is_newer.then(|| known.clone())
        };
        if found.subdevices.iter().all(|info| newer_of(info).is_none()) {
            return;
        }
        for info in &mut Rc::make_mut(found).subdevices {
            if let Some(known) = newer_of(info) {
                let info = Rc::make_mut(info);
                (info.pdos, info.pdo_source) = (known.pdos.clone(), known.pdo_source);
            }
        }
    }

    /// What is found about the PDOs of a SubDevice without a declaration.
    pub(in crate::segment) fn observe_undeclared_pdos(
        &mut self,
        key: SubDeviceKey,
        finding: PdoFinding<'_>,
        effects: &mut Effects,
    ) {
        let Some((_, it)) = self.subdevices.unassigned_mut(key) else {
            if matches!(finding, PdoFinding::Outdated) {
                self.doubt_scanned(key.station);
            }
            return;
        };
        if let Some(upkeep) = &mut it.upkeep {
            upkeep.reading = match finding {
                PdoFinding::Outdated | PdoFinding::Held(_) => PdoReading::Open,
                PdoFinding::Unreadable => PdoReading::Ended,
            };
        }
        self.observe_pdos(key.station, finding, effects);
    }

    /// Whether the dictionary of a SubDevice without a declaration is to be read in PREOP. `from_init`: it comes from
    /// INIT, where a dictionary that was written may have fallen back to that of power-on.
    pub fn wants_pdos(&self, info: &SubDeviceInfo, from_init: bool) -> bool {
        let is_open = match info.pdo_source {
            PdoSource::Sii | PdoSource::Outdated => true,
            PdoSource::Written => from_init,
            PdoSource::Dictionary => false,
        };
        is_open
            && info.has_dictionary_of_pdos()
            && match self.choices.pdos {
                ReadPdos::Never => false,
                ReadPdos::Missing => info.pdo_source == PdoSource::Outdated || info.lacks_pdos(),
                ReadPdos::Always => true,
            }
    }

    /// Whether dictionaries are about to be read, or are being read, of SubDevices on their first way to a state with
    /// mail, or in it.
    pub fn are_pdos_awaited(&self) -> bool {
        self.subdevices.unassigned().filter(|it| it.is_undeclared()).any(|it| {
            let is_open = it.knowledge.info().is_some_and(|info| self.wants_pdos(info, false));
            is_open
                && match &it.upkeep {
                    None => self.choices.idle_operation,
                    Some(upkeep) if !has_mail(upkeep.target) => false,
                    Some(upkeep) if upkeep.progress == UpkeepProgress::Reached => upkeep.reading != PdoReading::Ended,
                    Some(upkeep) => upkeep.is_on_its_first_way(),
                }
        })
    }

    /// The next SubDevice, with its attempt, whose object dictionary is to be read: in a state with mail, once for each
    /// time that it has reached its state.
    pub fn dictionary_to_read(&self) -> Option<(SubDeviceKey, u32)> {
        self.subdevices.unassigned().find_map(|it| {
            let upkeep = it.unassigned.upkeep.as_ref().filter(|upkeep| has_mail(upkeep.target))?;
            let has_one = it.knowledge.info().is_some_and(|info| info.coe.sdo_information());
            Some((it.key, upkeep.dictionary_due()?)).filter(|_| has_one)
        })
    }

    /// Has dictionaries read of SubDevices that are in their states already: those of another owner, and those that
    /// were written since.
    pub(in crate::segment) fn read_open_pdos(&mut self, effects: &mut Effects) {
        if self.choices.pdos == ReadPdos::Never {
            return;
        }
        let kept = || self.subdevices.unassigned().filter_map(|it| Some((it, it.unassigned.upkeep.as_ref()?)));
        let in_state = || kept().filter(|(_, upkeep)| upkeep.progress == UpkeepProgress::Reached);
        let under_way = in_state().filter(|(_, upkeep)| upkeep.reading == PdoReading::UnderWay).count();
        let is_open = |upkeep: &Upkeep| upkeep.reading == PdoReading::Open && has_mail(upkeep.target);
        let due = in_state().filter(|(it, upkeep)| {
            is_open(upkeep) && it.knowledge.info().is_some_and(|info| self.wants_pdos(info, false))
        });
        let due = due.map(|(it, upkeep)| (it.key, upkeep.attempt)).take(READ_AT_ONCE.saturating_sub(under_way));
        let due: Vec<(SubDeviceKey, u32)> = due.collect();
        for (key, attempt) in due {
            let upkeep = self.subdevices.unassigned_mut(key).and_then(|(_, it)| it.upkeep.as_mut());
            upkeep.into_iter().for_each(|upkeep| upkeep.reading = PdoReading::UnderWay);
            effects.start(Task::ReadPdos { key, attempt });
        }
    }
}

/// Whether a dictionary can be read in a state.
const fn has_mail(state: AlState) -> bool {
    matches!(state, AlState::PreOp | AlState::SafeOp | AlState::Op)
}
