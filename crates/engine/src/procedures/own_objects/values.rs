//! Values of the MainDevice's own objects (protocol 10.2): registers are read at each request.

use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{DlStatus, map};

use super::catalogue::{LIST, MAX_MODULES, Object, TEXT_BYTES, Values};
use super::in_its_dictionary::Requested;
use super::seen::Seen;
use super::shared::Shared;
use super::{messages, rates};
use crate::config::groups;
use crate::info::SubDeviceInfo;
use crate::procedures::services::statistics;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::Segment;
use crate::segment::member::{MemberView, Phase};
use crate::supervisor::{Bus, BusError};
use crate::topology::PortOf;

/// Modular device profile (ETG.5001), without a profile of its modules.
const DEVICE_TYPE: u32 = 5001;
const NAME: &[u8] = b"RingCAT";
const HARDWARE_VERSION: &[u8] = b"none";
const SOFTWARE_VERSION: &[u8] = env!("CARGO_PKG_VERSION").as_bytes();
/// Distance between the objects of two SubDevices.
const INDEX_DISTANCE: u16 = 1;
/// Bits of the link status 0x8nnn:35, above them a bit for each port.
const NO_LINK: u8 = 1 << 0;
const LINK_WITHOUT_COMMUNICATION: u8 = 1 << 1;
const MISSING_LINK: u8 = 1 << 2;
const ADDITIONAL_LINK: u8 = 1 << 3;
/// Bits of the flags 0x8nnn:37, above the port of the redundant link.
const GROUP_HEAD: u8 = 1 << 2;
const GROUP_MEMBER: u8 = 1 << 3;

fn u8_(sub_index: u8, value: u8) -> (u8, Vec<u8>) {
    (sub_index, vec![value])
}

fn u16_(sub_index: u8, value: u16) -> (u8, Vec<u8>) {
    (sub_index, value.to_le_bytes().to_vec())
}

fn u32_(sub_index: u8, value: u32) -> (u8, Vec<u8>) {
    (sub_index, value.to_le_bytes().to_vec())
}

/// Counters saturate.
fn counter(sub_index: u8, value: u64) -> (u8, Vec<u8>) {
    u32_(sub_index, u32::try_from(value).unwrap_or(u32::MAX))
}

fn text(sub_index: u8, value: &[u8]) -> (u8, Vec<u8>) {
    (sub_index, value[..value.len().min(TEXT_BYTES)].to_vec())
}

/// All values of an object. If only one entry is `wanted`, other entries that need mailbox requests are zeros.
pub(super) async fn read(seen: &Seen, shared: &Shared, object: Object, wanted: Option<u8>) -> Values {
    match (object, &seen.segment) {
        (Object::DeviceType, _) => vec![u32_(0, DEVICE_TYPE)],
        (Object::Name, _) => vec![text(0, NAME)],
        (Object::HardwareVersion, _) => vec![text(0, HARDWARE_VERSION)],
        (Object::SoftwareVersion, _) => vec![text(0, SOFTWARE_VERSION)],
        // RingCAT has no vendor id.
        (Object::Identity, _) => (1..=4).map(|sub_index| u32_(sub_index, 0)).collect(),
        (Object::DiagnosisHistory, segment) => messages::read(&seen.bus, segment.as_ref()),
        (Object::ModularProfile, _) => vec![u16_(1, INDEX_DISTANCE), u16_(2, MAX_MODULES as u16)],
        (Object::DetectModules, _) => {
            let status = shared.detection.status() as u8;
            vec![u16_(1, 0), u8_(2, status), text(3, &[status, 0, 0, 0, 0, 0])]
        }
        (Object::DetectedAddresses(list), _) => addresses(list, &shared.detection.found(seen)),
        (Object::ConfiguredAddresses(list), segment) => {
            let stations = |segment: &SharedSegment| segment.view().members().map(|member| member.station).collect();
            addresses(list, &segment.as_ref().map_or(Vec::new(), stations))
        }
        (Object::MainDeviceDiagnosis, _) => main_device(seen, shared),
        (Object::DiagnosisControl, _) => vec![u8_(16, 0)],
        (Object::Configuration(index), Some(segment)) => configuration(&seen.bus, segment, index, wanted).await,
        (Object::Information(index), Some(segment)) => information(&seen.bus, segment, index).await,
        (Object::Diagnosis(index), Some(segment)) => diagnosis(seen, shared, segment, index, wanted).await,
        (Object::Configuration(_) | Object::Information(_) | Object::Diagnosis(_), None) => Vec::new(),
    }
}

fn addresses(list: usize, all: &[StationAddress]) -> Values {
    let part = all.chunks(LIST).nth(list).unwrap_or_default();
    (1..=u8::MAX).zip(part).map(|(sub_index, station)| u16_(sub_index, station.0)).collect()
}

