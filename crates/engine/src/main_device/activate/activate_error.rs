//! Why a declaration cannot be activated: types and messages.

use alloc::vec::Vec;
use core::fmt;
use core::time::Duration;

use ringcat_wire::address::LogicalAddress;
use ringcat_wire::al::AlState;

use crate::config::ConfigError;
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::info::Direction;
use crate::junction::JunctionError;
use crate::layout::LayoutError;
#[cfg(feature = "standby")]
use crate::main_device::declaration::partner_memory::PartnerMemoryError;
use crate::main_device::declaration::{ExplicitLrw, MAX_UNDER_WAY};
use crate::role::NotPermitted;
use crate::segment::setup::SetupError;

/// Why a declaration cannot be activated.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ActivateError {
    /// There is no scan result, or a requested scan is under way.
    NoScan,
    /// It is refused in the present role, or while the MainDevice is active.
    NotPermitted(NotPermitted),
    /// A declared SubDevice is missing, or has another identity.
    Config {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The error.
        error: ConfigError,
    },
    /// A SubDevice cannot be configured as declared.
    Setup {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The error.
        error: SetupError,
    },
    /// A scan is running.
    Scanning,
    /// There is no loaded declaration to apply.
    NotLoaded,
    /// Data words by which SubDevices are declared could not be read: frames were lost, or a scan or an application has
    /// begun meanwhile.
    DataWords,
    /// A connection of a local ring does not fit.
    Junction(JunctionError),
    /// The declared target state cannot be held with process data and mailbox.
    Target {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The declared state.
        target: AlState,
    },
    /// The head of a hot connect group has neither alias nor identification.
    Headless {
        /// Index in the declaration.
        subdevice: SubDeviceId,
    },
    /// LRW with MainDevice redundancy: the other MainDevice takes outputs from frames that have passed SubDevices.
    #[cfg(feature = "standby")]
    LrwWithStandby,
    /// Process data of a SubDevice was put into two domains.
    TwoDomains {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The SyncManager.
        sync_manager: u8,
        /// The domains.
        domains: [DomainId; 2],
    },
    /// A domain has members, which the MainDevice packs, and registered areas, which have their places already.
    MixedPlaces {
        /// Number of the domain.
        domain: DomainId,
    },
    /// Memory that was given for an image is shorter than the image.
    MemoryTooShort {
        /// Number of the domain.
        domain: DomainId,
        /// Bytes of the image.
        needed: usize,
        /// Bytes of the memory.
        got: usize,
    },
    /// A copy of the declaration has the memory for an image, too.
    MemoryShared {
        /// Number of the domain.
        domain: DomainId,
    },
    /// Memory for process data between both MainDevices cannot be used.
    #[cfg(feature = "standby")]
    PartnerMemory(PartnerMemoryError),
    /// Process data has another size or direction than when its place was registered.
    Registered {
        /// Number of the domain.
        domain: DomainId,
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// The SyncManager.
        sync_manager: u8,
        /// Direction and bytes as registered.
        expected: (Direction, u16),
        /// Direction and bytes now; `None` where the SyncManager has no process data.
        got: Option<(Direction, u16)>,
    },
    /// There is no domain, and a SubDevice has process data: it would reach OP without exchanging any.
    NoDomain {
        /// Index in the declaration.
        subdevice: SubDeviceId,
    },
    /// SYNC0 does not fit the cycle: its pulse would come at another time in each cycle.
    SyncCycle {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Cycle of SYNC0.
        sync0: Duration,
        /// The shortest period.
        period: Duration,
    },
    /// No cycle of a domain may be under way, or more than [`MAX_UNDER_WAY`].
    UnderWay {
        /// Number of the domain.
        domain: DomainId,
        /// The declared number.
        under_way: u8,
    },
    /// LRW is configured with two links. When the ring opens, one copy would be processed by some of its SubDevices and
    /// the other copy by the rest (protocol CR-16, 9.2.2).
    LrwOnTwoLinks {
        /// Number of the domain.
        domain: DomainId,
        /// First logical address of the datagram.
        logical: LogicalAddress,
        /// Its bytes.
        length: usize,
        /// Indices in the declaration of the SubDevices that it addresses.
        subdevices: Vec<SubDeviceId>,
    },
    /// A configuration file names an LRW over several SubDevices, and there are two links (protocol CR-16, 9.2.2).
    NamedLrwOnTwoLinks(ExplicitLrw),
    /// LRW is configured, and a SubDevice does not support it.
    LrwUnknown {
        /// Number of the domain.
        domain: DomainId,
        /// Index in the declaration.
        subdevice: SubDeviceId,
    },
    /// Process data does not fit into frames or images.
    Layout(LayoutError),
    /// SYNC signals are declared for a SubDevice, but no distributed clocks, or it has no clock.
    NoClock {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// It has a clock.
        has_clock: bool,
    },
    /// A domain names a SubDevice that was not declared.
    UnknownMember {
        /// Number of the domain.
        domain: DomainId,
        /// The index.
        subdevice: SubDeviceId,
    },
}

