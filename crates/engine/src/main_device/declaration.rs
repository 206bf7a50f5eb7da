//! The declaration of the application: SubDevices, domains, clocks.

pub(super) mod areas;
pub(super) mod declare;
pub(super) mod image_memory;
pub(super) mod loaded;
pub(super) mod memories;
#[cfg(feature = "standby")]
pub(super) mod partner_memory;
pub(super) mod register_error;
pub(super) mod registered;
pub(super) mod registered_area;
pub(super) mod registration;
pub(super) mod working_counters;

use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::LogicalAddress;

use crate::config::{ClockConfig, Group, SubDeviceConfig};
use crate::declared::{GroupId, SubDeviceId};
use crate::layout::LrwPolicy;
use image_memory::ImageMemory;
use registered_area::RegisteredArea;

/// Maximum number of cycles of a domain under way at once.
pub const MAX_UNDER_WAY: u8 = 4;

/// A domain as the application declares it.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DomainConfig {
    /// Interval at which the application will exchange it. Zero: it has none, and its frames count as lost after
    /// 500 us ([`crate::exchange::Exchange::set_timeout`]).
    pub period: Duration,
    /// Number of its cycles that may be under way at once, 1 to [`MAX_UNDER_WAY`]: 1 if frames return within a period,
    /// more if their way through segment and host takes longer. The cost: inputs are up to as many periods old, the
    /// answer to an input is sent as many cycles later, a lost cycle is detected as much later (or when the next one
    /// returns), and each cycle under way has buffers of its own.
    pub under_way: u8,
    /// Whether lost frames are sent again within their cycle, with one cycle under way; with several they never are.
    /// Each SubDevice receives a second time what its [`Repetition`](crate::config::Repetition) allows. Off by default.
    pub sends_again: bool,
    /// Its members; the MainDevice packs their process data.
    pub members: Vec<DomainMember>,
    /// Process data with places of its own, in the order of registration, instead of members
    /// ([`Declaration::register_entry`]).
    pub registered: Vec<RegisteredArea>,
    /// Memory of the application for its image; `None` for own memory.
    pub memory: Option<ImageMemory>,
}

impl DomainConfig {
    /// Sets [`DomainConfig::under_way`].
    #[must_use]
    pub const fn with_under_way(mut self, under_way: u8) -> DomainConfig {
        self.under_way = under_way;
        self
    }

    /// A domain with one cycle under way.
    pub const fn new(period: Duration, members: Vec<DomainMember>) -> DomainConfig {
        DomainConfig { period, under_way: 1, sends_again: false, members, registered: Vec::new(), memory: None }
    }

    /// Sets [`DomainConfig::sends_again`].
    #[must_use]
    pub const fn with_sends_again(mut self, sends_again: bool) -> DomainConfig {
        self.sends_again = sends_again;
        self
    }
}

/// Process data of a SubDevice in a domain.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct DomainMember {
    /// Index of the SubDevice in the declaration.
    pub subdevice: SubDeviceId,
    /// SyncManagers whose process data belongs to the domain; `None` for all.
    pub sync_managers: Option<Vec<u8>>,
}

impl DomainMember {
    /// All process data of a SubDevice.
    pub const fn new(subdevice: SubDeviceId) -> DomainMember {
        DomainMember { subdevice, sync_managers: None }
    }

    /// Sets [`DomainMember::sync_managers`].
    #[must_use]
    pub fn with_sync_managers(mut self, sync_managers: impl Into<Option<Vec<u8>>>) -> DomainMember {
        self.sync_managers = sync_managers.into();
        self
    }
}

