//! Faults around a segment that look like a dead cable: a cable of the segment that ends at another interface of this
//! host, and other MainDevices.
//!
//! The other interface is found by this MainDevice's own frames: with a ring that is plugged into an interface the
//! command line does not name, no frame returns, they all arrive there. A thread of its own listens on all other
//! interfaces, from before the scan until the program ends. Frames of other MainDevices are events of the engine; each
//! sender is reported once.

use std::os::unix::net::UnixStream;
use std::sync::{Arc, OnceLock};
use std::thread;

use ringcat::links::Links;
use ringcat::packet::PacketLinks;
use ringcat::text::{address, address_of_sender};
use ringcat::wire::frame::MacAddress;
use ringcat::{Classified, Error, Event, Identity, Link, MacCodec, ScanError};
use ringcat_link::{Listener, Sender};

use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, LinkNames};
use crate::output::warn;

/// Most senders that are reported: a second MainDevice is one.
const MOST_SENDERS: usize = 4;

/// What was noticed.
#[derive(Debug)]
pub struct Surroundings {
    links: LinkNames,
    /// The interface that our frames arrive on and should not.
    elsewhere: Arc<OnceLock<String>>,
    /// Bytes that distinguish senders, and the senders.
    mask: [u8; 6],
    senders: Vec<(Link, [u8; 6])>,
    /// Ends the thread that listens when it is dropped.
    _end: Option<UnixStream>,
}

impl Surroundings {
    /// Begins to listen on the interfaces that are not in use; silently does not where that is not possible. The thread
    /// inherits the priority of the calling one.
    pub fn watch(interfaces: &InterfaceArguments, links: &PacketLinks) -> Surroundings {
        let elsewhere = Arc::new(OnceLock::new());
        let end = listen(interfaces, links, elsewhere.clone());
        let mask = unmarked(interfaces.codec());
        Surroundings { links: interfaces.links.clone(), elsewhere, mask, senders: Vec::new(), _end: end }
    }

    /// Around links that are no interfaces: nothing listens.
    pub fn unwatched(interfaces: &InterfaceArguments) -> Surroundings {
        let mask = unmarked(interfaces.codec());
        let (links, elsewhere) = (interfaces.links.clone(), Arc::default());
        Surroundings { links, elsewhere, mask, senders: Vec::new(), _end: None }
    }

    /// Takes note of an event. `Some` for a frame of another MainDevice; in it the warning, if the sender is new.
    pub fn note(&mut self, event: &Event) -> Option<Option<String>> {
        let Event::ForeignFrame { arrived_on, bytes } = event else { return None };
        Some(self.note_sender(*arrived_on, address_of_sender(bytes)?))
    }

    /// Takes note of the sender of a foreign frame. The warning, if the sender is new.
    pub fn note_sender(&mut self, arrived_on: Link, source: MacAddress) -> Option<String> {
        let sender = (arrived_on, std::array::from_fn(|at| source.0[at] & self.mask[at]));
        if self.senders.contains(&sender) || self.senders.len() == MOST_SENDERS {
            return None;
        }
        self.senders.push(sender);
        Some(format!(
            "another MainDevice sends into this segment: frames from {} arrive on {} ({arrived_on}); the first bytes \
             of the address may carry marks. Stop one of the two, or unplug its cable",
            address(source),
            self.links.of(arrived_on)
        ))
    }

    /// Warns of the sender of a foreign frame, if it is new.
    pub fn report_sender(&mut self, arrived_on: Link, source: MacAddress) {
        self.note_sender(arrived_on, source).iter().for_each(warn);
    }

    /// Why a scan or a run failed, with what was noticed; `foreign` counts the frames of others.
    pub fn explain(&self, error: Error, foreign: u64) -> Failure {
        let silent = matches!(error, Error::Scan(ScanError::NoAnswer | ScanError::Bus(_)));
        let mut text = match self.elsewhere.get() {
            Some(name) if silent => {
                format!("scan: no frame returns, they arrive on {name}; {}", self.links.advice(name))
            }
            _ => Failure::from(error).to_string(),
        };
        if foreign > 0 {
            text += &format!("\nmeanwhile {foreign} frames of another MainDevice arrived: {}", self.senders());
        }
        Failure::new(text)
    }

