//! SIIs, and the progress of long transfers.

use ringcat_control::message::Answer;
use ringcat_control::tool::{MAX_IMAGES, MAX_TRANSFERS, SiiLine, ToolAnswer, TransferLine, TransferWork};
use ringcat_engine::{TransferKind, TransferProgress};
use ringcat_wire::address::Position;

use super::super::refusing::refusal;
use super::service::{Answered, LONG, expected};
use crate::error::Error;
use crate::job::Job;
use crate::supervisor_thread::SupervisorThread;

/// SIIs of several SubDevices, at the same time. If the bus passes to another process meanwhile, the query as a whole
/// ends, and is sent again to the next one.
pub(super) fn images(supervisor: &SupervisorThread, positions: &[u16]) -> Answered {
    if positions.len() > MAX_IMAGES {
        return Err(expected(&format!("at most {MAX_IMAGES} SubDevices, not {}", positions.len())));
    }
    // Each read of an EEPROM that is never kept takes its time once more.
    if (1..positions.len()).any(|at| positions[..at].contains(&positions[at])) {
        return Err(expected("each SubDevice once"));
    }
    let start = |position: &u16| {
        let job = supervisor.background().subdevice(Position(*position)).within(LONG).sii_image();
        (*position, job)
    };
    let jobs: Vec<(u16, Job<_>)> = positions.iter().map(start).collect();
    let (mut lines, mut bytes) = (Vec::new(), Vec::new());
    for (position, job) in jobs {
        let read = match job.wait().and_then(|read| read.map_err(Error::from)) {
            Ok(mut image) => {
                let length = image.len() as u32;
                bytes.append(&mut image);
                Ok(length)
            }
            Err(Error::Gone) => return Err(refusal(&Error::Gone)),
            Err(error) => Err(refusal(&error)),
        };
        lines.push(SiiLine { position, bytes: read });
    }
    Ok((Answer::Tool(ToolAnswer::SiiImages(lines)), bytes))
}

/// Progress of the transfers of a SubDevice.
pub(super) fn transfers(supervisor: &SupervisorThread, position: u16) -> Result<Vec<TransferLine>, Error> {
    let transfers = supervisor.act(move |engine| engine.transfers(Position(position)))?;
    Ok(transfers.into_iter().filter_map(line).take(MAX_TRANSFERS).collect())
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
