//! Ring and standby marks in the source MAC address (protocol 9.7).
//!
//! Converts the address of the MainDevice's main network interface and the marks of a frame into the source address of
//! the frame, and back. The engine assigns frame ids and discards frames.
//!
//! Two encodings exist. [`MacCodec::FlagsFirst`] (A) is the default and the only encoding with standby marks;
//! [`MacCodec::IdLast`] (B) supports only the ring.

use crate::frame::MacAddress;

/// Bit of byte 0 that is set in frames sent on the redundant link, in both encodings.
pub const REDUNDANT: u8 = 0x08;
/// Bit of byte 0 that a controller with forwarding rule 1 sets in every EtherCAT frame it processes (protocol 2.6).
pub const PROCESSED: u8 = 0x02;
/// Bit of byte 0 in encoding A: a standby MainDevice has forwarded the frame on its main link.
pub const FORWARDED_ON_MAIN: u8 = 0x04;
/// Bit of byte 0 in encoding A: a standby MainDevice has forwarded the frame on its redundant link.
pub const FORWARDED_ON_REDUNDANT: u8 = 0x80;

/// Largest retry index; three bits.
pub const MAX_RETRY: u8 = 7;

const RETRY_SHIFT: u32 = 4;

/// Marks in the source address of a frame, in addition to the identity of its sender.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct SourceMarks {
    /// Sent on the redundant link.
    pub redundant: bool,
    /// Id of both copies of a frame.
    pub frame_id: u8,
    /// Retry index of an acyclic frame, 0..=[`MAX_RETRY`].
    pub retry: u8,
    /// Forwarded by a standby MainDevice on its main link (A only).
    pub forwarded_on_main: bool,
    /// Forwarded by a standby MainDevice on its redundant link (A only).
    pub forwarded_on_redundant: bool,
    /// Processed by a controller with forwarding rule 1. A missing mark is no proof of the opposite (protocol 2.6).
    pub processed: bool,
}

/// Encoding of marks in the source address.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum MacCodec {
    /// Encoding A: flags and retry in byte 0, id in byte 1, identity in bytes 3..=5.
    #[default]
    FlagsFirst,
    /// Encoding B: flags in byte 0, retry added to byte 1, identity in bytes 2..=4, id in byte 5.
    IdLast,
}

const fn flag(set: bool, mask: u8) -> u8 {
    if set { mask } else { 0 }
}

impl MacCodec {
    /// Source address for a frame: `nic` is the address of the main interface, for both copies. Encoding B omits the
    /// forwarding marks. A retry above [`MAX_RETRY`] loses its upper bits.
    pub const fn encode(self, nic: MacAddress, marks: &SourceMarks) -> MacAddress {
        let n = nic.0;
        let retry = marks.retry & MAX_RETRY;
        let flags = flag(marks.redundant, REDUNDANT) | flag(marks.processed, PROCESSED);
        MacAddress(match self {
            MacCodec::FlagsFirst => {
                let flags = flags
                    | retry << RETRY_SHIFT
                    | flag(marks.forwarded_on_main, FORWARDED_ON_MAIN)
                    | flag(marks.forwarded_on_redundant, FORWARDED_ON_REDUNDANT);
                [flags, marks.frame_id, n[2], n[3], n[4], n[5]]
            }
            MacCodec::IdLast => [flags, n[1].wrapping_add(retry), n[2], n[3], n[4], marks.frame_id],
        })
    }

    /// The marks of a received frame. Encoding B has no forwarding marks, and its retry index depends on the sender's
    /// address: see [`MacCodec::retry`].
    pub const fn decode(self, source: MacAddress) -> SourceMarks {
        let flags = source.0[0];
        let (retry, forwarding) = match self {
            MacCodec::FlagsFirst => (flags >> RETRY_SHIFT & MAX_RETRY, flags),
            MacCodec::IdLast => (0, 0),
        };
        SourceMarks {
            redundant: flags & REDUNDANT != 0,
            frame_id: self.frame_id(source),
            retry,
            forwarded_on_main: forwarding & FORWARDED_ON_MAIN != 0,
            forwarded_on_redundant: forwarding & FORWARDED_ON_REDUNDANT != 0,
            processed: flags & PROCESSED != 0,
        }
    }

    /// The id of both copies of a frame.
    pub const fn frame_id(self, source: MacAddress) -> u8 {
        match self {
            MacCodec::FlagsFirst => source.0[1],
            MacCodec::IdLast => source.0[5],
        }
    }

