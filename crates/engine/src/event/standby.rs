//! Events of MainDevice redundancy (protocol 9.6).

use alloc::format;
use alloc::string::String;
use core::time::Duration;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::{NotReady, Stage};
use ringcat_wire::memory_write::MemoryWrite;

use crate::declared::SubDeviceId;
use crate::link::Link;
use crate::queue::WORDS;
use crate::role::{MainDeviceRole, Partner, RoleCause};

/// An event of MainDevice redundancy.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum StandbyEvent {
    /// The role has changed.
    RoleChanged {
        /// The role now.
        role: MainDeviceRole,
        /// Cause of the change.
        cause: RoleCause,
    },
    /// This MainDevice controls the bus, and goes on with the process data of the other one; with its own if it was
    /// ACTIVE itself and has received no frame of another MainDevice since.
    TookOver {
        /// Time since a frame of the other MainDevice came last; `None` if none has come.
        silence: Option<Duration>,
        /// SubDevices that go on as they are.
        in_state: u16,
        /// They keep their configuration; otherwise all are configured again from INIT on.
        is_hot: bool,
        /// A write into the memory of a SubDevice by the other MainDevice, which the takeover may have cut off.
        cut: Option<MemoryWrite>,
    },
    /// The state of the other MainDevice has changed, as determined by this one as ACTIVE.
    Partner(Partner),
    /// A frame of another MainDevice came while this one is ACTIVE (protocol MR-10).
    Collision {
        /// The link on which it arrived.
        arrived_on: Link,
        /// Its source address.
        source: MacAddress,
    },
    /// The other MainDevice has another configuration (protocol REQ010).
    ConfigurationDiffers {
        /// Number of the first item that was found to differ; `None` if their number does.
        item: Option<u16>,
        /// What differs.
        what: String,
    },
    /// One of both MainDevices has master frames of a version that the other one cannot read: neither can take over
    /// from the other. Reported on both sides.
    OtherVersion {
        /// Version of the other MainDevice.
        got: u8,
        /// The oldest version that could read the newer one of both.
        least: u8,
    },
    /// The role was to be handed over, and the other MainDevice does not take it.
    HandOverRefused(Partner),
    /// A requested change of the role was refused: this write into the memory of a SubDevice is under way, and the
    /// change would cut it off ([`RoleControl::force`](crate::role::RoleControl::force)).
    RoleRefused(MemoryWrite),
    /// No ACTIVE sends process data, and this MainDevice is not allowed to take over, or has no link: outputs of the
    /// SubDevices stay as they are or are switched off by their watchdogs. Reported after the time-out of the policy
    /// (three times the time-out if the policy takes over); before an application, after the time of listening (twice
    /// that time if the policy takes over). Reported once until an ACTIVE sends again; the next event is
    /// [`StandbyEvent::ActiveIsBack`] or [`StandbyEvent::RoleChanged`]. Without a policy it is not reported.
    NoActive {
        /// Time since the last process data of an ACTIVE, or since this MainDevice began to wait for one.
        silence: Duration,
    },
    /// After [`StandbyEvent::NoActive`]: an ACTIVE sends process data again.
    ActiveIsBack,
    /// Whether a failure of one MainDevice would now cost no more than the time-out of a takeover: no reasons
    /// ([`NotReady::NOTHING`]), or why not ([`RoleControl::readiness`](crate::role::RoleControl::readiness)). Reported
    /// on both sides when it has changed, and has been the same for four cycles.
    Readiness(NotReady),
    /// The declared watchdog of a SubDevice with outputs is not longer than the time for which process data may be
    /// missing in a takeover: the SubDevice then leaves OP. Reported once when the policy is set.
    WatchdogTooShort {
        /// The SubDevice.
        subdevice: SubDeviceId,
        /// Its watchdog for process data (registers 0x0400, 0x0420).
        watchdog: Duration,
        /// The time-out and two cycles (protocol 9.9); more where its outputs are not exchanged in each cycle.
        needed: Duration,
    },
    /// The knowledge of the segment is too long for its place in master frames: the other MainDevice cannot follow, and
    /// a takeover goes through INIT. About 400 SubDevices fit.
    KnowledgeTooLong {
        /// Its bytes.
        bytes: usize,
        /// Bytes that there is room for.
        room: usize,
    },
}

