//! One SubDevice of the segment: found, or declared and absent.

use alloc::rc::Rc;

use ringcat_wire::address::StationAddress;

use super::key::SubDeviceKey;
use super::knowledge::Knowledge;
use super::member::{Member, MemberView};
use super::owners::Owners;
use super::setup::{Setup, SetupError};
use super::unassigned::{At, Unassigned, UnassignedView};
use crate::config::SubDeviceConfig;
use crate::info::SubDeviceInfo;

/// Whether a SubDevice is declared.
#[derive(Debug)]
pub enum Role {
    /// The application declares it. It may be absent.
    Declared(Member),
    /// It has no declaration, or is not matched with one yet. When it no longer answers it leaves the list.
    Unassigned(Unassigned),
}

/// One SubDevice of the segment: found, or declared and absent.
#[derive(Debug)]
pub struct SubDevice {
    /// Its key, with its station address.
    pub key: SubDeviceKey,
    /// Its identity and features.
    pub knowledge: Knowledge,
    /// Whether it is declared.
    pub role: Role,
}

impl SubDevice {
    /// A declared SubDevice with the data of the scan, if it was found; why it cannot be set up although it was.
    pub fn declared(
        config: SubDeviceConfig,
        info: Option<Rc<SubDeviceInfo>>,
        station: StationAddress,
        setup: Result<Rc<Setup>, Option<SetupError>>,
    ) -> SubDevice {
        let node = info.as_ref().map(|info| usize::from(info.position.0));
        SubDevice {
            key: SubDeviceKey { station, since: 0 },
            knowledge: info.map_or(Knowledge::NeverSeen, Knowledge::Known),
            role: Role::Declared(Member::new(config, node, setup)),
        }
    }

    /// A SubDevice of the scan without a declaration. `owners` has all positions; the first `main_count` are on the
    /// main link.
    pub fn undeclared(info: Rc<SubDeviceInfo>, owners: &Owners, main_count: usize) -> SubDevice {
        let at = At { position: usize::from(info.position.0), owners, main_count };
        SubDevice {
            key: SubDeviceKey { station: info.station, since: 0 },
            knowledge: Knowledge::Known(info),
            role: Role::Unassigned(Unassigned { reported: true, ..Unassigned::at(&at) }),
        }
    }

    /// Whether the identities of both are known and equal.
    pub(super) fn is_same(&self, other: &SubDevice) -> bool {
        let (one, other) = (self.knowledge.info(), other.knowledge.info());
        one.zip(other).is_some_and(|(one, other)| one.identity == other.identity)
    }

    /// It, if it is declared.
    pub fn as_member(&self) -> Option<MemberView<'_>> {
        let Role::Declared(member) = &self.role else { return None };
        Some(MemberView { station: self.key.station, info: self.knowledge.info(), member })
    }

    /// It, if it is unassigned.
    pub fn as_unassigned(&self) -> Option<UnassignedView<'_>> {
        let Role::Unassigned(unassigned) = &self.role else { return None };
        Some(UnassignedView { key: self.key, knowledge: &self.knowledge, unassigned })
    }
}
