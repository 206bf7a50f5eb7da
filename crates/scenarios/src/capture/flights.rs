//! Pairs, ids and flights: checks 6 to 8 of [`crate::capture`].
//!
//! Frames go in, in the order of time; findings go into the verdict. A frame is identified by its class and number, its
//! copies by the RED bit.

use std::collections::HashMap;
use std::time::Duration;

use super::ethercat::Frame;
use super::pcapng::Packet;
use super::verdict::Verdict;

/// First number that a MainDevice uses.
const FIRST: u16 = 1;

/// Class and number.
type Name = (bool, u16);

/// A frame that was sent.
#[derive(Debug)]
struct Flight {
    /// Number in the capture, and time, of its first copy.
    frame: usize,
    at_ns: u64,
    alike: Vec<u8>,
    sent: [bool; 2],
    back: [bool; 2],
    /// Its 8 bits of id have been used again.
    over: bool,
}

/// All sent frames.
#[derive(Debug)]
pub struct Flights {
    links: usize,
    /// The last frame with each class and number.
    flights: HashMap<Name, Flight>,
    /// The last frame with each class and 8-bit id.
    users: HashMap<(bool, u8), Name>,
    /// The last number of each class.
    last: [Option<u16>; 2],
}

impl Flights {
    /// No frames.
    pub fn new(links: usize) -> Flights {
        Flights { links, flights: HashMap::new(), users: HashMap::new(), last: [None; 2] }
    }

    /// A copy was sent.
    pub fn sent(&mut self, verdict: &mut Verdict, number: usize, packet: &Packet, frame: &Frame<'_>) {
        let (class, link) = (frame.is_acyclic(), packet.interface);
        let name = (class, frame.number());
        if let Some(flight) = self.flights.get_mut(&name).filter(|flight| !flight.over && !flight.sent[link]) {
            // The second link's copy.
            flight.sent[link] = true;
            verdict.pairs += 1;
            let apart = Duration::from_nanos(packet.time_ns - flight.at_ns);
            verdict.longest_pair = verdict.longest_pair.max(apart);
            if flight.alike != frame.alike() {
                verdict.find(number, format_args!("differs from its copy, frame {}", flight.frame));
            }
            return;
        }
        match self.last[usize::from(class)].map(|last| last.wrapping_add(1) & 0x7FFF) {
            Some(expected) if expected == name.1 => {}
            Some(_) if name.1 == FIRST => verdict.anew += 1,
            Some(expected) => {
                verdict.find(number, format_args!("has number {:#06x}, expected {expected:#06x}", name.1))
            }
            None => {}
        }
        self.last[usize::from(class)] = Some(name.1);
        if let Some(user) = self.users.insert((class, frame.id()), name)
            && let Some(flight) = self.flights.get_mut(&user)
        {
            flight.over = true;
        }
        let mut sent = [false; 2];
        sent[link] = true;
        let flight =
            Flight { frame: number, at_ns: packet.time_ns, alike: frame.alike(), sent, back: [false; 2], over: false };
        if let Some(earlier) = self.flights.insert(name, flight) {
            self.close(verdict, &earlier);
        }
    }

    /// A copy came back.
    pub fn received(&mut self, verdict: &mut Verdict, number: usize, _packet: &Packet, frame: &Frame<'_>) {
        let copy = usize::from(frame.is_marked_redundant());
        let Some(flight) = self.flights.get_mut(&(frame.is_acyclic(), frame.number())) else {
            verdict.find(number, "was never sent from here");
            return;
        };
        if flight.over {
            let text = format!("comes back after its id was used again, first sent as frame {}", flight.frame);
            verdict.find(number, text);
        }
        if !flight.sent[copy] {
            verdict.find(number, format_args!("is a copy that was not sent, of frame {}", flight.frame));
        } else if flight.back[copy] {
            verdict.find(number, format_args!("is back for the second time, first sent as frame {}", flight.frame));
        } else {
            verdict.returned += 1;
        }
        flight.back[copy] = true;
    }

    /// End of the capture.
    pub fn finish(&mut self, verdict: &mut Verdict) {
        let mut flights: Vec<Flight> = self.flights.drain().map(|(_, flight)| flight).collect();
        flights.sort_by_key(|flight| flight.frame);
        for flight in flights {
            self.close(verdict, &flight);
        }
    }

    fn close(&self, verdict: &mut Verdict, flight: &Flight) {
        let copies = flight.sent.iter().filter(|sent| **sent).count();
        if copies != self.links {
            verdict.find(flight.frame, format_args!("left on {copies} of {} links", self.links));
        }
        verdict.missing += flight.sent.iter().zip(flight.back).filter(|(sent, back)| **sent && !back).count() as u64;
    }
}