fn main_device(seen: &Seen, shared: &Shared) -> Values {
    let (lost, forgotten) = (rates::lost(seen), shared.forgotten.get());
    let rates = shared.rates.borrow_mut().take(seen.bus.now(), rates::sent(seen));
    let state = seen.segment.as_ref().map_or(0, |segment| lowest_state(&segment.view()));
    vec![
        counter(1, lost[0].saturating_sub(forgotten[0])),
        counter(2, lost[1].saturating_sub(forgotten[1])),
        u32_(3, rates[0]),
        u32_(4, rates[1]),
        u16_(16, state),
    ]
}

/// The lowest state of the mandatory SubDevices; 0 while a SubDevice is missing or on its way.
fn lowest_state(segment: &Segment) -> u16 {
    let mandatory = segment.members().filter(|member| !member.config.optional);
    let code = |member: MemberView<'_>| match member.phase {
        Phase::Settled(state) => u16::from(state.code()),
        Phase::Absent | Phase::Configuring => 0,
    };
    mandatory.map(code).min().unwrap_or(0)
}

async fn dl_status(bus: &Bus, segment: &SharedSegment, index: usize) -> Option<[u8; DlStatus::LEN]> {
    let station = segment.view().member(index)?.station;
    bus.fprd_array(station, map::DL_STATUS).await.ok()
}

async fn configuration(bus: &Bus, segment: &SharedSegment, index: usize, wanted: Option<u8>) -> Values {
    let status = dl_status(bus, segment, index).await.map(|bytes| DlStatus::decode(&bytes));
    let requested = Requested::of(segment, index, |sub_index| wanted.is_none_or(|wanted| wanted == sub_index));
    let device_type = requested.device_type(4).await;
    let has_history = requested.has_history(40).await;
    let access = segment.view();
    let Some(member) = access.member(index) else { return Vec::new() };
    let (expected, info) = (&member.config.expected, member.info.map(|info| &**info));
    let planned = member.setup.as_ref().and_then(|setup| setup.plan.mailbox_layout());
    let mailbox = planned.or_else(|| info.and_then(|info| info.mailbox));
    let string = |of: fn(&SubDeviceInfo) -> &str| info.map_or("", of).as_bytes();
    vec![
        u16_(1, member.station.0),
        text(2, string(|info| &info.order_code)),
        text(3, string(|info| &info.name)),
        u32_(4, device_type),
        u32_(5, expected.vendor_id.unwrap_or(0)),
        u32_(6, expected.product_code.unwrap_or(0)),
        u32_(7, expected.revision.or(expected.minimum_revision).unwrap_or(0)),
        u32_(8, expected.serial.unwrap_or(0)),
        u16_(33, mailbox.map_or(0, |mailbox| mailbox.receive_size)),
        u16_(34, mailbox.map_or(0, |mailbox| mailbox.send_size)),
        u8_(35, link_status(&access, member, status)),
        u8_(36, link_preset(&access, member)),
        u8_(37, flags(&access, index, member)),
        u16_(38, info.map_or(0, |info| info.physical_ports)),
        u16_(39, info.map_or(0, |info| info.protocols.0)),
        u8_(40, u8::from(has_history)),
    ]
}

/// The ports with a cable at the scan.
fn preset_ports(segment: &Segment, member: MemberView<'_>) -> [bool; 4] {
    let Some((node, here)) = member.node.and_then(|node| Some((node, segment.cabling().topology.nodes.get(node)?)))
    else {
        return [false; 4];
    };
    [0, 1, 2, 3].map(|port: u8| {
        let is_end = |end: &Option<PortOf>| *end == Some(PortOf { node, port });
        let closes = segment.cabling().cables.iter().any(|(cable, _)| is_end(&cable.near) || is_end(&cable.far));
        port == here.entry_port || here.children[usize::from(port)].is_some() || closes
    })
}

fn link_status(segment: &Segment, member: MemberView<'_>, status: Option<DlStatus>) -> u8 {
    let Some(status) = status else { return NO_LINK };
    let mut bits = 0;
    for (number, (port, preset)) in status.ports.iter().zip(preset_ports(segment, member)).enumerate() {
        let finding = match (preset, port.link, port.communication) {
            (true, false, _) => MISSING_LINK,
            (false, true, _) => ADDITIONAL_LINK,
            (true, true, false) => LINK_WITHOUT_COMMUNICATION,
            (true, true, true) | (false, false, _) => continue,
        };
        bits |= finding | 0x10 << number;
    }
    bits
}

/// Ports 1 to 3: communication, and above it the physical link.
fn link_preset(segment: &Segment, member: MemberView<'_>) -> u8 {
    let ports = preset_ports(segment, member);
    (1..4).filter(|port| ports[*port]).map(|port| 0x11 << (port - 1)).sum()
}

fn flags(segment: &Segment, index: usize, member: MemberView<'_>) -> u8 {
    let ends_at_link =
        segment.cabling().cables.iter().find(|(cable, _)| cable.far.is_none()).and_then(|(cable, _)| cable.near);
    let port = ends_at_link.filter(|end| Some(end.node) == member.node).map_or(0, |end| end.port & 3);
    let groups = groups(segment.members().map(|member| &*member.member.config));
    let head = groups.iter().any(|group| group.first() == Some(&index));
    let group = match (head, member.config.group.is_some()) {
        (true, _) => GROUP_HEAD,
        (false, true) => GROUP_MEMBER,
        (false, false) => 0,
    };
    port | group
}

