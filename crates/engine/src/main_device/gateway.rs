//! Messages of a gateway's clients to declared SubDevices (facts 10.1).

use ringcat_wire::mailbox::{ErrorReply, Protocol};
use ringcat_wire::sii::MailboxProtocols;

use super::MainDevice;
use crate::mail::relay::{Desk, RelayCounters, Relayed};
use crate::procedures::fleet::SharedFleet;

impl MainDevice {
    /// Takes a message of a client, EtherCAT header of type 5 included; its answers come out of
    /// [`MainDevice::pop_relayed`]. Any bytes are allowed. The address is the station address of a declared SubDevice;
    /// 0, the MainDevice itself, is answered with an error, since it has no dictionary.
    pub fn relay(&mut self, client: u64, message: &[u8]) {
        let bus = self.supervisor.bus();
        let desk = self.desk.get_or_insert_with(|| Desk::new(&bus));
        let fleet = self.fleet.as_ref();
        desk.take(client, message, |address, protocol| find(fleet, address, protocol));
    }

    /// Takes the oldest answer for a client.
    pub fn pop_relayed(&mut self) -> Option<Relayed> {
        self.desk.as_ref()?.pop()
    }

    /// A client has gone: what it asked for is forgotten, and a transfer of it is ended.
    pub fn forget_client(&mut self, client: u64) {
        if let Some(desk) = &self.desk {
            desk.forget(client);
        }
    }

    /// What clients' messages came to.
    pub fn relay_counters(&self) -> RelayCounters {
        self.desk.as_ref().map(Desk::counters).unwrap_or_default()
    }
}

fn find(fleet: Option<&SharedFleet>, address: u16, protocol: Protocol) -> Result<crate::mail::Mailbox, u16> {
    if address == 0 {
        return Err(ErrorReply::UNSUPPORTED_PROTOCOL);
    }
    let Some(fleet) = fleet else { return Err(ErrorReply::INVALID_HEADER) };
    let access = fleet.access();
    let member = access.members.iter().find(|member| member.station.0 == address);
    let Some((member, info)) = member.and_then(|member| Some((member, member.info.as_ref()?))) else {
        return Err(ErrorReply::INVALID_HEADER);
    };
    let bit = match protocol {
        Protocol::Aoe => MailboxProtocols::AOE,
        Protocol::Eoe => MailboxProtocols::EOE,
        Protocol::Coe => MailboxProtocols::COE,
        Protocol::Foe => MailboxProtocols::FOE,
        Protocol::Soe => MailboxProtocols::SOE,
        Protocol::Voe => MailboxProtocols::VOE,
        Protocol::Error | Protocol::Other(_) => 0,
    };
    if info.protocols.0 & bit == 0 {
        return Err(ErrorReply::UNSUPPORTED_PROTOCOL);
    }
    Ok(member.mailbox.clone())
}
