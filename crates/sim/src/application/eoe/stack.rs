//! The IP stack of an EoE device (smoltcp): answers ARP and ping, serves TCP.
//!
//! Input: frames, virtual time. Output: frames. Port 7 echoes; port 80 answers `GET /bytes/N` with N bytes and any
//! other request with the device's name. No random numbers are used: the MAC address is the seed of the sequence
//! numbers.

use core::fmt;
use core::fmt::Write as _;
use core::ops::Range;
use core::time::Duration;

use smoltcp::iface::{Config, Interface, PollResult, SocketHandle, SocketSet};
use smoltcp::socket::tcp;
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, HardwareAddress, IpCidr};

use super::addresses::Addresses;
use super::frames::Frames;
use crate::time::SimTime;

/// Maximum number of frames waiting for the stack; further frames are dropped, as in a network.
const MAX_RECEIVED: usize = 16;
/// Maximum number of frames ready for sending.
const MAX_READY: usize = 16;
/// Maximum number of connections of each service.
const CONNECTIONS: usize = 4;
const BUFFER: usize = 16 * 1024;
const ECHO_PORT: u16 = 7;
const WEB_PORT: u16 = 80;
/// Longest request that is evaluated.
const MAX_REQUEST: usize = 1024;
/// Maximum number of bytes of an answer.
const MAX_BYTES: usize = 1 << 26;
/// Minimum time between two steps requested by the stack.
const LEAST_WAIT: Duration = Duration::from_micros(10);
/// Maximum number of processing rounds of the stack per frame.
const MAX_ROUNDS: usize = 8;

/// The stack.
pub struct Stack {
    addresses: Addresses,
    interface: Interface,
    sockets: SocketSet<'static>,
    connections: Vec<Connection>,
    frames: Frames,
}

/// One socket and its service.
struct Connection {
    handle: SocketHandle,
    port: u16,
    request: Vec<u8>,
    /// Head of the answer, and number of bytes left to send after it.
    answer: Option<(Vec<u8>, Range<usize>)>,
}

impl Clone for Stack {
    /// A stack with the same addresses and without connections.
    fn clone(&self) -> Stack {
        Stack::new(&self.addresses)
    }
}

impl fmt::Debug for Stack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Stack").field("addresses", &self.addresses).finish_non_exhaustive()
    }
}

impl Stack {
    /// A listening stack.
    pub fn new(addresses: &Addresses) -> Stack {
        let mut frames = Frames::new(MAX_READY);
        let mut config = Config::new(HardwareAddress::Ethernet(EthernetAddress(addresses.mac)));
        config.random_seed = addresses.mac.iter().fold(0, |seed, byte| seed << 8 | u64::from(*byte));
        let interface = Interface::new(config, &mut frames, Instant::ZERO);
        let mut sockets = SocketSet::new(Vec::new());
        let mut connections = Vec::new();
        for port in [ECHO_PORT, WEB_PORT] {
            for _ in 0..CONNECTIONS {
                let buffer = || tcp::SocketBuffer::new(vec![0; BUFFER]);
                let handle = sockets.add(tcp::Socket::new(buffer(), buffer()));
                connections.push(Connection { handle, port, request: Vec::new(), answer: None });
            }
        }
        let mut stack = Stack { addresses: addresses.clone(), interface, sockets, connections, frames };
        stack.set_addresses(addresses);
        stack
    }

    /// Sets new, valid addresses.
    pub fn set_addresses(&mut self, addresses: &Addresses) {
        self.addresses = addresses.clone();
        self.interface.set_hardware_addr(HardwareAddress::Ethernet(EthernetAddress(addresses.mac)));
        self.interface.update_ip_addrs(|known| {
            known.clear();
            if !addresses.address.is_unspecified() {
                // The capacity is one.
                let _ = known.push(IpCidr::new(addresses.address.into(), addresses.prefix()));
            }
        });
        let routes = self.interface.routes_mut();
        routes.remove_default_ipv4_route();
        if !addresses.gateway.is_unspecified() {
            // The capacity is one.
            let _ = routes.add_default_ipv4_route(addresses.gateway);
        }
    }

    /// Adds a received frame.
    pub fn receive(&mut self, frame: Vec<u8>) {
        if self.frames.received.len() < MAX_RECEIVED {
            self.frames.received.push_back(frame);
        }
    }

    /// Runs the due work; returns the next frame to send.
    pub fn work(&mut self, now: SimTime) -> Option<Vec<u8>> {
        for _ in 0..MAX_ROUNDS {
            if let Some(frame) = self.frames.sent.pop_front() {
                return Some(frame);
            }
            let result = self.interface.poll(instant(now), &mut self.frames, &mut self.sockets);
            let served = self.serve();
            if result == PollResult::None && !served {
                break;
            }
        }
        self.frames.sent.pop_front()
    }

