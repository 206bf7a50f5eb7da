//! A message of which a part may have arrived.

use std::io;

use crate::message::Message;
use crate::receive_error::ReceiveError;
use crate::wire::{self, HEADER, Header, Limits};

/// Bytes that are read at once.
const PART: usize = 64 << 10;

/// A message that arrives in parts. Memory grows with what has arrived, not with what was announced.
#[derive(Debug)]
pub struct Arriving {
    limits: Limits,
    header: [u8; HEADER],
    /// Bytes of the header that are there.
    filled: usize,
    /// Lengths, when the whole header is there.
    lengths: Option<Header>,
    content: Vec<u8>,
    bytes: Vec<u8>,
}

impl Arriving {
    /// Nothing has arrived.
    pub fn new(limits: Limits) -> Arriving {
        let (content, bytes) = (Vec::new(), Vec::new());
        Arriving { limits, header: [0; HEADER], filled: 0, lengths: None, content, bytes }
    }

    /// Whether a part of a message is there.
    pub fn has_begun(&self) -> bool {
        self.filled > 0
    }

    /// Reads once. The whole message, when its last part is there; the next one begins then.
    ///
    /// # Errors
    /// The stream has ended or failed, or what came is no message.
    pub(crate) fn read_part(
        &mut self,
        read: impl FnMut(&mut [u8]) -> io::Result<usize>,
    ) -> Result<Option<Message>, ReceiveError> {
        let Some(lengths) = self.lengths else {
            self.filled += once(&mut self.header[self.filled..], read)?;
            if self.filled == HEADER {
                self.lengths = Some(Header::decode(&self.header, self.limits)?);
            }
            return self.finish();
        };
        if self.content.len() < lengths.content {
            append(&mut self.content, lengths.content, read)?;
        } else {
            append(&mut self.bytes, lengths.bytes, read)?;
        }
        self.finish()
    }

    fn finish(&mut self) -> Result<Option<Message>, ReceiveError> {
        match self.lengths {
            Some(lengths) if self.content.len() == lengths.content && self.bytes.len() == lengths.bytes => {
                let Arriving { content, bytes, .. } = std::mem::replace(self, Arriving::new(self.limits));
                Ok(Some(Message { content: wire::decode_content(&content)?, bytes }))
            }
            _ => Ok(None),
        }
    }
}

fn append(
    part: &mut Vec<u8>,
    length: usize,
    read: impl FnMut(&mut [u8]) -> io::Result<usize>,
) -> Result<(), ReceiveError> {
    let begin = part.len();
    part.resize(begin + PART.min(length - begin), 0);
    let read = once(&mut part[begin..], read);
    part.truncate(begin + *read.as_ref().unwrap_or(&0));
    read.map(|_| ())
}

/// Reads at least one byte, or nothing after a signal.
fn once(bytes: &mut [u8], mut read: impl FnMut(&mut [u8]) -> io::Result<usize>) -> Result<usize, ReceiveError> {
    match read(bytes) {
        Ok(0) => Err(ReceiveError::Ended),
        Ok(read) => Ok(read),
        Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(0),
        Err(error) => Err(error.into()),
    }
}
