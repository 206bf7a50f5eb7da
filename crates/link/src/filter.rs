//! Which frames the kernel hands to a socket, as a classic BPF program.
//!
//! Input: a [`ClassFilter`]. Output: the BPF program. Only EtherType 0x88A4 passes, with or without one VLAN tag. The
//! class filters also test one bit of the first datagram's Idx, which the MainDevice sets in its acyclic frames. Frames
//! of one half of the MainDevice therefore never wake the socket of the other half.

/// The EtherType of EtherCAT.
pub const ETHERCAT: u16 = 0x88A4;
/// EtherType of a VLAN tag.
pub const VLAN: u16 = 0x8100;
/// The bit of Idx that separates the classes: set in acyclic frames.
pub const CLASS_BIT: u8 = 0x80;

/// Offset of the EtherType.
pub(crate) const ETHER_TYPE: u32 = 12;
/// Offset of the first datagram's Idx: Ethernet header 14, EtherCAT header 2, Cmd 1.
const IDX: u32 = 17;
/// Bytes by which a VLAN tag moves both offsets.
const TAG: u32 = 4;
/// Longer than any frame: the whole frame passes.
const WHOLE_FRAME: u32 = 0x4_0000;

/// Frame classes that a socket receives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ClassFilter {
    /// Every EtherCAT frame.
    #[default]
    All,
    /// Frames whose first Idx has [`CLASS_BIT`] clear.
    Cyclic,
    /// Frames whose first Idx has [`CLASS_BIT`] set.
    Acyclic,
}

pub(crate) const LOAD_HALF: u16 = (libc::BPF_LD | libc::BPF_H | libc::BPF_ABS) as u16;
const LOAD_BYTE: u16 = (libc::BPF_LD | libc::BPF_B | libc::BPF_ABS) as u16;
pub(crate) const JUMP_EQUAL: u16 = (libc::BPF_JMP | libc::BPF_JEQ | libc::BPF_K) as u16;
const JUMP_SET: u16 = (libc::BPF_JMP | libc::BPF_JSET | libc::BPF_K) as u16;
const JUMP: u16 = (libc::BPF_JMP | libc::BPF_JA) as u16;
pub(crate) const RETURN: u16 = (libc::BPF_RET | libc::BPF_K) as u16;

/// The program to attach to a packet socket. A load beyond the end of a frame rejects the frame.
pub fn program(filter: ClassFilter) -> [libc::sock_filter; 11] {
    let (set, clear) = match filter {
        ClassFilter::All => (PASS, PASS),
        ClassFilter::Cyclic => (REJECT, PASS),
        ClassFilter::Acyclic => (PASS, REJECT),
    };
    let load = |code, k| libc::sock_filter { code, jt: 0, jf: 0, k };
    // Jump targets are given as positions; the kernel counts from the next instruction.
    let branch =
        |at: u8, code, k: u32, yes: u8, no: u8| libc::sock_filter { code, jt: yes - at - 1, jf: no - at - 1, k };
    [
        load(LOAD_HALF, ETHER_TYPE),
        branch(1, JUMP_EQUAL, u32::from(ETHERCAT), 7, 2),
        branch(2, JUMP_EQUAL, u32::from(VLAN), 3, REJECT),
        load(LOAD_HALF, ETHER_TYPE + TAG),
        branch(4, JUMP_EQUAL, u32::from(ETHERCAT), 5, REJECT),
        load(LOAD_BYTE, IDX + TAG),
        load(JUMP, 1),
        load(LOAD_BYTE, IDX),
        branch(8, JUMP_SET, u32::from(CLASS_BIT), set, clear),
        load(RETURN, 0),
        load(RETURN, WHOLE_FRAME),
    ]
}

/// Positions of the two ends of the program.
const REJECT: u8 = 9;
const PASS: u8 = 10;

#[cfg(test)]
mod tests;
