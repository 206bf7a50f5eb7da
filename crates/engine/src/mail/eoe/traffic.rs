//! Ethernet traffic of one mailbox: queues, counters, rates.

use alloc::collections::VecDeque;
use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::mailbox::eoe::{EoeBody, EoeMessage};

use super::reassembly::{MAX_FRAME, Outcome, Reassembly};
use crate::mail::answer_time::AnswerTime;
use crate::mail::bounded_queue::BoundedQueue;
use crate::time::Instant;

/// Shortest frame: its Ethernet header.
const MIN_FRAME: usize = 14;
/// Frames that may be queued for sending: about twenty milliseconds of a mailbox's throughput. A faster sender must
/// wait.
pub const QUEUE: usize = 32;
/// Received frames that are kept until the application takes them.
const RECEIVED: usize = 64;
/// Time stamps that are kept until the application takes them.
const TIME_STAMPS: usize = 16;
/// Time after a fragment in which the reader polls for others; later fragments are detected by the mail status.
const ACTIVE_FOR: Duration = Duration::from_millis(20);
/// Rates are those of the last full second.
const RATE_PERIOD: Duration = Duration::from_secs(1);

/// A frame from a SubDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EthernetFrame {
    /// The frame, without check sequence.
    pub bytes: Vec<u8>,
    /// Time at which it arrived at the SubDevice, if the SubDevice reports it: lower half, nanoseconds.
    pub time_ns: Option<u32>,
}

/// Time at which a SubDevice forwarded a frame with a requested time stamp.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeStamp {
    /// Number of the frame, as [`super::EthernetPort::send_with_time`] returned it.
    pub frame: u8,
    /// Lower half of the time, nanoseconds.
    pub time_ns: u32,
}

/// Why a frame was not queued for sending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum QueueError {
    /// The mailbox is not in use (the SubDevice is in INIT or does not answer), or it is too small for a fragment.
    Down,
    /// The queue is full; [`super::EthernetPort::ready`] waits for space.
    Full,
    /// Not an Ethernet frame of 14 to 1,518 bytes.
    Length {
        /// Its length in bytes.
        bytes: usize,
    },
}

impl fmt::Display for QueueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            QueueError::Down => f.write_str("no EoE at present: the SubDevice is in INIT or does not answer"),
            QueueError::Full => write!(f, "{QUEUE} frames wait to be sent"),
            QueueError::Length { bytes } => {
                write!(f, "an Ethernet frame has {MIN_FRAME} to {MAX_FRAME} bytes, got {bytes}")
            }
        }
    }
}

impl core::error::Error for QueueError {}

/// Counters of one SubDevice's Ethernet.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct EthernetCounters {
    /// Frames that the SubDevice accepted.
    pub tx_frames: u64,
    /// Their bytes.
    pub tx_bytes: u64,
    /// Queued frames that were not delivered: the SubDevice became unreachable, or did not accept mail for too long.
    pub tx_dropped: u64,
    /// Frames received from the SubDevice.
    pub rx_frames: u64,
    /// Their bytes.
    pub rx_bytes: u64,
    /// Received frames that the application did not take in time.
    pub rx_overruns: u64,
    /// Frames with missing or inconsistent fragments.
    pub rx_lost: u64,
    /// Malformed messages.
    pub malformed: u64,
}

/// Traffic per second in one direction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct EthernetRate {
    /// Bytes.
    pub bytes: u64,
    /// Frames.
    pub frames: u64,
}

/// Status of the port.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct EthernetStatus {
    /// Frames can be sent and received.
    pub up: bool,
    /// Counters since the port was opened.
    pub counters: EthernetCounters,
    /// To the SubDevice.
    pub tx_rate: EthernetRate,
    /// From the SubDevice.
    pub rx_rate: EthernetRate,
    /// Frames queued for sending, of [`QUEUE`].
    pub queued: usize,
}

/// A frame on its way to the SubDevice.
#[derive(Debug)]
pub(in crate::mail) struct Outgoing {
    pub bytes: Vec<u8>,
    pub number: u8,
    pub wants_time: bool,
}

/// Bytes and frames in the last full second.
#[derive(Debug, Default)]
struct Rate {
    since: Instant,
    now: (u64, u64),
    last: (u64, u64),
}

