//! Frames of one sender on interfaces where they are not expected.
//!
//! Input: a source address with a mask, and the interfaces in use. Output: the first bytes of EtherCAT frames with that
//! source that arrive on another interface, and the name of that interface. One socket listens on all interfaces, also
//! on those created later. The kernel filters all other frames, so traffic of other segments wakes no thread. An
//! interface on top of another (bridge, bond, macvlan) is left out: it would show frames a second time. The other end
//! of a veth pair in the same namespace is left out too.

use std::mem::{size_of, zeroed};
use std::os::fd::{AsFd, AsRawFd, OwnedFd, RawFd};
use std::{fs, io};

use crate::error::LinkError;
use crate::filter::{self, ETHER_TYPE, JUMP_EQUAL, LOAD_HALF, RETURN};
use crate::interface;
use crate::kernel;
use crate::packet_socket;

/// Bytes of a frame that are kept: the headers and the first datagrams.
pub const KEPT: usize = 64;
/// Largest number of interfaces to exclude; a filter has to stay small.
const MAX_LEFT_OUT: usize = 64;
/// Interface index for a packet socket that is not bound to one interface.
const ALL_INTERFACES: libc::c_int = 0;
/// Offsets of the source address, as two bytes and four.
const SOURCE: [u32; 2] = [6, 8];
/// Offset at which a filter reads the index of the receiving interface.
const INTERFACE: u32 = (libc::SKF_AD_OFF + libc::SKF_AD_IFINDEX) as u32;

const LOAD_WORD: u16 = (libc::BPF_LD | libc::BPF_W | libc::BPF_ABS) as u16;
const AND: u16 = (libc::BPF_ALU | libc::BPF_AND | libc::BPF_K) as u16;

/// A sender, identified by bits of the source address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sender {
    /// The address.
    pub address: [u8; 6],
    /// The bits to compare.
    pub mask: [u8; 6],
}

/// A received frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReceivedFrame {
    /// Name of the interface that it arrived on.
    pub interface: String,
    /// Its first bytes, at most [`KEPT`].
    pub bytes: Vec<u8>,
}

/// A socket on all interfaces except some.
#[derive(Debug)]
pub struct Listener {
    fd: OwnedFd,
}

impl Listener {
    /// Listens for a sender on all interfaces except `except`. Interfaces that exist now accept frames to the EtherCAT
    /// group address while the listener is open; all interfaces accept broadcast. Waits for locks of the kernel: not
    /// for the cyclic thread.
    ///
    /// # Errors
    /// A missing permission, or a kernel without packet sockets.
    pub fn open(sender: Sender, except: &[&str]) -> Result<Listener, LinkError> {
        let failed = |what| move |errno| LinkError::from_errno("all interfaces", what, errno);
        // Protocol 0 receives nothing until the filter is in place.
        let fd = kernel::socket(libc::AF_PACKET, libc::SOCK_RAW | libc::SOCK_NONBLOCK, 0)
            .map_err(failed("opening a packet socket"))?;
        let raw = fd.as_raw_fd();
        // Before Linux 4.20 only the filter removes outgoing frames.
        let _ = kernel::set_option(raw, libc::SOL_PACKET, kernel::PACKET_IGNORE_OUTGOING, &1);
        let mut left_out = interface::indices(|name| except.contains(&name) || is_stacked(name));
        // A frame sent on one end of a veth pair arrives at the other end by design.
        left_out.extend(except.iter().filter_map(|name| interface::peer(name)));
        let mut program = program(sender, &left_out);
        packet_socket::attach(raw, &mut program).map_err(failed("attaching the filter"))?;
        packet_socket::bind(raw, ALL_INTERFACES, filter::ETHERCAT).map_err(failed("binding to all interfaces"))?;
        for index in interface::indices(|_| true).into_iter().filter(|index| !left_out.contains(index)) {
            // An interface that cannot join still receives broadcast.
            let _ = packet_socket::join(raw, index as libc::c_int, false);
        }
        Ok(Listener { fd })
    }

    /// Waits for a frame; `None` if `end` becomes readable or its other side closes, or if the kernel fails.
    pub fn receive(&self, end: &impl AsFd) -> Option<ReceivedFrame> {
        loop {
            let place = |fd| libc::pollfd { fd, events: libc::POLLIN, revents: 0 };
            let mut polled = [place(self.fd.as_raw_fd()), place(end.as_fd().as_raw_fd())];
            // SAFETY: the pointer refers to two live entries.
            let result = unsafe { libc::poll(polled.as_mut_ptr(), 2, -1) };
            if result < 0 && kernel::errno() != libc::EINTR || polled[1].revents != 0 {
                return None;
            }
            if result > 0 {
                match take(self.fd.as_raw_fd()) {
                    Ok(frame) => return Some(frame),
                    Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                    // One of the interfaces went down: the socket keeps working for the others, and the interface may
                    // come back.
                    Err(error) if error.raw_os_error() == Some(libc::ENETDOWN) => {}
                    Err(_) => return None,
                }
            }
        }
    }
}

fn take(fd: RawFd) -> io::Result<ReceivedFrame> {
    let mut bytes = vec![0; KEPT];
    // SAFETY: all bytes zero is a valid sockaddr_ll.
    let mut from: libc::sockaddr_ll = unsafe { zeroed() };
    let mut length = size_of::<libc::sockaddr_ll>() as libc::socklen_t;
    // SAFETY: both pointers refer to live memory of the lengths that are passed.
    let received = unsafe {
        let from = std::ptr::from_mut(&mut from).cast();
        libc::recvfrom(fd, bytes.as_mut_ptr().cast(), bytes.len(), 0, from, &mut length)
    };
    if received < 0 {
        return Err(io::Error::last_os_error());
    }
    bytes.truncate(received as usize);
    let index = from.sll_ifindex as u32;
    Ok(ReceivedFrame { interface: interface::name_of(index).unwrap_or_else(|| format!("interface {index}")), bytes })
}

