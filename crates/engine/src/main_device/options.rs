//! Options of a MainDevice, given before it begins.

use core::time::Duration;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::MacCodec;

use crate::junction::JunctionMode;
use crate::link::LinkSet;
use crate::procedures::dictionary::ReadPdos;
use crate::ring::MIN_DATAGRAMS_PER_FRAME;

/// What a MainDevice needs to know before it sends its first frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Options {
    /// Address of the main interface.
    pub main: MacAddress,
    /// Address of the redundant interface; `None` for a single link.
    pub redundant: Option<MacAddress>,
    /// How marks are written into source addresses.
    pub codec: MacCodec,
    /// Whether SII contents are kept and used for SubDevices with the same first 64 words.
    pub sii_cache: bool,
    /// Whose dictionaries are asked for PDOs after a scan.
    pub pdos: ReadPdos,
    /// Whether a supervision datagram rides with the process data. Without it nothing is noticed by itself.
    pub supervision: bool,
    /// For so long the number of SubDevices must not change at the beginning of a scan.
    pub settle: Duration,
    /// So long a scan waits for the first SubDevice.
    pub patience: Duration,
    /// What becomes of rings behind junctions. A connection that is added makes it strict.
    pub junctions: JunctionMode,
    /// Whether the cabling is looked at anew, as by a rescan, when a hot connect group has joined or left, and as soon
    /// as nothing is broken. Positions, places of breaks and errors of cables are then those of the segment as it is;
    /// otherwise a group has none until a rescan is asked for.
    pub follow_groups: bool,
    /// Whether the redundant link may be taken down for a moment to find out where a line is crossed.
    pub enhanced_line_crossed: bool,
    /// Datagrams that a frame may hold, cyclic and acyclic; `None`: as many as fit. For segments behind gateways, and
    /// simulators, that take fewer (often 15). Less than [`MIN_DATAGRAMS_PER_FRAME`] counts as that.
    pub max_datagrams_per_frame: Option<u16>,
}

impl Options {
    /// Usual options for these interfaces.
    pub fn new(main: MacAddress, redundant: Option<MacAddress>) -> Options {
        Options {
            main,
            redundant,
            codec: MacCodec::FlagsFirst,
            sii_cache: true,
            pdos: ReadPdos::default(),
            supervision: true,
            settle: Duration::from_millis(5),
            patience: Duration::from_secs(5),
            junctions: JunctionMode::Disabled,
            follow_groups: true,
            enhanced_line_crossed: false,
            max_datagrams_per_frame: None,
        }
    }

    /// Datagrams that a frame may hold.
    pub(super) fn most_datagrams(&self) -> Option<usize> {
        self.max_datagrams_per_frame.map(|most| usize::from(most.max(MIN_DATAGRAMS_PER_FRAME)))
    }

    /// Which links these are.
    pub(super) fn links(&self) -> LinkSet {
        if self.redundant.is_some() { LinkSet::Ring } else { LinkSet::Single }
    }
}
