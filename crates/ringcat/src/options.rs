//! Options of a MainDevice.

use std::time::Duration;

use ringcat_engine::info::{AliasSource, SiiAssignment, SiiExtent};
#[cfg(feature = "standby")]
use ringcat_engine::main_device::StandbyOptions;
use ringcat_engine::main_device::{MainDevice as Engine, Options as Engineering, Retries};
use ringcat_engine::{JunctionMode, ReadPdos};
use ringcat_wire::source_address::MacCodec;

use crate::links::{Links, PerLink};
use crate::of_two::OfTwo;
use crate::window::DEFAULT_BUDGET;

/// Options of a MainDevice. The MAC addresses come from the links.
///
/// ```
/// use std::time::Duration;
/// use ringcat::Options;
///
/// let options = Options::default().with_patience(Duration::from_secs(20)).with_max_datagrams_per_frame(15);
/// assert!(options.supervision);
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Options {
    /// Whether SII contents are kept and used for SubDevices with the same first 64 words.
    pub sii_cache: bool,
    /// How much of each SII a scan reads. `None`, the default: all of it in
    /// [`MainDevice::scan`](crate::MainDevice::scan), what operation needs in
    /// [`MainDevice::bring_up`](crate::MainDevice::bring_up). The less, the sooner SubDevices are in OP; the rest is
    /// read in the background afterwards, or by [`Services::complete_siis`](crate::Services::complete_siis) when it is
    /// needed.
    pub sii_extent: Option<SiiExtent>,
    /// Where the aliases of SubDevices are read, by default in register STATION_ALIAS (0x0012). On a bus of a daemon
    /// the settings of the daemon apply instead.
    pub alias_source: AliasSource,
    /// When the EEPROMs of SubDevices belong to their PDIs, by default on the way to PREOP. On a bus of a daemon the
    /// settings of the daemon apply instead.
    pub sii_assignment: SiiAssignment,
    /// Dictionaries read for PDOs. `None`: [`ReadPdos::Missing`], in PREOP with idle operation [`ReadPdos::Always`].
    pub pdos: Option<ReadPdos>,
    /// Whether object dictionaries are read in the background while no application is active, with idle operation:
    /// descriptions of objects then need no mail. Those that were read on request are kept in any case.
    pub dictionaries: bool,
    /// Whether a supervision datagram is sent with the process data. Without it changes of the segment are not detected
    /// automatically.
    pub supervision: bool,
    /// How marks are written into source addresses (protocol 9.7.1).
    pub source_address: MacCodec,
    /// Time for which the number of SubDevices must be unchanged at the beginning of a scan.
    pub settle: Duration,
    /// Maximum wait of a scan for the first SubDevice.
    pub patience: Duration,
    /// Handling of rings behind junctions. An added connection makes it strict.
    pub junctions: JunctionMode,
    /// Whether the cabling is scanned again, as by [`Services::rescan`](crate::Services::rescan), when a hot connect
    /// group has joined or left, as soon as nothing is broken. Positions, places of breaks and errors of cables then
    /// follow the present segment; otherwise a group has no position until a rescan is requested.
    pub follow_groups: bool,
    /// Whether the redundant link may be taken down for a moment, when ports have changed, to locate a crossed line
    /// ([`Links::force_disconnect`]). Otherwise a closed ring shows only that a line is crossed.
    pub enhanced_line_crossed: bool,
    /// Whether the MainDevice works on its segment without an application, too, and on SubDevices without a
    /// declaration: it scans by itself, follows changes, and keeps all of them in PREOP with their mailboxes. Services
    /// take positions at any time then. In one thread it works while one of its methods runs
    /// ([`MainDevice::attend`](crate::MainDevice::attend)).
    pub idle_operation: bool,
    /// What follows a failed configuration of a SubDevice.
    pub retries: Retries,
    /// Maximum number of datagrams in a frame, cyclic and acyclic; `None`: as many as fit. Some gateways and simulators
    /// accept fewer (often 15): the scan then fails with [`ScanError::FrameLimit`](crate::ScanError). Values below 3
    /// are raised to 3.
    pub max_datagrams_per_frame: Option<u16>,
    /// Maximum number of bytes per cycle and link for everything but process data. The limit never exceeds the wire
    /// time that process data leaves free in the cycle, and is at least one longest frame. SubDevices share it fairly.
    pub acyclic_bytes: usize,
    /// It is one of two MainDevices in a ring, and begins INACTIVE: it forwards, and sends nothing on its own
    /// ([`MainDevice::join`](crate::MainDevice::join)). Needs a redundant link.
    #[cfg(feature = "standby")]
    pub standby: Option<StandbyOptions>,
}

impl Default for Options {
    fn default() -> Options {
        Options {
            sii_cache: true,
            sii_extent: None,
            alias_source: AliasSource::default(),
            sii_assignment: SiiAssignment::default(),
            pdos: None,
            dictionaries: false,
            supervision: true,
            source_address: MacCodec::FlagsFirst,
            settle: Duration::from_millis(5),
            patience: Duration::from_secs(5),
            junctions: JunctionMode::Disabled,
            follow_groups: true,
            enhanced_line_crossed: false,
            idle_operation: false,
            retries: Retries::Always,
            max_datagrams_per_frame: None,
            acyclic_bytes: DEFAULT_BUDGET,
            #[cfg(feature = "standby")]
            standby: None,
        }
    }
}