impl Rate {
    fn add(&mut self, now: Instant, bytes: usize) {
        self.turn(now);
        self.now = (self.now.0 + bytes as u64, self.now.1 + 1);
    }

    fn turn(&mut self, now: Instant) {
        let passed = now.since(self.since);
        if passed >= RATE_PERIOD {
            self.last = if passed < RATE_PERIOD * 2 { self.now } else { (0, 0) };
            self.now = (0, 0);
            let periods = passed.as_nanos() / RATE_PERIOD.as_nanos();
            self.since += RATE_PERIOD.saturating_mul(u32::try_from(periods).unwrap_or(u32::MAX));
        }
    }

    fn per_second(&mut self, now: Instant) -> EthernetRate {
        self.turn(now);
        let (bytes, frames) = self.last;
        EthernetRate { bytes, frames }
    }
}

/// Ethernet traffic of one mailbox.
#[derive(Debug)]
pub(in crate::mail) struct Traffic {
    /// A port is open. Without one, fragments are handled as unsolicited mail.
    pub attached: bool,
    /// Number of that port.
    pub attachment: u32,
    outgoing: VecDeque<Outgoing>,
    number: u8,
    reassembly: Reassembly,
    received: BoundedQueue<EthernetFrame>,
    time_stamps: BoundedQueue<TimeStamp>,
    counters: EthernetCounters,
    tx_rate: Rate,
    rx_rate: Rate,
    /// When a fragment was last sent or received.
    last_fragment: Option<Instant>,
}

impl Traffic {
    pub(in crate::mail) fn new() -> Traffic {
        Traffic {
            attached: false,
            attachment: 0,
            outgoing: VecDeque::new(),
            number: 0,
            reassembly: Reassembly::default(),
            received: BoundedQueue::new(RECEIVED),
            time_stamps: BoundedQueue::new(TIME_STAMPS),
            counters: EthernetCounters::default(),
            tx_rate: Rate::default(),
            rx_rate: Rate::default(),
            last_fragment: None,
        }
    }

    /// Drops frames in progress when the mailbox is closed or opened.
    pub(in crate::mail) fn reset(&mut self) {
        self.counters.tx_dropped += self.outgoing.len() as u64;
        self.outgoing.clear();
        self.reassembly.clear();
        self.last_fragment = None;
    }

    /// Queues a frame for sending; returns its number.
    pub(super) fn queue(&mut self, bytes: &[u8], wants_time: bool) -> Result<u8, QueueError> {
        if !(MIN_FRAME..=MAX_FRAME).contains(&bytes.len()) {
            return Err(QueueError::Length { bytes: bytes.len() });
        }
        if self.outgoing.len() >= QUEUE {
            return Err(QueueError::Full);
        }
        self.number = (self.number + 1) & 0x0F;
        self.outgoing.push_back(Outgoing { bytes: bytes.to_vec(), number: self.number, wants_time });
        Ok(self.number)
    }

    /// Number of frames that may still be queued.
    pub(super) fn room(&self) -> usize {
        QUEUE - self.outgoing.len()
    }

    pub(super) fn has_outgoing(&self) -> bool {
        !self.outgoing.is_empty()
    }

    pub(super) fn next_outgoing(&mut self) -> Option<Outgoing> {
        self.outgoing.pop_front()
    }

    /// A frame was sent, or failed.
    pub(super) fn sent(&mut self, bytes: usize, arrived: bool, now: Instant) {
        if arrived {
            self.counters.tx_frames += 1;
            self.counters.tx_bytes += bytes as u64;
            self.tx_rate.add(now, bytes);
        } else {
            self.counters.tx_dropped += 1;
        }
    }

    /// A fragment was written.
    pub(in crate::mail) fn note_fragment(&mut self, now: Instant) {
        self.last_fragment = Some(now);
    }

