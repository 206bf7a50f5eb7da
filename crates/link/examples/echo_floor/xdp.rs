//! `AF_XDP` in copy mode: frames in memory shared with the kernel, past most of its network stack.
//!
//! A program of five instructions at the interface (`XDP_FLAGS_SKB_MODE`: in the general path, or in the driver's own)
//! redirects every frame to the socket. Sending takes a system call per frame in copy mode. Layouts and constants are
//! from `linux/if_xdp.h` and `linux/bpf.h`.

use std::os::fd::{AsRawFd, OwnedFd};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use ringcat_link::monotonic::now_ns;

use crate::Failed;
use crate::path::{Path, bind, checked, owned, set};

/// Bytes for a frame, headroom of the kernel included.
const CHUNK: usize = 2048;
/// Frames in the shared memory; the first of them is for sending.
const CHUNKS: usize = 64;
/// Entries of each ring.
const ENTRIES: u32 = CHUNKS as u32;
/// An interface is busy for some milliseconds after another socket of this kind was closed.
const BUSY: Duration = Duration::from_millis(500);

const SO_PREFER_BUSY_POLL: libc::c_int = 69;
const SO_BUSY_POLL_BUDGET: libc::c_int = 70;
const BPF_MAP_CREATE: libc::c_long = 0;
const BPF_MAP_UPDATE: libc::c_long = 2;
const BPF_PROG_LOAD: libc::c_long = 5;
const BPF_LINK_CREATE: libc::c_long = 28;
const BPF_MAP_TYPE_XSKMAP: u32 = 17;
const BPF_PROG_TYPE_XDP: u32 = 6;
const BPF_XDP: u32 = 37;

/// Where the program runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Attach {
    /// In the general receive path.
    Generic = 1 << 1,
    /// In the driver.
    Native = 1 << 2,
}

/// How frames are waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wait {
    /// `poll`.
    Sleep,
    /// Reading the ring.
    Spin,
    /// Reading the ring, and running the driver's receive path in between (`SO_PREFER_BUSY_POLL`).
    BusyPoll,
}

/// A mapping.
struct Memory {
    base: *mut u8,
    length: usize,
}

impl Memory {
    fn map(fd: libc::c_int, flags: libc::c_int, length: usize, offset: u64) -> Result<Memory, Failed> {
        let access = libc::PROT_READ | libc::PROT_WRITE;
        // SAFETY: the kernel chooses the address; no existing mapping is replaced.
        let base = unsafe { libc::mmap(std::ptr::null_mut(), length, access, flags, fd, offset as libc::off_t) };
        if base == libc::MAP_FAILED {
            return Err(std::io::Error::last_os_error().into());
        }
        Ok(Memory { base: base.cast(), length })
    }

    /// The word of a ring at this offset.
    fn word(&self, at: u64) -> &AtomicU32 {
        assert!(at.is_multiple_of(4) && at as usize + 4 <= self.length, "the kernel's offsets are within the ring");
        // SAFETY: aligned, within the mapping, which lives as long as `self`; both sides use atomic accesses.
        unsafe { AtomicU32::from_ptr(self.base.add(at as usize).cast()) }
    }

    /// The bytes at this offset, which belong to this process now.
    fn bytes(&mut self, at: usize, length: usize) -> &mut [u8] {
        assert!(at + length <= self.length, "the kernel's addresses are within the shared memory");
        // SAFETY: within the mapping; the kernel leaves them alone until an entry of a ring hands them over.
        unsafe { std::slice::from_raw_parts_mut(self.base.add(at), length) }
    }
}

impl Drop for Memory {
    fn drop(&mut self) {
        // SAFETY: this is the mapping made in `map`; no reference into it outlives `self`.
        unsafe { libc::munmap(self.base.cast(), self.length) };
    }
}

/// One of the four rings; entries are 8 bytes, or 16 with a length.
struct Ring {
    memory: Memory,
    offset: libc::xdp_ring_offset,
    entry: usize,
}

impl Ring {
    fn map(fd: &OwnedFd, kind: u64, offset: libc::xdp_ring_offset, entry: usize) -> Result<Ring, Failed> {
        let length = offset.desc as usize + ENTRIES as usize * entry;
        let memory = Memory::map(fd.as_raw_fd(), libc::MAP_SHARED | libc::MAP_POPULATE, length, kind)?;
        Ok(Ring { memory, offset, entry })
    }

    /// Puts an entry in; there is room, because there are no more frames than entries.
    fn put(&mut self, address: u64, length: u32) {
        let producer = self.memory.word(self.offset.producer).load(Ordering::Relaxed);
        let at = self.at(producer);
        let mut entry = [0; 16];
        entry[..8].copy_from_slice(&address.to_ne_bytes());
        entry[8..12].copy_from_slice(&length.to_ne_bytes());
        let size = self.entry;
        self.memory.bytes(at, size).copy_from_slice(&entry[..size]);
        self.memory.word(self.offset.producer).store(producer.wrapping_add(1), Ordering::Release);
    }

