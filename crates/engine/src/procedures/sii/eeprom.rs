//! Words of an EEPROM through the SII interface of its controller (protocol 3.8).
//!
//! A poll reads the data of a command, and the next command follows it in the same frame: while the EEPROM is busy the
//! controller refuses the command, otherwise it starts at once. The address register shows which word the data belongs
//! to, so duplicated, late and lost commands are detected.

use alloc::vec::Vec;
use core::ops::Range;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{SiiCommand, SiiControl, map};

use super::error::{LIMIT, SiiReadError};
use super::pace::Pace;
use crate::supervisor::{Bus, BusError};
use crate::time::Instant;

/// How long an EEPROM may be busy with one command (protocol 5.4: 20 ms are usual; emulated ones take longer).
const COMMAND_LIMIT: Duration = Duration::from_millis(100);
/// How long a controller may take to load its EEPROM after power-on.
const LOAD_LIMIT: Duration = Duration::from_millis(500);
/// Repetitions of a command that the EEPROM did not acknowledge or the controller did not take.
const RETRIES: usize = 3;
/// Bytes of control, address and data registers in one poll with 8-byte reads.
const POLL_LEN: usize = 14;

/// A read command sent to the controller.
#[derive(Clone, Copy, Debug)]
struct SentCommand {
    word: u32,
    /// When its frame left.
    at: Instant,
}

/// Result of a poll.
struct Poll {
    control: SiiControl,
    address: u32,
    data: [u8; 8],
    /// When its frame left.
    at: Instant,
    /// The controller took the command that came with the poll: when that command left.
    taken: Option<Instant>,
}

/// Why a command returned no data.
enum Failure {
    /// The data register holds another word, or the polled data was overwritten.
    NotTaken,
    /// The EEPROM reported an error.
    Command(SiiControl),
}

/// The EEPROM of one SubDevice, and the words read so far.
pub(super) struct Eeprom {
    bus: Bus,
    station: StationAddress,
    pub(super) pace: Pace,
    eight_bytes: bool,
    given: Option<SentCommand>,
    until: Instant,
    words: Vec<Option<u16>>,
}

impl Eeprom {
    /// Waits until the controller has loaded its configuration, and until the last command of another user has ended.
    pub(super) async fn open(bus: &Bus, station: StationAddress, pace: Pace) -> Result<Eeprom, SiiReadError> {
        let mut begin = None;
        loop {
            let control = SiiControl::decode(&bus.fprd_array(station, map::SII_CONTROL).await?);
            // From the first reply on: a segment that stands still for a moment loads nothing.
            let begin = *begin.get_or_insert(bus.now());
            let elapsed = bus.now().since(begin);
            if !control.busy {
                return Ok(Eeprom { until: begin + LIMIT, ..Eeprom::ready(bus, station, pace, control) });
            }
            if elapsed >= LOAD_LIMIT {
                return Err(SiiReadError::Busy { word: 0 });
            }
            bus.sleep(Pace::next(elapsed)).await;
        }
    }

    /// That of a controller that is not busy, by its register SII_CONTROL.
    pub(super) fn ready(bus: &Bus, station: StationAddress, pace: Pace, control: SiiControl) -> Eeprom {
        Eeprom {
            bus: bus.clone(),
            station,
            pace,
            eight_bytes: control.eight_byte_reads,
            given: None,
            until: bus.now() + LIMIT,
            words: Vec::new(),
        }
    }

    /// Time at which reading must have ended.
    pub(super) fn until(&self) -> Instant {
        self.until
    }

    pub(super) fn station(&self) -> StationAddress {
        self.station
    }

    /// Reads words. `then` is the word that will be read next, if that is certain: it is read ahead.
    pub(super) async fn bytes(&mut self, first: u32, count: u32, then: Option<u32>) -> Result<Vec<u8>, SiiReadError> {
        self.bytes_with(first, count, then, |_| None).await
    }

    /// As [`Eeprom::bytes`], but words that `known` returns are not read.
    pub(super) async fn bytes_with(
        &mut self,
        first: u32,
        count: u32,
        then: Option<u32>,
        known: impl Fn(u32) -> Option<u16>,
    ) -> Result<Vec<u8>, SiiReadError> {
        let end = first + count;
        let mut bytes = Vec::with_capacity(2 * count as usize);
        for word in first..end {
            let value = match self.word(word).or_else(|| known(word)) {
                Some(value) => value,
                None => {
                    let ahead = |eeprom: &Eeprom, read: Range<u32>| {
                        let mut rest = (word..end).filter(|word| known(*word).is_none()).chain(then);
                        rest.find(|word| eeprom.word(*word).is_none() && !read.contains(word))
                    };
                    self.fetch(word, &ahead).await?
                }
            };
            bytes.extend_from_slice(&value.to_le_bytes());
        }
        Ok(bytes)
    }

    /// The words of this range that have been read.
    pub(super) fn own_words(&self, first: u32, count: u32) -> impl Iterator<Item = (u32, u16)> {
        (first..first + count).filter_map(|word| Some((word, self.word(word)?)))
    }

    /// Words that one command reads.
    pub(super) const fn width(&self) -> u32 {
        if self.eight_bytes { 4 } else { 2 }
    }

    fn word(&self, word: u32) -> Option<u16> {
        self.words.get(word as usize).copied().flatten()
    }

