//! A network file from a scan: the SubDevices as they were found, with the process data that a MainDevice exchanges
//! without a declaration.

use std::time::Duration;

use ringcat_engine::Topology;
use ringcat_engine::config::SubDeviceConfig;
use ringcat_engine::info::{Direction, SubDeviceInfo};
use ringcat_engine::{AreaPlan, MappedPdo, plan};
use ringcat_wire::sii::{MailboxLayout, Pdo as SiiPdo};

use super::model::{
    self, Buffer, CheckRevision, Clocks, Domain, Entry, Mailbox, NetworkFile, Pdo, PluggedInto, Protocol, Redundancy,
    SubDevice, SyncManager,
};
use super::unique::Names;
use super::values::Time;
use crate::compare::ports;
use crate::esi::sii::name_of;

/// Name of the only domain.
const DOMAIN: &str = "cycle";

/// Choices for a network file from a scan.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ScanOptions {
    /// Name of the network.
    pub name: String,
    /// Cycle time.
    pub period: Duration,
    /// The scan used two links.
    pub ring: bool,
    /// Distributed clocks are used, if a SubDevice has one.
    pub clocks: bool,
    /// SubDevices with an alias that no other has are found by it.
    pub by_alias: bool,
    /// Comparison of revisions.
    pub check_revision: CheckRevision,
    /// Serial numbers are compared.
    pub check_serial: bool,
}

impl ScanOptions {
    /// A network with one cycle: SubDevices by position, vendor and product compared.
    pub fn new(name: impl Into<String>, period: Duration) -> ScanOptions {
        ScanOptions {
            name: name.into(),
            period,
            ring: false,
            clocks: false,
            by_alias: false,
            check_revision: CheckRevision::None,
            check_serial: false,
        }
    }
}

impl NetworkFile {
    /// The network that a scan found. SubDevices whose SII contradicts itself have no process data of their own in the
    /// file; the engine reports them.
    pub fn from_scan(found: &[SubDeviceInfo], topology: &Topology, options: &ScanOptions) -> NetworkFile {
        let names = names(found);
        let alone = |alias: u16| alias != 0 && found.iter().filter(|info| info.alias == alias).count() == 1;
        let subdevice = |(at, info): (usize, &SubDeviceInfo)| {
            let by_alias = options.by_alias && alone(info.alias);
            let identity = &info.identity;
            SubDevice {
                name: names[at].clone(),
                position: (!by_alias).then_some(info.position.0),
                alias: by_alias.then_some(info.alias),
                vendor: Some(identity.vendor_id),
                product: Some(identity.product_code),
                revision: Some(identity.revision),
                check_revision: options.check_revision,
                serial: Some(identity.serial).filter(|serial| options.check_serial && *serial != 0),
                order_code: printable(&info.order_code),
                ports: ports(info),
                plugged_into: plugged_into(info, topology, &names),
                mailbox: mailbox(info),
                sync_manager: sync_managers(info),
                ..SubDevice::default()
            }
        };
        NetworkFile {
            ringcat_network: model::VERSION,
            name: options.name.clone(),
            redundancy: Redundancy { ring: options.ring, ..Redundancy::default() },
            clocks: options.clocks.then(|| clocks(found, &names)).flatten(),
            domain: vec![Domain {
                name: DOMAIN.to_owned(),
                period: Time(options.period),
                under_way: 1,
                send_again: false,
            }],
            subdevice: found.iter().enumerate().map(subdevice).collect(),
            ..NetworkFile::default()
        }
    }
}

/// A name for each SubDevice: order code or name, with a number where it occurs again.
fn names(found: &[SubDeviceInfo]) -> Vec<String> {
    let mut names = Names::default();
    let unique = |info: &SubDeviceInfo| {
        let own = [&info.order_code, &info.name].into_iter().map(|text| printable(text)).find(|text| !text.is_empty());
        names.unique(own.unwrap_or_else(|| format!("SubDevice {}", info.position)))
    };
    found.iter().map(unique).collect()
}

/// Clocks with the reference that the engine takes where none is named, the first SubDevice with a clock. An ENI made
/// from the file names the same reference.
fn clocks(found: &[SubDeviceInfo], names: &[String]) -> Option<Clocks> {
    let first = found.iter().position(|info| info.controller.features.dc)?;
    Some(Clocks { reference: Some(names[first].clone()), ..Clocks::default() })
}

/// A text of an EEPROM without control characters and outer blanks.
fn printable(text: &str) -> String {
    let text: String = text.chars().filter(|character| !character.is_control()).collect();
    text.trim().to_owned()
}

