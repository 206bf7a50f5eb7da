//! The last frames in a file, without a fault.

use ringcat_control::message::Answer;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::{RecordLine, ToolAnswer};

use super::service::{Answered, LONG};
use crate::record_requests::NoRecord;
use crate::supervisor_thread::SupervisorThread;

/// Writes the file, and waits for it.
pub(super) fn write(supervisor: &SupervisorThread) -> Answered {
    let written = supervisor.record_requests().ok_or(NoRecord::NotKept).and_then(|requests| requests.write(LONG));
    let written = written.map_err(|error| Refusal::Failed(why(error)))?;
    let path = written.path.to_string_lossy().into_owned();
    let line = RecordLine { path, frames: written.frames, lost: written.lost };
    Ok((Answer::Tool(ToolAnswer::Record(line)), Vec::new()))
}

fn why(error: NoRecord) -> String {
    match error {
        NoRecord::NotKept => {
            "the program that drives the bus keeps no frames: it has no FrameRecord, or reported why it \
                              has none"
                .to_owned()
        }
        NoRecord::Ended => "the bus has passed to another process: repeat the command".to_owned(),
        NoRecord::Busy => "another file of the last frames is being written: repeat the command later".to_owned(),
        NoRecord::Failed(why) => why,
    }
}
