//! Links of one half: network interfaces, a segment that is simulated in this process, or those of a daemon.

use std::path::Path;

use ringcat::daemon::DaemonLinks;
use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;
use ringcat::tee::Tee;
use ringcat::{EitherLinks, Tap, Taps};

use crate::environment::Source;

/// Links of one half with a tap: those of a daemon, network interfaces that this process opens, which are the same
/// kind, or a simulated segment. Each cycle tests the kind several times, so each kind occurs once.
pub type AnyLinks = EitherLinks<DaemonLinks, Tee<SharedSegment>>;

/// Memory for frames on their way to a record, in which a frame stays for up to 200 ms.
const QUEUE: usize = 4 << 20;

/// A tap for one half.
fn tap(taps: &Taps) -> Tap {
    taps.tap_with(QUEUE)
}

/// Names of links, the main one first.
pub fn names(source: &Source) -> Vec<String> {
    match source {
        Source::Simulated(_) => vec!["main".to_owned(), "redundant".to_owned()],
        Source::Interfaces(main, redundant) => std::iter::once(main).chain(redundant).cloned().collect(),
    }
}

/// Opens the links of the cyclic and of the acyclic half, with taps where frames are recorded.
///
/// # Errors
/// What is wrong, for the operator.
pub fn open(source: &Source, taps: Option<&Taps>) -> Result<(AnyLinks, AnyLinks), String> {
    match source {
        Source::Simulated(file) => {
            let segment = ringcat::esi::load_segment(Path::new(file)).map_err(|error| error.to_string())?;
            let network = Network::from_description(segment).map_err(|error| error.to_string())?;
            let (cyclic, acyclic) = SharedSegment::halves(network);
            let second = |links| EitherLinks::Second(Tee::new(links, taps.map(tap)));
            Ok((second(cyclic), second(acyclic)))
        }
        Source::Interfaces(main, redundant) => {
            let opened = PacketLinks::open_halves(main, redundant.as_deref(), ReceiveMode::Blocking);
            let (cyclic, acyclic) = opened.map_err(|error| error.to_string())?;
            let first = |links| EitherLinks::First(Tee::new(EitherLinks::First(links), taps.map(tap)));
            Ok((first(cyclic), first(acyclic)))
        }
    }
}
