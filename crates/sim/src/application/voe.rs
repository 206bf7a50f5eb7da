//! The VoE server of a device: echoes messages (protocol 6.8).

use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::voe::VoeMessage;

use super::answer::Answer;

/// Answers one message of this vendor with the same content; messages of other vendors are ignored.
pub fn serve(payload: &[u8], room: usize, vendor_id: u32) -> Answer {
    match VoeMessage::decode(payload) {
        Ok(message) if message.vendor_id != vendor_id => Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED),
        Ok(_) if payload.len() > room => Answer::Error(ErrorReply::INVALID_SIZE),
        Ok(_) => Answer::payload(payload.to_vec()),
        Err(_) => Answer::Error(ErrorReply::SIZE_TOO_SHORT),
    }
}