    /// Takes the oldest entry out: address and, in a ring with lengths, length.
    fn take(&mut self) -> Option<(u64, u32)> {
        let consumer = self.memory.word(self.offset.consumer).load(Ordering::Relaxed);
        if self.memory.word(self.offset.producer).load(Ordering::Acquire) == consumer {
            return None;
        }
        let (at, size) = (self.at(consumer), self.entry);
        let mut entry = [0; 16];
        entry[..size].copy_from_slice(self.memory.bytes(at, size));
        self.memory.word(self.offset.consumer).store(consumer.wrapping_add(1), Ordering::Release);
        let [low, high] = [0, 8].map(|at| u64::from_ne_bytes(std::array::from_fn(|byte| entry[at + byte])));
        Some((low, high as u32))
    }

    fn is_empty(&self) -> bool {
        let consumer = self.memory.word(self.offset.consumer).load(Ordering::Relaxed);
        self.memory.word(self.offset.producer).load(Ordering::Acquire) == consumer
    }

    fn at(&self, number: u32) -> usize {
        self.offset.desc as usize + (number % ENTRIES) as usize * self.entry
    }
}

/// The socket.
pub struct Xdp {
    receive: Ring,
    send: Ring,
    fill: Ring,
    completion: Ring,
    frames: Memory,
    fd: OwnedFd,
    /// The program is detached when the last descriptor of the link is closed.
    _attached: [OwnedFd; 3],
    wait: Wait,
}