async fn information(bus: &Bus, segment: &SharedSegment, index: usize) -> Values {
    let status = dl_status(bus, segment, index).await.unwrap_or_default();
    let access = segment.view();
    let Some(member) = access.member(index) else { return Vec::new() };
    let identity = member.info.map(|info| info.identity).unwrap_or_default();
    vec![
        u16_(1, member.station.0),
        u32_(5, identity.vendor_id),
        u32_(6, identity.product_code),
        u32_(7, identity.revision),
        u32_(8, identity.serial),
        (32, status.to_vec()),
    ]
}

/// Register values of a SubDevice; zeros if it does not answer.
#[derive(Default)]
struct Registers {
    al_control: [u8; 2],
    al_status: [u8; 6],
    dl_control: [u8; 4],
    dl_status: Option<DlStatus>,
}

async fn registers(bus: &Bus, station: StationAddress) -> Result<Registers, BusError> {
    let al = bus.both(bus.fprd_array(station, map::AL_CONTROL), bus.fprd_array(station, map::AL_STATUS));
    let dl = bus.both(bus.fprd_array(station, map::DL_CONTROL), bus.fprd_array(station, map::DL_STATUS));
    let ((al_control, al_status), (dl_control, dl_status)) = bus.both(al, dl).await;
    let dl_status = Some(DlStatus::decode(&dl_status?));
    Ok(Registers { al_control: al_control?, al_status: al_status?, dl_control: dl_control?, dl_status })
}

async fn diagnosis(seen: &Seen, shared: &Shared, segment: &SharedSegment, index: usize, wanted: Option<u8>) -> Values {
    let bus = &seen.bus;
    let Some(station) = segment.view().member(index).map(|member| member.station) else { return Vec::new() };
    let kept = &segment.statistics;
    let (registers, counted) = bus.both(registers(bus, station), statistics::read(bus, kept, index, station)).await;
    let registers = registers.unwrap_or_default();
    let requested = Requested::of(segment, index, |sub_index| wanted.is_none_or(|wanted| wanted == sub_index));
    let has_new_message = requested.has_new_message(19).await;
    let counted = counted.ok().or_else(|| kept.find(index)).unwrap_or_default();
    let access = segment.view();
    let Some(member) = access.member(index) else { return Vec::new() };
    let [al_low, al_high, _, _, code_low, code_high] = registers.al_status;
    let ports = registers.dl_status.map(|status| status.ports).unwrap_or_default();
    let connection =
        (0..4).map(|port| u8::from(ports[port].communication) << port | u8::from(ports[port].link) << (port + 4));
    let mut values = vec![
        u16_(1, u16::from_le_bytes([al_low, al_high])),
        u16_(2, u16::from_le_bytes(registers.al_control)),
        u16_(3, u16::from_le_bytes([code_low, code_high])),
        u8_(4, connection.sum()),
        u8_(5, registers.dl_control[1]),
    ];
    for port in 0..4 {
        let station = neighbour(&access, member, port).filter(|_| ports[usize::from(port)].communication);
        values.push(u16_(6 + port, station.map_or(0, |station| station.0)));
    }
    values.extend((10..).zip(&counted.ports).map(|(sub_index, port)| counter(sub_index, port.invalid_frames)));
    let forgotten = shared.forgotten_wkc.borrow().get(index).copied().unwrap_or(0);
    values.extend([
        u32_(14, segment.board.wkc_errors(index).wrapping_sub(forgotten)),
        u32_(15, member.incidents.absences),
        u32_(16, member.incidents.state_changes),
        u8_(17, u8::from(registers.dl_control[1] != 0)),
        u32_(18, segment.mailbox(index).map_or(0, |mailbox| mailbox.last_protocol_error())),
        u8_(19, u8::from(has_new_message)),
    ]);
    values
}

/// The SubDevice at a port at the scan.
fn neighbour(segment: &Segment, member: MemberView<'_>, port: u8) -> Option<StationAddress> {
    let node = member.node?;
    let here = segment.cabling().topology.nodes.get(node)?;
    let other = match here.parent {
        Some((parent, _)) if port == here.entry_port => parent,
        _ => here.children[usize::from(port)]?,
    };
    segment.members().find(|member| member.node == Some(other)).map(|member| member.station)
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: 10.2
    #[test]
    fn a_list_has_255_addresses_and_the_next_has_the_rest() {
        let all: Vec<StationAddress> = (0..300).map(StationAddress).collect();
        let (first, second) = (addresses(0, &all), addresses(1, &all));
        assert_eq!((first.len(), first[0].clone(), first[254].clone()), (255, u16_(1, 0), u16_(255, 254)));
        assert_eq!((second.len(), second[0].clone()), (45, u16_(1, 255)));
        assert!(addresses(2, &all).is_empty());
    }
}
