//! `events`: what has happened on the bus. Not a command of the original tool.

use std::fs::File;
use std::io;
use std::os::fd::AsFd;
use std::os::unix::fs::FileTypeExt;
use std::time::Duration;

use ringcat_control::message::{Answer, EventLine, MasterState, Query};
use ringcat_control::wait_readable;

use crate::failure::{Failure, unexpected};
use crate::json;
use crate::json::ring::Event;
use crate::session::Session;
use crate::shape::{Command, Output};

/// Interval of questions.
const LOOK: Duration = Duration::from_millis(100);

/// The command.
pub const COMMAND: Command = Command {
    name: "events",
    summary: "Show events of the bus: states, cables, the ring, faults.",
    forms: &[""],
    help: "One line for each event: seconds since the host was started, and the
event in words. The daemon, or the application that drives the bus, keeps the
last 4096; each begins anew. With several masters a line begins with the
number of its master. Not a command of IgH.
",
    options: "  --follow               Go on with events as they come, until Ctrl-C.
",
    output: Output::Data,
    run,
};

/// Events of a master that were shown.
struct Shown {
    master: u32,
    /// It was driven when it was asked last. A line on the standard error reports once that it no longer is.
    is_driven: bool,
    /// Number of the next one.
    next: u64,
    /// Identifies the numbering, once it is known.
    epoch: Option<u64>,
}

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let masters = session.masters()?;
    let is_alone = masters.len() == 1;
    let shown = |it: &MasterState| Shown { master: it.master, is_driven: true, next: 0, epoch: None };
    let mut all: Vec<Shown> = masters.iter().map(shown).collect();
    loop {
        for shown in &mut all {
            while show(session, shown, is_alone)? {}
        }
        if !session.arguments.follow {
            return Ok(());
        }
        session.flush()?;
        if pause() == Reader::Gone {
            return Err(Failure::Closed);
        }
    }
}

/// Whether the output still has a reader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Reader {
    Reads,
    Gone,
}

/// Waits until the next question, or until the pipe to which the output goes is closed at its other end.
fn pause() -> Reader {
    let output = io::stdout();
    let owned = output.as_fd().try_clone_to_owned().map(File::from);
    let is_pipe = owned.and_then(|file| file.metadata()).is_ok_and(|kind| kind.file_type().is_fifo());
    if !is_pipe {
        std::thread::sleep(LOOK);
        return Reader::Reads;
    }
    if wait_readable(&[output.as_fd()], LOOK) == 0 { Reader::Reads } else { Reader::Gone }
}

/// Shows events of a master from the next one on, as many as an answer has. Whether there may be more.
fn show(session: &mut Session<'_>, shown: &mut Shown, is_alone: bool) -> Result<bool, Failure> {
    let master = shown.master;
    let answer = match session.ask(master, Query::Events { from: shown.next }, Vec::new()) {
        Err(failure) if failure.not_driven().is_some() && !shown.is_driven => return Ok(false),
        answer => answer,
    };
    let answer = session.if_driven(answer)?;
    shown.is_driven = answer.is_some();
    let Some((answer, _)) = answer else { return Ok(false) };
    let Answer::Events { epoch, missed, next, events } = answer else { return Err(unexpected()) };
    let is_same = shown.epoch.is_none_or(|before| before == epoch);
    shown.epoch = Some(epoch);
    if !is_same {
        // Another process drives the master, and numbers its own events.
        shown.next = 0;
        return Ok(true);
    }
    if missed > 0 && shown.next > 0 {
        session.say(&format!("{missed} events came too fast to be shown"));
    }
    for event in &events {
        if session.arguments.json {
            json::print(session, &Event::new(master, event))?;
            continue;
        }
        let EventLine { at_ns, text, .. } = event;
        let (seconds, micros) = (at_ns / 1_000_000_000, at_ns / 1_000 % 1_000_000);
        let of_master = if is_alone { String::new() } else { format!("{master}: ") };
        writeln!(session, "{of_master}[{seconds:5}.{micros:06}] {text}")?;
    }
    let has_more = next > shown.next && !events.is_empty();
    shown.next = next;
    Ok(has_more)
}