/// Whether an interface lies on top of another interface.
fn is_stacked(name: &str) -> bool {
    let entries = fs::read_dir(format!("/sys/class/net/{name}")).into_iter().flatten().flatten();
    entries.into_iter().any(|entry| entry.file_name().as_encoded_bytes().starts_with(b"lower_"))
}

/// A filter for the first bytes of EtherCAT frames from `sender` on all interfaces except these.
fn program(sender: Sender, left_out: &[u32]) -> Vec<libc::sock_filter> {
    let plain = |code, k| libc::sock_filter { code, jt: 0, jf: 0, k };
    let left_out = &left_out[..left_out.len().min(MAX_LEFT_OUT)];
    let two = |bytes: [u8; 6]| u32::from(u16::from_be_bytes([bytes[0], bytes[1]]));
    let four = |bytes: [u8; 6]| u32::from_be_bytes([bytes[2], bytes[3], bytes[4], bytes[5]]);
    let Sender { address, mask } = sender;
    let mut program = vec![plain(LOAD_HALF, ETHER_TYPE), plain(JUMP_EQUAL, filter::ETHERCAT.into())];
    for (load, at, mask, address) in
        [(LOAD_HALF, SOURCE[0], two(mask), two(address)), (LOAD_WORD, SOURCE[1], four(mask), four(address))]
    {
        program.extend([plain(load, at), plain(AND, mask), plain(JUMP_EQUAL, address & mask)]);
    }
    let comparisons = program.len();
    program.push(plain(LOAD_WORD, INTERFACE));
    program.extend(left_out.iter().map(|index| plain(JUMP_EQUAL, *index)));
    program.extend([plain(RETURN, KEPT as u32), plain(RETURN, 0)]);
    // The last instruction rejects: it is the target if a comparison of the frame fails or a comparison of the
    // interface matches.
    let reject = program.len() - 1;
    for (at, instruction) in program.iter_mut().enumerate().filter(|(_, instruction)| instruction.code == JUMP_EQUAL) {
        let way = (reject - at - 1) as u8;
        (instruction.jt, instruction.jf) = if at < comparisons { (0, way) } else { (way, 0) };
    }
    program
}

#[cfg(test)]
mod tests {
    use super::*;

    const SENDER: Sender = Sender { address: [0x02, 0xee, 0x5e, 0x11, 0x22, 0x33], mask: [0, 0, 0, 0xff, 0xff, 0xff] };

    /// Runs a program on a frame as the kernel does.
    fn run(program: &[libc::sock_filter], frame: &[u8], interface: u32) -> u32 {
        let (mut at, mut accumulator) = (0, 0u32);
        loop {
            let libc::sock_filter { code, jt, jf, k } = program[at];
            at += 1;
            let load = |size: usize| {
                let bytes = frame.get(k as usize..k as usize + size)?;
                Some(bytes.iter().fold(0, |word, byte| word << 8 | u32::from(*byte)))
            };
            let loaded = match code {
                LOAD_WORD if k == INTERFACE => Some(interface),
                LOAD_HALF => load(2),
                LOAD_WORD => load(4),
                AND => Some(accumulator & k),
                JUMP_EQUAL => {
                    at += usize::from(if accumulator == k { jt } else { jf });
                    continue;
                }
                RETURN => return k,
                other => panic!("instruction {other:#06x} is not implemented in this test"),
            };
            let Some(loaded) = loaded else { return 0 };
            accumulator = loaded;
        }
    }

    fn frame() -> Vec<u8> {
        let mut frame = vec![0xff; 6];
        frame.extend([0x03, 0x07, 0x5e, 0x11, 0x22, 0x33, 0x88, 0xa4, 0x0e, 0x10]);
        frame.resize(60, 0);
        frame
    }

    #[test]
    fn frames_of_the_sender_pass_on_interfaces_that_are_not_left_out() {
        for left_out in [&[][..], &[3], &[3, 4, 5]] {
            let program = program(SENDER, left_out);
            for interface in 1..8 {
                let passes = run(&program, &frame(), interface) > 0;
                assert_eq!(passes, !left_out.contains(&interface), "{interface} of {left_out:?}");
            }
        }
        let many: Vec<u32> = (1..=1_000).collect();
        let program = program(SENDER, &many);
        assert_eq!((run(&program, &frame(), MAX_LEFT_OUT as u32), run(&program, &frame(), 2_000)), (0, KEPT as u32));
    }

    #[test]
    fn frames_of_others_other_types_and_short_frames_do_not_pass() {
        let program = program(SENDER, &[3]);
        for at in [9, 10, 11, 12, 13] {
            let mut frame = frame();
            frame[at] ^= 1;
            assert_eq!(run(&program, &frame, 7), 0, "byte {at}");
        }
        for length in 0..14 {
            assert_eq!(run(&program, &frame()[..length], 7), 0, "{length} bytes");
        }
        for marked in [6, 7, 8] {
            let mut frame = frame();
            frame[marked] = 0xaa;
            assert_eq!(run(&program, &frame, 7), KEPT as u32, "byte {marked} is not compared");
        }
    }
}
