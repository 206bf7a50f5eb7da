//! Ethernet frames between both MainDevices of a ring: each side sends numbered frames, and each frame that arrives is
//! checked: it is whole, has not come before, and none behind it has.

use ringcat::standby::{MAX_ETHERNET, PartnerEndpoint};

/// Bytes before the pattern: sender, start of its program, number.
const HEAD: usize = 14;

/// What one side has sent and received.
#[derive(Clone, Debug, Default)]
pub struct EthernetPeer {
    sender: u8,
    /// Number of the start of its program.
    start: u16,
    /// Frames that were queued.
    pub sent: u64,
    /// Frames that were not, because the queue was full or the other side did not answer.
    pub refused: u64,
    /// Frames of the present program of the other side that have arrived.
    pub received: u64,
    /// Frames of it that have not arrived, although a later one has.
    pub missed: u64,
    /// Start of that program, and number of its last frame that has arrived.
    last: Option<(u16, u64)>,
    length: usize,
    /// What was wrong first.
    pub fault: Option<String>,
}

impl EthernetPeer {
    /// Of one of both sides, and the start of its program.
    pub fn new(sender: u8, start: u16) -> EthernetPeer {
        EthernetPeer { sender, start, ..EthernetPeer::default() }
    }

    /// Sends frames.
    pub fn send(&mut self, endpoint: &mut PartnerEndpoint, frames: usize) {
        for _ in 0..frames {
            // All lengths in turn, and more often those that a poll has room for in any case.
            self.length = (self.length + 37) % (MAX_ETHERNET - HEAD + 1);
            let length = if self.length.is_multiple_of(3) { self.length / 12 } else { self.length };
            match endpoint.send(&frame(self.sender, self.start, self.sent + 1, HEAD + length)) {
                Ok(()) => self.sent += 1,
                Err(_) => self.refused += 1,
            }
        }
    }

    /// Takes the frames that have arrived.
    pub fn receive(&mut self, endpoint: &mut PartnerEndpoint) {
        let mut room = [0; MAX_ETHERNET];
        while let Some(length) = endpoint.receive(&mut room) {
            let fault = self.take(&room[..length]).err();
            self.fault = self.fault.take().or(fault);
        }
    }

    fn take(&mut self, bytes: &[u8]) -> Result<(), String> {
        let (start, number) = read(bytes).ok_or_else(|| format!("{} bytes", bytes.len()))?;
        if bytes != frame(self.sender ^ 1, start, number, bytes.len()) {
            return Err(format!("frame {number} of start {start} is another one"));
        }
        match self.last.filter(|(before, _)| *before == start) {
            Some((_, last)) if number <= last => return Err(format!("{number} comes behind {last}")),
            Some((_, last)) => self.missed += number - last - 1,
            None => (self.received, self.missed) = (0, 0),
        }
        self.last = Some((start, number));
        self.received += 1;
        Ok(())
    }
}

fn frame(sender: u8, start: u16, number: u64, length: usize) -> Vec<u8> {
    let mut bytes = vec![0x02, 0, 0, sender];
    bytes.extend(start.to_le_bytes());
    bytes.extend(number.to_le_bytes());
    bytes.resize(length, 0);
    let pattern = (HEAD as u64..).map(|at| (at * 7 + number * 13) as u8);
    bytes[HEAD..].iter_mut().zip(pattern).for_each(|(byte, value)| *byte = value);
    bytes
}

fn read(bytes: &[u8]) -> Option<(u16, u64)> {
    let start = bytes.get(4..)?.first_chunk()?;
    let number = bytes.get(6..)?.first_chunk()?;
    Some((u16::from_le_bytes(*start), u64::from_le_bytes(*number)))
}
