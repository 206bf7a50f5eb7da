//! An acyclic frame on the wire, its datagrams, and the content of the copies received so far.

use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::{CIRCULATING, HEADER_LEN, WKC_LEN};

use super::reply::Reply;
use super::stray::Overdue;
use super::transfer::{Request, TransferId};
use crate::link::{Link, LinkSet};
use crate::ring::{Arrivals, MergeRule, Sequence};
use crate::time::Instant;

/// A datagram in a frame.
#[derive(Debug)]
pub(super) struct SentDatagram {
    pub transfer: TransferId,
    pub header_at: usize,
    pub length: usize,
    pub command: Command,
    pub expected: Option<Wkc>,
    pub mail: Option<StationAddress>,
    /// The datagram before it is its witness ([`Request::witness`]).
    pub witness: bool,
    /// The link on which the addressed SubDevice is reached, by the witness.
    pub visible: Link,
    pub wkc: [Wkc; 2],
    /// The reply was delivered to its procedure.
    pub answered: bool,
}

/// A frame on the wire.
#[derive(Debug)]
pub(super) struct SentFrame {
    pub sequence: Sequence,
    pub datagrams: Vec<SentDatagram>,
    /// The first copy, with later ones merged in; before the first copy, the frame as sent.
    pub bytes: Vec<u8>,
    pub arrivals: Arrivals,
    pub sent_at: Instant,
    /// When the interface finishes sending it, if it sends nothing else meanwhile.
    pub left_at: Instant,
    pub deadline: Instant,
    /// Bytes of its mailbox reads, while it is on the wire.
    pub reads: usize,
    /// All datagrams are answered; the frame is kept to recognise the second copy.
    pub answered: bool,
    /// All its datagrams may be repeated.
    pub repeatable: bool,
    /// Links on which copies are known not to return, a bit each.
    pub no_return: u8,
    /// No further copy is awaited because its link is silent: the frame does not count against the window.
    pub released: bool,
}

impl Default for SentFrame {
    fn default() -> SentFrame {
        SentFrame {
            sequence: Sequence::default(),
            datagrams: Vec::new(),
            bytes: Vec::new(),
            arrivals: Arrivals::default(),
            sent_at: Instant::NEVER,
            left_at: Instant::NEVER,
            deadline: Instant::NEVER,
            reads: 0,
            answered: false,
            repeatable: true,
            no_return: 0,
            released: false,
        }
    }
}

impl SentFrame {
    /// A new, empty frame in the same memory.
    pub fn begin(&mut self, sequence: Sequence) {
        self.sequence = sequence;
        self.datagrams.clear();
        self.bytes.clear();
        self.arrivals = Arrivals::default();
        self.reads = 0;
        (self.answered, self.repeatable) = (false, true);
        (self.released, self.no_return) = (false, 0);
    }

    /// Whether all fields that controllers never change are as sent (protocol 1.5): command, Idx, length, M bit of
    /// every datagram.
    pub fn matches_sent(&self, bytes: &[u8]) -> bool {
        if bytes.len() < self.bytes.len() {
            return false;
        }
        self.datagrams.iter().all(|datagram| {
            let at = datagram.header_at;
            let (sent, got) = (&self.bytes[at..at + 8], &bytes[at..at + 8]);
            let circulating = (CIRCULATING >> 8) as u8;
            sent[..2] == got[..2] && sent[6] == got[6] && (sent[7] ^ got[7]) & !circulating == 0
        })
    }

    /// Its mailbox reads.
    pub fn mail_reads(&self) -> impl Iterator<Item = Overdue> {
        let SentFrame { sequence, sent_at, .. } = *self;
        self.datagrams.iter().filter_map(move |datagram| {
            let SentDatagram { header_at, length, mail, .. } = *datagram;
            Some(Overdue { sequence, header_at, length, station: mail?, sent_at })
        })
    }

    /// Its mailbox reads with a working counter from an earlier copy: the second copy contains another mail.
    pub fn second_reads(&self) -> Vec<Overdue> {
        let answered = |read: &Overdue| {
            self.datagrams.iter().any(|datagram| datagram.header_at == read.header_at && datagram.total() != Wkc(0))
        };
        self.mail_reads().filter(answered).collect()
    }