    /// Reads the data at a word. Afterwards a command is under way for the word that `ahead` returns: the next one that
    /// is needed, but for those that are being read.
    async fn fetch(
        &mut self,
        word: u32,
        ahead: &dyn Fn(&Eeprom, Range<u32>) -> Option<u32>,
    ) -> Result<u16, SiiReadError> {
        let mut failures = 0;
        loop {
            if let Some(value) = self.word(word) {
                return Ok(value);
            }
            if self.bus.now() >= self.until {
                return Err(SiiReadError::TooSlow { word });
            }
            let Some(given) = self.given.take() else {
                self.command(word).await?;
                continue;
            };
            // After a failure no command is sent ahead. A command that was sent ahead may return the word, but begin
            // before it.
            let read = given.word..given.word + self.width();
            let next = if failures > 0 {
                None
            } else if read.contains(&word) {
                ahead(self, read)
            } else {
                Some(word)
            };
            let Err(failure) = self.finish(given, next).await? else { continue };
            failures += 1;
            match failure {
                Failure::NotTaken if failures > RETRIES => return Err(SiiReadError::Refused { word }),
                Failure::Command(control) if failures > RETRIES => return Err(SiiReadError::Command { word, control }),
                Failure::Command(_) if self.given.is_none() => {
                    self.write(SiiControl::request(SiiCommand::Idle).encode().to_vec()).await?;
                }
                Failure::NotTaken | Failure::Command(_) => {}
            }
        }
    }

    /// Writes from SII_CONTROL on; returns when the command left, if the controller took it. It refuses commands while
    /// the EEPROM is busy, also if the reply to a command was lost and the command is sent again.
    async fn write(&self, data: Vec<u8>) -> Result<Option<Instant>, BusError> {
        let target = Target::Station(self.station, map::SII_CONTROL);
        let reply = self.bus.transfer(Command::Fpwr, target, data, Some(Wkc(1))).await?;
        Ok((reply.wkc() == Wkc(1)).then_some(reply.sent_at))
    }

    fn read_command(word: u32) -> Vec<u8> {
        let [low, high] = SiiControl::request(SiiCommand::Read).encode();
        let [a, b, c, d] = word.to_le_bytes();
        alloc::vec![low, high, a, b, c, d]
    }

    async fn command(&mut self, word: u32) -> Result<(), BusError> {
        let sent_at = self.write(Eeprom::read_command(word)).await?;
        self.given = Some(SentCommand { word, at: sent_at.unwrap_or_else(|| self.bus.now()) });
        Ok(())
    }

    /// Polls until a command has ended, and sends the next one at once. Times count from departure to departure: a
    /// command and its poll take the same path, so the propagation time of a long frame through many SubDevices does
    /// not count.
    async fn finish(&mut self, given: SentCommand, next: Option<u32>) -> Result<Result<(), Failure>, SiiReadError> {
        self.bus.sleep_until(given.at + self.pace.first()).await;
        let mut early = None;
        let mut busy: Option<(u32, Instant)> = None;
        loop {
            let poll = self.poll(next).await?;
            let elapsed = poll.at.since(given.at);
            if let (Some(at), Some(word)) = (poll.taken, next) {
                self.given = Some(SentCommand { word, at });
            }
            if !poll.control.busy {
                self.pace.took(elapsed, early);
                if poll.control.command_error || poll.control.write_enable_error {
                    return Ok(Err(Failure::Command(poll.control)));
                }
                // Repeated after a loss, the next command may be before the poll in one frame: the address is then new,
                // the data old.
                if poll.address != given.word {
                    return Ok(Err(Failure::NotTaken));
                }
                self.keep(poll.address, poll.data);
                return Ok(Ok(()));
            }
            if poll.taken.is_some() {
                // The EEPROM finished between the poll and the command behind it.
                return Ok(Err(Failure::NotTaken));
            }
            // From the reply on that has shown it first: where a segment stands still for a moment, frames are answered
            // long after they left, and the busy command may be the next one.
            let since = match busy {
                Some((word, since)) if word == poll.address => since,
                _ => self.bus.now(),
            };
            busy = Some((poll.address, since));
            if poll.at.since(since) > COMMAND_LIMIT {
                return Err(SiiReadError::Busy { word: given.word });
            }
            if self.bus.now() >= self.until {
                return Err(SiiReadError::TooSlow { word: given.word });
            }
            // After a lost reply the busy command may be the next one: this one has ended before.
            if poll.address == given.word {
                early = Some(elapsed);
            }
            self.bus.sleep(Pace::next(elapsed)).await;
        }
    }

    async fn poll(&self, next: Option<u32>) -> Result<Poll, BusError> {
        let length = if self.eight_bytes { POLL_LEN } else { POLL_LEN - 4 };
        let (target, expected) = (Target::Station(self.station, map::SII_CONTROL), Wkc(1));
        let read = self.bus.transfer(Command::Fprd, target, alloc::vec![0; length], Some(expected));
        let (reply, taken) = match next {
            None => (read.await?, None),
            Some(word) => {
                let (reply, taken) = self.bus.both(read, self.write(Eeprom::read_command(word))).await;
                (reply?, taken?)
            }
        };
        if reply.wkc() != expected {
            return Err(BusError::Wkc { target, expected, got: reply.wkc() });
        }
        let (bytes, at) = (&reply.data, reply.sent_at);
        let mut data = [0; 8];
        data[..length - 6].copy_from_slice(&bytes[6..length]);
        let control = SiiControl::decode(&[bytes[0], bytes[1]]);
        Ok(Poll { control, address: u32::from_le_bytes([bytes[2], bytes[3], bytes[4], bytes[5]]), data, at, taken })
    }

    fn keep(&mut self, word: u32, data: [u8; 8]) {
        let (at, count) = (word as usize, self.width() as usize);
        if self.words.len() < at + count {
            self.words.resize(at + count, None);
        }
        for (slot, pair) in self.words[at..at + count].iter_mut().zip(data.as_chunks::<2>().0) {
            *slot = Some(u16::from_le_bytes(*pair));
        }
    }
}
