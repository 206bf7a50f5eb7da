//! Links of one half: network interfaces, a segment that is simulated in this process, or those of a daemon.

use std::path::Path;

use ringcat::EitherLinks;
use ringcat::daemon::DaemonLinks;
use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;

use crate::environment::Source;

/// Links of one half: those of a daemon, network interfaces that this process opens, which are the same kind, or a
/// simulated segment. Each cycle tests the kind several times, so each kind occurs once.
pub type AnyLinks = EitherLinks<DaemonLinks, SharedSegment>;

/// Opens the links of the cyclic and of the acyclic half.
///
/// # Errors
/// What is wrong, for the operator.
pub fn open(source: &Source) -> Result<(AnyLinks, AnyLinks), String> {
    match source {
        Source::Simulated(file) => {
            let segment = ringcat::esi::load_segment(Path::new(file)).map_err(|error| error.to_string())?;
            let network = Network::from_description(segment).map_err(|error| error.to_string())?;
            let (cyclic, acyclic) = SharedSegment::halves(network);
            Ok((AnyLinks::Second(cyclic), AnyLinks::Second(acyclic)))
        }
        Source::Interfaces(main, redundant) => {
            let opened = PacketLinks::open_halves(main, redundant.as_deref(), ReceiveMode::Blocking);
            let (cyclic, acyclic) = opened.map_err(|error| error.to_string())?;
            Ok((AnyLinks::First(DaemonLinks::First(cyclic)), AnyLinks::First(DaemonLinks::First(acyclic))))
        }
    }
}
