//! The thread that receives messages of the daemon to an owner, and sends the knowledge and the orders of the owner.

use std::os::fd::{AsFd, OwnedFd};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use ringcat_control::Arriving;
use ringcat_control::connection::Connection;
use ringcat_control::message::{Content, Message};
use ringcat_control::wire::Limits;
use ringcat_engine::event::ClientId;
use ringcat_link::process::wait_readable;

use super::ethernet::Ethernet;
use super::orders::Orders;
use super::ownership::OwnershipWatch;
use super::query_threads::QueryThreads;
use crate::services::Services;
use crate::supervisor_thread::SupervisorThread;

/// Stack of the thread. It is small because a program may lock its memory, and with it the stack.
const STACK_BYTES: usize = 512 << 10;
/// Interval of checks for new events of scans, also while messages arrive.
const LOOK: Duration = Duration::from_millis(200);

/// The thread that receives the messages of the daemon.
pub(super) struct Receiver {
    pub supervisor: SupervisorThread,
    pub connection: Arc<Connection>,
    pub ownership: OwnershipWatch,
    pub queries: QueryThreads,
    pub orders: Arc<Orders>,
    pub ethernet: Ethernet,
    /// Events of scans.
    pub events: Option<ClientId>,
}

impl Receiver {
    /// Starts the thread; `prepare` runs first in it.
    ///
    /// # Errors
    /// The system cannot start it.
    pub fn start(self, prepare: impl FnOnce() + Send + 'static) -> std::io::Result<JoinHandle<()>> {
        let run = move || {
            prepare();
            self.run();
        };
        std::thread::Builder::new().name("daemon".into()).stack_size(STACK_BYTES).spawn(run)
    }

    fn run(self) {
        let (mut arriving, mut descriptors) = (Arriving::new(Limits::OWNER), Vec::new());
        let mut look_at = Instant::now() + LOOK;
        loop {
            let left = look_at.saturating_duration_since(Instant::now());
            let ready = wait_readable(&[self.connection.as_fd(), self.orders.as_fd()], left);
            for order in self.orders.take() {
                self.tell(order.into());
            }
            if Instant::now() >= look_at {
                self.tell_knowledge();
                look_at = Instant::now() + LOOK;
            }
            if ready & 1 == 0 {
                continue;
            }
            match self.connection.receive_part_with_descriptors(&mut arriving, &mut descriptors) {
                Ok(None) => {}
                Ok(Some(message)) => {
                    let descriptor = std::mem::take(&mut descriptors).into_iter().next();
                    if !self.take(message, descriptor) {
                        return;
                    }
                }
                Err(_) => return self.ownership.daemon_ended(),
            }
        }
    }

    /// Takes a message; false if it was the last one.
    fn take(&self, message: Message, descriptor: Option<OwnedFd>) -> bool {
        match message.content {
            Content::Query(query) => self.queries.take(query, message.bytes),
            Content::Interface { name, fault } => {
                let made = fault.map_or_else(|| descriptor.ok_or_else(|| "no descriptor came".to_owned()), Err);
                self.ethernet.answered(name, made);
            }
            Content::Released => return false,
            Content::TakenBack { cause } => {
                // Another process has the interfaces now.
                self.ethernet.end();
                self.ownership.taken_back(cause);
                return false;
            }
            // A daemon of this version sends no other message.
            _ => {}
        }
        true
    }

    /// Sends the daemon the knowledge, if a scan has ended since the last time.
    fn tell_knowledge(&self) {
        let Some(events) = self.events else { return };
        match self.supervisor.client_events(events) {
            Ok(Some(events)) if !events.events.is_empty() => {}
            _ => return,
        }
        if let Ok(Some(knowledge)) = self.supervisor.knowledge() {
            self.tell(Message { content: Content::Knowledge, bytes: knowledge.to_bytes() });
        }
    }

    /// The next check finds that the daemon has ended, if it has.
    fn tell(&self, message: Message) {
        let _ = self.connection.send(&message);
    }
}