    /// Takes a message that is not an answer.
    pub(in crate::mail) fn take(&mut self, payload: &[u8], now: Instant) {
        match EoeMessage::decode(payload).map(|message| message.body) {
            Ok(EoeBody::Fragment(fragment)) => {
                self.note_fragment(now);
                let (lost, frame) = match self.reassembly.take(&fragment) {
                    Outcome::Part => (false, None),
                    Outcome::Frame(frame) => (false, Some(frame)),
                    Outcome::Lost => (true, None),
                    Outcome::Replaced(frame) => (true, frame),
                };
                self.counters.rx_lost += u64::from(lost);
                if let Some(bytes) = frame {
                    self.arrive(EthernetFrame { bytes, time_ns: fragment.time_ns }, now);
                }
            }
            Ok(EoeBody::TimeStamp { frame, time_ns }) => self.time_stamps.push(TimeStamp { frame, time_ns }),
            Ok(_) | Err(_) => self.counters.malformed += 1,
        }
    }

    fn arrive(&mut self, frame: EthernetFrame, now: Instant) {
        if frame.bytes.len() < MIN_FRAME {
            self.counters.malformed += 1;
            return;
        }
        self.counters.rx_frames += 1;
        self.counters.rx_bytes += frame.bytes.len() as u64;
        self.rx_rate.add(now, frame.bytes.len());
        self.received.push(frame);
    }

    pub(super) fn pop_received(&mut self) -> Option<EthernetFrame> {
        self.received.pop()
    }

    pub(super) fn pop_time_stamp(&mut self) -> Option<TimeStamp> {
        self.time_stamps.pop()
    }

    /// Time since the last fragment, while further fragments are expected.
    pub(in crate::mail) fn recently_active(&self, now: Instant) -> Option<Duration> {
        let idle = now.since(self.last_fragment.filter(|_| self.attached)?);
        (idle < ACTIVE_FOR).then_some(idle)
    }

    /// Pause to the next poll for a fragment.
    pub(in crate::mail) fn pause(&self, now: Instant) -> Option<Duration> {
        self.recently_active(now).map(AnswerTime::pause)
    }

    pub(super) fn status(&mut self, up: bool, now: Instant) -> EthernetStatus {
        EthernetStatus {
            up,
            counters: EthernetCounters { rx_overruns: self.received.overruns(), ..self.counters },
            tx_rate: self.tx_rate.per_second(now),
            rx_rate: self.rx_rate.per_second(now),
            queued: self.outgoing.len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fragments::Fragments;
    use super::*;

    const SECOND: u64 = 1_000_000_000;

    // covers: eoe
    #[test]
    fn rates_are_those_of_the_last_full_second() {
        let mut rate = Rate::default();
        for at in 0..10 {
            rate.add(Instant(5 * SECOND + at * SECOND / 10), 100);
        }
        assert_eq!(
            rate.per_second(Instant(5 * SECOND + SECOND / 2)),
            EthernetRate { bytes: 0, frames: 0 },
            "the first second is not over"
        );
        assert_eq!(rate.per_second(Instant(6 * SECOND + SECOND / 2)), EthernetRate { bytes: 1000, frames: 10 });
        assert_eq!(rate.per_second(Instant(7 * SECOND)), EthernetRate { bytes: 0, frames: 0 });
    }

    // covers: eoe
    #[test]
    fn queues_are_bounded_and_frames_that_do_not_fit_are_refused_or_counted() {
        let mut traffic = Traffic::new();
        for _ in 0..QUEUE {
            assert!(traffic.queue(&[0; 60], false).is_ok());
        }
        assert_eq!((traffic.queue(&[0; 60], false), traffic.room()), (Err(QueueError::Full), 0));
        assert_eq!(traffic.queue(&[0; 13], false), Err(QueueError::Length { bytes: 13 }));
        assert_eq!(traffic.queue(&[0; 1519], false), Err(QueueError::Length { bytes: 1519 }));
        for number in 0..RECEIVED + 3 {
            for fragment in Fragments::new(&[7; 100], number as u8 & 0x0F, 128, false).unwrap() {
                traffic.take(&fragment, Instant(0));
            }
        }
        traffic.take(&[0x0F, 0, 0, 0], Instant(0));
        let counters = traffic.status(true, Instant(0)).counters;
        assert_eq!((counters.rx_frames, counters.rx_overruns, counters.malformed), (67, 3, 1));
        traffic.reset();
        assert_eq!(traffic.status(false, Instant(0)).counters.tx_dropped, QUEUE as u64);
        assert_eq!(traffic.pop_received().map(|frame| frame.bytes), Some(alloc::vec![7; 100]));
    }
}
