//! Knowledge of the segment for another process, and going on with that of another process (decision 0061).

use alloc::rc::Rc;
use alloc::string::ToString;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress};
use ringcat_wire::al::AlState;

use super::MainDevice;
use super::activate::activate_error::ActivateError;
use crate::info::{PdoSource, SubDeviceInfo};
use crate::knowledge::{Handover, Knowledge, KnownMailbox, KnownProgress, KnownSubDevice};
use crate::procedures::resume::{Before, Known, resume};
use crate::procedures::scan::unless_another;
use crate::ring::Sequence;
use crate::role::Function;
use crate::segment::clocks::ClockObservation;
use crate::segment::{Addressed, Found, Observation, UpkeepProgress};

/// Activations by which a session after a crash differs at least from those of the former owner: half of all sessions.
const AFTER_CRASH: u32 = 512;
/// The same for temporary station addresses.
const ADDRESSES_AFTER_CRASH: u16 = 0x1000;

impl MainDevice {
    /// What is known of the segment, for another process that goes on with it; `None` without a successful scan. The
    /// MainDevice must not send any more if the knowledge is to be handed over. Outputs of an active application then
    /// last until the watchdogs of the SubDevices expire, or until the other process has them in PREOP.
    pub fn knowledge(&self) -> Option<Knowledge> {
        Some(Knowledge { dictionaries: self.segment.dictionaries.known(), ..self.knowledge_without_dictionaries()? })
    }

    /// The same without descriptions of objects, which no configuration needs.
    pub(super) fn knowledge_without_dictionaries(&self) -> Option<Knowledge> {
        let view = self.segment.view();
        let found = view.found()?;
        let stations = found.stations();
        let is_other = |info: &Rc<SubDeviceInfo>| !stations.contains(&info.station);
        let all = view.subdevices().all().iter();
        let others = all.filter_map(|it| Some((it.key.station, it.knowledge.info()?.clone())));
        let others = others.map(|(station, info)| with_station(info, station)).filter(is_other);
        let others: Vec<KnownSubDevice> = others.enumerate().map(|(at, info)| self.known(&placed(info, at))).collect();
        Some(Knowledge {
            subdevices: found.subdevices.iter().map(|info| self.known(info)).collect(),
            others,
            topology: found.topology.clone(),
            main_count: found.main_count,
            ring: self.ring(),
            sequence: self.supervisor.sequence().number(),
            offered: view.last_offered(),
            activations: self.activations,
            siis: self.cache.known(),
            dictionaries: Vec::new(),
            clocks: view.known_clocks().map(|known| (*known).clone()),
        })
    }

    fn known(&self, info: &Rc<SubDeviceInfo>) -> KnownSubDevice {
        let kept = self.kept(info.station);
        // A declared SubDevice, or one that nothing is requested of.
        let progress = if self.options.idle_operation { KnownProgress::Due } else { KnownProgress::None };
        let (target, progress, mailbox) = kept.unwrap_or((AlState::PreOp, progress, None));
        let mut info = (**info).clone();
        if self.has_written_pdos(info.station) {
            info.pdo_source = PdoSource::Outdated;
        }
        KnownSubDevice { info, target, progress, mailbox }
    }

    /// Whether mail has changed the PDOs of a SubDevice since they were known.
    fn has_written_pdos(&self, station: StationAddress) -> bool {
        let view = self.segment.view();
        let of_member = view.subdevices().member_of(station).map(Addressed::Member);
        let subdevice = of_member.or_else(|| view.undeclared_at(station).map(Addressed::Undeclared));
        let mailbox = subdevice.and_then(|subdevice| self.segment.mailbox_of(subdevice));
        mailbox.is_some_and(|mailbox| mailbox.has_written_pdos())
    }

    /// State and mailbox of a SubDevice without a declaration.
    fn kept(&self, station: StationAddress) -> Option<(AlState, KnownProgress, Option<KnownMailbox>)> {
        let view = self.segment.view();
        let key = view.undeclared_at(station)?;
        let upkeep = view.upkeep(key)?;
        let progress = match upkeep.progress {
            UpkeepProgress::Due(_) | UpkeepProgress::UnderWay => KnownProgress::Due,
            UpkeepProgress::Reached => KnownProgress::Reached,
            UpkeepProgress::Left => KnownProgress::Left,
        };
        Some((upkeep.target, progress, self.segment.undeclared.known(key)))
    }