impl Xdp {
    /// Opens it on queue 0 of an interface.
    pub fn open(index: u32, attach: Attach, wait: Wait, need_wakeup: bool) -> Result<Xdp, Failed> {
        // SAFETY: no pointers are passed.
        let fd = owned(unsafe { libc::socket(libc::AF_XDP, libc::SOCK_RAW | libc::SOCK_CLOEXEC, 0) })?;
        let anonymous = libc::MAP_PRIVATE | libc::MAP_ANONYMOUS | libc::MAP_POPULATE;
        let frames = Memory::map(-1, anonymous, CHUNK * CHUNKS, 0)?;
        // The structs and constants of this family differ between versions of the `libc` crate: plain words.
        let region: [u64; 4] = [frames.base as u64, (CHUNK * CHUNKS) as u64, CHUNK as u64, 0];
        set(&fd, libc::SOL_XDP, libc::XDP_UMEM_REG, &region)?;
        let sizes = [libc::XDP_UMEM_FILL_RING, libc::XDP_UMEM_COMPLETION_RING, libc::XDP_RX_RING, libc::XDP_TX_RING];
        sizes.iter().try_for_each(|ring| set(&fd, libc::SOL_XDP, *ring, &ENTRIES))?;
        // SAFETY: all bytes zero is valid for offsets.
        let mut offsets: libc::xdp_mmap_offsets = unsafe { std::mem::zeroed() };
        let mut length = size_of_val(&offsets) as libc::socklen_t;
        let (to, option) = (std::ptr::from_mut(&mut offsets).cast(), libc::XDP_MMAP_OFFSETS);
        // SAFETY: pointer and length describe the live offsets.
        checked(unsafe { libc::getsockopt(fd.as_raw_fd(), libc::SOL_XDP, option, to, &mut length) })?;
        let mut fill = Ring::map(&fd, 0x1_0000_0000, offsets.fr, 8)?;
        let completion = Ring::map(&fd, 0x1_8000_0000, offsets.cr, 8)?;
        let receive = Ring::map(&fd, 0, offsets.rx, 16)?;
        let send = Ring::map(&fd, 0x8000_0000, offsets.tx, 16)?;
        (1..CHUNKS).for_each(|chunk| fill.put((chunk * CHUNK) as u64, 0));
        if wait == Wait::BusyPoll {
            set(&fd, libc::SOL_SOCKET, SO_PREFER_BUSY_POLL, &1i32)?;
            set(&fd, libc::SOL_SOCKET, libc::SO_BUSY_POLL, &20i32)?;
            set(&fd, libc::SOL_SOCKET, SO_BUSY_POLL_BUDGET, &64i32)?;
        }
        let flags = libc::XDP_COPY | if need_wakeup { libc::XDP_USE_NEED_WAKEUP } else { 0 };
        let address = libc::sockaddr_xdp {
            sxdp_family: libc::AF_XDP as u16,
            sxdp_flags: flags,
            sxdp_ifindex: index,
            sxdp_queue_id: 0,
            sxdp_shared_umem_fd: 0,
        };
        let begin = Instant::now();
        while let Err(error) = bind(&fd, &address) {
            if begin.elapsed() > BUSY {
                return Err(error);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        let attached = redirect(index, &fd, attach)?;
        Ok(Xdp { receive, send, fill, completion, frames, fd, _attached: attached, wait })
    }

    /// Runs the kernel's side of the socket.
    fn wake(&self, receives: bool) {
        let fd = self.fd.as_raw_fd();
        let nothing = std::ptr::null_mut();
        // SAFETY: no memory is passed; the socket's rings are mapped.
        unsafe {
            if receives {
                libc::recvfrom(fd, nothing, 0, libc::MSG_DONTWAIT, nothing.cast(), nothing.cast());
            } else {
                libc::sendto(fd, nothing, 0, libc::MSG_DONTWAIT, nothing.cast(), 0);
            }
        }
    }
}

impl Path for Xdp {
    fn send(&mut self, frame: &[u8]) {
        while self.completion.take().is_some() {}
        self.frames.bytes(0, frame.len()).copy_from_slice(frame);
        self.send.put(0, frame.len() as u32);
        self.wake(false);
    }

    fn receive(&mut self, until_ns: u64, take: &mut dyn FnMut(&[u8])) -> bool {
        while self.receive.is_empty() {
            match self.wait {
                Wait::Sleep => {
                    let mut polled = libc::pollfd { fd: self.fd.as_raw_fd(), events: libc::POLLIN, revents: 0 };
                    // SAFETY: one live entry.
                    unsafe { libc::poll(&mut polled, 1, 1000) };
                }
                Wait::Spin => std::hint::spin_loop(),
                Wait::BusyPoll => self.wake(true),
            }
            if self.receive.is_empty() && now_ns() >= until_ns {
                return false;
            }
        }
        let Some((address, length)) = self.receive.take() else { return false };
        take(self.frames.bytes(address as usize, length as usize));
        self.fill.put(address - address % CHUNK as u64, 0);
        true
    }
}

/// A call of `bpf` with the words of its attributes; a descriptor is returned, or nothing of use.
fn bpf(command: libc::c_long, words: &[u64]) -> Result<libc::c_int, Failed> {
    // SAFETY: pointer and length describe live words; those that are addresses refer to values that live across the
    // call, which callers see to.
    let result = unsafe { libc::syscall(libc::SYS_bpf, command, words.as_ptr(), size_of_val(words)) };
    checked(result as libc::c_int)?;
    Ok(result as libc::c_int)
}

/// Two words of 32 bits, in the order of memory.
fn pair(first: u32, second: u32) -> u64 {
    let (first, second) = (first.to_ne_bytes(), second.to_ne_bytes());
    u64::from_ne_bytes(std::array::from_fn(|at| if at < 4 { first[at] } else { second[at - 4] }))
}

/// Has all frames of queue 0 redirected to the socket: the map, the program and their link.
fn redirect(index: u32, socket: &OwnedFd, attach: Attach) -> Result<[OwnedFd; 3], Failed> {
    let map = owned(bpf(BPF_MAP_CREATE, &[pair(BPF_MAP_TYPE_XSKMAP, 4), pair(4, 1)])?)?;
    let (key, value) = (0u32, socket.as_raw_fd());
    let addresses = [std::ptr::from_ref(&key) as u64, std::ptr::from_ref(&value) as u64];
    bpf(BPF_MAP_UPDATE, &[pair(map.as_raw_fd() as u32, 0), addresses[0], addresses[1], 0])?;
    let instruction = |code: u8, registers: u8, offset: u16, immediate: u32| -> u64 {
        pair(u32::from_ne_bytes([code, registers, offset.to_ne_bytes()[0], offset.to_ne_bytes()[1]]), immediate)
    };
    let program = [
        // r2 = the context's rx_queue_index
        instruction(0x61, 0x12, 16, 0),
        // r1 = the map, in two instructions
        instruction(0x18, 0x11, 0, map.as_raw_fd() as u32),
        0,
        // r3 = XDP_PASS for other queues; return redirect_map(r1, r2, r3)
        instruction(0xb7, 0x03, 0, 2),
        instruction(0x85, 0, 0, 51),
        instruction(0x95, 0, 0, 0),
    ];
    let licence = c"Dual MIT/GPL";
    let text = [program.as_ptr() as u64, licence.as_ptr() as u64];
    let words = [pair(BPF_PROG_TYPE_XDP, program.len() as u32), text[0], text[1], 0, 0, 0];
    let loaded = owned(bpf(BPF_PROG_LOAD, &words)?)?;
    let link = [pair(loaded.as_raw_fd() as u32, index), pair(BPF_XDP, attach as u32)];
    let link = owned(bpf(BPF_LINK_CREATE, &link)?)?;
    Ok([map, loaded, link])
}
