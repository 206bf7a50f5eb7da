//! The handle to a SubDevice's mailbox.

use alloc::rc::Rc;
use core::time::Duration;

use ringcat_wire::address::{RegisterAddress, StationAddress};
use ringcat_wire::memory_write::WriteKind;
use ringcat_wire::sii::MailboxLayout;

use super::conversation::Conversation;
use super::counters::MailCounters;
use super::emergencies::{EmergencyRing, ReceivedEmergency};
use super::error::MailboxError;
use super::lane::{Lane, LaneState};
use super::shared::{Session, SharedMailbox};
use super::unsolicited::{Unclaimed, Unsolicited};
use crate::declared::Address;
use crate::role::Function;
use crate::supervisor::Bus;
use crate::supervisor::long_transfers::{TransferKind, UnderWayTransfer};
use crate::supervisor::memory_writes::UnderWayWrite;
use crate::time::Instant;

/// The handle to a SubDevice's mailbox and its router; copies are handles to the same mailbox. It stays valid while the
/// SubDevice is absent: while the mailbox is not in use, every request ends with [`MailboxError::Closed`].
#[derive(Clone, Debug)]
pub struct Mailbox {
    shared: Rc<SharedMailbox>,
}

impl Mailbox {
    /// A mailbox that is not in use yet. `subdevice` names it in events.
    pub fn new(bus: &Bus, subdevice: impl Into<Address>) -> Mailbox {
        Mailbox { shared: SharedMailbox::new(bus, subdevice.into()) }
    }

    /// Another name of the SubDevice in events: it is at another position now.
    pub(crate) fn rename(&self, subdevice: Address) {
        self.shared.subdevice.set(subdevice);
    }

    /// The SubDevice has entered PREOP or BOOT with this mailbox: counters restart. `send_manager` is the SyncManager
    /// of the mailbox that the MainDevice reads.
    pub(crate) fn open(&self, station: StationAddress, layout: MailboxLayout, send_manager: u8) {
        self.shared.close();
        self.shared.open(Session::new(station, layout, send_manager, self.shared.bus.now()));
    }

    /// The SubDevice goes to INIT.
    pub(crate) fn close(&self) {
        self.shared.close();
    }

    /// The SubDevice does not answer; it may return with its mailbox unchanged.
    pub(crate) fn suspend(&self) {
        self.shared.suspend();
    }

    /// The SubDevice answers again and was never in INIT meanwhile.
    pub(crate) fn resume(&self) {
        self.shared.resume();
    }

    /// The SubDevice has mail, or may have.
    pub(crate) fn mail_available(&self) {
        self.shared.mail_available();
    }

    /// Makes the reader poll the status of the send mailbox once.
    pub(super) fn poll_once(&self) {
        self.shared.poll_once();
    }

    pub(super) fn shared(&self) -> &Rc<SharedMailbox> {
        &self.shared
    }

    /// Whether the mailbox may be used.
    pub fn is_open(&self) -> bool {
        self.shared.state().open
    }

    /// Whether it is idle: no conversation holds or waits for a lane, no message waits to be written or to be fetched
    /// by a conversation, and neither writer nor reader runs.
    pub fn is_idle(&self) -> bool {
        let state = self.shared.state();
        let at_work = |epoch: Option<u32>| epoch == Some(state.epoch);
        state.lanes.iter().all(LaneState::is_idle) && !at_work(state.writer) && !at_work(state.reader)
    }

    /// Station address of the SubDevice, while the mailbox may be used.
    pub fn station(&self) -> Option<StationAddress> {
        let state = self.shared.state();
        state.session.filter(|_| state.open).map(|session| session.station)
    }

    /// The session, by the station address of the SubDevice and its beginning, while the mailbox may be used.
    pub(crate) fn session(&self) -> Option<(StationAddress, Instant)> {
        let state = self.shared.state();
        state.session.filter(|_| state.open).map(|session| (session.station, session.since))
    }

    /// Station address of the SubDevice and status register of its send mailbox, while the mailbox may be used.
    pub(crate) fn send_status(&self) -> Option<(StationAddress, RegisterAddress)> {
        let state = self.shared.state();
        state.session.filter(|_| state.open).map(|session| (session.station, session.send_status()))
    }

