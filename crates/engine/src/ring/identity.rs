//! Marks that a MainDevice puts on its frames, and their recognition.
//!
//! The source address carries the identity of the MainDevice, the bit of the link on which the copy was sent, and the
//! lower 8 bits of the frame's sequence number (protocol 9.7.1, 9.7.2). The Idx of every datagram carries the class bit
//! and 7 further bits, so that a frame that was delayed by more than 256 others never counts as a new one.

use ringcat_wire::datagram;
use ringcat_wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, ETHERTYPE, MacAddress};
use ringcat_wire::source_address::{MacCodec, SourceMarks};

use crate::link::Link;

/// Offset of the source address in a frame.
const SOURCE_AT: usize = 6;
/// Offset of the EtherType, which follows the source address.
const ETHERTYPE_AT: usize = SOURCE_AT + 6;
/// Offset of the byte with the EtherCAT type in its upper half.
const KIND_AT: usize = ETHERNET_HEADER_LEN + 1;
/// Offset of the first datagram.
pub(crate) const DATAGRAMS_AT: usize = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN;
/// Offset of the first datagram's Idx.
const FIRST_INDEX_AT: usize = DATAGRAMS_AT + 1;
/// Bit of the source address that distinguishes the copies (protocol SM-01).
const REDUNDANT_BIT: u8 = 0x08;
/// Bit of Idx that distinguishes the classes.
const CLASS_BIT: u8 = 0x80;
/// Of the four bytes before the first datagram's address, the EtherCAT type and the class bit; and these in a cyclic
/// frame.
const TYPE_AND_CLASS: u32 = 0x8000_F000;
const CYCLIC: u32 = 0x0000_1000;

/// The half of the engine that sent a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Class {
    /// Sent by the exchange.
    Cyclic,
    /// Sent by the supervisor.
    Acyclic,
}

/// Sequence number of a frame within its class, 15 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Sequence(u16);

impl Sequence {
    /// The number after this one.
    #[must_use]
    pub const fn next(self) -> Sequence {
        Sequence((self.0 + 1) & 0x7FFF)
    }

    /// Number of the frame with this count, from 1 on; 0 before the first frame.
    pub const fn of_frame(count: u64) -> Sequence {
        Sequence(count as u16 & 0x7FFF)
    }

    /// The number.
    pub const fn number(self) -> u16 {
        self.0
    }

    /// How many frames later this number is than another one; negative if it is earlier.
    #[cfg(feature = "standby")]
    pub(crate) const fn since(self, other: Sequence) -> i16 {
        // The numbers have 15 bits.
        (self.0.wrapping_sub(other.0) << 1) as i16 >> 1
    }

    /// The lower 8 bits, RedFrameId in docs/protocol.
    pub const fn frame_id(self) -> u8 {
        self.0 as u8
    }

    /// The Idx of a datagram of this frame.
    pub const fn index(self, class: Class) -> u8 {
        let high = (self.0 >> 8) as u8 & 0x7F;
        match class {
            Class::Cyclic => high,
            Class::Acyclic => high | CLASS_BIT,
        }
    }

    /// From frame id and Idx.
    pub const fn from_wire(frame_id: u8, index: u8) -> Sequence {
        Sequence(frame_id as u16 | ((index & !CLASS_BIT) as u16) << 8)
    }
}

/// A copy of a frame of this MainDevice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameCopy {
    /// The half that sent it.
    pub class: Class,
    /// Its sequence number.
    pub sequence: Sequence,
    /// The link it was sent on.
    pub sent_on: Link,
}

/// Classification of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Classified {
    /// A copy of a frame of this MainDevice.
    Ours(FrameCopy),
    /// An EtherCAT frame of another MainDevice (protocol MR-10).
    Foreign,
    /// Not an EtherCAT frame with datagrams.
    Other,
}

/// Identity of this MainDevice on the wire.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    codec: MacCodec,
    main: MacAddress,
    id_at: usize,
    /// Position of the frame id in the eight bytes from the source address on, in bits.
    id_shift: u32,
    /// Bits of the eight bytes from the source address on that identify frames of this MainDevice: identity and
    /// EtherType.
    own_mask: u64,
    /// These bits with the identity of the main and of the redundant interface.
    own: [u64; 2],
}

