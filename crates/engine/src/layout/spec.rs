//! Input of a layout: areas, domains, and common rules.

use alloc::vec::Vec;
use core::time::Duration;

use crate::direction::Direction;
use crate::link::LinkSet;

/// One SyncManager's process data that takes part in a domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AreaSpec {
    /// Index of the SubDevice among those that were declared.
    pub subdevice: usize,
    /// SyncManager number.
    pub sync_manager: u8,
    /// Direction.
    pub direction: Direction,
    /// Bytes.
    pub length: u16,
}

/// Use of LRW instead of LWR and LRD (protocol 9.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum LrwPolicy {
    /// On one link, where every SubDevice of a domain supports it; never on two links.
    #[default]
    Automatic,
    /// As the application or its configuration requests; refused with two links, or where a SubDevice does not support
    /// it.
    Explicit,
    /// One datagram per SubDevice, with LRW where it has outputs and inputs. Allowed with two links too, because one
    /// copy reaches all that a datagram addresses.
    PerSubDevice,
}

/// How a frame shows whether a SubDevice delivered its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Witness {
    /// By its AL status, which one of its FMMUs maps into the frame: in these states its inputs are valid.
    Mapped(Delivers),
    /// By the working counter of a datagram that addresses no other SubDevice.
    Alone,
}

/// AL states in which a SubDevice with FMMUs and SyncManagers set delivers its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivers {
    /// In SAFEOP and OP.
    FromSafeOp,
    /// In OP only (protocol 4.4).
    InOp,
}

/// Rules of a layout.
#[derive(Clone, Copy, Debug)]
pub struct Rules<'a> {
    /// Links that frames leave on.
    pub links: LinkSet,
    /// Adds the supervision datagram.
    pub supervision: bool,
    /// Where LRW is used.
    pub lrw: LrwPolicy,
    /// By SubDevice; those beyond the end have a spare FMMU.
    pub witnesses: &'a [Witness],
    /// Number of the session, modulo `SESSIONS`. Each session has logical addresses of its own, so that a SubDevice
    /// that was out of reach since an earlier session and still has its old FMMUs does not answer for another one.
    pub session: u32,
    /// Largest number of datagrams in a frame, `MIN_DATAGRAMS_PER_FRAME` at least; `None`: as many as fit.
    pub max_datagrams: Option<usize>,
}

/// Content of a domain.
#[derive(Clone, Debug)]
pub struct DomainSpec {
    /// Period of its exchange by the application; zero for a domain without one.
    pub period: Duration,
    /// Largest number of its cycles on the wire at once.
    pub under_way: u8,
    /// Whether every SubDevice of the domain supports LRW (protocol 3.1, features bit 9).
    pub lrw: bool,
    /// The areas.
    pub areas: Vec<AreaSpec>,
    /// Their order in the image.
    pub image: ImageOrder,
}

/// Places of areas in the image of a domain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum ImageOrder {
    /// As on the wire: in the order of the areas, in each frame outputs before inputs. The areas of a SubDevice are
    /// adjacent.
    #[default]
    Packed,
    /// Given, whatever the order on the wire.
    Fixed(FixedImage),
}

/// Places that were given before the layout.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FixedImage {
    /// First byte of each area of [`DomainSpec::areas`]. Areas do not overlap.
    pub starts: Vec<u32>,
    /// Bytes of the image.
    pub bytes: u32,
}

/// Rules for cutting the areas of a domain into frames.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    /// One LRW instead of an LWR and an LRD.
    pub(super) lrw: bool,
    /// Every SubDevice has datagrams of its own.
    pub(super) each: bool,
    /// Largest number of datagrams in a frame.
    pub(super) most: Option<usize>,
}
