//! What goes wrong around a segment and looks like a dead cable: a cable of it that ends at another interface of this
//! host, and MainDevices of others.
//!
//! Another interface is found by our own frames: a ring that is plugged into an interface which was not named lets no
//! frame return, they all arrive there. A thread of its own listens on all other interfaces, from before the scan until
//! the program ends. The frames of others come as events of the engine; each sender is told once.

use std::os::unix::net::UnixStream;
use std::sync::{Arc, OnceLock};
use std::thread;

use ringcat::links::Links;
use ringcat::packet::PacketLinks;
use ringcat::text::{address, address_of_sender};
use ringcat::wire::frame::MacAddress;
use ringcat::{Classified, Error, Event, Identity, Link, Options, ScanError};
use ringcat_link::{Listener, Sender};

use crate::failure::Failure;
use crate::interfaces::InterfaceArguments;

/// Bytes of the source address that MainDevices and controllers leave alone (protocol 9.7.1): they tell senders apart.
const SENDER_MASK: [u8; 6] = [0, 0, 0, 0xFF, 0xFF, 0xFF];
/// Senders that are told; a segment has one MainDevice, and one too many is one.
const SENDERS_TOLD: usize = 4;

/// What was noticed.
#[derive(Debug)]
pub struct Surroundings {
    interfaces: InterfaceArguments,
    /// The interface that our frames arrive on and should not.
    elsewhere: Arc<OnceLock<String>>,
    senders: Vec<(Link, [u8; 6])>,
    /// Ends the thread that listens when it is dropped.
    _end: Option<UnixStream>,
}

impl Surroundings {
    /// Begins to listen on the interfaces that are not in use; where that is not possible, without a word. The thread
    /// inherits the priority of the calling one.
    pub fn watch(interfaces: &InterfaceArguments, links: &PacketLinks) -> Surroundings {
        let elsewhere = Arc::new(OnceLock::new());
        let end = listen(interfaces, links, elsewhere.clone());
        Surroundings { interfaces: interfaces.clone(), elsewhere, senders: Vec::new(), _end: end }
    }

    /// Takes note of an event. Whether it was a frame of another MainDevice; with it the words to tell, if there are
    /// new ones.
    pub fn note(&mut self, event: &Event) -> Option<Option<String>> {
        let Event::ForeignFrame { arrived_on, bytes } = event else { return None };
        Some(self.note_sender(*arrived_on, address_of_sender(bytes)?))
    }

    /// Takes note of the sender of a foreign frame. The words to tell, if there are new ones.
    pub fn note_sender(&mut self, arrived_on: Link, source: MacAddress) -> Option<String> {
        let sender = (arrived_on, std::array::from_fn(|at| source.0[at] & SENDER_MASK[at]));
        if self.senders.contains(&sender) || self.senders.len() == SENDERS_TOLD {
            return None;
        }
        self.senders.push(sender);
        Some(format!(
            "another MainDevice sends into this segment: frames from {} arrive on {} ({arrived_on}); the first bytes \
             of the address may carry marks. Stop one of the two, or unplug its cable",
            address(source),
            self.interfaces.name(arrived_on)
        ))
    }

    /// Tells of the sender of a foreign frame, if it has not been told of.
    pub fn tell_sender(&mut self, arrived_on: Link, source: MacAddress) {
        self.note_sender(arrived_on, source).iter().for_each(|words| eprintln!("ringcat: {words}"));
    }

    /// Why a scan or a run failed, with what was noticed; `foreign` counts the frames of others.
    pub fn explain(&self, error: Error, foreign: u64) -> Failure {
        let silent = matches!(error, Error::Scan(ScanError::NoAnswer | ScanError::Bus(_)));
        let mut text = match self.elsewhere.get() {
            Some(name) if silent => {
                format!("scan: no frame returns, they arrive on {name}; {}", self.interfaces.advice(name))
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
            format!("from ..:{a:02x}:{b:02x}:{c:02x} on {}", self.interfaces.name(*link))
        };
        self.senders.iter().map(one).collect::<Vec<_>>().join(", ")
    }
}

/// Starts the thread that listens.
fn listen(interfaces: &InterfaceArguments, links: &PacketLinks, found: Arc<OnceLock<String>>) -> Option<UnixStream> {
    let (main, redundant) = links.addresses();
    let identity = Identity::new(Options::default().source_address, main, redundant);
    let (end, ours) = UnixStream::pair().ok()?;
    let interfaces = interfaces.clone();
    // Opened in the thread: nobody waits for that, and a scan that finds nobody asks for seconds.
    let ears = move || {
        let names: Vec<&str> = interfaces.names().collect();
        let Ok(listener) = Listener::open(Sender { address: main.0, mask: SENDER_MASK }, &names) else { return };
        while let Some(heard) = listener.hear(&end) {
            if matches!(identity.classify(&heard.bytes), Classified::Ours(_)) {
                eprintln!(
                    "ringcat: frames sent on {} arrive on {}: a cable of this segment, such as the other end of a \
                     ring, is plugged in there; {}",
                    interfaces.main,
                    heard.interface,
                    interfaces.advice(&heard.interface)
                );
                // Only this thread sets it, and once.
                let _ = found.set(heard.interface);
                return;
            }
        }
    };
    thread::Builder::new().name("ringcat-listen".to_owned()).spawn(ears).ok()?;
    Some(ours)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surroundings(elsewhere: Option<&str>) -> Surroundings {
        Surroundings {
            interfaces: InterfaceArguments {
                main: "eth1".to_owned(),
                redundant: None,
                source_address: crate::interfaces::SourceAddress::default(),
                max_datagrams: None,
                force: false,
            },
            elsewhere: Arc::new(elsewhere.map_or_else(OnceLock::new, |name| OnceLock::from(name.to_owned()))),
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
    fn each_sender_is_told_once_whatever_marks_its_frames_carry() {
        let mut surroundings = surroundings(None);
        assert_eq!(surroundings.note(&Event::ScanFinished { subdevices: 1 }), None);
        let words = surroundings.note(&foreign([2, 7, 0x5e, 0xaa, 0xbb, 0xcc], 60)).flatten().expect("a new one");
        assert!(words.contains("frames from 02:07:5e:aa:bb:cc arrive on eth1 (MAIN)"), "{words}");
        assert_eq!(surroundings.note(&foreign([2, 8, 0x5e, 0xaa, 0xbb, 0xcc], 60)), Some(None));
        for sender in 0..100 {
            surroundings.note(&foreign([2, 0, 0, 0, 0, sender], 60));
        }
        assert_eq!(surroundings.senders.len(), SENDERS_TOLD);
        surroundings.note(&foreign([0; 6], 3));
    }

    // covers: other-main-device
    #[test]
    fn a_scan_that_fails_says_what_was_noticed_meanwhile() {
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
