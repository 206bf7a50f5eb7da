//! The sockets of the gateway and their clients.

use std::collections::BTreeMap;
use std::io;
use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, TrySendError};
use std::time::{Duration, Instant};

use mio::net::{TcpListener, UdpSocket};
use mio::{Events, Interest, Poll, Token, Waker};
use ringcat_engine::mail::relay::Relayed;
use ringcat_wire::mailbox::gateway::{HEADER_LEN, MAX_LENGTH};

use crate::connection::{Connection, Going};
use crate::options::GatewayOptions;
use crate::shared::{FromClient, Shared, ToEngine};

const LISTENER: Token = Token(0);
const DATAGRAMS: Token = Token(1);
const WAKE: Token = Token(2);
/// Number of the first client; numbers are tokens.
const FIRST_CLIENT: u64 = 16;
/// Period of checks for overdue messages.
const CHECK: Duration = Duration::from_millis(250);
/// Pause before the next attempt where the queue had no room for a message.
const AGAIN: Duration = Duration::from_millis(1);
/// Datagrams received in a row.
const BURST: usize = 64;
/// Most senders of datagrams that are distinguished.
const PEERS: usize = 64;
/// When all connections are in use, a connection that was idle for this time is closed for a new one.
const SILENT: Duration = Duration::from_secs(10);
/// Tries to find a port that is free for UDP and TCP.
const PORT_TRIES: usize = 16;

/// A sender of datagrams.
struct Peer {
    address: SocketAddr,
    client: u64,
    seen: Instant,
}

/// State of the thread.
pub(super) struct Server {
    poll: Poll,
    listener: TcpListener,
    datagrams: UdpSocket,
    limit: usize,
    connections: BTreeMap<u64, Connection>,
    peers: Vec<Peer>,
    next_client: u64,
    to_engine: ToEngine,
    answers: Receiver<Relayed>,
    /// Ended clients that are not reported to the engine yet.
    gone: Vec<u64>,
    /// Connections with more to read.
    again: Vec<u64>,
    shared: Arc<Shared>,
}

impl Server {
    /// Opens the sockets; also returns the waker and the address.
    pub(super) fn open(
        options: GatewayOptions,
        to_engine: ToEngine,
        answers: Receiver<Relayed>,
        shared: Arc<Shared>,
    ) -> io::Result<(Server, Arc<Waker>, SocketAddr)> {
        let poll = Poll::new()?;
        let (mut listener, mut datagrams) = sockets(options.address)?;
        let address = listener.local_addr()?;
        poll.registry().register(&mut listener, LISTENER, Interest::READABLE)?;
        poll.registry().register(&mut datagrams, DATAGRAMS, Interest::READABLE)?;
        let waker = Arc::new(Waker::new(poll.registry(), WAKE)?);
        let server = Server {
            poll,
            listener,
            datagrams,
            limit: options.connections,
            connections: BTreeMap::new(),
            peers: Vec::new(),
            next_client: FIRST_CLIENT,
            to_engine,
            answers,
            gone: Vec::new(),
            again: Vec::new(),
            shared,
        };
        Ok((server, waker, address))
    }

    /// Serves until the gateway is dropped.
    pub(super) fn run(mut self) {
        let mut events = Events::with_capacity(64);
        let mut datagrams_wait = false;
        while !self.shared.ended.load(Ordering::Relaxed) {
            let busy = datagrams_wait || !self.again.is_empty() || !self.gone.is_empty();
            // An interrupted wait is treated like a finished one.
            let _ = self.poll.poll(&mut events, Some(if busy { AGAIN } else { CHECK }));
            let now = Instant::now();
            for client in std::mem::take(&mut self.again) {
                self.read(client, now);
            }
            for event in &events {
                match event.token() {
                    LISTENER => self.accept(now),
                    DATAGRAMS => datagrams_wait = true,
                    WAKE => {}
                    Token(client) => {
                        let client = client as u64;
                        if event.is_writable() {
                            let going = self.connections.get_mut(&client).map(Connection::write);
                            self.apply(client, going);
                        }
                        if event.is_readable() && !self.again.contains(&client) {
                            self.read(client, now);
                        }
                    }
                }
            }
            if datagrams_wait {
                datagrams_wait = self.receive_datagrams(now);
            }
            while let Ok(answer) = self.answers.try_recv() {
                self.deliver(&answer);
            }
            self.clean_up(now);
        }
    }

