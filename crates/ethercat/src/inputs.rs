//! Data that a command gets from a file or from the standard input.

use std::fs::File;
use std::io::{self, Read};

use crate::failure::Failure;

/// All bytes of a file, or of the standard input (`-`), at most `limit`.
///
/// # Errors
/// It cannot be read, or is longer.
pub fn read(name: &str, limit: usize) -> Result<Vec<u8>, Failure> {
    if name == "-" {
        return all(&mut io::stdin().lock(), "the standard input", limit);
    }
    let mut file = File::open(name).map_err(|error| Failure::failed(format!("Failed to open '{name}'! ({error})")))?;
    all(&mut file, &format!("'{name}'"), limit)
}

fn all(source: &mut dyn Read, name: &str, limit: usize) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    let most = limit as u64 + 1;
    let read = source.take(most).read_to_end(&mut bytes);
    read.map_err(|error| Failure::failed(format!("Failed to read {name}: {error}")))?;
    if bytes.len() > limit {
        return Err(Failure::failed(format!("{name} is longer than {limit} bytes!")));
    }
    Ok(bytes)
}
