//! The CoE server of a device (protocol 6.3): selects the service; `transfer` serves SDOs, `information` SDO
//! information, `pdo` PDOs by mailbox.
//!
//! Input: the payload of a CoE message, the dictionary, the process data (values of mapped objects), the state. Output:
//! the payloads of the answer. Emergencies are sent by other modules; a message that is not a request gets the mailbox
//! error "service not supported".

mod information;
mod objects;
mod pdo;
mod transfer;

use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::coe::{CoeHeader, CoeService, Emergency};

use super::answer::Answer;
use transfer::Transfer;

pub use super::dictionary::MAX_TRANSFER_BYTES;
pub use objects::Objects;

/// The server with its state between messages.
#[derive(Clone, Debug, Default)]
pub struct CoeServer {
    transfer: Transfer,
}

impl CoeServer {
    /// Serves one message. `room` is the largest payload of each answer after the mailbox header.
    pub fn serve(&mut self, payload: &[u8], room: usize, objects: &mut Objects<'_>) -> Answer {
        let Some(header) = payload.first_chunk() else {
            return Answer::Error(ErrorReply::SIZE_TOO_SHORT);
        };
        let data = &payload[CoeHeader::LEN..];
        let CoeHeader { number, service, .. } = CoeHeader::decode(header);
        match service {
            CoeService::SdoRequest => self.transfer.serve(payload, room, objects),
            CoeService::SdoInformation if objects.information => information::serve(payload, room, objects.dictionary),
            CoeService::RxPdo => pdo::receive(number, data, objects),
            CoeService::TxPdoRemote => pdo::send(CoeService::TxPdo, number, room, objects),
            CoeService::RxPdoRemote => pdo::send(CoeService::RxPdo, number, room, objects),
            CoeService::Emergency
            | CoeService::SdoResponse
            | CoeService::TxPdo
            | CoeService::SdoInformation
            | CoeService::Other(_) => Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED),
        }
    }
}

/// An emergency as the payload of a message.
pub fn emergency_payload(emergency: &Emergency) -> Vec<u8> {
    let mut payload = CoeHeader::new(CoeService::Emergency).encode().to_vec();
    payload.extend_from_slice(&emergency.encode());
    payload
}
