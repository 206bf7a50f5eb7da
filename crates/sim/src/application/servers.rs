//! The protocol servers behind a device's mailbox, one per protocol that the SII announces (facts 6).
//!
//! In: a message's protocol and payload, the state, the rest of the application. Out: an answer. A protocol that is not
//! announced, or that is not served in this state, gets the mailbox error "protocol not supported".

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::{ErrorReply, Protocol};

use super::coe::{CoeServer, Objects};
use super::dictionary::Dictionary;
use super::mailbox::Answer;
use super::process_data::ProcessData;
use crate::description::MailboxDescription;

/// What servers share with the rest of the application while they serve.
#[derive(Debug)]
pub struct Surroundings<'a> {
    /// What the device announces.
    pub declared: MailboxDescription,
    /// Present state.
    pub state: AlState,
    /// Bytes of each answer behind the mailbox header.
    pub room: usize,
    /// The objects.
    pub dictionary: &'a mut Dictionary,
    /// Values of mapped objects.
    pub process_data: &'a ProcessData,
}

/// The servers of one device with what they remember between two messages.
#[derive(Clone, Debug, Default)]
pub struct Servers {
    coe: CoeServer,
}

impl Servers {
    /// The servers of a device whose mailbox is opened.
    pub fn new() -> Servers {
        Servers::default()
    }

    /// Serves one message.
    pub fn serve(&mut self, protocol: Protocol, payload: &[u8], surroundings: &mut Surroundings<'_>) -> Answer {
        let Surroundings { declared, state, room, .. } = *surroundings;
        let boot = state == AlState::Boot;
        match protocol {
            Protocol::Coe if declared.has_coe() && !boot => {
                let mut objects = Objects {
                    dictionary: surroundings.dictionary,
                    process_data: surroundings.process_data,
                    state,
                    complete_access: declared.coe_details.complete_access(),
                    information: declared.coe_details.sdo_information(),
                };
                self.coe.serve(payload, room, &mut objects)
            }
            // Errors are never answered, or two ends would answer each other for ever.
            Protocol::Error => Answer::Silence,
            Protocol::Aoe
            | Protocol::Eoe
            | Protocol::Coe
            | Protocol::Foe
            | Protocol::Soe
            | Protocol::Voe
            | Protocol::Other(_) => Answer::Error(ErrorReply::UNSUPPORTED_PROTOCOL),
        }
    }
}