    /// Next time at which the stack has work without input.
    pub fn next_deadline(&mut self, now: SimTime) -> Option<SimTime> {
        let at = self.interface.poll_at(instant(now), &self.sockets)?;
        let micros = u64::try_from(at.total_micros()).unwrap_or(0);
        Some(SimTime(micros.saturating_mul(1000)).max(now + LEAST_WAIT))
    }

    /// Moves data between sockets and services; true if any data was moved.
    fn serve(&mut self) -> bool {
        let mut moved = false;
        for connection in &mut self.connections {
            let socket = self.sockets.get_mut::<tcp::Socket<'_>>(connection.handle);
            moved |= connection.serve(socket, &self.addresses);
        }
        moved
    }
}

impl Connection {
    fn serve(&mut self, socket: &mut tcp::Socket<'_>, addresses: &Addresses) -> bool {
        if !socket.is_open() {
            self.request.clear();
            self.answer = None;
            return socket.listen(self.port).is_ok();
        }
        let moved = if self.port == ECHO_PORT { echo(socket) } else { self.serve_web(socket, addresses) };
        // The peer has closed, and all requests are answered.
        let over = socket.state() == tcp::State::CloseWait && !socket.can_recv() && self.answer.is_none();
        if over {
            socket.close();
        }
        moved || over
    }

    fn serve_web(&mut self, socket: &mut tcp::Socket<'_>, addresses: &Addresses) -> bool {
        let mut moved = false;
        while self.answer.is_none() && socket.can_recv() {
            let mut piece = [0; 256];
            let length = socket.recv_slice(&mut piece).unwrap_or(0);
            self.request.extend_from_slice(&piece[..length]);
            moved |= length > 0;
            let complete = self.request.windows(4).any(|end| end == b"\r\n\r\n");
            if complete || self.request.len() > MAX_REQUEST {
                self.answer = Some(answer(&self.request, addresses));
                self.request.clear();
            }
        }
        let Some((head, body)) = &mut self.answer else {
            return moved;
        };
        if !head.is_empty() {
            let sent = socket.send_slice(head).unwrap_or(0);
            head.drain(..sent);
            moved |= sent > 0;
        }
        while head.is_empty() && body.start < body.end && socket.can_send() {
            let piece: Vec<u8> = body.clone().take(1024).map(body_byte).collect();
            let sent = socket.send_slice(&piece).unwrap_or(0);
            body.start += sent;
            moved |= sent > 0;
            if sent == 0 {
                break;
            }
        }
        if head.is_empty() && body.start == body.end {
            self.answer = None;
            socket.close();
            moved = true;
        }
        moved
    }
}

fn echo(socket: &mut tcp::Socket<'_>) -> bool {
    let mut moved = false;
    while socket.can_recv() && socket.can_send() {
        let mut piece = [0; 1024];
        let room = (BUFFER - socket.send_queue()).min(piece.len());
        let length = socket.recv_slice(&mut piece[..room]).unwrap_or(0);
        if length == 0 || socket.send_slice(&piece[..length]).is_err() {
            break;
        }
        moved = true;
    }
    moved
}

/// A byte of the answer to `/bytes/N`; neighbouring bytes differ.
fn body_byte(number: usize) -> u8 {
    b'!' + (number % 89) as u8
}

/// Head of the answer to a request, and the range of body bytes that follows.
fn answer(request: &[u8], addresses: &Addresses) -> (Vec<u8>, Range<usize>) {
    let text = String::from_utf8_lossy(request);
    let wanted = text.strip_prefix("GET /bytes/").and_then(|rest| rest.split_whitespace().next()?.parse().ok());
    let mut head = String::from("HTTP/1.0 200 OK\r\nConnection: close\r\n");
    // Writing into a String cannot fail.
    match wanted.filter(|bytes| *bytes <= MAX_BYTES) {
        Some(bytes) => {
            let _ = write!(head, "Content-Type: application/octet-stream\r\nContent-Length: {bytes}\r\n\r\n");
            (head.into_bytes(), 0..bytes)
        }
        None => {
            let page = format!("RingCAT simulated device {}\n", String::from_utf8_lossy(&addresses.name));
            let _ = write!(head, "Content-Type: text/plain\r\nContent-Length: {}\r\n\r\n{page}", page.len());
            (head.into_bytes(), 0..0)
        }
    }
}

fn instant(now: SimTime) -> Instant {
    Instant::from_micros(i64::try_from(now.0 / 1000).unwrap_or(i64::MAX))
}