impl Identity {
    /// The addresses of the interfaces; both copies of a frame carry those of the main one (protocol SM-07).
    pub fn new(codec: MacCodec, main: MacAddress, redundant: Option<MacAddress>) -> Identity {
        let (id_at, mask) = match codec {
            MacCodec::FlagsFirst => (SOURCE_AT + 1, [0, 0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]),
            MacCodec::IdLast => (SOURCE_AT + 5, [0, 0, 0xFF, 0xFF, 0xFF, 0, 0xFF, 0xFF]),
        };
        let own_mask = u64::from_le_bytes(mask);
        let own = [main, redundant.unwrap_or(main)].map(|address| {
            let [a, b, c, d, e, f] = address.0;
            let [high, low] = ETHERTYPE.to_be_bytes();
            u64::from_le_bytes([a, b, c, d, e, f, high, low]) & own_mask
        });
        Identity { codec, main, id_at, id_shift: 8 * (id_at - SOURCE_AT) as u32, own_mask, own }
    }

    /// The source address of the main copy of frame zero, for a frame under construction.
    pub fn source(&self) -> MacAddress {
        self.marked(Sequence::default(), 0)
    }

    fn marked(&self, sequence: Sequence, retry: u8) -> MacAddress {
        self.codec.encode(self.main, &SourceMarks { frame_id: sequence.frame_id(), retry, ..SourceMarks::default() })
    }

    /// Writes the source address of the main copy into a built frame. `retry` is the number of retries (protocol
    /// SM-04).
    pub(crate) fn stamp(&self, frame: &mut [u8], sequence: Sequence, retry: u8) {
        frame[SOURCE_AT..SOURCE_AT + 6].copy_from_slice(&self.marked(sequence, retry).0);
    }

    /// Changes only the frame id of a frame that [`Identity::stamp`] or [`Identity::source`] marked before.
    pub(crate) fn restamp(&self, frame: &mut [u8], sequence: Sequence) {
        frame[self.id_at] = sequence.frame_id();
    }

    /// Makes a frame the copy for the redundant link, or the main copy again.
    pub(crate) fn mark_redundant(frame: &mut [u8], redundant: bool) {
        if redundant {
            frame[SOURCE_AT] |= REDUNDANT_BIT;
        } else {
            frame[SOURCE_AT] &= !REDUNDANT_BIT;
        }
    }

    /// The sequence number of a received frame, where it is the main copy of a cyclic frame of this MainDevice with the
    /// address of the main interface. `None` does not say that it is not: [`Identity::classify`] does.
    #[inline(always)]
    pub(crate) fn main_cyclic(&self, bytes: &[u8]) -> Option<Sequence> {
        let head = bytes.first_chunk::<{ DATAGRAMS_AT + datagram::OVERHEAD }>()?;
        let (mut word, mut tail) = ([0; 8], [0; 4]);
        word.copy_from_slice(&head[SOURCE_AT..SOURCE_AT + 8]);
        tail.copy_from_slice(&head[ETHERNET_HEADER_LEN..FIRST_INDEX_AT + 1]);
        let (word, tail) = (u64::from_le_bytes(word), u32::from_le_bytes(tail));
        let is_ours = word & (self.own_mask | u64::from(REDUNDANT_BIT)) == self.own[0];
        let sequence = Sequence::from_wire((word >> self.id_shift) as u8, (tail >> 24) as u8);
        (is_ours && tail & TYPE_AND_CLASS == CYCLIC).then_some(sequence)
    }

    /// Classifies a received frame. Any bytes are allowed; only untagged Ethernet frames can be frames of this
    /// MainDevice.
    #[inline]
    pub fn classify(&self, bytes: &[u8]) -> Classified {
        let Some(head) = bytes.first_chunk::<{ DATAGRAMS_AT + datagram::OVERHEAD }>() else {
            return Classified::Other;
        };
        // Slices of constant length: the compiler loads eight bytes at once.
        let mut word = [0; 8];
        word.copy_from_slice(&head[SOURCE_AT..SOURCE_AT + 8]);
        let word = u64::from_le_bytes(word);
        if head[KIND_AT] >> 4 != 1 {
            return Classified::Other;
        }
        let own = word & self.own_mask;
        if own != self.own[0] && own != self.own[1] {
            let ethercat = head[ETHERTYPE_AT..ETHERTYPE_AT + 2] == ETHERTYPE.to_be_bytes();
            return if ethercat { Classified::Foreign } else { Classified::Other };
        }
        let index = head[FIRST_INDEX_AT];
        Classified::Ours(FrameCopy {
            class: if index & CLASS_BIT == 0 { Class::Cyclic } else { Class::Acyclic },
            sequence: Sequence::from_wire((word >> self.id_shift) as u8, index),
            sent_on: if word as u8 & REDUNDANT_BIT == 0 { Link::Main } else { Link::Redundant },
        })
    }
}

