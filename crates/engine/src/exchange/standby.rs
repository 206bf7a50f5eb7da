//! The part of the exchange in MainDevice redundancy: the role, and what goes with it in each cycle (protocol 9.6,
//! 9.8).
//!
//! ACTIVE: master frames follow the frames with process data ([`super::master_frames`]); what comes back in them shows
//! whether the other MainDevice is there and follows. INACTIVE: nothing is sent; the images are those of the ACTIVE
//! ([`super::following`]). [`Exchange::begin_role`] changes the role, at the beginning of a cycle and nowhere else.

mod active;
mod inactive;
mod pace;
mod partner;
mod partner_data;
mod readiness;
mod roles;
pub mod state;

use alloc::boxed::Box;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::{Header, NotReady};
use ringcat_wire::memory_write::MemoryWrite;

use super::Exchange;
use super::following::{Following, OutputsSeen};
use super::master_frames::MasterFrames;
use crate::domain::DomainId;
use crate::event::CyclicStandbyEvent;
use crate::layout::Layout;
use crate::link::{Link, LinkSet};
use crate::role::{MainDeviceRole, Partner, RoleControl};
use crate::time::Instant;

pub use partner_data::PartnerMemory;

use partner::{Items, PartnerWatch};
use partner_data::PartnerData;
use readiness::ReadinessWatch;
use state::{Offers, Standby, StandbySetup, State};

impl Exchange {
    /// From now on this MainDevice is one of two in a ring, in the role of its control. Not for the cyclic path: this
    /// allocates. Without a redundant link nothing is set up (protocol MR-22).
    pub fn set_up_standby(&mut self, layout: &Layout, setup: StandbySetup) {
        if self.links != LinkSet::Ring {
            return;
        }
        let StandbySetup { planned, items, identity, session, exchanges_from, control, words, .. } = setup;
        // One of an application before.
        words.take_collision();
        let period = layout.home().map_or(0, |home| layout.domains[home].period.as_nanos() as u64);
        let items = Items::new(identity, items);
        let mut header = Header::new();
        (header.session, header.identity, header.item) = (session, identity, items.first());
        header.period_ns = u32::try_from(period).unwrap_or(u32::MAX);
        let mut following = Following::new(planned.lengths, words.clone());
        (following.answer.identity, following.answer.item) = (identity, items.first());
        following.answer.not_ready = NotReady::NO_CYCLE;
        let mut data = PartnerData::new(&planned.lengths);
        // The activation has checked its length.
        let _ = setup.memory.is_some_and(|memory| data.place(memory));
        self.standby = Standby(Some(Box::new(State {
            role: control.role(),
            frames: MasterFrames::new(&self.identity, &planned, header, home_domains(layout)),
            following,
            outputs: OutputsSeen::new(layout),
            watch: PartnerWatch::default(),
            data,
            readiness: ReadinessWatch::default(),
            items,
            exchanges_from,
            yields_without_links: setup.yields_without_links,
            goes_through_init: setup.goes_through_init,
            offers: Offers::Possible,
            is_forced: false,
            offered: 0,
            shown: None,
            foreign_in: 0,
            acyclic_counts_from: 0,
            collided_with: None,
            collided_write: None,
            other_version: None,
            noticed: None,
            begun_at: Instant::NEVER,
            left_at: None,
            runs: planned.inputs.into_boxed_slice(),
            period_ns: period,
            control,
            words,
        })));
    }

    /// Whether this MainDevice is one of two in a ring.
    #[inline(always)]
    pub fn is_of_two(&self) -> bool {
        self.standby.0.is_some()
    }

    /// The role, and requests for another one: for any thread. `None` without MainDevice redundancy.
    pub fn role_control(&self) -> Option<RoleControl> {
        self.standby.0.as_ref().map(|state| state.control.clone())
    }

