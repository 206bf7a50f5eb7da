//! Error codes in the mail of SubDevices, as defined by each protocol (protocol 6.1, 6.3, 6.4, 6.6, 6.7).

use ringcat_wire::mailbox::aoe::{AdsErrorCode, AdsResponse, AmsHeader};
use ringcat_wire::mailbox::coe::{CoeHeader, CoeService, InformationOpcode, SdoInformation};
use ringcat_wire::mailbox::foe::FoeMessage;
use ringcat_wire::mailbox::sdo::SdoResponse;
use ringcat_wire::mailbox::soe::SoeMessage;
use ringcat_wire::mailbox::{ErrorReply, Message, Protocol};

/// The error in a mail, if there is one: the code of an SDO abort, the detail of an error reply, the code of FoE, SoE
/// or ADS. Any bytes are allowed.
pub(super) fn error_in(message: &Message<'_>) -> Option<u32> {
    let payload = message.payload;
    let code = match message.header.protocol {
        Protocol::Error => u32::from(ErrorReply::decode(payload.first_chunk()?).detail),
        Protocol::Coe => coe(payload)?,
        Protocol::Foe => match FoeMessage::decode(payload).ok()? {
            FoeMessage::Error { code, .. } => code.0,
            FoeMessage::Read { .. }
            | FoeMessage::Write { .. }
            | FoeMessage::Data { .. }
            | FoeMessage::Acknowledge { .. }
            | FoeMessage::Busy { .. } => return None,
        },
        Protocol::Soe => u32::from(SoeMessage::decode(payload).ok()?.error_code()?.0),
        Protocol::Aoe => aoe(payload)?,
        Protocol::Eoe | Protocol::Voe | Protocol::Other(_) => return None,
    };
    (code != 0).then_some(code)
}

fn coe(payload: &[u8]) -> Option<u32> {
    match CoeHeader::decode(payload.first_chunk()?).service {
        // An abort has the service of a request in both directions.
        CoeService::SdoRequest | CoeService::SdoResponse => match SdoResponse::decode(payload).ok()? {
            SdoResponse::Abort { code, .. } => Some(code.0),
            _ => None,
        },
        CoeService::SdoInformation => {
            let information = SdoInformation::decode(payload).ok()?;
            let is_error = information.opcode == InformationOpcode::Error;
            is_error.then(|| information.data.first_chunk().map(|code| u32::from_le_bytes(*code)))?
        }
        _ => None,
    }
}

fn aoe(payload: &[u8]) -> Option<u32> {
    let (header, data) = AmsHeader::decode(payload).ok()?;
    if !header.is_response() {
        return None;
    }
    let undelivered = Some(header.error).filter(|error| *error != AdsErrorCode::NO_ERROR);
    undelivered.or_else(|| Some(AdsResponse::decode(header.command, data).ok()?.result())).map(|error| error.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::mailbox::Header;

    fn error_of(protocol: Protocol, payload: &[u8]) -> Option<u32> {
        let header = Header::new(protocol, 1, payload.len() as u16);
        error_in(&Message { header, payload })
    }

    // covers: 6, own-objects
    #[test]
    fn errors_of_all_protocols_are_detected_and_other_mail_is_no_error() {
        let abort = [0x00, 0x30, 0x80, 0x00, 0x20, 0x01, 0x11, 0x00, 0x09, 0x06];
        assert_eq!(error_of(Protocol::Coe, &abort), Some(0x0609_0011));
        let from_a_device = [0x00, 0x20, 0x80, 0x00, 0x20, 0x01, 0x00, 0x00, 0x02, 0x06];
        assert_eq!(error_of(Protocol::Coe, &from_a_device), Some(0x0602_0000));
        let uploaded = [0x00, 0x30, 0x4F, 0x00, 0x20, 0x01, 0x07, 0, 0, 0];
        assert_eq!(error_of(Protocol::Coe, &uploaded), None);
        let information = [0x00, 0x80, 0x07, 0x00, 0x00, 0x00, 0x00, 0x00, 0x02, 0x06];
        assert_eq!(error_of(Protocol::Coe, &information), Some(0x0602_0000));
        assert_eq!(error_of(Protocol::Error, &[1, 0, 2, 0]), Some(2));
        assert_eq!(error_of(Protocol::Foe, &[5, 0, 1, 0x80, 0, 0, b'n', b'o']), Some(0x8001));
        assert_eq!(error_of(Protocol::Foe, &[4, 0, 1, 0, 0, 0]), None);
        assert_eq!(error_of(Protocol::Soe, &[0x12, 0x40, 1, 0, 1, 0x10]), Some(0x1001));
        assert_eq!(error_of(Protocol::Soe, &[0x02, 0x40, 1, 0, 1, 0x10]), None);
        let mut ads = [0; 36];
        (ads[16], ads[18], ads[20], ads[32]) = (3, 5, 4, 7);
        assert_eq!(error_of(Protocol::Aoe, &ads), Some(7));
        ads[18] = 4;
        assert_eq!(error_of(Protocol::Aoe, &ads), None, "a request of the SubDevice contains no error");
        for protocol in [Protocol::Coe, Protocol::Error, Protocol::Foe, Protocol::Soe, Protocol::Aoe, Protocol::Voe] {
            assert_eq!(error_of(protocol, &[]), None);
        }
    }
}
