//! A host behind an EoE port in virtual time: an IP stack of its own (smoltcp) that downloads over TCP.
//!
//! It runs as a procedure of the acyclic half, like a network interface beside it: it does not wait for cycles.

use std::time::Duration;

use ringcat::Instant;
use ringcat_engine::Bus;
use ringcat_engine::mail::eoe::EthernetPort;
use ringcat_sim::application::eoe::frames::Frames;
use smoltcp::iface::{Config, Interface, PollResult, SocketHandle, SocketSet};
use smoltcp::socket::tcp;
use smoltcp::wire::{EthernetAddress, HardwareAddress, IpCidr, Ipv4Address};

/// The initial value of Linux.
const BUFFER: usize = 64 * 1024;
const LOCAL_PORT: u16 = 49_152;
const WEB_PORT: u16 = 80;
/// The stack checks its timers at least this often.
const LONGEST_WAIT: Duration = Duration::from_millis(50);
/// Maximum number of frames queued in the stack.
const READY: usize = 64;

/// Result of a download.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Download {
    /// Bytes of the file.
    pub bytes: usize,
    /// From the first frame of the connection to the last byte.
    pub time: Duration,
}

impl Download {
    /// Kilobytes (1,000 bytes) of the file per second.
    pub fn kilobytes_per_second(&self) -> f64 {
        self.bytes as f64 / 1e3 / self.time.as_secs_f64()
    }
}

/// Addresses of a connection.
#[derive(Clone, Copy, Debug)]
pub struct Addresses {
    /// MAC address of the host.
    pub mac: [u8; 6],
    /// IP address of the host, in a network of 24 bits.
    pub host: [u8; 4],
    /// IP address of the device.
    pub device: [u8; 4],
}

struct Host {
    interface: Interface,
    sockets: SocketSet<'static>,
    handle: SocketHandle,
    frames: Frames,
}

/// Downloads this many bytes from the web server of a simulated device, with a time limit.
///
/// # Errors
/// The download was incomplete within the limit, or the data was wrong.
pub async fn download(
    bus: Bus,
    port: &EthernetPort,
    addresses: Addresses,
    bytes: usize,
    limit: Duration,
) -> Result<Download, String> {
    let mut host = Host::new(addresses, bus.now());
    let (begin, until) = (bus.now(), bus.now() + limit);
    let request = format!("GET /bytes/{bytes} HTTP/1.0\r\n\r\n");
    let (mut asked, mut head, mut got) = (false, Vec::new(), 0);
    loop {
        while let Some(frame) = port.pop_frame() {
            host.frames.received.push_back(frame.bytes);
        }
        let socket = host.poll(bus.now());
        if !asked && socket.can_send() {
            asked = socket.send_slice(request.as_bytes()).is_ok();
        }
        got += take(socket, &mut head, got)?;
        // Taken data frees the receive window, which the stack announces to the other end.
        host.poll(bus.now());
        while port.room() > 0
            && let Some(frame) = host.frames.sent.pop_front()
        {
            port.send(&frame).map_err(|error| error.to_string())?;
        }
        let now = bus.now();
        if got >= bytes {
            return Ok(Download { bytes: got, time: now.since(begin) });
        }
        if now >= until {
            return Err(format!("{got} of {bytes} bytes; {:?}", port.status()));
        }
        let wait = host.wait(now);
        if host.frames.sent.is_empty() || port.room() == 0 {
            let any = async {
                let frame = port.frame().await;
                host.frames.received.push_back(frame.bytes);
            };
            // An expired time is a reason to poll, too.
            let _ = bus.within(wait, any).await;
        }
    }
}

/// Takes the received data; returns the number of bytes after the HTTP header.
fn take(socket: &mut tcp::Socket<'_>, head: &mut Vec<u8>, before: usize) -> Result<usize, String> {
    const END: &[u8] = b"\r\n\r\n";
    let mut count = 0;
    while socket.can_recv() {
        let mut piece = [0; 2048];
        let length = socket.recv_slice(&mut piece).map_err(|error| format!("{error:?}"))?;
        let mut body = &piece[..length];
        if !head.ends_with(END) {
            for byte in &piece[..length] {
                head.push(*byte);
                body = &body[1..];
                if head.ends_with(END) {
                    break;
                }
            }
        }
        // As docs/segments.md says.
        let is_right = |(at, byte): (usize, &u8)| usize::from(*byte) == 33 + (before + count + at) % 89;
        if !body.iter().enumerate().all(is_right) {
            return Err("the file is not what was sent".to_owned());
        }
        count += body.len();
    }
    Ok(count)
}

impl Host {
    fn new(addresses: Addresses, now: Instant) -> Host {
        let mut frames = Frames::new(READY);
        let config = Config::new(HardwareAddress::Ethernet(EthernetAddress(addresses.mac)));
        let mut interface = Interface::new(config, &mut frames, instant(now));
        let [a, b, c, d] = addresses.host;
        // The capacity is checked.
        interface.update_ip_addrs(|known| {
            let _ = known.push(IpCidr::new(Ipv4Address::new(a, b, c, d).into(), 24));
        });
        let buffer = || tcp::SocketBuffer::new(vec![0; BUFFER]);
        let mut socket = tcp::Socket::new(buffer(), buffer());
        let [a, b, c, d] = addresses.device;
        let device = (Ipv4Address::new(a, b, c, d), WEB_PORT);
        // Both ends are valid addresses.
        let _ = socket.connect(interface.context(), device, LOCAL_PORT);
        let mut sockets = SocketSet::new(Vec::new());
        let handle = sockets.add(socket);
        Host { interface, sockets, handle, frames }
    }

    fn poll(&mut self, now: Instant) -> &mut tcp::Socket<'static> {
        while self.interface.poll(instant(now), &mut self.frames, &mut self.sockets) != PollResult::None {}
        self.sockets.get_mut(self.handle)
    }

    fn wait(&mut self, now: Instant) -> Duration {
        let delay = self.interface.poll_delay(instant(now), &self.sockets);
        delay.map_or(LONGEST_WAIT, |delay| Duration::from(delay).min(LONGEST_WAIT)).max(Duration::from_micros(10))
    }
}

fn instant(now: Instant) -> smoltcp::time::Instant {
    smoltcp::time::Instant::from_micros(i64::try_from(now.0 / 1000).unwrap_or(i64::MAX))
}
