//! The whole state of the MainDevice at one moment, for programs that read it from outside.
//!
//! Input: the state of the MainDevice between two calls of [`MainDevice::poll`], so all parts belong to the same
//! moment. Output: [`Snapshot`], plain numbers and names; with the feature `serde` its types can be written in any
//! format. Together with [`MainDevice::events_since`] a program follows the state without a gap: it reads a snapshot,
//! and later the events from [`Snapshot::next_event`] on.

use alloc::string::String;
use alloc::vec::Vec;

use super::{MainDevice, SubDeviceState};
use crate::info::SubDeviceInfo;
use crate::link::Link;
use crate::mail::{MailCounters, Mailbox};
use crate::ring::RingState;
use crate::ring_status::{Cable, Redundancy};
use crate::segment::Addressed;
use crate::segment::member::MemberView;
use crate::segment::unassigned::UnassignedView;
use crate::supervisor::AcyclicCounters;

macro_rules! plain {
    ($($(#[$doc:meta])* pub struct $name:ident { $($(#[$field_doc:meta])* pub $field:ident: $kind:ty,)* })*) => {$(
        $(#[$doc])*
        #[derive(Clone, Debug, Default, PartialEq)]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
        #[non_exhaustive]
        pub struct $name {
            $($(#[$field_doc])* pub $field: $kind,)*
        }
    )*};
}

/// What the MainDevice does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Activity {
    /// Nothing: there is no successful scan.
    #[default]
    Unscanned,
    /// A scan runs.
    Scanning,
    /// The segment is scanned, and no declaration is active.
    Scanned,
    /// A declaration is active.
    Active,
}

/// Progress of a declared SubDevice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Progress {
    /// It has no declaration, or none is active.
    #[default]
    Undeclared,
    /// It does not answer.
    Absent,
    /// It is not known: no ACTIVE reports it to this INACTIVE.
    Unknown,
    /// It is being configured, or waits for the next attempt.
    Configuring,
    /// It is in its target state.
    Settled,
}

plain! {
    /// The whole state.
    pub struct Snapshot {
        /// Time of the last call of the engine, in nanoseconds of the host's clock.
        pub at_ns: u64,
        /// Identifies the numbering of events; another epoch means that the MainDevice began anew.
        pub epoch: u64,
        /// Number of the next event: all events before it are part of this state.
        pub next_event: u64,
        /// What the MainDevice does.
        pub activity: Activity,
        /// While active the declared SubDevices by index, then those without a declaration; before, by position.
        pub subdevices: Vec<SubDeviceSnapshot>,
        /// The ring and both links.
        pub ring: RingSnapshot,
        /// The cables of the last scan.
        pub cables: Vec<CableSnapshot>,
        /// The distributed clocks, by position; empty without.
        pub clocks: Vec<ClockSnapshot>,
        /// All clocks are locked.
        pub clocks_locked: bool,
        /// The hot connect groups by number.
        pub groups: Vec<GroupSnapshot>,
        /// Frames and datagrams of the acyclic half.
        pub acyclic: AcyclicSnapshot,
        /// Events that were dropped because they were not fetched.
        pub events_dropped: u64,
    }

    /// One SubDevice.
    pub struct SubDeviceSnapshot {
        /// Index in the active declaration.
        pub declared: Option<usize>,
        /// Position; `None` for a declared SubDevice that the last scan did not find.
        pub position: Option<u16>,
        /// Station address.
        pub station: u16,
        /// Alias; 0 is none.
        pub alias: u16,
        /// Vendor, product, revision and serial number; zeros if it was never present.
        pub identity: [u32; 4],
        /// Name from its SII.
        pub name: String,
        /// Progress towards its target state.
        pub progress: Progress,
        /// Target state while its declaration is active, as in register AL_CONTROL: 1 INIT, 2 PREOP, 3 BOOT, 4 SAFEOP,
        /// 8 OP.
        pub target_state: Option<u8>,
        /// Mailbox protocols by its SII (word 0x1C); 0 without a mailbox.
        pub protocols: u16,
        /// Bytes of its mailboxes: those of messages to it, and from it; zeros without a mailbox.
        pub mailbox_bytes: [u16; 2],
        /// Its PDOs were read from its dictionary.
        pub are_pdos_read: bool,
        /// Its mailbox is in use.
        pub mailbox_open: bool,
        /// Messages written, mails read, and mails that no request waited for.
        pub mail: [u64; 3],
        /// Emergencies kept, and emergencies that were not kept.
        pub emergencies: [u64; 2],
    }

    /// The ring and both links.
    pub struct RingSnapshot {
        /// The ring is closed; `None` while unknown.
        pub closed: Option<bool>,
        /// The ring tolerates a further break; `None` with one link and while unknown.
        pub redundant: Option<bool>,
        /// MAIN, then REDUNDANT.
        pub links: [LinkSnapshot; 2],
        /// The broken cable, once located.
        pub break_at: Option<CableSnapshot>,
        /// Changes since activation.
        pub changes: u32,
    }

    /// One link.
    pub struct LinkSnapshot {
        /// The interface has a carrier; `None` if unknown.
        pub carrier: Option<bool>,
        /// SubDevices that processed the last frames.
        pub answering: u16,
        /// Their AL states, ORed.
        pub al_states: u8,
    }

    /// One cable: position and port at both ends, `None` for an interface of the host.
    pub struct CableSnapshot {
        /// The end nearer to MAIN.
        pub near: Option<(usize, u8)>,
        /// The other end.
        pub far: Option<(usize, u8)>,
        /// Damaged frames and link losses since activation.
        pub errors: [u64; 2],
    }

    /// One clock.
    pub struct ClockSnapshot {
        /// Position in the scan, or at which it was found later.
        pub position: u16,
        /// Index in the declaration.
        pub declared: Option<usize>,
        /// It is the reference.
        pub is_reference: bool,
        /// It is within the lock window.
        pub is_locked: bool,
        /// Propagation delay in nanoseconds.
        pub delay_ns: i64,
        /// System time minus local time at the set-up.
        pub offset_ns: i64,
        /// Drift in parts per billion.
        pub drift_ppb: i64,
        /// Its time minus that of the reference; `None` before the first read.
        pub difference_ns: Option<i32>,
        /// Largest magnitude of the difference since it was locked.
        pub worst_ns: u32,
    }

    /// One hot connect group.
    pub struct GroupSnapshot {
        /// SubDevices that answer.
        pub present: usize,
        /// SubDevices in their declared states.
        pub settled: usize,
        /// All SubDevices.
        pub members: usize,
    }

    /// Frames and datagrams of the acyclic half since the first scan.
    pub struct AcyclicSnapshot {
        /// Frames sent.
        pub sent: u64,
        /// Frames answered.
        pub received: u64,
        /// Frames of which no copy came back in time.
        pub lost: u64,
        /// Frames that came back with other datagrams than were sent.
        pub corrupt: u64,
        /// Frames of other MainDevices.
        pub foreign: u64,
        /// Datagrams sent.
        pub datagrams: u64,
        /// Datagrams that were sent again.
        pub resent: u64,
        /// Datagrams that were given up.
        pub timed_out: u64,
        /// Mailbox messages that arrived when no read waited for them, and were dropped because they were not fetched
        /// in time: lost answers.
        pub mails_dropped: u64,
    }
}

impl MainDevice {
    /// The whole state at this moment. Its cost grows with the number of SubDevices; it sends nothing.
    pub fn snapshot(&mut self) -> Snapshot {
        // Cyclic events get their numbers first, so that those before the moment are part of it.
        let since = self.events_since(u64::MAX);
        let ring = self.ring_status();
        let cables = self.cable_errors();
        Snapshot {
            at_ns: self.supervisor.bus().now().0,
            epoch: since.epoch,
            next_event: since.next,
            activity: self.activity(),
            subdevices: self.subdevice_snapshots(),
            ring: RingSnapshot {
                closed: match ring.state {
                    RingState::Unknown => None,
                    RingState::Closed => Some(true),
                    RingState::Open => Some(false),
                },
                redundant: match ring.redundancy {
                    Redundancy::None | Redundancy::Unknown => None,
                    Redundancy::Ready => Some(true),
                    Redundancy::Lost { .. } => Some(false),
                },
                links: Link::ALL.map(|link| {
                    let status = ring.link(link);
                    LinkSnapshot { carrier: status.carrier, answering: status.answering, al_states: status.al_states }
                }),
                break_at: ring.place.map(|cable| cable_snapshot(cable, [0; 2])),
                changes: ring.changes,
            },
            cables: cables
                .into_iter()
                .map(|it| cable_snapshot(it.cable, [it.errors.invalid_frames, it.errors.lost_links]))
                .collect(),
            clocks: self.clock_snapshots(),
            clocks_locked: self.clocks_locked(),
            groups: self
                .groups()
                .into_iter()
                .map(|group| GroupSnapshot { present: group.present, settled: group.settled, members: group.members })
                .collect(),
            acyclic: acyclic_snapshot(self.counters()),
            events_dropped: self.events_dropped(),
        }
    }

    fn activity(&self) -> Activity {
        let view = self.segment.view();
        if view.is_active() {
            Activity::Active
        } else if view.is_scanning() {
            Activity::Scanning
        } else if view.found().is_some() {
            Activity::Scanned
        } else {
            Activity::Unscanned
        }
    }

    /// The declared SubDevices by index, then those that are known to be undeclared.
    fn subdevice_snapshots(&self) -> Vec<SubDeviceSnapshot> {
        let view = self.segment.view();
        let position = |station: u16| {
            let found = view.found()?.subdevices.iter().find(|info| info.station.0 == station);
            found.map(|info| info.position.0)
        };
        let members = view.members().enumerate().map(|(index, member)| {
            let snapshot = of_member(index, &member, self.known_state(member.phase));
            (Addressed::Member(index), SubDeviceSnapshot { position: position(snapshot.station), ..snapshot })
        });
        let others = view.subdevices().unassigned().filter(UnassignedView::is_undeclared);
        let others = others.map(|it| (Addressed::Undeclared(it.key), of_undeclared(&it)));
        let with_mail = |(subdevice, snapshot)| with_mail(snapshot, self.segment.mailbox_of(subdevice).as_ref());
        members.chain(others).map(with_mail).collect()
    }

    fn clock_snapshots(&self) -> Vec<ClockSnapshot> {
        let clocks = self.clocks().into_iter().map(|clock| ClockSnapshot {
            position: clock.position.0,
            declared: clock.subdevice.map(|subdevice| subdevice.0),
            is_reference: clock.is_reference,
            is_locked: clock.is_locked,
            delay_ns: clock.delay_ns,
            offset_ns: clock.offset_ns,
            drift_ppb: clock.drift_ppb,
            difference_ns: clock.difference_ns,
            worst_ns: clock.worst_ns,
        });
        clocks.collect()
    }
}

fn of_member(index: usize, member: &MemberView<'_>, state: SubDeviceState) -> SubDeviceSnapshot {
    SubDeviceSnapshot {
        declared: Some(index),
        station: member.station.0,
        progress: match state {
            SubDeviceState::Absent => Progress::Absent,
            SubDeviceState::Unknown => Progress::Unknown,
            SubDeviceState::Configuring => Progress::Configuring,
            SubDeviceState::Settled(_) => Progress::Settled,
        },
        target_state: Some(member.target.code()),
        ..member.info.map(|info| of_info(info)).unwrap_or_default()
    }
}

fn of_undeclared(subdevice: &UnassignedView<'_>) -> SubDeviceSnapshot {
    SubDeviceSnapshot {
        position: Some(subdevice.position.0),
        station: subdevice.key.station.0,
        ..subdevice.knowledge.info().map(|info| of_info(info)).unwrap_or_default()
    }
}

/// With what its mailbox has counted, if it was in use.
fn with_mail(subdevice: SubDeviceSnapshot, mailbox: Option<&Mailbox>) -> SubDeviceSnapshot {
    let Some(mailbox) = mailbox else { return subdevice };
    let MailCounters { written, read, unclaimed, .. } = mailbox.counters();
    let ring = mailbox.emergencies();
    SubDeviceSnapshot {
        mailbox_open: mailbox.is_open(),
        mail: [written, read, unclaimed],
        emergencies: [ring.len() as u64, ring.overruns()],
        ..subdevice
    }
}

fn of_info(info: &SubDeviceInfo) -> SubDeviceSnapshot {
    let identity = &info.identity;
    let layout = info.mailbox.unwrap_or_default();
    SubDeviceSnapshot {
        position: Some(info.position.0),
        station: info.station.0,
        alias: info.alias,
        identity: [identity.vendor_id, identity.product_code, identity.revision, identity.serial],
        name: info.name.clone(),
        protocols: info.protocols.0,
        mailbox_bytes: [layout.receive_size, layout.send_size],
        are_pdos_read: info.pdo_source.is_of_dictionary(),
        ..SubDeviceSnapshot::default()
    }
}

fn cable_snapshot(cable: Cable, errors: [u64; 2]) -> CableSnapshot {
    let [near, far] = [cable.near, cable.far].map(|end| end.map(|port| (port.node, port.port)));
    CableSnapshot { near, far, errors }
}

fn acyclic_snapshot(counters: AcyclicCounters) -> AcyclicSnapshot {
    let AcyclicCounters { sent, received, lost, corrupt, foreign, datagrams, resent, timed_out, mails_dropped, .. } =
        counters;
    AcyclicSnapshot { sent, received, lost, corrupt, foreign, datagrams, resent, timed_out, mails_dropped }
}
