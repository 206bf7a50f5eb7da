//! Threads that answer the questions which a daemon passes to the owner of a bus.
//!
//! So that a slow SubDevice does not keep other questions waiting, there are some of them. They hold their answers back
//! from nothing: a full queue refuses.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};

use ringcat_control::Connection;
use ringcat_control::message::{Answer, Ask, Content, Message, Numbered};
use ringcat_control::refusal::Refusal;

use super::serving::answer;
use crate::supervisor_thread::SupervisorThread;

/// Threads, and so questions to slow SubDevices at a time.
const THREADS: usize = 4;
/// Questions that wait for a thread. The daemon has no more under way.
const WAITING: usize = 16;

type Question = (Numbered<Ask>, Vec<u8>);

/// Where questions are put. The threads end when it is dropped.
#[derive(Debug)]
pub(super) struct Questions {
    queue: SyncSender<Question>,
    connection: Arc<Connection>,
}

impl Questions {
    /// Starts the threads.
    ///
    /// # Errors
    /// The system cannot start one.
    pub fn start(supervisor: &SupervisorThread, connection: &Arc<Connection>) -> std::io::Result<Questions> {
        let (queue, waiting) = sync_channel(WAITING);
        let waiting = Arc::new(Mutex::new(waiting));
        for _ in 0..THREADS {
            let (supervisor, connection, waiting) = (supervisor.clone(), connection.clone(), waiting.clone());
            let body = move || serve(&supervisor, &connection, &waiting);
            std::thread::Builder::new().name("daemon answers".into()).spawn(body)?;
        }
        Ok(Questions { queue, connection: connection.clone() })
    }

    /// Takes a question, and says so.
    pub fn take(&self, question: Numbered<Ask>, bytes: Vec<u8>) {
        let (id, master) = (question.id, question.master);
        match self.queue.try_send((question, bytes)) {
            Ok(()) => send(&self.connection, Content::Underway { id }.into()),
            Err(_) => {
                let what = Err(Refusal::Failed("the application answers as many questions as it can".to_owned()));
                send(&self.connection, Content::Answer(Numbered { id, master, what }).into());
            }
        }
    }
}

fn serve(supervisor: &SupervisorThread, connection: &Connection, waiting: &Mutex<Receiver<Question>>) {
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