impl fmt::Display for ActivateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ActivateError::NoScan => f.write_str("no scan result: scan before activating"),
            ActivateError::NotPermitted(denied) => denied.fmt(f),
            ActivateError::Config { subdevice, error } => write!(f, "SubDevice {subdevice}: {error}"),
            ActivateError::Setup { subdevice, error } => write!(f, "SubDevice {subdevice}: {error}"),
            ActivateError::Scanning => f.write_str("a scan is running"),
            ActivateError::NotLoaded => f.write_str("nothing is loaded: load a declaration before applying it"),
            ActivateError::DataWords => f.write_str(
                "the data words by which SubDevices are declared could not be read: frames are lost, or the segment is \
                 in use",
            ),
            ActivateError::Junction(error) => error.fmt(f),
            ActivateError::Target { subdevice, target } => {
                write!(f, "SubDevice {subdevice}: expected target INIT, PREOP, SAFEOP or OP, got {target}")
            }
            ActivateError::Headless { subdevice } => write!(
                f,
                "SubDevice {subdevice}: the head of a group is found by alias or identification, got another address"
            ),
            ActivateError::TwoDomains { subdevice, sync_manager, domains: [a, b] } => write!(
                f,
                "SubDevice {subdevice}: process data of SyncManager {sync_manager} is in domain {a} and in domain {b}"
            ),
            ActivateError::MixedPlaces { domain } => {
                write!(f, "domain {domain} has members and registered areas: register all of its process data, or none")
            }
            ActivateError::MemoryTooShort { .. } | ActivateError::MemoryShared { .. } => self.fmt_memory(f),
            #[cfg(feature = "standby")]
            ActivateError::PartnerMemory(error) => error.fmt(f),
            ActivateError::Registered { .. } => self.fmt_registered(f),
            ActivateError::NoDomain { subdevice } => write!(
                f,
                "SubDevice {subdevice} has process data and there is no domain to exchange it: declare a domain, or \
                 PREOP as the target"
            ),
            ActivateError::SyncCycle { subdevice, sync0, period } => fmt_sync_cycle(f, *subdevice, *sync0, *period),
            ActivateError::UnderWay { domain, under_way } => {
                write!(f, "domain {domain}: expected 1 to {MAX_UNDER_WAY} cycles under way, got {under_way}")
            }
            ActivateError::LrwOnTwoLinks { .. } | ActivateError::NamedLrwOnTwoLinks(_) => self.fmt_two_links(f),
            #[cfg(feature = "standby")]
            ActivateError::LrwWithStandby => {
                f.write_str("LRW is not allowed with MainDevice redundancy: declare LRD and LWR")
            }
            ActivateError::LrwUnknown { domain, subdevice } => {
                write!(f, "domain {domain}: LRW is configured, but SubDevice {subdevice} does not support it")
            }
            ActivateError::Layout(error) => error.fmt(f),
            ActivateError::NoClock { subdevice, has_clock: false } => {
                write!(f, "SubDevice {subdevice}: SYNC signals, but it has no distributed clock")
            }
            ActivateError::NoClock { subdevice, has_clock: true } => {
                write!(f, "SubDevice {subdevice}: SYNC signals, but no distributed clocks are declared")
            }
            ActivateError::UnknownMember { domain, subdevice } => {
                write!(f, "domain {domain} names SubDevice {subdevice}, which is not declared")
            }
        }
    }
}

