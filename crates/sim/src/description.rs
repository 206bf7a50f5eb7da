//! Description of a simulated SubDevice: identity, ports, SyncManagers, PDOs, mailbox, clocks, timing and behaviour.
//!
//! Input: values from the [`catalogue`](crate::catalogue), an application, or a real SII image
//! ([`DeviceDescription::from_sii`](crate::sii_image)). Output: the SII image, the object dictionary and the settings
//! of the controller are derived from it, so that they cannot contradict each other (protocol 4, 5.2, 6.3).

mod services;

use core::time::Duration;

use ringcat_wire::register::{PortKind, SyncManagerControl, SyncManagerMode, map};
use ringcat_wire::sii::{
    CoeDetails, DcMode, FmmuUsage, Identity, MailboxLayout, MailboxProtocols, PdoDirection, SiiSyncManager,
    SyncManagerKind,
};

use crate::application::Behaviour;
use crate::application::dictionary::Object;
use crate::controller::{ClockErrors, ControllerConfig, MAX_UNITS, Wander};

pub use crate::data_type;
pub use services::{AoeDescription, EoeDescription, EoeEnd, FoeDescription, Services, SoeDescription};

/// One SyncManager of the SII (protocol 4.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SyncManagerDescription {
    /// Physical start address.
    pub start: u16,
    /// Length in bytes with the default PDO assignment.
    pub length: u16,
    /// Control byte of register 0x0804 + 8n.
    pub control: u8,
    /// Enable byte of the SII entry; a MainDevice copies bit 0 to the activate register.
    pub enable: u8,
    /// Type of the SyncManager.
    pub kind: SyncManagerKind,
}

/// One process data object (protocol 4.5).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoDescription {
    /// `Tx` = inputs of the MainDevice, `Rx` = outputs.
    pub direction: PdoDirection,
    /// Object index of the mapping, 0x16xx or 0x1Axx.
    pub index: u16,
    /// Name.
    pub name: String,
    /// SyncManager it is assigned to by default.
    pub sync_manager: Option<u8>,
    /// Flags of the SII entry, unchanged.
    pub flags: u16,
    /// Its entries, in order.
    pub entries: Vec<PdoEntryDescription>,
}

impl PdoDescription {
    /// Sum of the entries in bits.
    pub fn bit_length(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.bit_length)).sum()
    }
}

/// One entry of a PDO; index 0 is a gap (protocol 4.5).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PdoEntryDescription {
    /// Object index, 0 for a gap.
    pub index: u16,
    /// Subindex.
    pub sub_index: u8,
    /// Name.
    pub name: String,
    /// Data type code, see [`data_type`].
    pub data_type: u8,
    /// Length in bits.
    pub bit_length: u8,
}

/// The mailbox of a SubDevice (protocol 4.1, 4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MailboxDescription {
    /// Addresses and sizes in PREOP and above.
    pub standard: MailboxLayout,
    /// Addresses and sizes in BOOT; all zero if BOOT is not supported.
    pub bootstrap: MailboxLayout,
    /// Protocols in the SII.
    pub protocols: MailboxProtocols,
    /// CoE features in the general category.
    pub coe_details: CoeDetails,
    /// Time from a request to its response.
    pub response_time: Duration,
}

impl MailboxDescription {
    /// Whether the device answers SDO requests.
    pub fn has_coe(&self) -> bool {
        self.protocols.coe()
    }
}

/// Distributed clock of a SubDevice (protocol 3.12, 4.6).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DcDescription {
    /// 64-bit registers (otherwise 32-bit).
    pub wide: bool,
    /// Operation modes of the SII; an activation value without a mode is refused with 0x0030.
    pub modes: Vec<DcMode>,
    /// Smallest accepted SYNC0 cycle; shorter cycles are refused with 0x0035.
    pub minimum_cycle_ns: u32,
}

