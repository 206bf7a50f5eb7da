//! VoE: messages of a vendor (protocol 6.8).

use super::payload::{FieldWriter, PayloadError, split};

/// A message of a vendor; the vendor defines the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VoeMessage<'a> {
    /// Vendor, as in the identity.
    pub vendor_id: u32,
    /// Message type, defined by the vendor.
    pub vendor_type: u16,
    /// The data.
    pub data: &'a [u8],
}

impl<'a> VoeMessage<'a> {
    /// Bytes before the data.
    pub const OVERHEAD: usize = 6;

    /// Decodes the payload of a mailbox message of protocol VoE.
    pub fn decode(payload: &'a [u8]) -> Result<VoeMessage<'a>, PayloadError> {
        let (&[a, b, c, d, e, f], data) = split(payload, "VoE message")?;
        Ok(VoeMessage { vendor_id: u32::from_le_bytes([a, b, c, d]), vendor_type: u16::from_le_bytes([e, f]), data })
    }

    /// Encodes the payload and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        writer.put_u32(self.vendor_id)?;
        writer.put_u16(self.vendor_type)?;
        writer.put(self.data)?;
        Some(writer.length())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    // covers: 6.8, codec-mailbox
    #[test]
    fn a_vendor_message_has_the_expected_bytes() {
        let message = VoeMessage { vendor_id: 0x0000_0C47, vendor_type: 0x0102, data: b"hello" };
        let bytes = b"\x47\x0C\x00\x00\x02\x01hello";
        let mut out = [0; 16];
        assert_eq!(message.encode(&mut out), Some(11));
        assert_eq!(&out[..11], bytes);
        assert_eq!(VoeMessage::decode(bytes), Ok(message));
        assert_eq!(message.encode(&mut out[..10]), None);
        let short = PayloadError::Short { what: "VoE message", expected: 6, got: 5 };
        assert_eq!(VoeMessage::decode(&bytes[..5]), Err(short));
    }

    proptest! {
        #[test]
        fn any_bytes_never_panic_and_decoded_messages_encode_back(
            bytes in proptest::collection::vec(any::<u8>(), 0..40)
        ) {
            if let Ok(message) = VoeMessage::decode(&bytes) {
                let mut out = [0; 64];
                let length = message.encode(&mut out).unwrap();
                prop_assert_eq!(&out[..length], &bytes[..]);
            }
        }
    }
}
