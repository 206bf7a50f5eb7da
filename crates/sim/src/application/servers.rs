//! The protocol servers of a device, one per protocol in the SII (protocol 6).
//!
//! Input: protocol and payload of a message, the state, the context. Output: a response. A protocol that is not in the
//! SII, or not served in this state, gets the mailbox error "protocol not supported".

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::foe::FoeMessage;
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::answer::Answer;
use super::aoe::AoeServer;
use super::coe::{CoeServer, Objects};
use super::dictionary::{Dictionary, type_name};
use super::eoe::EoeServer;
use super::foe::files::FileStore;
use super::foe::{Files, FoeServer};
use super::process_data::ProcessData;
use super::soe::SoeServer;
use super::voe;
use crate::description::{DeviceDescription, MailboxDescription};
use crate::time::SimTime;

/// Context of the servers.
#[derive(Debug)]
pub struct ServerContext<'a> {
    /// Settings of the device.
    pub description: &'a DeviceDescription,
    /// Protocols in the SII.
    pub declared: MailboxDescription,
    /// Current state.
    pub state: AlState,
    /// Largest length of each answer after the mailbox header.
    pub room: usize,
    /// Largest length of each request after the mailbox header.
    pub receive_room: usize,
    /// Current time.
    pub now: SimTime,
    /// The objects.
    pub dictionary: &'a mut Dictionary,
    /// The files.
    pub files: &'a mut FileStore,
    /// Values of mapped objects.
    pub process_data: &'a ProcessData,
}

/// The servers of one device with their state between messages.
#[derive(Clone, Debug, Default)]
pub struct Servers {
    coe: CoeServer,
    foe: FoeServer,
    eoe: Option<EoeServer>,
    soe: Option<SoeServer>,
    aoe: Option<AoeServer>,
}

impl Servers {
    /// The servers of a device when its mailbox is opened.
    pub fn new(description: &DeviceDescription) -> Servers {
        let announced = description.mailbox.map(|mailbox| mailbox.protocols).unwrap_or_default();
        let services = &description.services;
        Servers {
            coe: CoeServer::default(),
            foe: FoeServer::default(),
            eoe: announced.eoe().then(|| EoeServer::new(&services.eoe)),
            soe: announced.soe().then(|| SoeServer::new(&services.soe)),
            aoe: announced.aoe().then(|| AoeServer::new(&services.aoe, type_name(description))),
        }
    }

    /// Ethernet over EtherCAT, if the device supports it.
    pub const fn eoe(&self) -> Option<&EoeServer> {
        self.eoe.as_ref()
    }

    /// The drives, if the device has any.
    pub const fn soe(&self) -> Option<&SoeServer> {
        self.soe.as_ref()
    }

    /// Serves one message.
    pub fn serve(&mut self, protocol: Protocol, payload: &[u8], context: &mut ServerContext<'_>) -> Answer {
        let ServerContext { description, declared, state, room, receive_room, now, .. } = *context;
        let boot = state == AlState::Boot;
        let unsupported = Answer::Error(ErrorReply::UNSUPPORTED_PROTOCOL);
        match protocol {
            // Errors are never answered: two ends could answer each other endlessly.
            Protocol::Error => Answer::Silence,
            Protocol::Foe if declared.protocols.foe() => {
                let mut files = Files {
                    description: &description.services.foe,
                    store: context.files,
                    boot,
                    receive_data: receive_room.saturating_sub(FoeMessage::OVERHEAD),
                    send_data: room.saturating_sub(FoeMessage::OVERHEAD),
                    now,
                };
                self.foe.serve(payload, &mut files)
            }
            _ if boot => unsupported,
            Protocol::Coe if declared.has_coe() => {
                let mut objects = Objects {
                    dictionary: context.dictionary,
                    process_data: context.process_data,
                    state,
                    complete_access: declared.coe_details.complete_access(),
                    information: declared.coe_details.sdo_information(),
                };
                self.coe.serve(payload, room, &mut objects)
            }
            Protocol::Eoe => self.eoe.as_mut().map_or(unsupported, |eoe| eoe.serve(payload, room, now)),
            Protocol::Soe => self.soe.as_mut().map_or(unsupported, |soe| soe.serve(payload, room, state, now)),
            Protocol::Aoe => {
                let dictionary = &mut *context.dictionary;
                self.aoe.as_mut().map_or(unsupported, |aoe| aoe.serve(payload, room, state, dictionary))
            }
            Protocol::Voe if declared.protocols.voe() => voe::serve(payload, room, description.identity.vendor_id),
            Protocol::Coe | Protocol::Foe | Protocol::Voe | Protocol::Other(_) => unsupported,
        }
    }

    /// Runs due work that needs no request.
    pub fn work(&mut self, room: usize, now: SimTime) {
        if let Some(eoe) = &mut self.eoe {
            eoe.run_stack(room, now);
        }
        if let Some(soe) = &mut self.soe {
            soe.end_due_commands(now);
        }
    }

    /// Next time with work that needs no request.
    pub fn next_deadline(&mut self, now: SimTime) -> Option<SimTime> {
        let ethernet = self.eoe.as_mut().and_then(|eoe| eoe.next_deadline(now));
        let command = self.soe.as_ref().and_then(SoeServer::next_deadline);
        ethernet.into_iter().chain(command).min()
    }

    /// An unsolicited message that waits for the mailbox.
    pub fn next_message(&mut self) -> Option<(Protocol, Vec<u8>)> {
        let command = self.soe.as_mut().and_then(SoeServer::next_message).map(|message| (Protocol::Soe, message));
        command.or_else(|| self.eoe.as_mut().and_then(EoeServer::next_message).map(|message| (Protocol::Eoe, message)))
    }
}