const KIND_ROLE: u64 = 0x10;
const KIND_TOOK_OVER: u64 = 0x11;
const KIND_PARTNER: u64 = 0x12;
const KIND_COLLISION: u64 = 0x13;
const KIND_ITEM: u64 = 0x14;
const KIND_COUNT: u64 = 0x15;
const KIND_VERSION: u64 = 0x16;
const KIND_REFUSED: u64 = 0x17;
const KIND_KEPT: u64 = 0x18;
const KIND_NO_ACTIVE: u64 = 0x19;
const KIND_BACK: u64 = 0x1A;
const KIND_READINESS: u64 = 0x1B;

/// An event of the exchange, which is packed into words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CyclicStandbyEvent {
    /// See [`StandbyEvent::RoleChanged`].
    RoleChanged(MainDeviceRole, RoleCause),
    /// See [`StandbyEvent::TookOver`].
    TookOver {
        /// Time since the last frame.
        silence: Option<Duration>,
        /// SubDevices that go on.
        in_state: u16,
        /// They keep their configuration.
        is_hot: bool,
        /// A write that may have been cut off.
        cut: Option<MemoryWrite>,
    },
    /// See [`StandbyEvent::Partner`].
    Partner(Partner),
    /// See [`StandbyEvent::Collision`].
    Collision {
        /// The link.
        arrived_on: Link,
        /// The source address.
        source: MacAddress,
    },
    /// An item of the configuration differs.
    Item(u16),
    /// The number of items differs.
    Count {
        /// Here.
        here: u16,
        /// At the other MainDevice.
        there: u16,
    },
    /// See [`StandbyEvent::OtherVersion`].
    OtherVersion {
        /// Its version.
        got: u8,
        /// The oldest version that could read it.
        least: u8,
    },
    /// See [`StandbyEvent::HandOverRefused`].
    HandOverRefused(Partner),
    /// See [`StandbyEvent::RoleRefused`].
    RoleRefused(MemoryWrite),
    /// See [`StandbyEvent::NoActive`].
    NoActive(Duration),
    /// See [`StandbyEvent::ActiveIsBack`].
    ActiveIsBack,
    /// See [`StandbyEvent::Readiness`].
    Readiness(NotReady),
}

impl CyclicStandbyEvent {
    /// As words; the lowest byte of the first is the kind.
    pub const fn pack(self) -> [u64; WORDS] {
        match self {
            CyclicStandbyEvent::RoleChanged(role, cause) => {
                let role = matches!(role, MainDeviceRole::Inactive) as u64;
                let cause = match cause {
                    RoleCause::Requested => 0,
                    RoleCause::HandedOver => 1,
                    RoleCause::LinksLost => 2,
                };
                [KIND_ROLE | role << 8 | cause << 16, 0, 0]
            }
            CyclicStandbyEvent::TookOver { silence, in_state, is_hot, cut } => {
                let cut = match cut {
                    Some(write) => write.code() as u64,
                    None => 0,
                };
                let silence = match silence {
                    Some(silence) => silence.as_nanos() as u64 | 1 << 63,
                    None => 0,
                };
                [KIND_TOOK_OVER | (is_hot as u64) << 8 | (in_state as u64) << 16, silence, cut]
            }
            CyclicStandbyEvent::Partner(partner) => [KIND_PARTNER, partner_word(partner), 0],
            CyclicStandbyEvent::Collision { arrived_on, source: MacAddress([a, b, c, d, e, f]) } => {
                let source = u64::from_le_bytes([a, b, c, d, e, f, 0, 0]);
                [KIND_COLLISION | (matches!(arrived_on, Link::Redundant) as u64) << 8, source, 0]
            }
            CyclicStandbyEvent::Item(number) => [KIND_ITEM | (number as u64) << 16, 0, 0],
            CyclicStandbyEvent::Count { here, there } => {
                [KIND_COUNT | (here as u64) << 16 | (there as u64) << 32, 0, 0]
            }
            CyclicStandbyEvent::OtherVersion { got, least } => {
                [KIND_VERSION | (got as u64) << 8 | (least as u64) << 16, 0, 0]
            }
            CyclicStandbyEvent::HandOverRefused(partner) => [KIND_REFUSED, partner_word(partner), 0],
            CyclicStandbyEvent::RoleRefused(write) => [KIND_KEPT | (write.code() as u64) << 16, 0, 0],
            CyclicStandbyEvent::NoActive(silence) => [KIND_NO_ACTIVE, silence.as_nanos() as u64, 0],
            CyclicStandbyEvent::ActiveIsBack => [KIND_BACK, 0, 0],
            CyclicStandbyEvent::Readiness(reasons) => [KIND_READINESS | (reasons.0 as u64) << 16, 0, 0],
        }
    }

