//! What a scan has found out about a SubDevice, as bytes.

use alloc::string::String;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, RegisterAddress, StationAddress};
use ringcat_wire::register::{DlStatus, Information, PortDescriptor};
use ringcat_wire::sii::{
    CategoryKind, CoeDetails, DcMode, FmmuUsage, GeneralFlags, Identity, MailboxLayout, MailboxProtocols,
    SiiSyncManager, SyncManagerKind,
};

use super::code::{Code, Input, by_number, choice, fields};
use super::error::KnowledgeError;
use crate::direction::Direction;
use crate::info::{
    ControllerInfo, DataWord, InfoWarning, PdoEntryInfo, PdoInfo, PdoSource, SiiExtent, SiiProblem, SubDeviceInfo,
    is_possible,
};

by_number!(Position, u16, |position| position.0, Position);
by_number!(RegisterAddress, u16, |register| register.0, RegisterAddress);
by_number!(StationAddress, u16, |station| station.0, StationAddress);
by_number!(DlStatus, u16, |status| status.bits(), DlStatus::from_bits);
by_number!(CategoryKind, u16, |kind| kind.code(), CategoryKind::from_code);
by_number!(CoeDetails, u8, |details| details.0, CoeDetails);
by_number!(FmmuUsage, u8, |usage| usage.code(), FmmuUsage::from_code);
by_number!(GeneralFlags, u8, |flags| flags.0, GeneralFlags);
by_number!(MailboxProtocols, u16, |protocols| protocols.0, MailboxProtocols);
by_number!(SyncManagerKind, u8, |kind| kind.code(), SyncManagerKind::from_code);
by_number!(DcMode, [u8; DcMode::LEN], DcMode::encode, |bytes| DcMode::decode(&bytes));
by_number!(MailboxLayout, [u8; MailboxLayout::LEN], MailboxLayout::encode, |bytes| MailboxLayout::decode(&bytes));
by_number!(SiiSyncManager, [u8; SiiSyncManager::LEN], SiiSyncManager::encode, |bytes| SiiSyncManager::decode(&bytes));
by_number!(ControllerInfo, [u8; Information::LEN], controller, |bytes| Information::decode(&bytes).into());

fields!(Identity { vendor_id: u32, product_code: u32, revision: u32, serial: u32 });
fields!(DataWord { register: RegisterAddress, value: u16 });
fields!(PdoEntryInfo { index: u16, sub_index: u8, bit_length: u8, data_type: u8, name: String });
fields!(PdoInfo {
    index: u16,
    direction: Direction,
    sync_manager: Option<u8>,
    name: String,
    flags: u16,
    entries: Vec<PdoEntryInfo>,
});
fields!(InfoWarning { category: Option<CategoryKind>, offset: Option<usize>, problem: SiiProblem });

choice!(Direction, "a direction" { 0 = Outputs, 1 = Inputs });
choice!(PdoSource, "a source of PDOs" { 0 = Sii, 1 = Dictionary, 2 = Written, 3 = Outdated });
choice!(SiiExtent, "an extent of an SII" { 0 = Operation, 1 = Clocks, 2 = Complete });
choice!(SiiProblem, "a fault of an SII" {
    0 = Blank,
    1 = Unreadable,
    2 = NoCategories,
    3 = Missing,
    4 = Beyond { announced: usize, left: usize },
    5 = Size { size: usize, end: usize },
    6 = Erased { bytes: usize },
    7 = Mailbox { layout: MailboxLayout, memory_end: u32 },
    8 = NoSyncManagers,
    9 = NoPdos { sync_manager: u8 },
    10 = NoType { sync_manager: u8, got: u8, taken: SyncManagerKind },
    11 = Checksum { expected: u8, got: u16 },
    12 = NoEndMarker,
    13 = Short { expected: usize, got: usize },
    14 = Repeated,
    15 = HalfMailbox { receive_size: u16, send_size: u16 },
    16 = NoMailbox { protocols: u16 },
    17 = NoString { index: u8 },
    18 = SyncManagers { expected: usize, got: usize },
    19 = PdoEntries { pdo: u16, expected: usize, got: usize },
    20 = PdoSyncManager { pdo: u16, sync_manager: u8 },
    21 = PdoDirection { pdo: u16, sync_manager: u8 },
    22 = Dictionary { sync_manager: u8, sii: u32, dictionary: u32 },
    23 = Control { sync_manager: u8, control: u8 },
});

/// The registers of a controller that its data comes from.
fn controller(info: &ControllerInfo) -> [u8; Information::LEN] {
    let information = Information {
        controller_type: info.type_code,
        revision: info.revision,
        build: info.build,
        fmmu_count: info.fmmu_count,
        sync_manager_count: info.sync_manager_count,
        ram_kib: info.ram_kib,
        port_descriptor: PortDescriptor { ports: info.ports },
        features: info.features,
    };
    information.encode()
}

/// [`SubDeviceInfo`] as it is in the bytes.
struct Plain(SubDeviceInfo);

macro_rules! plain {
    ($($field:ident: $of:ty),* $(,)?) => {
        impl Code for Plain {
            const LEAST: usize = 0 $(+ <$of as Code>::LEAST)*;

            fn put(&self, _: &mut Vec<u8>) {}

            fn take(input: &mut Input<'_>) -> Result<Plain, KnowledgeError> {
                Ok(Plain(SubDeviceInfo { $($field: <$of as Code>::take(input)?),* }))
            }
        }

        fn put_plain(info: &SubDeviceInfo, out: &mut Vec<u8>) {
            $(<$of as Code>::put(&info.$field, out);)*
        }
    };
}

plain! {
    position: Position,
    station: StationAddress,
    extent: SiiExtent,
    alias: u16,
    identity: Identity,
    identification: Option<u16>,
    data_words: Vec<DataWord>,
    controller: ControllerInfo,
    device_emulation: bool,
    dl_status: DlStatus,
    receive_times: Option<[u32; 4]>,
    name: String,
    order_code: String,
    group: String,
    image: String,
    mailbox: Option<MailboxLayout>,
    bootstrap: Option<MailboxLayout>,
    protocols: MailboxProtocols,
    coe: CoeDetails,
    flags: GeneralFlags,
    id_switch_address: u16,
    physical_ports: u16,
    ebus_current_ma: i16,
    sync_managers: Vec<SiiSyncManager>,
    fmmu_usages: Vec<FmmuUsage>,
    pdos: Vec<PdoInfo>,
    pdo_source: PdoSource,
    dc_modes: Vec<DcMode>,
    warnings: Vec<InfoWarning>,
}

/// As the collection of an SII does, decoding refuses mailboxes that cannot exist, and more SyncManagers than the
/// controller has.
impl Code for SubDeviceInfo {
    const LEAST: usize = Plain::LEAST;

    fn put(&self, out: &mut Vec<u8>) {
        put_plain(self, out);
    }

    fn take(input: &mut Input<'_>) -> Result<SubDeviceInfo, KnowledgeError> {
        let mailboxes = input.expected("a SubDevice with mailboxes within its memory");
        let managers = input.expected("a SubDevice with as many SyncManagers as its controller");
        let Plain(info) = Plain::take(input)?;
        let layouts = [&info.mailbox, &info.bootstrap];
        if layouts.into_iter().flatten().any(|layout| !is_possible(layout, &info.controller)) {
            return Err(mailboxes);
        }
        if info.sync_managers.len() > usize::from(info.controller.sync_manager_count) {
            return Err(managers);
        }
        Ok(info)
    }
}