/// The half for which a received frame is, without the identity of the MainDevice: the class bit of its first datagram.
/// Foreign frames are classified by the same bit. `None` if there is no first datagram.
pub fn class_of(bytes: &[u8]) -> Option<Class> {
    let index = *bytes.get(FIRST_INDEX_AT)?;
    Some(if index & CLASS_BIT == 0 { Class::Cyclic } else { Class::Acyclic })
}

/// Whether an INACTIVE MainDevice has forwarded a received frame (protocol CF-01), whose source address begins with the
/// marks.
#[cfg(feature = "standby")]
pub(crate) fn is_forwarded(bytes: &[u8]) -> bool {
    use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT};
    bytes.get(SOURCE_AT).is_some_and(|marks| marks & (FORWARDED_ON_MAIN | FORWARDED_ON_REDUNDANT) != 0)
}

/// The sender of a frame of another MainDevice, and the sequence number of the frame, if that one writes source
/// addresses and Idx as this library does by default. `None` if there is no first datagram.
#[cfg(feature = "standby")]
pub(crate) fn foreign_frame(bytes: &[u8]) -> Option<([u8; 3], Sequence)> {
    let head = bytes.first_chunk::<{ FIRST_INDEX_AT + 1 }>()?;
    let sender = [head[SOURCE_AT + 3], head[SOURCE_AT + 4], head[SOURCE_AT + 5]];
    Some((sender, Sequence::from_wire(head[SOURCE_AT + 1], head[FIRST_INDEX_AT])))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NIC: MacAddress = MacAddress([0x00, 0x30, 0x64, 0x11, 0x22, 0x33]);

    fn identity() -> Identity {
        Identity::new(MacCodec::FlagsFirst, NIC, Some(MacAddress([0, 0x30, 0x64, 0x11, 0x22, 0x34])))
    }

    fn frame(sequence: Sequence, class: Class) -> [u8; 60] {
        let mut bytes = [0; 60];
        bytes[12] = 0x88;
        bytes[13] = 0xA4;
        bytes[15] = 0x10;
        bytes[FIRST_INDEX_AT] = sequence.index(class);
        identity().stamp(&mut bytes, sequence, 0);
        bytes
    }

    // covers: CR-04, CR-24, SM-02, ring-merge
    #[test]
    fn both_copies_are_recognised_after_controllers_set_the_local_bit() {
        let mut sequence = Sequence::default();
        for _ in 0..70_000 {
            let mut bytes = frame(sequence, Class::Acyclic);
            bytes[6] |= 0x02;
            let copy = FrameCopy { class: Class::Acyclic, sequence, sent_on: Link::Main };
            assert_eq!(identity().classify(&bytes), Classified::Ours(copy));
            assert_eq!(identity().main_cyclic(&bytes), None);
            Identity::mark_redundant(&mut bytes, true);
            let copy = FrameCopy { sent_on: Link::Redundant, ..copy };
            assert_eq!(identity().classify(&bytes), Classified::Ours(copy));
            sequence = sequence.next();
        }
    }

    // covers: CR-04, SM-03, ring-merge
    #[test]
    fn a_frame_that_is_256_frames_old_has_another_sequence_number() {
        let old = Sequence::default();
        let new = (0..256).fold(old, |sequence, _| sequence.next());
        assert_eq!(old.frame_id(), new.frame_id());
        let bytes = frame(old, Class::Cyclic);
        let Classified::Ours(copy) = identity().classify(&bytes) else { panic!("not ours") };
        assert_ne!(copy.sequence, new);
    }

    // covers: CR-24, SM-08
    #[test]
    fn the_short_way_finds_the_main_copies_of_cyclic_frames_alone() {
        let sequence = Sequence::of_frame(0x1234);
        let mut bytes = frame(sequence, Class::Cyclic);
        bytes[6] |= 0x02;
        assert_eq!(identity().main_cyclic(&bytes), Some(sequence));
        let others: [(usize, u8); 5] = [(6, 0x08), (9, 1), (12, 1), (15, 0x20), (17, 0x80)];
        for (at, bits) in others {
            bytes[at] ^= bits;
            assert_eq!(identity().main_cyclic(&bytes), None, "byte {at}");
            bytes[at] ^= bits;
        }
        assert_eq!(identity().main_cyclic(&bytes[..27]), None);
    }

    // covers: SM-08, ring-merge
    #[test]
    fn frames_of_other_maindevices_are_foreign_and_short_frames_are_other() {
        let mut bytes = frame(Sequence::default(), Class::Cyclic);
        bytes[11] ^= 0x40;
        assert_eq!(identity().classify(&bytes), Classified::Foreign);
        assert_eq!(identity().classify(&bytes[..20]), Classified::Other);
        bytes[12] = 0x08;
        assert_eq!(identity().classify(&bytes), Classified::Other);
    }
}
