//! Threads that answer the queries which a daemon passes to the owner of a bus.
//!
//! There are several threads, so that a slow SubDevice does not delay other queries. The queues are bounded: a query is
//! refused if its queue is full.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use ringcat_control::Connection;
use ringcat_control::message::{Answer, Content, Message, Numbered, Query, ToolQuery};
use ringcat_control::refusal::Refusal;

use super::serving::answer;
use crate::supervisor_thread::SupervisorThread;

/// Stack of each thread. It is small because a program may lock its memory, and with it the stacks.
const STACK_BYTES: usize = 256 << 10;
/// Threads for queries that are answered by a mailbox: so many queries to slow SubDevices are possible at a time.
const SLOW: usize = 3;
/// Threads for all other queries: slow SubDevices do not delay queries about registers and states.
const QUICK: usize = 1;
/// Maximum number of queries that wait for a thread. The daemon has no more pending queries.
const WAITING: usize = 16;

type QueuedQuery = (Numbered<Query>, Vec<u8>);

/// The queues of the threads. The threads end when it is dropped.
#[derive(Debug)]
pub(super) struct QueryThreads {
    slow: SyncSender<QueuedQuery>,
    quick: SyncSender<QueuedQuery>,
    connection: Arc<Connection>,
}

impl QueryThreads {
    /// Starts the threads. `prepare` runs first in each.
    ///
    /// # Errors
    /// The system cannot start one.
    pub fn start(
        supervisor: &SupervisorThread,
        connection: &Arc<Connection>,
        prepare: &(impl Fn() + Clone + Send + 'static),
    ) -> std::io::Result<QueryThreads> {
        let start = |threads| QueryThreads::queue(threads, supervisor, connection, prepare);
        Ok(QueryThreads { slow: start(SLOW)?, quick: start(QUICK)?, connection: connection.clone() })
    }

    /// A queue with this number of threads.
    fn queue(
        threads: usize,
        supervisor: &SupervisorThread,
        connection: &Arc<Connection>,
        prepare: &(impl Fn() + Clone + Send + 'static),
    ) -> std::io::Result<SyncSender<QueuedQuery>> {
        let (queue, waiting) = sync_channel(WAITING);
        let waiting = Arc::new(Mutex::new(waiting));
        for _ in 0..threads {
            let (supervisor, connection, waiting) = (supervisor.clone(), connection.clone(), waiting.clone());
            let prepare = prepare.clone();
            let body = move || {
                prepare();
                serve(&supervisor, &connection, &waiting);
            };
            std::thread::Builder::new().name("daemon answers".into()).stack_size(STACK_BYTES).spawn(body)?;
        }
        Ok(queue)
    }

    /// Puts a query into its queue and confirms this to the daemon; refuses the query if the queue is full.
    pub fn take(&self, query: Numbered<Query>, bytes: Vec<u8>) {
        let (id, master) = (query.id, query.master);
        let queue = if is_quick(&query.what) { &self.quick } else { &self.slow };
        match queue.try_send((query, bytes)) {
            Ok(()) => send(&self.connection, Content::Underway { id }.into()),
            Err(_) => {
                let what = Err(Refusal::Failed("the application has the maximum number of pending queries".to_owned()));
                send(&self.connection, Content::Answer(Numbered { id, master, what }).into());
            }
        }
    }
}

/// Whether no mailbox and no procedure is needed for the answer.
fn is_quick(ask: &Query) -> bool {
    matches!(
        ask,
        Query::State
            | Query::Events { .. }
            | Query::AlStatus { .. }
            | Query::RegisterRead { .. }
            | Query::RegisterWrite { .. }
            | Query::Overview
            | Query::Tool(
                ToolQuery::Master
                    | ToolQuery::SubDevices { .. }
                    | ToolQuery::Description { .. }
                    | ToolQuery::Ports { .. }
                    | ToolQuery::Transfers { .. }
            )
    )
}

fn serve(supervisor: &SupervisorThread, connection: &Connection, waiting: &Mutex<Receiver<QueuedQuery>>) {
    loop {
        let next = waiting.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((Numbered { id, master, what }, bytes)) = next else { return };
        let (what, bytes) = match answer(supervisor, what, bytes) {
            Ok((answer, bytes)) => (Ok::<Answer, Refusal>(answer), bytes),
            Err(refusal) => (Err(refusal), Vec::new()),
        };
        send(connection, Message { content: Content::Answer(Numbered { id, master, what }), bytes });
    }
}

/// If the daemon is gone the thread that receives finds that.
fn send(connection: &Connection, message: Message) {
    let _ = connection.send(&message);
}
