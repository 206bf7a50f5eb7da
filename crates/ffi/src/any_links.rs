//! Links of one half: network interfaces, a segment that is simulated in this process, or those of a daemon.

use std::path::Path;

use ringcat::EitherLinks;
use ringcat::daemon::DaemonLinks;
use ringcat::packet::{PacketLinks, ReceiveMode};
use ringcat::shared_segment::SharedSegment;
use ringcat::sim::network::Network;

use crate::environment::Source;

/// Links that this process opens: network interfaces, or a simulated segment.
type OwnLinks = EitherLinks<PacketLinks, SharedSegment>;

/// Links of one half: of this process, or of a daemon.
pub type AnyLinks = EitherLinks<OwnLinks, DaemonLinks>;

/// Opens the links of the cyclic and of the acyclic half.
///
/// # Errors
/// What is wrong, for the operator.
pub fn open(source: &Source) -> Result<(AnyLinks, AnyLinks), String> {
    let own = match source {
        Source::Simulated(file) => {
            let segment = ringcat::esi::load_segment(Path::new(file)).map_err(|error| error.to_string())?;
            let network = Network::from_description(segment).map_err(|error| error.to_string())?;
            let (cyclic, acyclic) = SharedSegment::halves(network);
            (OwnLinks::Second(cyclic), OwnLinks::Second(acyclic))
        }
        Source::Interfaces(main, redundant) => {
            let opened = PacketLinks::open_halves(main, redundant.as_deref(), ReceiveMode::Blocking);
            let (cyclic, acyclic) = opened.map_err(|error| error.to_string())?;
            (OwnLinks::First(cyclic), OwnLinks::First(acyclic))
        }
    };
    Ok((AnyLinks::First(own.0), AnyLinks::First(own.1)))
}
