//! Knowledge of a segment and any bytes: an error that names a place within them, or knowledge that survives a round
//! trip.

use ringcat::Knowledge;
use ringcat_engine::knowledge::seal;

/// Knowledge of two SubDevices. To write it again: `RINGCAT_WRITE_CORPUS=1 cargo test -p scenarios --test virtual_time
/// the_corpus`.
pub const SMALL: &[u8] = include_bytes!("../../../../fuzz/corpus/knowledge/00");

/// Bytes of the header before the content.
pub const HEADER: usize = 22;

/// Takes knowledge from bytes as they are, and from the same as content behind a header that fits.
pub fn target(bytes: &[u8]) {
    let _ = is_read(bytes);
    let _ = is_read(&seal(bytes));
}

/// Takes knowledge from bytes; returns whether they are some.
pub fn is_read(bytes: &[u8]) -> bool {
    match Knowledge::from_bytes(bytes) {
        Ok(knowledge) => {
            let again = knowledge.to_bytes();
            assert_eq!(Knowledge::from_bytes(&again).as_ref(), Ok(&knowledge));
            true
        }
        Err(error) => {
            assert!(error.offset <= bytes.len(), "{error}");
            false
        }
    }
}
