//! Two exchanges in one ring, an ACTIVE and an INACTIVE that follows it, measured by `standby_cycle`.
//!
//! In: process data. Out: whole cycles of the ACTIVE in a call of their own; the SubDevices are the answering double.

use std::sync::Arc;

use ringcat_engine::domain::DomainStatus;
use ringcat_engine::exchange::{Exchange, StandbySetup};
use ringcat_engine::layout::{Layout, LayoutError, MasterSizes, PlannedMasterFrames};
use ringcat_engine::link::Link;
use ringcat_engine::role::{MainDeviceRole, Partner, RoleControl};
use ringcat_wire::master_frame::is_master_frame;
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT, PROCESSED};

use crate::cyclic_load::{CyclicLoad, LoadSpec};

/// Offset of the source address in a frame.
const SOURCE_AT: usize = 6;
/// Code of SAFEOP.
const SAFEOP: u8 = 4;

/// Both.
#[derive(Debug)]
pub struct CyclicPair {
    /// It drives the ring; its double are the SubDevices.
    pub active: CyclicLoad,
    inactive: CyclicLoad,
}

impl CyclicPair {
    /// Both in a closed ring, with the default sizes of master frames.
    ///
    /// # Errors
    /// Process data that cannot be laid out.
    pub fn new(spec: &LoadSpec) -> Result<CyclicPair, LayoutError> {
        let with = |role| CyclicLoad::with(spec, |exchange, layout| set_up(exchange, layout, spec.subdevices, role));
        Ok(CyclicPair { active: with(MainDeviceRole::Active)?, inactive: with(MainDeviceRole::Inactive)? })
    }

    /// The other MainDevice as the ACTIVE sees it.
    pub fn partner(&self) -> Partner {
        self.active.exchange.partner()
    }

    /// The cycle of the ACTIVE.
    #[inline(never)]
    pub fn exchange_of_two(&mut self) -> DomainStatus {
        self.active.exchange.begin_role(self.active.now);
        self.active.exchange_inline()
    }

    /// The ring: SubDevices process the copies of the main link, the INACTIVE works on each copy and forwards it.
    pub fn pass_ring(&mut self) {
        let CyclicPair { active, inactive } = self;
        let now = active.now;
        inactive.exchange.begin_role(now);
        while let Some((link, frame)) = active.links.sent.pop() {
            if !active.double.process(link, frame) {
                if !is_master_frame(frame) {
                    continue;
                }
                frame[SOURCE_AT] |= PROCESSED;
            }
            let arrived_on = active.double.arrives_on(link);
            inactive.exchange.fill(arrived_on, frame, now);
            frame[SOURCE_AT] |= if arrived_on == Link::Main { FORWARDED_ON_REDUNDANT } else { FORWARDED_ON_MAIN };
            inactive.exchange.take_forwarded(frame);
            active.links.arriving.push(arrived_on, frame);
        }
    }
}

fn set_up(
    exchange: &mut Exchange,
    layout: &Layout,
    subdevices: usize,
    role: MainDeviceRole,
) -> Result<(), LayoutError> {
    let setup = StandbySetup {
        planned: PlannedMasterFrames::new(MasterSizes::default(), layout, subdevices)?,
        items: Arc::from([1]),
        identity: 1,
        session: 0,
        exchanges_from: vec![SAFEOP; subdevices].into(),
        yields_without_links: true,
        goes_through_init: false,
        control: RoleControl::new(role),
        words: Arc::default(),
        memory: None,
    };
    exchange.set_up_standby(layout, setup);
    Ok(())
}
