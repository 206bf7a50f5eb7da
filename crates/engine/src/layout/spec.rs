//! What a layout is made from: areas, domains, and the rules that all of them keep.

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

/// Where LRW is used instead of LWR and LRD (protocol 9.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LrwPolicy {
    /// On one link, where every SubDevice of a domain knows it; never on two.
    #[default]
    Automatic,
    /// As the application or its configuration says so: refused with two links, or where a SubDevice does not know it.
    Explicit,
    /// One datagram per SubDevice, with LRW where it has outputs and inputs. Allowed with two links too, because one
    /// copy meets all that a datagram addresses.
    PerSubDevice,
}

/// How a frame shows whether a SubDevice put its inputs into it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Witness {
    /// By its AL status, which an FMMU of it maps into the frame: in these states its inputs are there.
    Mapped(Delivers),
    /// By the working counter of a datagram that no other SubDevice answers.
    Alone,
}

/// In which AL states a SubDevice whose FMMUs and SyncManagers are set gives its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Delivers {
    /// In SAFEOP and OP.
    FromSafeOp,
    /// In OP only (protocol 4.4).
    InOp,
}

/// What a layout has to follow.
#[derive(Clone, Copy, Debug)]
pub struct Rules<'a> {
    /// Links that frames leave on.
    pub links: LinkSet,
    /// Adds the supervision datagram to the domain with the shortest period.
    pub supervision: bool,
    /// Where LRW is used.
    pub lrw: LrwPolicy,
    /// By SubDevice; those behind the end have an FMMU to spare.
    pub witnesses: &'a [Witness],
    /// Number of the session, modulo [`SESSIONS`]: each has logical addresses of its own, so that a SubDevice that was
    /// out of reach since an earlier one and still has its FMMUs does not answer for another one.
    pub session: u32,
    /// Datagrams that a frame may hold, [`MIN_DATAGRAMS_PER_FRAME`] at least; `None`: as many as fit.
    pub max_datagrams: Option<usize>,
}

/// What a domain exchanges.
#[derive(Clone, Debug)]
pub struct DomainSpec {
    /// How often the application exchanges it.
    pub period: Duration,
    /// How many of its cycles may be under way at once.
    pub under_way: u8,
    /// Whether every SubDevice of the domain knows LRW (protocol 3.1, features bit 9).
    pub lrw: bool,
    /// Areas in the order in which they lie in the image; those of a SubDevice stand together.
    pub areas: Vec<AreaSpec>,
}

/// How the areas of a domain are cut into frames.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cut {
    /// One LRW in the place of an LWR and an LRD.
    pub(super) lrw: bool,
    /// Every SubDevice has datagrams of its own.
    pub(super) each: bool,
    /// Datagrams that a frame may hold.
    pub(super) most: Option<usize>,
}
