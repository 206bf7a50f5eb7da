//! Files by FoE. A file to be written comes in parts, which are kept until it is written or forgotten.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ringcat_control::message::Answer;
use ringcat_control::refusal::Refusal;
use ringcat_control::tool::{MOST_FILE, MOST_PART};

use super::super::refusing::refusal;
use super::service::{Answered, LONG, expected, largest, subdevice};
use crate::supervisor_thread::SupervisorThread;

/// Transfers that are kept at a time.
const MOST_TRANSFERS: usize = 4;
/// A transfer without a further part is forgotten after this time, when another one begins.
const FORGOTTEN: Duration = Duration::from_secs(60);

/// Files that come in parts. They belong to the process, which is the daemon or an owner.
static TRANSFERS: Mutex<Vec<Transfer>> = Mutex::new(Vec::new());

struct Transfer {
    number: u64,
    bytes: Vec<u8>,
    last: Instant,
}

/// Takes a part of a file.
pub(super) fn part(number: u64, offset: u32, bytes: Vec<u8>) -> Answered {
    if bytes.len() > MOST_PART {
        return Err(expected(&format!("a part of at most {MOST_PART} bytes, not {}", bytes.len())));
    }
    let mut all = TRANSFERS.lock().unwrap_or_else(PoisonError::into_inner);
    take_part(&mut all, number, offset as usize, &bytes, Instant::now())?;
    Ok((Answer::Done, Vec::new()))
}

fn take_part(all: &mut Vec<Transfer>, number: u64, offset: usize, bytes: &[u8], now: Instant) -> Result<(), Refusal> {
    if offset == 0 {
        all.retain(|it| it.number != number && now.duration_since(it.last) < FORGOTTEN);
        if all.len() >= MOST_TRANSFERS {
            return Err(Refusal::Failed(format!("{MOST_TRANSFERS} files are being written: try again later")));
        }
        all.push(Transfer { number, bytes: Vec::new(), last: now });
    }
    let transfer = all.iter_mut().find(|it| it.number == number);
    let transfer = transfer.ok_or_else(|| expected("the first part of a file"))?;
    if transfer.bytes.len() != offset {
        return Err(expected(&format!("the part of a file from byte {} on", transfer.bytes.len())));
    }
    if offset + bytes.len() > MOST_FILE {
        all.retain(|it| it.number != number);
        return Err(expected(&format!("a file of at most {MOST_FILE} bytes")));
    }
    transfer.bytes.extend_from_slice(bytes);
    transfer.last = now;
    Ok(())
}

/// Writes the file of a transfer.
pub(super) fn write(supervisor: &SupervisorThread, position: u16, name: String, number: u64) -> Answered {
    let mut all = TRANSFERS.lock().unwrap_or_else(PoisonError::into_inner);
    let place = all.iter().position(|it| it.number == number);
    let bytes = place.map(|place| all.swap_remove(place).bytes).unwrap_or_default();
    drop(all);
    let written = subdevice(supervisor, position).within(LONG).foe_write(name, bytes);
    written.map(|_| (Answer::Done, Vec::new())).map_err(|error| refusal(&error))
}

/// Reads a file.
pub(super) fn read(supervisor: &SupervisorThread, position: u16, name: String) -> Answered {
    let read = subdevice(supervisor, position).within(LONG).limits(largest()).foe_read(name);
    read.map(|bytes| (Answer::Data, bytes)).map_err(|error| refusal(&error))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn parts_follow_each_other_and_files_that_are_not_finished_are_few() {
        let (mut all, now) = (Vec::new(), Instant::now());
        let mut put = |number, offset, bytes: &[u8], after| {
            take_part(&mut all, number, offset, bytes, now + Duration::from_secs(after)).map_err(|it| it.to_string())
        };
        assert_eq!((put(1, 0, b"abc", 0), put(1, 3, b"de", 1)), (Ok(()), Ok(())));
        assert_eq!(put(1, 4, b"f", 1), Err("expected the part of a file from byte 5 on".to_owned()));
        assert_eq!(put(2, 3, b"f", 1), Err("expected the first part of a file".to_owned()));
        for number in 2..=4 {
            assert_eq!(put(number, 0, b"x", 2), Ok(()));
        }
        assert!(put(5, 0, b"x", 2).is_err_and(|text| text.contains("4 files")));
        // No part of the first one came for a minute.
        assert_eq!(put(5, 0, b"x", 61), Ok(()));
        assert_eq!(all.iter().map(|it| it.number).collect::<Vec<_>>(), [2, 3, 4, 5]);
    }

    // covers: daemon
    #[test]
    fn a_file_has_a_largest_size() {
        let (mut all, now) = (Vec::new(), Instant::now());
        let part = vec![0; MOST_PART];
        let mut offset = 0;
        while offset + part.len() <= MOST_FILE {
            assert_eq!(take_part(&mut all, 1, offset, &part, now), Ok(()));
            offset += part.len();
        }
        assert!(take_part(&mut all, 1, offset, &part, now).is_err() && all.is_empty());
    }
}