    /// Takes a copy that was identified as a frame of this MainDevice.
    pub fn take(&mut self, sent_on: Link, bytes: &[u8], first: bool) {
        for datagram in &mut self.datagrams {
            let data_at = datagram.header_at + HEADER_LEN;
            let data = data_at..data_at + datagram.length;
            let wkc = Wkc(u16::from_le_bytes([bytes[data.end], bytes[data.end + 1]]));
            let before = datagram.total();
            datagram.wkc[sent_on.index()] = wkc;
            let witnessed = datagram.witness && bytes[datagram.header_at - WKC_LEN..datagram.header_at] != [0; WKC_LEN];
            if witnessed {
                datagram.visible = sent_on;
            }
            // OR of the event requests (protocol 9.3); both copies have them after the length.
            let irq = datagram.header_at + 8;
            if first {
                self.bytes[data.clone()].copy_from_slice(&bytes[data]);
                self.bytes[irq..irq + WKC_LEN].copy_from_slice(&bytes[irq..irq + WKC_LEN]);
            } else {
                let rule = MergeRule::of(datagram.command, datagram.visible);
                rule.merge(&mut self.bytes[data.clone()], before, &bytes[data], wkc, sent_on);
                self.bytes[irq] |= bytes[irq];
                self.bytes[irq + 1] |= bytes[irq + 1];
            }
        }
    }

    /// Whether all copies are received.
    pub fn has_all_copies(&self, links: LinkSet) -> bool {
        self.arrivals.arrived & links.mask() == links.mask()
    }

    /// The links with a copy that has not returned, a bit each.
    pub fn missing_links(&self, links: LinkSet) -> u8 {
        links.mask() & !self.arrivals.arrived
    }

    /// Whether replies of it are awaited that can be requested again without another effect.
    pub fn awaits_repeatable(&self) -> bool {
        self.repeatable && !self.answered && !self.released && self.no_return == 0
    }

    /// Whether copies of frames that were sent more than `margin` nanoseconds later have come back on the path of each
    /// missing copy, which frames do not overtake each other on: it does not come back any more. `newest`: when the
    /// newest of these was sent, by link.
    pub fn is_overtaken(&self, newest: [Instant; 2], margin: u64, links: LinkSet) -> bool {
        let missing = self.missing_links(links);
        let is_overtaken = |link: &Link| newest[link.index()].ns_since(self.sent_at) > margin;
        self.awaits_repeatable() && Link::ALL.iter().filter(|link| missing & link.bit() != 0).all(is_overtaken)
    }

    /// Whether one copy arrived on the other link and one on its own: the ring opened or closed meanwhile, and
    /// SubDevices processed the frame twice or not at all.
    pub fn ring_changed_meanwhile(&self) -> bool {
        self.arrivals.arrived == LinkSet::Ring.mask() && self.arrivals.returned.count_ones() == 1
    }

    /// Whether a copy returned on its own link, after all SubDevices that it can reach, and the missing copies were
    /// sent on silent links.
    pub fn has_all_but(&self, silent: u8, links: LinkSet) -> bool {
        self.arrivals.returned != 0 && (self.arrivals.arrived | silent) & links.mask() == links.mask()
    }
}

impl SentDatagram {
    /// A request with its data at an offset in the frame.
    pub fn new(transfer: TransferId, request: &Request, data_at: usize) -> SentDatagram {
        SentDatagram {
            transfer,
            header_at: data_at - HEADER_LEN,
            length: request.data.len(),
            command: request.command,
            expected: request.expected,
            mail: request.mail,
            witness: witnesses(request),
            visible: Link::Main,
            wkc: [Wkc(0); 2],
            answered: false,
        }
    }

    pub fn total(&self) -> Wkc {
        self.wkc[0].plus(self.wkc[1])
    }

    /// Whether the datagram addresses one SubDevice, and its working counter shows that the command was executed.
    pub fn is_answered_by_one(&self) -> bool {
        match self.command {
            Command::Aprd | Command::Apwr | Command::Fprd | Command::Fpwr => self.total() == Wkc(1),
            Command::Aprw | Command::Fprw => self.total() == Wkc(3),
            _ => false,
        }
    }

    pub fn satisfied(&self) -> bool {
        self.expected.is_some_and(|expected| self.total() == expected)
    }

    /// The reply of the frame with this number, sent at this time. `data`: memory for its data.
    pub fn reply(&self, bytes: &[u8], (frame, sent_at): (Sequence, Instant), mut data: Vec<u8>) -> Reply {
        let data_at = self.header_at + HEADER_LEN;
        data.clear();
        data.extend_from_slice(&bytes[data_at..data_at + self.length]);
        Reply {
            data,
            main: self.wkc[0],
            redundant: self.wkc[1],
            irq: u16::from_le_bytes([bytes[data_at - 2], bytes[data_at - 1]]),
            frame,
            sent_at,
        }
    }
}

/// Whether the datagram before a request's is its witness.
fn witnesses(request: &Request) -> bool {
    request.preceding.is_some() && matches!(request.command, Command::Armw | Command::Frmw)
}