    fn accept(&mut self, now: Instant) {
        while let Ok((mut stream, _)) = self.listener.accept() {
            if self.connections.len() >= self.limit && !self.make_room(now) {
                // Dropping the stream closes it.
                self.shared.count(|counters| counters.ended += 1);
                continue;
            }
            let client = self.number();
            let interest = Interest::READABLE | Interest::WRITABLE;
            if self.poll.registry().register(&mut stream, Token(client as usize), interest).is_err() {
                continue;
            }
            let connection = Connection::new(stream, now);
            // Without it answers are only delayed.
            let _ = connection.prepare();
            self.connections.insert(client, connection);
            self.shared.count(|counters| counters.connections += 1);
        }
    }

    /// Closes the connection with the longest idle time, if that is long enough.
    fn make_room(&mut self, now: Instant) -> bool {
        let silent = self.connections.iter().min_by_key(|(_, connection)| connection.active);
        let Some(client) = silent.filter(|(_, c)| now.duration_since(c.active) > SILENT).map(|(client, _)| *client)
        else {
            return false;
        };
        self.apply(client, Some(Going::CutOff));
        true
    }

    fn number(&mut self) -> u64 {
        self.next_client += 1;
        self.next_client
    }

    fn read(&mut self, client: u64, now: Instant) {
        let to_engine = &self.to_engine;
        let mut take = |message: &[u8]| match to_engine.try_send(FromClient::Message(client, message.to_vec())) {
            Ok(()) | Err(TrySendError::Disconnected(_)) => true,
            Err(TrySendError::Full(_)) => false,
        };
        let going = self.connections.get_mut(&client).map(|connection| connection.read(now, &mut take));
        self.apply(client, going);
    }

    fn apply(&mut self, client: u64, going: Option<Going>) {
        match going {
            None | Some(Going::On) => {}
            Some(Going::Again) => self.again.push(client),
            Some(end @ (Going::Closed | Going::CutOff)) => {
                if let Some(mut connection) = self.connections.remove(&client) {
                    // Closing the descriptor deregisters it in any case.
                    let _ = self.poll.registry().deregister(&mut connection.stream);
                    self.gone.push(client);
                    self.shared.count(|counters| counters.ended += u64::from(end == Going::CutOff));
                }
            }
        }
    }

    /// True where more datagrams may wait.
    fn receive_datagrams(&mut self, now: Instant) -> bool {
        let mut bytes = [0; HEADER_LEN + MAX_LENGTH + 1];
        for _ in 0..BURST {
            let Ok((length, address)) = self.datagrams.recv_from(&mut bytes) else { return false };
            let client = self.peer(address, now);
            let message = FromClient::Message(client, bytes[..length].to_vec());
            if self.to_engine.try_send(message).is_err() {
                self.shared.count(|counters| counters.dropped += 1);
            }
        }
        true
    }

    /// The number of the client at this address; the client with the longest idle time makes room.
    fn peer(&mut self, address: SocketAddr, now: Instant) -> u64 {
        if let Some(peer) = self.peers.iter_mut().find(|peer| peer.address == address) {
            peer.seen = now;
            return peer.client;
        }
        if self.peers.len() >= PEERS
            && let Some(oldest) = self.peers.iter().enumerate().min_by_key(|(_, peer)| peer.seen).map(|(at, _)| at)
        {
            self.gone.push(self.peers.swap_remove(oldest).client);
        }
        let client = self.number();
        self.peers.push(Peer { address, client, seen: now });
        client
    }

    fn deliver(&mut self, answer: &Relayed) {
        if let Some(peer) = self.peers.iter().find(|peer| peer.client == answer.client) {
            // A datagram may be lost anywhere, so also here.
            let _ = self.datagrams.send_to(&answer.bytes, peer.address);
            return;
        }
        let going = self.connections.get_mut(&answer.client).map(|connection| connection.answer(&answer.bytes));
        self.apply(answer.client, going);
    }

    /// Closes overdue connections, and reports ended clients to the engine.
    fn clean_up(&mut self, now: Instant) {
        let overdue = self.connections.iter().filter(|(_, connection)| connection.is_overdue(now));
        for client in overdue.map(|(client, _)| *client).collect::<Vec<_>>() {
            self.apply(client, Some(Going::CutOff));
        }
        let to_engine = &self.to_engine;
        self.gone.retain(|client| matches!(to_engine.try_send(FromClient::Gone(*client)), Err(TrySendError::Full(_))));
    }
}

/// Both sockets on one port.
fn sockets(address: SocketAddr) -> io::Result<(TcpListener, UdpSocket)> {
    let mut tries = 0;
    loop {
        let listener = TcpListener::bind(address)?;
        match UdpSocket::bind(listener.local_addr()?) {
            Ok(datagrams) => return Ok((listener, datagrams)),
            // Any free port is requested, and this one is free for TCP only.
            Err(_) if address.port() == 0 && tries < PORT_TRIES => tries += 1,
            Err(error) => return Err(error),
        }
    }
}
