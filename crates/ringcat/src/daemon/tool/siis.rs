//! SIIs, and how far long transfers are.

use ringcat_control::message::Answer;
use ringcat_control::tool::{MOST_IMAGES, MOST_TRANSFERS, SiiLine, ToolAnswer, TransferLine, TransferWork};
use ringcat_engine::{TransferKind, TransferProgress};
use ringcat_wire::address::Position;

use super::super::refusing::refusal;
use super::service::{Answered, LONG, expected};
use crate::error::Error;
use crate::job::Job;
use crate::supervisor_thread::SupervisorThread;

/// SIIs of several SubDevices, at the same time.
pub(super) fn images(supervisor: &SupervisorThread, positions: &[u16]) -> Answered {
    if positions.len() > MOST_IMAGES {
        return Err(expected(&format!("at most {MOST_IMAGES} SubDevices, not {}", positions.len())));
    }
    let start = |position: &u16| {
        let job = supervisor.background().subdevice(Position(*position)).within(LONG).sii_image();
        (*position, job)
    };
    let jobs: Vec<(u16, Job<_>)> = positions.iter().map(start).collect();
    let (mut lines, mut bytes) = (Vec::new(), Vec::new());
    for (position, job) in jobs {
        let read = job.wait().and_then(|read| read.map_err(Error::from)).map_err(|error| refusal(&error));
        let length = read.map(|mut image| {
            let length = image.len() as u32;
            bytes.append(&mut image);
            length
        });
        lines.push(SiiLine { position, bytes: length });
    }
    Ok((Answer::Tool(ToolAnswer::SiiImages(lines)), bytes))
}

/// How far the transfers of a SubDevice are.
pub(super) fn transfers(supervisor: &SupervisorThread, position: u16) -> Result<Vec<TransferLine>, Error> {
    let transfers = supervisor.act(move |engine| engine.transfers(Position(position)))?;
    Ok(transfers.into_iter().filter_map(line).take(MOST_TRANSFERS).collect())
}

fn line(progress: TransferProgress) -> Option<TransferLine> {
    let work = match progress.kind {
        TransferKind::EepromRead => TransferWork::SiiRead,
        TransferKind::EepromWrite => TransferWork::SiiWrite,
        TransferKind::FileRead => TransferWork::FileRead,
        TransferKind::FileWrite => TransferWork::FileWrite,
        TransferKind::ObjectRead => TransferWork::ObjectRead,
        TransferKind::ObjectWrite => TransferWork::ObjectWrite,
        _ => return None,
    };
    Some(TransferLine { work, done: progress.done, total: progress.total })
}
