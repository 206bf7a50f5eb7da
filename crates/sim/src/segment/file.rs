//! Files of a segment, read up to a limit.

use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The bytes of a segment file, or of a file that it names. A pipe could keep its reader waiting for ever, and a device
/// never ends.
pub(super) fn read_at_most(path: &Path, limit: u64) -> Result<Vec<u8>, String> {
    let failed = |error: std::io::Error| format!("cannot be read: {error}");
    let kind = std::fs::metadata(path).map_err(failed)?;
    if !kind.is_file() && !kind.is_dir() {
        return Err("cannot be read: it is no regular file".to_owned());
    }
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|file| file.take(limit + 1).read_to_end(&mut bytes));
    read.map_err(failed)?;
    match bytes.len() as u64 > limit {
        true => Err(format!("is longer than {limit} bytes")),
        false => Ok(bytes),
    }
}
