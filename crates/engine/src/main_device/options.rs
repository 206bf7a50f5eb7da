//! Options of a MainDevice, given before it begins.

use core::time::Duration;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::MacCodec;

use crate::info::{AliasSource, SiiAssignment, SiiExtent};
use crate::junction::JunctionMode;
use crate::link::LinkSet;
use crate::ring::MIN_DATAGRAMS_PER_FRAME;
use crate::role::MainDeviceRole;
use crate::segment::{ReadPdos, Retries};

#[cfg(feature = "standby")]
use super::standby::standby_options::StandbyOptions;

/// Configuration of a MainDevice that is needed before the first frame.
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
    /// How much of each SII a scan reads; the rest follows in the background once all are in their target states.
    /// `None`: all of it, and in [`MainDevice::start_scan_for_operation`](super::MainDevice) what operation needs.
    pub sii_extent: Option<SiiExtent>,
    /// Where the aliases of SubDevices are read.
    pub alias_source: AliasSource,
    /// When the EEPROMs of SubDevices belong to their PDIs.
    pub sii_assignment: SiiAssignment,
    /// Dictionaries that are read for PDOs: after a scan, which brings the SubDevice to PREOP and back for this, and of
    /// undeclared SubDevices in PREOP. `None`: after a scan [`ReadPdos::Missing`], in PREOP [`ReadPdos::Always`] with
    /// idle operation and [`ReadPdos::Missing`] without.
    pub pdos: Option<ReadPdos>,
    /// Whether object dictionaries are read in the background while no application is active, with idle operation.
    /// Those that were read on request are kept in any case.
    pub dictionaries: bool,
    /// Whether a supervision datagram is sent with the process data. Without it changes of the segment are not detected
    /// automatically.
    pub supervision: bool,
    /// Time for which the number of SubDevices must be unchanged at the beginning of a scan.
    pub settle: Duration,
    /// Maximum wait of a scan for the first SubDevice.
    pub patience: Duration,
    /// Handling of rings behind junctions. An added connection makes it strict.
    pub junctions: JunctionMode,
    /// Whether the cabling is scanned again, as by a rescan, when a hot connect group has joined or left, and as soon
    /// as nothing is broken. Positions, places of breaks and errors of cables then follow the present segment;
    /// otherwise a group has no position until a rescan is requested.
    pub follow_groups: bool,
    /// Whether the redundant link may be taken down for a moment to locate a crossed line.
    pub enhanced_line_crossed: bool,
    /// Whether the MainDevice also works on its segment without an application: it scans by itself, follows changes,
    /// and keeps all SubDevices in PREOP with their mailboxes; while an application is active those that its
    /// declaration does not name.
    pub idle_operation: bool,
    /// What follows a failed configuration of a SubDevice, declared or not.
    pub retries: Retries,
    /// Maximum number of datagrams in a frame, cyclic and acyclic; `None`: as many as fit. For segments behind
    /// gateways, and simulators, with a limit (often 15). Values below [`MIN_DATAGRAMS_PER_FRAME`] are raised to it.
    pub max_datagrams_per_frame: Option<u16>,
    /// MainDevice redundancy; `None` without. With it the MainDevice begins INACTIVE (protocol MR-01).
    #[cfg(feature = "standby")]
    pub standby: Option<StandbyOptions>,
}

impl Options {
    /// Usual options for these interfaces.
    pub fn new(main: MacAddress, redundant: Option<MacAddress>) -> Options {
        Options {
            main,
            redundant,
            codec: MacCodec::FlagsFirst,
            sii_cache: true,
            sii_extent: None,
            alias_source: AliasSource::default(),
            sii_assignment: SiiAssignment::default(),
            pdos: None,
            dictionaries: false,
            supervision: true,
            settle: Duration::from_millis(5),
            patience: Duration::from_secs(5),
            junctions: JunctionMode::Disabled,
            follow_groups: true,
            enhanced_line_crossed: false,
            idle_operation: false,
            retries: Retries::Always,
            max_datagrams_per_frame: None,
            #[cfg(feature = "standby")]
            standby: None,
        }
    }

    /// Maximum number of datagrams in a frame.
    pub(super) fn most_datagrams(&self) -> Option<usize> {
        self.max_datagrams_per_frame.map(|most| usize::from(most.max(MIN_DATAGRAMS_PER_FRAME)))
    }

    /// The role in which the MainDevice begins.
    pub(super) fn first_role(&self) -> MainDeviceRole {
        #[cfg(feature = "standby")]
        if self.standby.is_some() {
            return MainDeviceRole::Inactive;
        }
        MainDeviceRole::Active
    }

    /// Dictionaries that are read of undeclared SubDevices in PREOP.
    pub(super) fn pdos_in_preop(&self) -> ReadPdos {
        self.pdos.unwrap_or(if self.idle_operation { ReadPdos::Always } else { ReadPdos::Missing })
    }

    /// The links in use.
    pub(super) fn links(&self) -> LinkSet {
        if self.redundant.is_some() { LinkSet::Ring } else { LinkSet::Single }
    }
}