/// Time that the application takes to reach each state (protocol 5.4 has the time limits of a MainDevice).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TransitionTimes {
    /// INIT from any state.
    pub to_init: Duration,
    /// PREOP or BOOT from INIT.
    pub to_preop: Duration,
    /// SAFEOP from PREOP.
    pub to_safeop: Duration,
    /// OP from SAFEOP; the wait for valid outputs is added.
    pub to_op: Duration,
    /// SAFEOP from OP, PREOP from SAFEOP or OP.
    pub back: Duration,
}

impl TransitionTimes {
    /// The same time for each transition.
    pub const fn all(time: Duration) -> TransitionTimes {
        TransitionTimes { to_init: time, to_preop: time, to_safeop: time, to_op: time, back: time }
    }
}

impl Default for TransitionTimes {
    fn default() -> Self {
        TransitionTimes::all(Duration::from_millis(1))
    }
}

/// A complete SubDevice.
#[derive(Clone, Debug)]
pub struct DeviceDescription {
    /// Name of this device in the segment.
    pub name: String,
    /// Name in the SII, if it must differ from that of others: then SIIs of the same structure differ in their fixed
    /// area. `None`: `name` is used, and the fixed areas are equal.
    pub name_in_sii: Option<String>,
    /// Order code, string of the SII.
    pub order_code: String,
    /// Group, string of the SII.
    pub group: String,
    /// Vendor, product, revision, serial number.
    pub identity: Identity,
    /// Configured station alias.
    pub alias: u16,
    /// Value of the identification switch; `None` = the request is not supported (protocol 5.3).
    pub identification: Option<u16>,
    /// Physical address of the identification switch; `None` = it is not in memory (protocol 4.3).
    pub id_switch_address: Option<u16>,
    /// A word of the memory that the application sets at power-on and whenever it reaches INIT, as address and value:
    /// an identification that the SII need not name (protocol 4.3).
    pub data_word: Option<(u16, u16)>,
    /// Kind of each port.
    pub ports: [PortKind; 4],
    /// Usage of the FMMUs, also their number in the SII.
    pub fmmus: Vec<FmmuUsage>,
    /// FMMUs of the controller; `None`: 8.
    pub controller_fmmus: Option<u8>,
    /// FMMU registers take effect on the way from PREOP to SAFEOP, until that state is left; later writes have no
    /// effect.
    pub latches_fmmus: bool,
    /// SyncManagers in order.
    pub sync_managers: Vec<SyncManagerDescription>,
    /// Process data objects, inputs and outputs.
    pub pdos: Vec<PdoDescription>,
    /// Objects in addition to the derived ones; they replace those with the same index.
    pub objects: Vec<Object>,
    /// Objects of a device description that the simulator derives itself: the derived objects take their names from
    /// here. Those that it does not derive are in the dictionary as described.
    pub described: Vec<Object>,
    /// Indices of objects that a MainDevice cannot access: for it they do not exist.
    pub left_out: Vec<u16>,
    /// The dictionary falls back to that of power-on whenever the device is in INIT.
    pub forgets_pdos_in_init: bool,
    /// Mailbox, if there is one.
    pub mailbox: Option<MailboxDescription>,
    /// Settings of the mailbox protocols.
    pub services: Services,
    /// Distributed clock, if there is one.
    pub dc: Option<DcDescription>,
    /// PDI type of register 0x0140.
    pub pdi_type: u8,
    /// Register 0x0141 except bit 0, which is [`DeviceDescription::emulation`].
    pub esc_configuration: u8,
    /// Registers 0x0150 to 0x0153.
    pub pdi_configuration: [u8; 4],
    /// The controller copies AL control to AL status; no application checks requests (protocol 3.4).
    pub emulation: bool,
    /// Whether process data is refused without a running watchdog (0x001F).
    pub watchdog_required: bool,
    /// Time that the application waits for outputs between SAFEOP and OP before it refuses with 0x0019.
    pub outputs_timeout: Duration,
    /// Time after INIT in which the application refuses SAFEOP (0x0052): its hardware is not ready yet.
    pub preop_settling: Duration,
    /// Current drawn from the E-bus; negative = supplied.
    pub ebus_current_ma: i16,
    /// Durations of the state transitions.
    pub transitions: TransitionTimes,
    /// Size of the EEPROM; grows if the content needs more.
    pub sii_size_bytes: usize,
    /// Duration of each EEPROM command.
    pub sii_busy: Duration,
    /// Whether the controller reads eight bytes of SII at a time.
    pub eight_byte_sii: bool,
    /// Delay of a pass through the processing unit, if it differs from that of the segment.
    pub processing_delay: Option<Duration>,
    /// Delay of a pass without the processing unit, if it differs from that of the segment.
    pub forwarding_delay: Option<Duration>,
    /// Error of the local clock.
    pub clock_drift_ppb: i64,
    /// Change of the drift over time.
    pub clock_wander: Wander,
    /// Maximum random delay of the detected arrival of a frame.
    pub receive_jitter: Duration,
    /// Whether the controller latches receive times of frames in processing direction only, unless 0x0936 selects
    /// otherwise.
    pub latches_processing_only: bool,
    /// Whether the controller does not distinguish frames when it latches receive times: other frames on the wire
    /// change them.
    pub latches_any_frame: bool,
    /// Value of the local clock at power-on.
    pub clock_start_ns: u64,
    /// Source of the inputs.
    pub behaviour: Behaviour,
    /// A real image to use instead of one derived from this description.
    pub sii_image: Option<Vec<u8>>,
}