    /// Goes on with the segment that another process has known, without a scan: no SII is read. First the number of
    /// SubDevices, their station addresses, ports, AL states and mailbox SyncManagers are compared with the knowledge.
    /// What differs is scanned as after a change of the segment; [`Event::Resumed`](crate::event::Event::Resumed) has
    /// the result. [`MainDevice::scan_result`] has the SubDevices afterwards, and their mailboxes are in use again.
    /// Without idle operation SubDevices stay in their states; with it all are brought to their states. Refused while
    /// active or while a scan runs.
    pub fn resume(&mut self, knowledge: Knowledge, handover: Handover) -> Result<(), ActivateError> {
        self.permit(Function::Scan)?;
        if self.segment.view().is_scanning() {
            return Err(ActivateError::Scanning);
        }
        let Knowledge { subdevices, others, topology, main_count, ring, .. } = knowledge;
        let Knowledge { sequence, offered, activations, siis, dictionaries, clocks, .. } = knowledge;
        self.supervisor.assume_ring(ring);
        self.segment.observe(Observation::ScanBegun);
        *self.scan_error.borrow_mut() = None;
        self.emergencies.borrow_mut().forget_positions();
        self.cache.learn(siis);
        self.segment.dictionaries.learn(dictionaries);
        if let Some(known) = clocks {
            self.segment.observe_clocks(ClockObservation::Known(Rc::new(known)));
        }
        self.begin_idle();
        self.go_on(sequence, activations, offered, handover);
        let count = subdevices.len();
        let all = subdevices.into_iter().chain(others);
        let all: Vec<Known> = all.map(|known| Known::from(in_doubt(known, handover))).collect();
        let scanned = all.iter().take(count).map(|known| known.info.clone()).collect();
        let found = Found { subdevices: scanned, topology, main_count };
        let before = Before { all, found, handover };
        let (bus, segment, slot) = (self.supervisor.bus(), self.segment.clone(), self.scan_error.clone());
        let options = self.own_scan_options();
        let number = self.segment.view().scan_number();
        self.supervisor.spawn(async move {
            let resumed = unless_another(&segment, number, resume(&bus, &segment, &options, before)).await;
            if let Some(Err(error)) = resumed {
                let reason = slot.borrow_mut().insert(error).to_string();
                segment.observe(Observation::ScanEnded(Err(reason)));
            }
        });
        Ok(())
    }

    /// Goes on with numbers of the former owner, or leaves those behind that it may have used since.
    fn go_on(&mut self, sequence: u16, activations: u32, offered: StationAddress, handover: Handover) {
        let now = self.supervisor.bus().now();
        let (sequence, activations, offered) = match handover {
            Handover::Orderly => (u64::from(sequence), activations, offered),
            Handover::AfterCrash => {
                // A number that the former owner has hardly used just now: its age is unknown.
                let epoch = now.0.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 49;
                let offered = StationAddress(offered.0.wrapping_add(ADDRESSES_AFTER_CRASH));
                (epoch, activations.wrapping_add(AFTER_CRASH), offered)
            }
        };
        self.supervisor.go_on_from(Sequence::of_frame(sequence));
        self.activations = self.activations.max(activations);
        self.segment.observe(Observation::Offered(offered));
    }
}

/// After a crash the dictionary may hold what the former owner has written since, or another one.
fn in_doubt(mut known: KnownSubDevice, handover: Handover) -> KnownSubDevice {
    if handover == Handover::AfterCrash {
        known.info.pdo_source = PdoSource::Outdated;
    }
    known
}

fn with_station(info: Rc<SubDeviceInfo>, station: StationAddress) -> Rc<SubDeviceInfo> {
    if info.station == station { info } else { Rc::new(SubDeviceInfo { station, ..(*info).clone() }) }
}

fn placed(info: Rc<SubDeviceInfo>, at: usize) -> Rc<SubDeviceInfo> {
    let position = Position(at as u16);
    if info.position == position { info } else { Rc::new(SubDeviceInfo { position, ..(*info).clone() }) }
}