    /// Unpacks words; `None` for words that [`CyclicStandbyEvent::pack`] does not make.
    pub const fn unpack(words: [u64; WORDS]) -> Option<CyclicStandbyEvent> {
        let (bytes, half) = (words[0].to_le_bytes(), (words[0] >> 16) as u16);
        match words[0] & 0xFF {
            KIND_ROLE => {
                let role = if bytes[1] == 0 { MainDeviceRole::Active } else { MainDeviceRole::Inactive };
                let cause = match bytes[2] {
                    0 => RoleCause::Requested,
                    1 => RoleCause::HandedOver,
                    2 => RoleCause::LinksLost,
                    _ => return None,
                };
                Some(CyclicStandbyEvent::RoleChanged(role, cause))
            }
            KIND_TOOK_OVER => {
                let silence = Duration::from_nanos(words[1] & !(1 << 63));
                let silence = if words[1] >> 63 != 0 { Some(silence) } else { None };
                let cut = MemoryWrite::from_code(words[2] as u16);
                Some(CyclicStandbyEvent::TookOver { silence, in_state: half, is_hot: bytes[1] != 0, cut })
            }
            KIND_PARTNER => Some(CyclicStandbyEvent::Partner(partner_of(words[1]))),
            KIND_COLLISION => {
                let arrived_on = if bytes[1] == 0 { Link::Main } else { Link::Redundant };
                let [a, b, c, d, e, f, _, _] = words[1].to_le_bytes();
                Some(CyclicStandbyEvent::Collision { arrived_on, source: MacAddress([a, b, c, d, e, f]) })
            }
            KIND_ITEM => Some(CyclicStandbyEvent::Item(half)),
            KIND_COUNT => Some(CyclicStandbyEvent::Count { here: half, there: (words[0] >> 32) as u16 }),
            KIND_VERSION => Some(CyclicStandbyEvent::OtherVersion { got: bytes[1], least: bytes[2] }),
            KIND_REFUSED => Some(CyclicStandbyEvent::HandOverRefused(partner_of(words[1]))),
            KIND_KEPT => match MemoryWrite::from_code(half) {
                Some(write) => Some(CyclicStandbyEvent::RoleRefused(write)),
                None => None,
            },
            KIND_NO_ACTIVE => Some(CyclicStandbyEvent::NoActive(Duration::from_nanos(words[1]))),
            KIND_BACK => Some(CyclicStandbyEvent::ActiveIsBack),
            KIND_READINESS => Some(CyclicStandbyEvent::Readiness(NotReady(half))),
            _ => None,
        }
    }