    /// Notes that a write into the memory of the SubDevice is under way, until what is returned is dropped.
    pub(super) fn begin_memory_write(&self, kind: WriteKind) -> UnderWayWrite {
        self.shared.bus.begin_memory_write(self.shared.subdevice.get().memory_write(kind))
    }

    /// Notes that a transfer is under way, until what is returned is dropped.
    pub(super) fn begin_transfer(&self, kind: TransferKind, total: Option<u64>) -> UnderWayTransfer {
        // No SubDevice has address 0: transfers of a closed mailbox belong to none.
        self.shared.bus.begin_transfer(self.station().unwrap_or(StationAddress(0)), kind, total)
    }

    /// Waits until a lane is free, and takes it.
    pub async fn conversation(&self, lane: Lane) -> Result<Conversation, MailboxError> {
        self.conversation_for(lane, lane.function()).await
    }

    /// The same, for a function that is not the usual one in this lane.
    pub(super) async fn conversation_for(&self, lane: Lane, function: Function) -> Result<Conversation, MailboxError> {
        // Types with a lane of their own use only that.
        let lane = if let Lane::Other(code) = lane { Lane::of(code) } else { lane };
        Conversation::take(&self.shared, lane, function).await
    }

    /// The bus.
    pub fn bus(&self) -> &Bus {
        &self.shared.bus
    }

    /// Counters since the beginning.
    pub fn counters(&self) -> MailCounters {
        self.shared.state().counters
    }

    /// Code of the last error that the SubDevice has reported in any protocol, in the protocol's own numbers: an SDO
    /// abort, the detail of an error reply, an error of FoE, SoE or AoE; 0 for none.
    pub fn last_protocol_error(&self) -> u32 {
        self.shared.state().last_error
    }

    /// Sets the last error back to `before`.
    pub(crate) fn forget_protocol_error(&self, before: u32) {
        self.shared.state_mut().last_error = before;
    }

    /// Whether a download to an object of PDO assignment or mapping was queued since [`Mailbox::forget_written_pdos`].
    pub(crate) fn has_written_pdos(&self) -> bool {
        self.shared.state().has_written_pdos
    }

    /// What such downloads have changed is known to the model.
    pub(crate) fn forget_written_pdos(&self) {
        self.shared.state_mut().has_written_pdos = false;
    }

    /// Takes the oldest kept emergency, with the time at which it was read. Each emergency is also an event.
    pub fn pop_emergency(&self) -> Option<ReceivedEmergency> {
        self.emergencies().pop()
    }

    /// The ring that keeps its emergencies.
    pub fn emergencies(&self) -> EmergencyRing {
        self.shared.state().emergencies.clone()
    }

    /// Keeps further emergencies in this ring.
    pub(crate) fn keep_emergencies_in(&self, ring: EmergencyRing) {
        self.shared.state_mut().emergencies = ring;
    }

    /// Takes the oldest unsolicited mail of a kind.
    pub fn pop_unsolicited(&self, kind: Unsolicited) -> Option<Unclaimed> {
        self.shared.state_mut().unsolicited.of_kind(kind).pop()
    }

    /// Number of mails of a kind that were not kept because the queue was full.
    pub fn unsolicited_overruns(&self, kind: Unsolicited) -> u64 {
        self.shared.state_mut().unsolicited.of_kind(kind).overruns()
    }

    /// Waits for unsolicited mail of a kind; `None` if none is received within the time.
    pub(super) async fn unsolicited_within(
        &self,
        kind: Unsolicited,
        limit: Duration,
    ) -> Result<Option<Unclaimed>, MailboxError> {
        let ready = || match self.pop_unsolicited(kind) {
            Some(mail) => Some(Ok(Some(mail))),
            None if !self.is_open() => Some(Err(MailboxError::Closed)),
            None => None,
        };
        self.shared.bus.within(limit, self.shared.changed.until(ready)).await.unwrap_or(Ok(None))
    }

    /// Waits for unsolicited mail of a kind.
    pub async fn unsolicited(&self, kind: Unsolicited) -> Unclaimed {
        self.shared.changed.until(|| self.pop_unsolicited(kind)).await
    }
}