impl Options {
    /// Sets [`Options::sii_cache`].
    #[must_use]
    pub fn with_sii_cache(mut self, sii_cache: bool) -> Options {
        self.sii_cache = sii_cache;
        self
    }

    /// Sets [`Options::sii_extent`].
    #[must_use]
    pub fn with_sii_extent(mut self, sii_extent: SiiExtent) -> Options {
        self.sii_extent = Some(sii_extent);
        self
    }

    /// Sets [`Options::alias_source`].
    #[must_use]
    pub fn with_alias_source(mut self, alias_source: AliasSource) -> Options {
        self.alias_source = alias_source;
        self
    }

    /// Sets [`Options::sii_assignment`].
    #[must_use]
    pub fn with_sii_assignment(mut self, sii_assignment: SiiAssignment) -> Options {
        self.sii_assignment = sii_assignment;
        self
    }

    /// Sets [`Options::pdos`].
    #[must_use]
    pub fn with_pdos(mut self, pdos: ReadPdos) -> Options {
        self.pdos = Some(pdos);
        self
    }

    /// Sets [`Options::dictionaries`].
    #[must_use]
    pub fn with_dictionaries(mut self, dictionaries: bool) -> Options {
        self.dictionaries = dictionaries;
        self
    }

    /// Sets [`Options::supervision`].
    #[must_use]
    pub fn with_supervision(mut self, supervision: bool) -> Options {
        self.supervision = supervision;
        self
    }

    /// Sets [`Options::source_address`].
    #[must_use]
    pub fn with_source_address(mut self, source_address: MacCodec) -> Options {
        self.source_address = source_address;
        self
    }

    /// Sets [`Options::settle`].
    #[must_use]
    pub fn with_settle(mut self, settle: Duration) -> Options {
        self.settle = settle;
        self
    }

    /// Sets [`Options::patience`].
    #[must_use]
    pub fn with_patience(mut self, patience: Duration) -> Options {
        self.patience = patience;
        self
    }

    /// Sets [`Options::junctions`].
    #[must_use]
    pub fn with_junctions(mut self, junctions: JunctionMode) -> Options {
        self.junctions = junctions;
        self
    }

    /// Sets [`Options::follow_groups`].
    #[must_use]
    pub fn with_follow_groups(mut self, follow_groups: bool) -> Options {
        self.follow_groups = follow_groups;
        self
    }

    /// Sets [`Options::enhanced_line_crossed`].
    #[must_use]
    pub fn with_enhanced_line_crossed(mut self, enhanced_line_crossed: bool) -> Options {
        self.enhanced_line_crossed = enhanced_line_crossed;
        self
    }

    /// Sets [`Options::idle_operation`].
    #[must_use]
    pub fn with_idle_operation(mut self, idle_operation: bool) -> Options {
        self.idle_operation = idle_operation;
        self
    }

    /// Sets [`Options::retries`].
    #[must_use]
    pub fn with_retries(mut self, retries: Retries) -> Options {
        self.retries = retries;
        self
    }

    /// Sets [`Options::acyclic_bytes`].
    #[must_use]
    pub fn with_acyclic_bytes(mut self, acyclic_bytes: usize) -> Options {
        self.acyclic_bytes = acyclic_bytes;
        self
    }

    /// Sets [`Options::standby`].
    #[cfg(feature = "standby")]
    #[must_use]
    pub fn with_standby(mut self, standby: StandbyOptions) -> Options {
        self.standby = Some(standby);
        self
    }

    /// Sets [`Options::max_datagrams_per_frame`].
    #[must_use]
    pub fn with_max_datagrams_per_frame(mut self, datagrams: u16) -> Options {
        self.max_datagrams_per_frame = Some(datagrams);
        self
    }

    /// An engine for these links.
    pub(crate) fn engine(&self, links: &impl Links) -> Engine {
        let PerLink { main, redundant, .. } = links.addresses();
        let mut options = Engineering::new(main, redundant);
        options.sii_cache = self.sii_cache;
        options.sii_extent = self.sii_extent;
        options.alias_source = self.alias_source;
        options.sii_assignment = self.sii_assignment;
        options.pdos = self.pdos;
        options.dictionaries = self.dictionaries;
        options.supervision = self.supervision;
        options.codec = self.source_address;
        options.settle = self.settle;
        options.patience = self.patience;
        options.junctions = self.junctions;
        options.follow_groups = self.follow_groups;
        options.enhanced_line_crossed = self.enhanced_line_crossed;
        options.idle_operation = self.idle_operation;
        options.retries = self.retries;
        options.max_datagrams_per_frame = self.max_datagrams_per_frame;
        #[cfg(feature = "standby")]
        {
            options.standby = self.standby;
        }
        Engine::new(options, links.now())
    }

    /// The part of a MainDevice with these links in a ring of two.
    pub(crate) fn of_two(&self, links: &impl Links) -> OfTwo {
        #[cfg(feature = "standby")]
        if self.standby.is_some() {
            return OfTwo::new(links, None);
        }
        let _ = links;
        OfTwo::default()
    }
}