impl ActivateError {
    /// The SubDevice whose declaration is refused, if it is a single one.
    pub const fn subdevice(&self) -> Option<SubDeviceId> {
        match self {
            ActivateError::Config { subdevice, .. }
            | ActivateError::Setup { subdevice, .. }
            | ActivateError::Target { subdevice, .. }
            | ActivateError::Headless { subdevice }
            | ActivateError::TwoDomains { subdevice, .. }
            | ActivateError::Registered { subdevice, .. }
            | ActivateError::NoDomain { subdevice }
            | ActivateError::SyncCycle { subdevice, .. }
            | ActivateError::LrwUnknown { subdevice, .. }
            | ActivateError::NoClock { subdevice, .. }
            | ActivateError::UnknownMember { subdevice, .. } => Some(*subdevice),
            _ => None,
        }
    }

    fn fmt_memory(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ActivateError::MemoryTooShort { domain, needed, got } => {
                write!(f, "domain {domain}: its image has {needed} bytes, the memory for it {got}")
            }
            ActivateError::MemoryShared { domain } => {
                write!(
                    f,
                    "domain {domain}: a copy of the declaration has the memory for its image, too: drop it before"
                )
            }
            _ => Ok(()),
        }
    }

    fn fmt_two_links(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ActivateError::LrwOnTwoLinks { domain, logical, length, subdevices } => write!(
                f,
                "domain {domain}: an LRW at logical address {logical} of {length} bytes for SubDevices \
                 {:?} cannot be used with two links: leave it to the MainDevice, or use one LRW per SubDevice",
                list(subdevices)
            ),
            ActivateError::NamedLrwOnTwoLinks(ExplicitLrw { name, logical, length, subdevices }) => write!(
                f,
                "{name}: an LRW at logical address {logical} of {length} bytes for SubDevices {:?} cannot \
                 be used with two links: let it be split into LRD and LWR, or use one LRW per SubDevice",
                list(subdevices)
            ),
            _ => Ok(()),
        }
    }

    fn fmt_registered(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ActivateError::Registered { domain, subdevice, sync_manager, expected: (direction, bytes), got } = self
        else {
            return Ok(());
        };
        write!(
            f,
            "SubDevice {subdevice}: SyncManager {sync_manager} was registered in domain {domain} with {bytes} bytes \
             of {direction}, "
        )?;
        match got {
            Some((direction, bytes)) => write!(f, "it has {bytes} bytes of {direction}"),
            None => f.write_str("it has no process data"),
        }
    }
}

/// Indices as a list: `[2, 3]`.
fn list(subdevices: &[SubDeviceId]) -> impl fmt::Debug + '_ {
    core::fmt::from_fn(move |f| f.debug_list().entries(subdevices.iter().map(|subdevice| subdevice.0)).finish())
}

/// Microseconds, with a fraction if there is one.
fn in_us(time: Duration) -> impl fmt::Display {
    let ns = time.as_nanos();
    core::fmt::from_fn(move |f| match ns % 1_000 {
        0 => write!(f, "{}", ns / 1_000),
        rest => write!(f, "{}.{rest:03}", ns / 1_000),
    })
}

fn fmt_sync_cycle(
    f: &mut fmt::Formatter<'_>,
    subdevice: SubDeviceId,
    sync0: Duration,
    period: Duration,
) -> fmt::Result {
    let [sync0, period] = [sync0, period].map(in_us);
    write!(f, "SubDevice {subdevice}: SYNC0 every {sync0} us does not go with cycles of {period} us: ")?;
    f.write_str("one must be a multiple of the other")
}

impl core::error::Error for ActivateError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            ActivateError::NotPermitted(error) => Some(error),
            ActivateError::Config { error, .. } => Some(error),
            ActivateError::Setup { error, .. } => Some(error),
            ActivateError::Junction(error) => Some(error),
            ActivateError::Layout(error) => Some(error),
            #[cfg(feature = "standby")]
            ActivateError::PartnerMemory(error) => Some(error),
            _ => None,
        }
    }
}

impl From<NotPermitted> for ActivateError {
    fn from(denied: NotPermitted) -> ActivateError {
        ActivateError::NotPermitted(denied)
    }
}