    /// Takes the address of another MainDevice of which a frame has come since the last call, while this one is
    /// ACTIVE. Bytes 3 to 5 are those of its main interface.
    pub fn take_collision(&mut self) -> Option<MacAddress> {
        self.standby.0.as_deref_mut()?.collided_with.take()
    }

    /// A write into the memory of a SubDevice that the own acyclic half does.
    pub fn memory_write(&self) -> Option<MemoryWrite> {
        self.standby.0.as_ref()?.words.write()
    }

    /// The same of the other ACTIVE in a collision, according to its last master frame.
    pub fn memory_write_of_collided(&self) -> Option<MemoryWrite> {
        self.standby.0.as_ref()?.collided_write
    }

    /// Whether a link has a carrier, as posted by the acyclic half; `None` if the links do not report it.
    pub fn carrier(&self, link: Link) -> Option<bool> {
        self.board.live.carrier(link)
    }

    /// The role; ACTIVE without MainDevice redundancy.
    pub fn role(&self) -> MainDeviceRole {
        self.standby.0.as_ref().map_or(MainDeviceRole::Active, |state| state.role)
    }

    /// Whether a policy neither takes over nor accepts the role ([`RoleControl::hold`]).
    pub fn is_held(&self) -> bool {
        self.standby.0.as_ref().is_some_and(|state| state.control.is_held())
    }

    /// State of the other MainDevice, as determined by the ACTIVE.
    pub fn partner(&self) -> Partner {
        self.standby.0.as_ref().map_or(Partner::Absent, |state| state.watch.partner())
    }

    /// Reports what a policy has found, in order with the events of the exchange. For the cyclic path.
    pub fn report_standby(&mut self, event: CyclicStandbyEvent) {
        self.events.push(event.pack());
    }

    /// The application ends: the role is not offered from now on, and an offer is withdrawn. If this MainDevice has
    /// already sent its last cycle as ACTIVE, it becomes INACTIVE with the next cycle. Otherwise the other MainDevice
    /// would become ACTIVE while this one stops the SubDevices.
    pub fn end_offers(&mut self) {
        if let Some(state) = self.standby.0.as_deref_mut() {
            state.offers = Offers::Ended;
            state.withdraw_offer();
        }
    }

    /// Process data for the other MainDevice: what leaves in this role, in the length of its direction (protocol
    /// FR-15). A change of the role does not change the bytes.
    pub fn to_partner_mut(&mut self) -> &mut [u8] {
        self.standby.0.as_deref_mut().map_or(&mut [], |state| state.data.outgoing_mut(state.role))
    }

    /// Process data of the other MainDevice, of the last cycle in which all of it has arrived; empty before, also after
    /// a change of the role.
    pub fn from_partner(&self) -> &[u8] {
        let Some(state) = self.standby.0.as_deref() else { return &[] };
        let has_arrived = match state.role {
            MainDeviceRole::Active => state.frames.to_active_cycle.is_some(),
            MainDeviceRole::Inactive => state.shown.is_some() && state.following.whole().is_some(),
        };
        if has_arrived { state.data.incoming(state.role) } else { &[] }
    }

    /// Gives back the memory of the application for process data between both MainDevices
    /// ([`Declaration::place_partner_data`](crate::main_device::Declaration::place_partner_data)), in the length that
    /// is used. From then on it is in own memory. Not for the cyclic path: this allocates. `None` where it is in own
    /// memory.
    pub fn give_partner_memory_back(&mut self) -> Option<PartnerMemory> {
        self.standby.0.as_deref_mut()?.data.give_back()
    }
}

/// The first domain of each SubDevice.
fn home_domains(layout: &Layout) -> Box<[Option<DomainId>]> {
    let areas = || layout.domains.iter().flat_map(|domain| &domain.areas).map(|placed| placed.area.subdevice);
    let count = areas().max().map_or(0, |last| last + 1);
    let domain_of = |subdevice: usize| layout.areas_of(subdevice).next().map(|(id, _)| id);
    (0..count).map(domain_of).collect()
}
