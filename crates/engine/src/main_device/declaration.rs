//! What the application declares: SubDevices, domains, clocks.

use alloc::string::String;
use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::address::LogicalAddress;

use crate::config::{ClockConfig, Group, SubDeviceConfig};
use crate::declared::{GroupId, SubDeviceId};
use crate::layout::LrwPolicy;

/// Cycles of a domain that may be under way at once, at the most.
pub const MAX_UNDER_WAY: u8 = 4;

/// A domain as the application declares it.
#[derive(Clone, Debug)]
pub struct DomainConfig {
    /// How often the application will exchange it.
    pub period: Duration,
    /// How many of its cycles may be under way at once, 1 to [`MAX_UNDER_WAY`]: 1 where frames come back within a
    /// period, more where their way through segment and host takes longer. What it costs: inputs are as old as that
    /// way, so up to as many periods, the answer to an input leaves as many cycles later, a lost cycle is noticed as
    /// much later (or when the next one comes back), and each cycle under way has buffers of its own.
    pub under_way: u8,
    /// What belongs to it.
    pub members: Vec<DomainMember>,
}

impl DomainConfig {
    /// A domain with one cycle under way.
    pub const fn new(period: Duration, members: Vec<DomainMember>) -> DomainConfig {
        DomainConfig { period, under_way: 1, members }
    }
}

/// A SubDevice's part in a domain.
#[derive(Clone, Debug)]
pub struct DomainMember {
    /// Index of the SubDevice in the declaration.
    pub subdevice: SubDeviceId,
    /// SyncManagers whose process data belongs to the domain; `None` for all.
    pub sync_managers: Option<Vec<u8>>,
}

/// What the application declares.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct Declaration {
    /// The SubDevices that are expected.
    pub subdevices: Vec<SubDeviceConfig>,
    /// The domains.
    pub domains: Vec<DomainConfig>,
    /// Where LRW is used.
    pub lrw: LrwPolicy,
    /// Datagrams with LRW that a configuration file names. With two links one over several SubDevices is refused, and
    /// where each has one SubDevice the policy is [`LrwPolicy::PerSubDevice`]; with one link they change nothing.
    pub explicit_lrw: Vec<ExplicitLrw>,
    /// Distributed clocks; `None` leaves them alone.
    pub clocks: Option<ClockConfig>,
    /// SubDevices that must answer for the activation.
    pub required: Required,
}

/// SubDevices that must answer, with the expected identity, for an activation. An event reports any other; it is left
/// alone and may come later.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Required {
    /// All that are declared, optional or not.
    All,
    /// Those that are not optional.
    #[default]
    Mandatory,
    /// None.
    Nothing,
}

impl Declaration {
    /// The same, with so many cycles of every domain under way at once (see [`DomainConfig::under_way`]).
    #[must_use]
    pub fn with_under_way(mut self, cycles: u8) -> Declaration {
        for domain in &mut self.domains {
            domain.under_way = cycles;
        }
        self
    }

    /// Declares a hot connect group. Returns its number, and the indices of its members, head first.
    pub fn add_group(&mut self, group: Group) -> (GroupId, Vec<SubDeviceId>) {
        let numbers = self.subdevices.iter().filter_map(|config| config.group);
        let group_id = numbers.max().map_or(GroupId(0), |GroupId(last)| GroupId(last + 1));
        let first = self.subdevices.len();
        self.subdevices.extend(group.into_configs(group_id));
        (group_id, (first..self.subdevices.len()).map(SubDeviceId).collect())
    }
}

/// A datagram with LRW as a configuration file names it. What leaves is laid out by the MainDevice.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExplicitLrw {
    /// How the author of the file finds it: its frame, its place in it, its comment.
    pub name: String,
    /// Its logical address in the file.
    pub logical: LogicalAddress,
    /// Its bytes.
    pub length: usize,
    /// Indices in the declaration of the SubDevices that it addresses.
    pub subdevices: Vec<SubDeviceId>,
}
