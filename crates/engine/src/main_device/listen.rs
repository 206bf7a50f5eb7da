//! An INACTIVE MainDevice without an application: it listens to the ACTIVE, and learns what it needs to follow
//! (protocol 9.10).

use core::time::Duration;

use ringcat_wire::master_frame::Header;

use super::MainDevice;
use crate::event::{Event, StandbyEvent};
use crate::exchange::following::Unusable;
use crate::link::Link;
use crate::role::MainDeviceRole;
use crate::time::Instant;

/// What an INACTIVE MainDevice has heard of the ACTIVE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Heard {
    /// When a frame of another MainDevice came last.
    pub at: Option<Instant>,
    /// Period of its cycles; `None` before a master frame.
    pub period: Option<Duration>,
    /// All that is needed to follow it has arrived ([`MainDevice::follow`]).
    pub is_known: bool,
}

impl MainDevice {
    /// Takes and fills a received frame of another MainDevice before it is forwarded, without an application: as
    /// INACTIVE with the options of MainDevice redundancy. Any bytes are allowed. With an application it is
    /// [`Exchange::fill`](crate::exchange::Exchange::fill).
    pub fn fill(&mut self, arrived_on: Link, frame: &mut [u8], now: Instant) {
        if self.role() != MainDeviceRole::Inactive || self.active().is_some() {
            return;
        }
        let Some(standby) = &mut self.standby else { return };
        standby.heard_at = Some(now);
        standby.listening.fill(arrived_on, frame, now);
        if let Some(Unusable::Version { least, got }) = standby.listening.unusable
            && standby.other_version.replace(got) != Some(got)
        {
            let event = Event::Standby(StandbyEvent::OtherVersion { got, least });
            self.supervisor.append_event(now, event, 0);
        }
    }

    /// What was heard of the ACTIVE while there is no application.
    pub fn heard(&self) -> Heard {
        let Some(standby) = &self.standby else { return Heard::default() };
        let newest = standby.listening.newest().and_then(|(cycle, _)| standby.listening.header_of(cycle));
        let period = |(Header { period_ns, .. }, _)| Duration::from_nanos(u64::from(period_ns));
        Heard {
            at: standby.heard_at,
            period: newest.map(period).filter(|period| !period.is_zero()),
            is_known: self.heard_configuration().is_some() && self.heard_knowledge().is_some(),
        }
    }
}