impl DeviceDescription {
    /// Imperfections of the clock.
    pub fn clock_errors(&self) -> ClockErrors {
        ClockErrors { drift_ppb: self.clock_drift_ppb, wander: self.clock_wander, receive_jitter: self.receive_jitter }
    }

    /// A device without process data, mailbox and clock: two MII ports, state machine in an application.
    pub fn plain(name: &str, identity: Identity) -> DeviceDescription {
        DeviceDescription {
            name: name.into(),
            name_in_sii: None,
            order_code: name.into(),
            group: String::from("RingCAT"),
            identity,
            alias: 0,
            identification: None,
            id_switch_address: None,
            data_word: None,
            ports: [PortKind::Mii, PortKind::Mii, PortKind::NotImplemented, PortKind::NotImplemented],
            fmmus: Vec::new(),
            controller_fmmus: None,
            latches_fmmus: false,
            sync_managers: Vec::new(),
            pdos: Vec::new(),
            objects: Vec::new(),
            described: Vec::new(),
            left_out: Vec::new(),
            forgets_pdos_in_init: false,
            mailbox: None,
            services: Services::default(),
            dc: None,
            pdi_type: 0x05,
            esc_configuration: 0,
            pdi_configuration: [0; 4],
            emulation: false,
            watchdog_required: false,
            outputs_timeout: Duration::from_secs(1),
            preop_settling: Duration::ZERO,
            ebus_current_ma: 0,
            transitions: TransitionTimes::default(),
            sii_size_bytes: 512,
            sii_busy: Duration::from_micros(500),
            eight_byte_sii: true,
            processing_delay: None,
            forwarding_delay: None,
            clock_drift_ppb: 0,
            clock_wander: Wander::default(),
            receive_jitter: Duration::ZERO,
            latches_processing_only: false,
            latches_any_frame: false,
            clock_start_ns: 0,
            behaviour: Behaviour::default(),
            sii_image: None,
        }
    }

    /// PDOs that are assigned to SyncManager `number` by default, in order.
    pub fn default_assignment(&self, number: u8) -> impl Iterator<Item = &PdoDescription> {
        self.pdos.iter().filter(move |pdo| pdo.sync_manager == Some(number))
    }