    /// The retry index of a frame of the MainDevice with this main interface.
    pub const fn retry(self, nic: MacAddress, source: MacAddress) -> u8 {
        match self {
            MacCodec::FlagsFirst => source.0[0] >> RETRY_SHIFT & MAX_RETRY,
            MacCodec::IdLast => source.0[1].wrapping_sub(nic.0[1]) & MAX_RETRY,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const A: MacCodec = MacCodec::FlagsFirst;
    const B: MacCodec = MacCodec::IdLast;

    fn mac(bytes: [u8; 6]) -> MacAddress {
        MacAddress(bytes)
    }

    fn round_trip(codec: MacCodec, nic: [u8; 6], marks: SourceMarks, source: [u8; 6]) {
        assert_eq!(codec.encode(mac(nic), &marks), mac(source));
        assert_eq!(codec.decode(mac(source)), marks);
    }

    // covers: 9.7.3, codec-frames
    #[test]
    fn the_trace_with_a_standby_decodes_as_described() {
        let nic = [0x00, 0x00, 0x0E, 0x01, 0xBD, 0x9A];
        let plain = SourceMarks { frame_id: 0x76, ..SourceMarks::default() };
        let redundant = SourceMarks { redundant: true, ..plain };
        let processed = SourceMarks { processed: true, ..plain };
        // 1: the redundant copy directly from the active MainDevice.
        round_trip(A, nic, redundant, [0x08, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
        // 2: the same copy, forwarded by the standby on its redundant link.
        let forwarded = SourceMarks { forwarded_on_redundant: true, ..redundant };
        round_trip(A, nic, forwarded, [0x88, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
        // 3: the main copy after the SubDevices.
        round_trip(A, nic, processed, [0x02, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
        // 4: the main copy, forwarded by the standby on its main link.
        let forwarded = SourceMarks { forwarded_on_main: true, ..processed };
        round_trip(A, nic, forwarded, [0x06, 0x76, 0x0E, 0x01, 0xBD, 0x9A]);
        // 5: the next frame.
        round_trip(A, nic, SourceMarks { frame_id: 0x77, ..processed }, [0x02, 0x77, 0x0E, 0x01, 0xBD, 0x9A]);
    }

    #[test]
    fn a_redundant_copy_that_was_forwarded_on_both_links_has_all_marks() {
        // protocol 9.7.4, CF-05.
        let marks = A.decode(mac([0x8E, 0x10, 0x0E, 0x01, 0xBD, 0x9A]));
        assert!(marks.redundant && marks.processed && marks.forwarded_on_main && marks.forwarded_on_redundant);
        assert_eq!((marks.retry, marks.frame_id), (0, 0x10));
    }

    // covers: codec-frames
    #[test]
    fn the_trace_of_encoding_b_counts_the_id_in_the_last_byte() {
        // protocol 9.7.1, trace of Cable Redundancy 4.2.
        let nic = [0x00, 0x0E, 0x0C, 0x61, 0x3D, 0x7C];
        for id in [1, 2] {
            let main = SourceMarks { frame_id: id, ..SourceMarks::default() };
            round_trip(B, nic, main, [0x00, 0x0E, 0x0C, 0x61, 0x3D, id]);
            round_trip(B, nic, SourceMarks { redundant: true, ..main }, [0x08, 0x0E, 0x0C, 0x61, 0x3D, id]);
        }
    }

    #[test]
    fn the_retry_index_is_three_bits() {
        let nic = mac([0x02, 0xFE, 0x0C, 0x61, 0x3D, 0x7C]);
        let marks = SourceMarks { retry: 5, frame_id: 9, ..SourceMarks::default() };
        assert_eq!(A.encode(nic, &marks), mac([0x50, 0x09, 0x0C, 0x61, 0x3D, 0x7C]));
        assert_eq!(B.encode(nic, &marks), mac([0x00, 0x03, 0x0C, 0x61, 0x3D, 0x09]));
        for codec in [A, B] {
            assert_eq!(codec.retry(nic, codec.encode(nic, &marks)), 5);
            assert_eq!(codec.retry(nic, codec.encode(nic, &SourceMarks { retry: 9, ..marks })), 1);
        }
        assert_eq!(A.decode(A.encode(nic, &marks)).retry, 5);
    }

    #[test]
    fn marks_keep_the_identity_of_the_sender() {
        let nic = mac([0x00, 0x0E, 0x0C, 0x61, 0x3D, 0x7C]);
        let marks =
            SourceMarks { redundant: true, frame_id: 0xFF, retry: 7, processed: true, ..SourceMarks::default() };
        for (codec, kept) in [(A, 3..6), (B, 2..5)] {
            assert_eq!(codec.encode(nic, &marks).0[kept.clone()], nic.0[kept.clone()]);
            let other = codec.encode(mac([0x00, 0x0E, 0x0C, 0x61, 0x3E, 0x7C]), &marks);
            assert_ne!(other.0[kept.clone()], nic.0[kept]);
        }
        let forwarded = SourceMarks { forwarded_on_main: true, ..marks };
        assert!(A.decode(A.encode(nic, &forwarded)).forwarded_on_main);
        assert_eq!(B.encode(nic, &forwarded), B.encode(nic, &marks), "encoding B has no marks for it");
    }

    proptest! {
        // covers: codec-frames
        #[test]
        fn any_address_round_trips_except_for_reserved_bits(bytes in any::<[u8; 6]>()) {
            let source = mac(bytes);
            let mut expected = bytes;
            expected[0] &= !0x01;
            prop_assert_eq!(A.encode(source, &A.decode(source)), mac(expected));
            expected[0] &= REDUNDANT | PROCESSED;
            prop_assert_eq!(B.encode(source, &B.decode(source)), mac(expected));
        }
    }
}
