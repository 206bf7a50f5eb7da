//! Messages of a gateway's clients to SubDevices and to the MainDevice itself (protocol 10.1).

use alloc::boxed::Box;

use ringcat_wire::address::StationAddress;
use ringcat_wire::mailbox::{ErrorReply, Message, Protocol};
use ringcat_wire::sii::MailboxProtocols;

use crate::mail::Mailbox;
use crate::mail::relay::{GatewayQueue, Recipient, RelayCounters, Relayed};
use crate::main_device::MainDevice;
use crate::procedures::own_objects::Seen;
use crate::procedures::shared_segment::SharedSegment;
use crate::role::Function;

/// The address of the MainDevice itself.
const OWN_ADDRESS: u16 = 0;

impl MainDevice {
    /// Takes a message of a client, EtherCAT header of type 5 included; [`MainDevice::pop_relayed`] returns its
    /// answers. Any bytes are allowed. The address is the station address of a SubDevice, or 0 for the objects of the
    /// MainDevice itself (docs/mailbox-gateway.md). A SubDevice without a declaration has an open mailbox with idle
    /// operation, or after a visit.
    pub fn relay(&mut self, client: u64, message: &[u8]) {
        let bus = self.supervisor.bus();
        let (active, segment, acyclic) = (self.active().cloned(), self.segment.clone(), self.counters());
        let own_objects = self.own_objects.clone();
        let gateway_queue = self.gateway_queue.get_or_insert_with(|| GatewayQueue::new(&bus));
        gateway_queue.take(client, message, |message| {
            if message.header.address != OWN_ADDRESS {
                bus.permit(Function::RawMailbox).map_err(|_| ErrorReply::SERVICE_NOT_SUPPORTED)?;
                return find(&segment, message);
            }
            if message.header.protocol != Protocol::Coe {
                return Err(ErrorReply::UNSUPPORTED_PROTOCOL);
            }
            let scanned = segment.view().found().map(|found| found.stations()).unwrap_or_default();
            let (seen, payload) = (Seen { bus, segment: active, scanned, acyclic }, message.payload.to_vec());
            Ok(Recipient::Own(Box::pin(async move { own_objects.answer(&seen, client, &payload).await })))
        });
    }

    /// Takes the oldest answer for a client.
    pub fn pop_relayed(&mut self) -> Option<Relayed> {
        self.gateway_queue.as_ref()?.pop()
    }

    /// A client has disconnected: its requests are removed, and its transfer is ended.
    pub fn forget_client(&mut self, client: u64) {
        self.own_objects.forget(client);
        if let Some(gateway_queue) = &self.gateway_queue {
            gateway_queue.forget(client);
        }
    }

    /// Counters of the results of clients' messages.
    pub fn relay_counters(&self) -> RelayCounters {
        self.gateway_queue.as_ref().map(GatewayQueue::counters).unwrap_or_default()
    }
}

/// The mailbox of the SubDevice at a station address, if its SII announces the protocol.
fn find(segment: &SharedSegment, message: &Message<'_>) -> Result<Recipient, u16> {
    let station = StationAddress(message.header.address);
    let (announced, mailbox) = mailbox_at(segment, station).ok_or(ErrorReply::INVALID_HEADER)?;
    let needed = match message.header.protocol {
        Protocol::Aoe => MailboxProtocols::AOE,
        Protocol::Eoe => MailboxProtocols::EOE,
        Protocol::Coe => MailboxProtocols::COE,
        Protocol::Foe => MailboxProtocols::FOE,
        Protocol::Soe => MailboxProtocols::SOE,
        Protocol::Voe => MailboxProtocols::VOE,
        Protocol::Error => 0,
        // The SII has no bit for other types.
        Protocol::Other(_) => u16::MAX,
    };
    if announced.0 & needed == 0 { Err(ErrorReply::UNSUPPORTED_PROTOCOL) } else { Ok(Recipient::SubDevice(mailbox)) }
}

/// Of a declared SubDevice that was seen, or of one without a declaration.
fn mailbox_at(segment: &SharedSegment, station: StationAddress) -> Option<(MailboxProtocols, Mailbox)> {
    let view = segment.view();
    if view.is_active()
        && let Some(index) = view.subdevices().member_of(station)
    {
        return Some((view.member(index)?.info?.protocols, segment.mailbox(index)?));
    }
    let it = view.subdevices().at(station)?.as_unassigned()?;
    Some((it.knowledge.info()?.protocols, segment.undeclared.of(it.key)?))
}
