//! An INACTIVE MainDevice without an application: it listens to the ACTIVE, and collects what it needs to follow
//! (protocol 9.10).

use ringcat_wire::master_frame::{Diagnosis, DomainRecord};

use super::listener::{Listener, PartnerDiagnosis, PartnerStatus, known};
use crate::event::{Event, StandbyEvent};
use crate::knowledge::Knowledge;
use crate::link::Link;
use crate::main_device::MainDevice;
use crate::role::MainDeviceRole;
use crate::time::Instant;

impl MainDevice {
    /// A listener for the thread that has the links on which master frames come, in place of all before:
    /// [`MainDevice::fill`] then only notes that a frame has come. `None` without the options of MainDevice redundancy.
    pub fn split_listener(&mut self) -> Option<Listener> {
        let standby = self.standby.as_mut()?;
        standby.listener = None;
        Some(Listener::new(standby.words.clone(), self.roles.clone()))
    }

    /// Takes and fills a received frame of another MainDevice before it is forwarded: as INACTIVE with the options of
    /// MainDevice redundancy. Any bytes are allowed. With an application
    /// [`Exchange::fill`](crate::exchange::Exchange::fill) does that for frames of the cyclic class; this function then
    /// takes and fills acyclic master frames, with Ethernet frames between both MainDevices.
    pub fn fill(&mut self, arrived_on: Link, frame: &mut [u8], now: Instant) {
        if self.role() != MainDeviceRole::Inactive {
            return;
        }
        self.fill_ethernet(frame, now);
        let has_application = self.active().is_some();
        let Some(standby) = &mut self.standby else { return };
        match &mut standby.listener {
            Some(listener) if !has_application => listener.fill(arrived_on, frame, now),
            _ => standby.words.post_partner_frame(now),
        }
        self.report_version(now);
    }

    /// Reports that the ACTIVE has master frames of a version that cannot be read.
    pub(in crate::main_device) fn report_version(&mut self, now: Instant) {
        let Some(standby) = &mut self.standby else { return };
        if let Some((least, got)) = standby.words.other_version()
            && standby.other_version.replace(got) != Some(got)
        {
            let event = Event::Standby(StandbyEvent::OtherVersion { got, least });
            self.supervisor.append_event(now, event);
        }
    }

    /// What has arrived from the ACTIVE while there is no application.
    pub fn partner_status(&self) -> PartnerStatus {
        let Some(standby) = &self.standby else { return PartnerStatus::default() };
        let at = standby.words.partner_frame_at();
        standby.listener.as_ref().map_or(PartnerStatus { at, ..PartnerStatus::default() }, Listener::partner_status)
    }

    /// Knowledge of the segment that the ACTIVE has sent, with which an application can follow it
    /// ([`MainDevice::follow`]); `None` before all of it has arrived.
    pub fn partner_knowledge(&self) -> Option<Knowledge> {
        known(&self.standby.as_ref()?.words.partner_knowledge)
    }

    /// What the ACTIVE has measured of the segment: its counters, carriers and domains (protocol MR-14, MR-19), as of
    /// the last cycle that has arrived as a whole; `None` before one, and without the options of MainDevice redundancy.
    /// [`PartnerDiagnosis::at`] shows how old it is: without an ACTIVE it remains.
    pub fn partner_diagnosis(&self) -> Option<PartnerDiagnosis> {
        let words = &self.standby.as_ref()?.words;
        let (_, bytes) = words.diagnosis.copy()?;
        let counters = Diagnosis::decode(&bytes).ok()?;
        let domains = bytes.get(Diagnosis::LEN..)?.chunks_exact(DomainRecord::LEN);
        let domains = domains.filter_map(|record| DomainRecord::decode(record).ok()).collect();
        Some(PartnerDiagnosis { at: words.partner_frame_at(), counters, domains })
    }

    /// What this MainDevice knew of the segment when it was ACTIVE last.
    pub(in crate::main_device) fn published_knowledge(&self) -> Option<Knowledge> {
        known(&self.standby.as_ref()?.words.knowledge)
    }
}