    /// The senders in one line.
    pub fn senders(&self) -> String {
        let one = |(link, source): &(Link, [u8; 6])| {
            let [.., a, b, c] = source;
            format!("from ..:{a:02x}:{b:02x}:{c:02x} on {}", self.links.of(*link))
        };
        self.senders.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

/// Bytes of the source address that carry no marks (protocol 9.7.1): they distinguish senders.
fn unmarked(codec: MacCodec) -> [u8; 6] {
    match codec {
        MacCodec::FlagsFirst => [0, 0, 0, 0xFF, 0xFF, 0xFF],
        MacCodec::IdLast => [0, 0, 0xFF, 0xFF, 0xFF, 0],
    }
}

/// Starts the thread that listens.
fn listen(interfaces: &InterfaceArguments, links: &PacketLinks, found: Arc<OnceLock<String>>) -> Option<UnixStream> {
    let ringcat::PerLink { main, redundant, .. } = links.addresses();
    let codec = interfaces.codec();
    let identity = Identity::new(codec, main, redundant);
    let (end, ours) = UnixStream::pair().ok()?;
    let links = interfaces.links.clone();
    // The sockets are opened in the thread: that takes time, which the command need not wait for.
    let body = move || {
        let names: Vec<&str> = links.all().collect();
        let Ok(listener) = Listener::open(Sender { address: main.0, mask: unmarked(codec) }, &names) else { return };
        while let Some(frame) = listener.receive(&end) {
            if matches!(identity.classify(&frame.bytes), Classified::Ours(_)) {
                warn(format_args!(
                    "frames sent on {} arrive on {}: a cable of this segment, such as the other end of a ring, is \
                     plugged in there; {}",
                    links.main,
                    frame.interface,
                    links.advice(&frame.interface)
                ));
                // Only this thread sets it, and once.
                let _ = found.set(frame.interface);
                return;
            }
        }
    };
    thread::Builder::new().name("ringcat-listen".to_owned()).spawn(body).ok()?;
    Some(ours)
}

#[cfg(test)]
mod tests {
    use ringcat::wire::source_address::SourceMarks;

    use super::*;

    fn surroundings(elsewhere: Option<&str>) -> Surroundings {
        Surroundings {
            links: LinkNames { main: "eth1".to_owned(), redundant: None },
            elsewhere: Arc::new(elsewhere.map_or_else(OnceLock::new, |name| OnceLock::from(name.to_owned()))),
            mask: unmarked(MacCodec::FlagsFirst),
            senders: Vec::new(),
            _end: None,
        }
    }

    fn foreign(source: [u8; 6], length: usize) -> Event {
        let mut bytes = vec![0xff; 6];
        bytes.extend(source);
        bytes.resize(length, 0);
        Event::ForeignFrame { arrived_on: Link::Main, bytes }
    }

    // covers: other-main-device
    #[test]
    fn each_sender_is_reported_once_whatever_marks_its_frames_carry() {
        let mut surroundings = surroundings(None);
        assert_eq!(surroundings.note(&Event::ScanFinished { subdevices: 1 }), None);
        let words = surroundings.note(&foreign([2, 7, 0x5e, 0xaa, 0xbb, 0xcc], 60)).flatten().expect("a new one");
        assert!(words.contains("frames from 02:07:5e:aa:bb:cc arrive on eth1 (MAIN)"), "{words}");
        assert_eq!(surroundings.note(&foreign([2, 8, 0x5e, 0xaa, 0xbb, 0xcc], 60)), Some(None));
        for sender in 0..100 {
            surroundings.note(&foreign([2, 0, 0, 0, 0, sender], 60));
        }
        assert_eq!(surroundings.senders.len(), MOST_SENDERS);
        surroundings.note(&foreign([0; 6], 3));
    }

    // covers: stray-ring-cable
    #[test]
    fn own_frames_pass_the_filter_of_the_listener_whatever_marks_they_carry() {
        let nic = MacAddress([0x02, 0x11, 0x22, 0x33, 0x44, 0x55]);
        for codec in [MacCodec::FlagsFirst, MacCodec::IdLast] {
            let mask = unmarked(codec);
            let masked = |mac: MacAddress| -> [u8; 6] { std::array::from_fn(|at| mac.0[at] & mask[at]) };
            for frame_id in [0, 1, 0x80, 0xFF] {
                let marks = SourceMarks { frame_id, retry: 3, processed: true, ..SourceMarks::default() };
                assert_eq!(masked(codec.encode(nic, &marks)), masked(nic), "{codec:?} {frame_id:#x}");
            }
        }
    }

    // covers: other-main-device
    #[test]
    fn a_scan_that_fails_reports_what_was_noticed_before() {
        let failed = || Error::Scan(ScanError::NoAnswer);
        let plain = surroundings(None).explain(failed(), 0).to_string();
        assert!(plain.contains("first SubDevice powered?") && !plain.contains("meanwhile"), "{plain}");
        let ring = surroundings(Some("eth2")).explain(failed(), 0).to_string();
        assert!(ring.contains("they arrive on eth2; add --redundant eth2"), "{ring}");
        let mut disturbed = surroundings(None);
        disturbed.note(&foreign([2, 7, 0x5e, 0xaa, 0xbb, 0xcc], 60));
        let text = disturbed.explain(failed(), 12).to_string();
        assert!(text.ends_with("12 frames of another MainDevice arrived: from ..:aa:bb:cc on eth1"), "{text}");
    }
}