fn plugged_into(info: &SubDeviceInfo, topology: &Topology, names: &[String]) -> Option<PluggedInto> {
    if topology.is_assumed() {
        return None;
    }
    let near = topology.connection_to(info.position)?.near;
    Some(PluggedInto { subdevice: names.get(usize::from(near.position().0))?.clone(), port: near.port() })
}

fn mailbox(info: &SubDeviceInfo) -> Option<Mailbox> {
    let layout = info.mailbox.as_ref().filter(|layout| layout.receive_size > 0 && layout.send_size > 0)?;
    let buffers = |layout: &MailboxLayout| {
        let write = Buffer { start: layout.receive_offset, length: layout.receive_size };
        (write, Buffer { start: layout.send_offset, length: layout.send_size })
    };
    let fits = |buffer: &Buffer| u32::from(buffer.start) + u32::from(buffer.length) <= 0x1_0000 && buffer.length > 0;
    let (write, read) = Some(buffers(layout)).filter(|(write, read)| fits(write) && fits(read))?;
    let boot = info.bootstrap.as_ref().map(buffers).filter(|(write, read)| fits(write) && fits(read));
    let known = info.protocols;
    let protocols = [
        (Protocol::AoE, known.aoe()),
        (Protocol::EoE, known.eoe()),
        (Protocol::CoE, known.coe()),
        (Protocol::FoE, known.foe()),
        (Protocol::SoE, known.soe()),
        (Protocol::VoE, known.voe()),
    ];
    Some(Mailbox {
        write,
        read,
        boot_write: boot.map(|boot| boot.0),
        boot_read: boot.map(|boot| boot.1),
        protocols: protocols.into_iter().filter(|(_, has)| *has).map(|(protocol, _)| protocol).collect(),
        complete_access: info.coe.complete_access(),
        pdo_assign: info.coe.pdo_assign(),
        pdo_config: info.coe.pdo_configuration(),
    })
}

/// The SyncManagers as a MainDevice sets them up without a declaration.
fn sync_managers(info: &SubDeviceInfo) -> Vec<SyncManager> {
    let Ok(plan) = plan(&SubDeviceConfig::from_info(info), info) else { return Vec::new() };
    plan.process_data.iter().map(|area| sync_manager(info, area)).collect()
}

fn sync_manager(info: &SubDeviceInfo, area: &AreaPlan) -> SyncManager {
    let described = info.sync_managers.get(usize::from(area.sync_manager));
    SyncManager {
        number: area.sync_manager,
        direction: match area.direction {
            Direction::Outputs => model::Direction::Outputs,
            Direction::Inputs => model::Direction::Inputs,
        },
        start: Some(area.physical),
        control: described.map(|sm| sm.control),
        op_only: area.op_only,
        length: (area.pdos.is_empty() && area.length > 0).then_some(area.length),
        pdo: area.pdos.iter().map(|pdo| of_pdo(info, pdo)).collect(),
        ..SyncManager::default()
    }
}

/// A PDO with the names and types of the SII. It is `fixed` if the SubDevice accepts PDO mappings (PdoConfig) and
/// the SII marks this PDO as fixed.
fn of_pdo(info: &SubDeviceInfo, pdo: &MappedPdo) -> Pdo {
    let described = info.pdo(pdo.index);
    let takes_mappings = info.protocols.coe() && info.coe.pdo_configuration();
    let texts = described.map(|described| &described.entries[..]).unwrap_or_default();
    let entry = |(at, mapped): (usize, &ringcat_engine::MappedEntry)| {
        let described = texts.get(at);
        Entry {
            index: mapped.index,
            sub: mapped.sub_index,
            bits: mapped.bit_length,
            name: described.map(|entry| printable(&entry.name)).unwrap_or_default(),
            data_type: described
                .filter(|_| mapped.index != 0)
                .map(|it| name_of(it.data_type.into()))
                .unwrap_or_default(),
        }
    };
    let entries: Vec<Entry> = pdo.entries.iter().enumerate().map(entry).collect();
    Pdo {
        index: pdo.index,
        name: described.map(|described| printable(&described.name)).unwrap_or_default(),
        fixed: takes_mappings && described.is_some_and(|described| described.flags & SiiPdo::FIXED != 0),
        // The format has no entries without bits: such a mapping is left to the SII.
        entries: Some(entries).filter(|entries| entries.iter().all(|entry| entry.bits > 0)),
    }
}
