//! The mailbox gateway: programs on this host or in the network exchange mail with SubDevices through the MainDevice's
//! mailboxes (protocol 10.1, ETG.8200), over UDP and TCP at once.
//!
//! A thread of its own serves the sockets ([`Gateway`]); messages pass to the engine's thread and answers back through
//! bounded queues ([`Passage`]). Which message may pass, and which client has its turn, is decided in the engine
//! ([`ringcat_engine::mail::relay`]), because a client's transfer occupies a lane of a mailbox. A client that does not
//! read its answers, leaves a message unfinished or sends anything else than messages loses its connection; other
//! clients are not affected.
//!
//! A program that reaches the port may change SubDevices: the protocol has no password. So the gateway exists only
//! where an application opens it, and listens only on this host unless the application gives another address.
#![forbid(unsafe_code)]

mod connection;
mod options;
mod server;
mod shared;

use std::io;
use std::net::SocketAddr;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, sync_channel};
use std::sync::{Arc, PoisonError};
use std::task;
use std::thread::JoinHandle;

use mio::Waker;
pub use ringcat_engine::mail::relay::RelayCounters;
use ringcat_engine::mail::relay::Relayed;
use ringcat_engine::main_device::MainDevice as Engine;

pub use options::GatewayOptions;
use server::Server;
pub use shared::GatewayCounters;
use shared::{FromClient, Shared, ToEngine};

/// Queued messages to the engine's thread.
const MESSAGES: usize = 256;
/// Queued answers.
const ANSWERS: usize = 1024;
/// Messages that the engine's thread takes per call.
const TURN: usize = 64;

/// The gateway; it ends when this is dropped.
#[derive(Debug)]
pub struct Gateway {
    shared: Arc<Shared>,
    waker: Arc<Waker>,
    address: SocketAddr,
    thread: Option<JoinHandle<()>>,
}

impl Gateway {
    /// The address that it listens on.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Its counters.
    pub fn counters(&self) -> GatewayCounters {
        *self.shared.counters.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Relaxed);
        // If waking fails, the thread checks by itself after a while.
        let _ = self.waker.wake();
        if let Some(thread) = self.thread.take() {
            // The panic handler has printed a panic of the thread.
            let _ = thread.join();
        }
    }
}

impl Gateway {
    /// Opens the gateway: its sockets are served from now on. The passage is for the thread of the acyclic half, which
    /// `engine` wakes when there is a message for it.
    ///
    /// # Errors
    /// The address cannot be listened on, or the system has no more threads.
    pub fn open(options: GatewayOptions, engine: task::Waker) -> io::Result<(Gateway, Passage)> {
        let (queue, incoming) = sync_channel(MESSAGES);
        let to_engine = ToEngine { queue, waker: engine.clone() };
        let (outgoing, answers) = sync_channel(ANSWERS);
        let shared = Arc::new(Shared::default());
        let (server, waker, address) = Server::open(options, to_engine, answers, shared.clone())?;
        let passage = Passage { incoming, outgoing, engine, waker: waker.clone(), shared: shared.clone() };
        let thread = std::thread::Builder::new().name("gateway".into()).spawn(move || server.run())?;
        Ok((Gateway { shared, waker, address, thread: Some(thread) }, passage))
    }
}

/// The engine's end of the gateway.
#[derive(Debug)]
pub struct Passage {
    incoming: Receiver<FromClient>,
    outgoing: SyncSender<Relayed>,
    /// Wakes the thread in which this is.
    engine: task::Waker,
    waker: Arc<Waker>,
    shared: Arc<Shared>,
}