    /// The event as the application receives it. `name_of`: the item of the configuration with a number.
    pub fn event(self, name_of: impl FnOnce(u16) -> String) -> StandbyEvent {
        match self {
            CyclicStandbyEvent::RoleChanged(role, cause) => StandbyEvent::RoleChanged { role, cause },
            CyclicStandbyEvent::TookOver { silence, in_state, is_hot, cut } => {
                StandbyEvent::TookOver { silence, in_state, is_hot, cut }
            }
            CyclicStandbyEvent::Partner(partner) => StandbyEvent::Partner(partner),
            CyclicStandbyEvent::Collision { arrived_on, source } => StandbyEvent::Collision { arrived_on, source },
            CyclicStandbyEvent::Item(number) => {
                StandbyEvent::ConfigurationDiffers { item: Some(number), what: name_of(number) }
            }
            CyclicStandbyEvent::Count { here, there } => StandbyEvent::ConfigurationDiffers {
                item: None,
                what: format!("{here} items here, {there} there: another number of SubDevices or domains"),
            },
            CyclicStandbyEvent::OtherVersion { got, least } => StandbyEvent::OtherVersion { got, least },
            CyclicStandbyEvent::HandOverRefused(partner) => StandbyEvent::HandOverRefused(partner),
            CyclicStandbyEvent::RoleRefused(write) => StandbyEvent::RoleRefused(write),
            CyclicStandbyEvent::NoActive(silence) => StandbyEvent::NoActive { silence },
            CyclicStandbyEvent::ActiveIsBack => StandbyEvent::ActiveIsBack,
            CyclicStandbyEvent::Readiness(reasons) => StandbyEvent::Readiness(reasons),
        }
    }
}

const fn partner_word(partner: Partner) -> u64 {
    match partner {
        Partner::Absent => 0,
        Partner::Forwards => 1,
        Partner::Alive { stage, not_ready, is_consistent } => {
            2 | (stage.code() as u64) << 8 | (is_consistent as u64) << 16 | (not_ready.0 as u64) << 32
        }
    }
}

const fn partner_of(word: u64) -> Partner {
    let bytes = word.to_le_bytes();
    match bytes[0] {
        0 => Partner::Absent,
        1 => Partner::Forwards,
        _ => Partner::Alive {
            stage: Stage::from_code(bytes[1]),
            is_consistent: bytes[2] != 0,
            not_ready: NotReady((word >> 32) as u16),
        },
    }
}

#[cfg(test)]
mod tests {
    use ringcat_wire::memory_write::WriteKind;

    use super::*;
    use crate::event::CyclicEvent;

    // covers: MR-04, MR-10, standby
    #[test]
    fn events_of_the_standby_survive_the_words() {
        let alive = Partner::Alive { stage: Stage::Ready, not_ready: NotReady(0x41), is_consistent: true };
        let source = MacAddress([1, 2, 3, 4, 5, 6]);
        let write = MemoryWrite::new(WriteKind::Boot, true, 0x123);
        let events = [
            CyclicStandbyEvent::RoleChanged(MainDeviceRole::Inactive, RoleCause::LinksLost),
            CyclicStandbyEvent::RoleChanged(MainDeviceRole::Active, RoleCause::HandedOver),
            CyclicStandbyEvent::TookOver {
                silence: Some(Duration::from_nanos(7)),
                in_state: 33,
                is_hot: true,
                cut: Some(write),
            },
            CyclicStandbyEvent::TookOver { silence: None, in_state: 0, is_hot: false, cut: None },
            CyclicStandbyEvent::Partner(alive),
            CyclicStandbyEvent::Partner(Partner::Forwards),
            CyclicStandbyEvent::Collision { arrived_on: Link::Redundant, source },
            CyclicStandbyEvent::Item(0x1234),
            CyclicStandbyEvent::Count { here: 33, there: 0xFFFF },
            CyclicStandbyEvent::OtherVersion { got: 3, least: 2 },
            CyclicStandbyEvent::HandOverRefused(Partner::Absent),
            CyclicStandbyEvent::RoleRefused(write),
            CyclicStandbyEvent::NoActive(Duration::from_nanos(0x1234_5678_9ABC)),
            CyclicStandbyEvent::ActiveIsBack,
            CyclicStandbyEvent::Readiness(NotReady::ABSENT.with(NotReady::GUARD, true)),
        ];
        for event in events {
            assert_eq!(CyclicEvent::unpack(event.pack()), Some(CyclicEvent::Standby(event)));
        }
        assert_eq!(CyclicStandbyEvent::unpack([0x1F, 0, 0]), None);
    }
}