/// The declaration of the application.
///
/// Built like options: [`Declaration::new`], then `with_*` for values. What returns an index in the declaration
/// (`add*`, `register*`) or takes one (`assign`, `place_image`) takes `&mut self`.
///
/// ```
/// use core::time::Duration;
/// use ringcat_engine::config::{ClockConfig, SubDeviceConfig};
/// use ringcat_engine::main_device::{Declaration, Required};
///
/// let period = Duration::from_millis(1);
/// let mut declaration = Declaration::new(period)
///     .with_clocks(ClockConfig::default())
///     .with_required(Required::All)
///     .with_sends_again(true);
/// let drive = declaration.add(SubDeviceConfig::at_position(0));
/// assert_eq!((drive.0, declaration.domains[0].sends_again), (0, true));
/// ```
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Declaration {
    /// The expected SubDevices.
    pub subdevices: Vec<SubDeviceConfig>,
    /// The domains.
    pub domains: Vec<DomainConfig>,
    /// Use of LRW.
    pub lrw: LrwPolicy,
    /// LRW datagrams of a configuration file. With two links an LRW over several SubDevices is refused; if each covers
    /// one SubDevice the policy is [`LrwPolicy::PerSubDevice`]. With one link they have no effect.
    pub explicit_lrw: Vec<ExplicitLrw>,
    /// Distributed clocks; with `None` no clock register is set up.
    pub clocks: Option<ClockConfig>,
    /// SubDevices that must be present for the activation.
    pub required: Required,
    /// Memory of the application for process data between two MainDevices.
    #[cfg(feature = "standby")]
    pub(in crate::main_device) partner_memory: Option<partner_memory::DeclaredMemory>,
}

/// SubDevices that must answer, with the expected identity, for an activation. Each other absent SubDevice is reported
/// by an event, and is configured when it comes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Required {
    /// All that are declared, optional or not.
    All,
    /// All declared SubDevices that are not optional.
    #[default]
    Mandatory,
    /// None. A present one that cannot be set up as declared (PDOs, SDOs, SYNC signals, places of its process data)
    /// is no obstacle either: its own configuration fails, and all others go on.
    Nothing,
}

/// A hot connect group that was added to a declaration.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct DeclaredGroup {
    /// Its number.
    pub id: GroupId,
    /// Its members in the declaration, head first.
    pub members: Vec<SubDeviceId>,
}

impl Declaration {
    /// The same declaration, with this number of cycles of every domain under way at once (see
    /// [`DomainConfig::under_way`]).
    #[must_use]
    pub fn with_under_way(mut self, cycles: u8) -> Declaration {
        for domain in &mut self.domains {
            domain.under_way = cycles;
        }
        self
    }

    /// The same declaration, with lost frames of every domain sent again within their cycle, or not (see
    /// [`DomainConfig::sends_again`]).
    #[must_use]
    pub fn with_sends_again(mut self, sends_again: bool) -> Declaration {
        self.domains.iter_mut().for_each(|domain| domain.sends_again = sends_again);
        self
    }

    /// Declares a hot connect group.
    pub fn add_group(&mut self, group: Group) -> DeclaredGroup {
        let numbers = self.subdevices.iter().filter_map(|config| config.group);
        let group_id = numbers.max().map_or(GroupId(0), |GroupId(last)| GroupId(last + 1));
        let first = self.subdevices.len();
        self.subdevices.extend(group.into_configs(group_id));
        DeclaredGroup { id: group_id, members: (first..self.subdevices.len()).map(SubDeviceId).collect() }
    }
}

/// An LRW datagram of a configuration file. The MainDevice lays out its own datagrams.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ExplicitLrw {
    /// Its designation in the file: frame, place in the frame, comment.
    pub name: String,
    /// Its logical address in the file.
    pub logical: LogicalAddress,
    /// Its bytes.
    pub length: usize,
    /// Indices in the declaration of the SubDevices that it addresses.
    pub subdevices: Vec<SubDeviceId>,
}

impl ExplicitLrw {
    /// An LRW datagram by its name, logical address, length in bytes and SubDevices.
    pub fn new(name: String, logical: LogicalAddress, length: usize, subdevices: Vec<SubDeviceId>) -> ExplicitLrw {
        ExplicitLrw { name, logical, length, subdevices }
    }
}