impl Passage {
    /// Passes messages to the engine and its answers back, a bounded number per call; to be called when the engine has
    /// worked and after each wake-up. True when the gateway no longer exists.
    pub fn work(&mut self, engine: &mut Engine) -> bool {
        let mut any = false;
        for number in 0..=TURN {
            if number == TURN {
                // The rest waits for the next call.
                self.engine.wake_by_ref();
                break;
            }
            match self.incoming.try_recv() {
                Ok(FromClient::Message(client, bytes)) => engine.relay(client, &bytes),
                Ok(FromClient::Gone(client)) => engine.forget_client(client),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => return true,
            }
            any = true;
        }
        while let Some(answer) = engine.pop_relayed() {
            any = true;
            if self.outgoing.try_send(answer).is_err() {
                self.shared.count(|counters| counters.dropped += 1);
            }
        }
        if any {
            let relay = engine.relay_counters();
            self.shared.count(|counters| counters.relay = relay);
            // If waking fails, the thread checks by itself after a while.
            let _ = self.waker.wake();
        }
        false
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::{Ipv4Addr, TcpStream, UdpSocket};
    use std::time::Duration;

    use ringcat_wire::mailbox::gateway::{HEADER_LEN, encode};
    use ringcat_wire::mailbox::{Header, Message, Protocol};

    use super::*;

    const LIMIT: Duration = Duration::from_secs(10);

    fn message(counter: u8) -> Vec<u8> {
        let payload = [counter; 6];
        let header = Header { address: 0x1001, ..Header::new(Protocol::Coe, counter, payload.len() as u16) };
        let mut bytes = vec![0; HEADER_LEN + Header::LEN + payload.len()];
        encode(&Message { header, payload: &payload }, &mut bytes).expect("it fits");
        bytes
    }

    fn open() -> (Gateway, Passage) {
        let any = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
        Gateway::open(GatewayOptions::at(any), task::Waker::noop().clone()).expect("a free port")
    }

    fn next(passage: &Passage) -> FromClient {
        passage.incoming.recv_timeout(LIMIT).expect("something comes")
    }

    fn give(passage: &Passage, client: u64, bytes: Vec<u8>) {
        passage.outgoing.try_send(Relayed { client, bytes }).expect("there is room");
        passage.waker.wake().expect("it can be woken");
    }

    // covers: gateway
    #[test]
    fn messages_of_both_kinds_come_with_their_client_and_answers_find_it() {
        let (gateway, passage) = open();
        let mut tcp = TcpStream::connect(gateway.address()).expect("it listens");
        tcp.set_read_timeout(Some(LIMIT)).expect("a timeout");
        let udp = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        udp.set_read_timeout(Some(LIMIT)).expect("a timeout");

        // Two messages in three pieces: they come whole and in order.
        let both = [message(1), message(2)].concat();
        for piece in [&both[..5], &both[5..20], &both[20..]] {
            tcp.write_all(piece).expect("it takes them");
        }
        let FromClient::Message(stream, first) = next(&passage) else { panic!("a message") };
        assert_eq!((first, next(&passage)), (message(1), FromClient::Message(stream, message(2))));
        udp.send_to(&message(3), gateway.address()).expect("it is sent");
        let FromClient::Message(datagrams, third) = next(&passage) else { panic!("a message") };
        assert_eq!(third, message(3));
        assert_ne!(stream, datagrams);

        give(&passage, datagrams, message(30));
        give(&passage, stream, message(10));
        let mut answer = vec![0; message(10).len()];
        tcp.read_exact(&mut answer).expect("an answer");
        assert_eq!(answer, message(10));
        let length = udp.recv(&mut answer).expect("an answer");
        assert_eq!(answer[..length], message(30));

        drop(tcp);
        assert_eq!(next(&passage), FromClient::Gone(stream));
        assert_eq!(gateway.counters().connections, 1);
    }

    // covers: gateway
    #[test]
    fn a_client_that_sends_no_message_is_cut_off_and_the_others_go_on() {
        let (gateway, passage) = open();
        let mut good = TcpStream::connect(gateway.address()).expect("it listens");
        good.write_all(&message(1)).expect("it takes it");
        let FromClient::Message(client, _) = next(&passage) else { panic!("a message") };
        let mut bad = TcpStream::connect(gateway.address()).expect("it listens");
        bad.set_read_timeout(Some(LIMIT)).expect("a timeout");
        bad.write_all(&[0xFF; 64]).expect("it takes it");
        assert!(matches!(next(&passage), FromClient::Gone(gone) if gone != client));
        assert_eq!(bad.read(&mut [0; 8]).unwrap_or(0), 0, "its connection is closed");
        good.write_all(&message(2)).expect("it takes it");
        assert_eq!(next(&passage), FromClient::Message(client, message(2)));
        assert_eq!((gateway.counters().connections, gateway.counters().ended), (2, 1));
    }

    // covers: gateway
    #[test]
    fn a_gateway_that_is_dropped_closes_its_connections_and_ends_the_passage() {
        let (gateway, passage) = open();
        let mut client = TcpStream::connect(gateway.address()).expect("it listens");
        client.set_read_timeout(Some(LIMIT)).expect("a timeout");
        client.write_all(&message(1)).expect("it takes it");
        assert!(matches!(next(&passage), FromClient::Message(..)));
        drop(gateway);
        assert_eq!(client.read(&mut [0; 8]).unwrap_or(0), 0, "its connection is closed");
        assert_eq!(passage.incoming.try_recv(), Err(TryRecvError::Disconnected));
    }
}