    /// Length that SyncManager `number` must have with the default assignment: the PDOs determine it if there are any,
    /// also PDOs without bits; otherwise the entry of the SyncManager if that is enabled.
    pub fn default_length(&self, number: u8) -> u16 {
        if self.default_assignment(number).next().is_some() {
            let bits: u32 = self.default_assignment(number).map(PdoDescription::bit_length).sum();
            return u16::try_from(bits.div_ceil(8)).unwrap_or(u16::MAX);
        }
        let entry = self.sync_managers.get(usize::from(number));
        entry.filter(|entry| entry.enable & SiiSyncManager::ENABLE != 0).map_or(0, |entry| entry.length)
    }

    /// KiB of process RAM sufficient for all mailboxes and SyncManagers, with three buffers where needed; the usual 8
    /// if that is enough.
    pub fn ram_kib(&self) -> u8 {
        /// RAM of an ET1100.
        const USUAL: u32 = 8;
        /// Maximum in the address space.
        const MOST: u32 = 60;
        let managers = (0u8..).zip(&self.sync_managers).map(|(number, entry)| {
            let buffered = SyncManagerControl::from_bits(entry.control).mode == SyncManagerMode::Buffered;
            let length = u32::from(self.default_length(number).max(entry.length));
            u32::from(entry.start) + length * if buffered { 3 } else { 1 }
        });
        let mailboxes = self.mailbox.iter().flat_map(|mailbox| [mailbox.standard, mailbox.bootstrap]).flat_map(|it| {
            let end = |start: u16, size: u16| u32::from(start) + u32::from(size);
            [end(it.receive_offset, it.receive_size), end(it.send_offset, it.send_size)]
        });
        let end = managers.chain(mailboxes).max().unwrap_or(0);
        let needed = end.saturating_sub(u32::from(map::PROCESS_RAM.0)).div_ceil(1024);
        needed.clamp(USUAL, MOST) as u8
    }

    /// SyncManagers of the controller: the number in the description, at least those of an ET1100.
    pub fn sync_manager_count(&self) -> u8 {
        let described = u8::try_from(self.sync_managers.len()).unwrap_or(u8::MAX);
        described.clamp(ControllerConfig::default().sync_manager_count, MAX_UNITS)
    }

    /// Sets another size of both mailboxes and moves the process data after them; false for a device without a mailbox
    /// and for one with a real image.
    pub fn set_mailbox_bytes(&mut self, bytes: u16) -> bool {
        let Some(mailbox) = self.mailbox.as_mut().filter(|_| self.sii_image.is_none()) else {
            return false;
        };
        let old = mailbox.standard;
        let send_offset = old.receive_offset + bytes;
        mailbox.standard = MailboxLayout { receive_size: bytes, send_offset, send_size: bytes, ..old };
        let (old_end, new_end) = (old.send_offset + old.send_size, send_offset + bytes);
        for entry in &mut self.sync_managers {
            match entry.kind {
                SyncManagerKind::MailboxOut => entry.length = bytes,
                SyncManagerKind::MailboxIn => (entry.start, entry.length) = (send_offset, bytes),
                _ if entry.start >= old_end => entry.start = entry.start - old_end + new_end,
                _ => {}
            }
        }
        true
    }

    /// Whether a SyncManager is for process data, with or without PDOs that describe it.
    pub fn has_process_data(&self) -> bool {
        self.sync_managers.iter().any(|it| matches!(it.kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs))
    }

    /// Number of the first SyncManager of a kind.
    pub fn sync_manager_of(&self, kind: SyncManagerKind) -> Option<u8> {
        self.sync_managers.iter().position(|entry| entry.kind == kind).and_then(|place| u8::try_from(place).ok())
    }

    /// Whether the device answers SDO requests.
    pub fn has_coe(&self) -> bool {
        self.mailbox.is_some_and(|mailbox| mailbox.has_coe())
    }
}
