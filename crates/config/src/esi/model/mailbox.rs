//! The mailbox of a device: protocols, their features, start-up commands.

/// Protocols of a mailbox; `Some` and `true` = supported.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Mailbox {
    /// Line in the file.
    pub line: u32,
    /// Lost mail is repeated (data link layer).
    pub data_link_layer: bool,
    /// ADS over EtherCAT.
    pub aoe: Option<AoeSettings>,
    /// Ethernet over EtherCAT.
    pub eoe: Option<EoeSettings>,
    /// CAN application protocol.
    pub coe: Option<CoeSettings>,
    /// Files.
    pub foe: bool,
    /// Servo drive profile: number of channels, start-up commands.
    pub soe: Option<(u8, Vec<SoeCommand>)>,
    /// Vendor protocol.
    pub voe: bool,
}

/// Features of ADS over EtherCAT.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AoeSettings {
    /// The device forwards ADS between its channels.
    pub is_router: bool,
    /// The configuration tool chooses its net id.
    pub generate_net_id: bool,
    /// Its net id is sent to it.
    pub initialize_net_id: bool,
    /// Start-up commands.
    pub commands: Vec<RawCommand>,
}

/// Features of Ethernet over EtherCAT.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EoeSettings {
    /// The device takes IP settings.
    pub takes_ip: bool,
    /// The device takes a MAC address.
    pub takes_mac: bool,
    /// The device appends time stamps.
    pub time_stamps: bool,
    /// Start-up commands.
    pub commands: Vec<RawCommand>,
}

/// Features of CoE.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct CoeSettings {
    /// SDO information services.
    pub sdo_info: bool,
    /// 0x1C1x can be written.
    pub pdo_assign: bool,
    /// 0x16xx and 0x1Axx can be written.
    pub pdo_config: bool,
    /// Sizes and mapping are to be read from the device.
    pub pdo_upload: bool,
    /// SDO complete access.
    pub complete_access: bool,
    /// Segmented transfers; `None` if not stated.
    pub segmented: Option<bool>,
    /// The diagnosis history 0x10F3 exists.
    pub diagnosis_history: bool,
    /// Uploads state the largest length that the MainDevice takes.
    pub upload_with_max_length: bool,
    /// Objects of the time distribution exist.
    pub time_distribution: bool,
    /// Electronic data sheet, a file of CANopen.
    pub eds_file: Option<String>,
    /// Start-up commands.
    pub commands: Vec<CoeCommand>,
}

/// State change at which a start-up command is sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Transition {
    /// INIT to PREOP.
    Ip,
    /// PREOP to SAFEOP.
    #[default]
    Ps,
    /// SAFEOP to OP.
    So,
    /// SAFEOP to PREOP.
    Sp,
    /// OP to PREOP.
    Op,
    /// OP to SAFEOP.
    Os,
}

/// A download by SDO.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CoeCommand {
    /// Line in the file.
    pub line: u32,
    /// When it is sent.
    pub transitions: Vec<Transition>,
    /// Index of the object.
    pub index: super::SlotIndex,
    /// Subindex.
    pub sub_index: u8,
    /// The value, little-endian.
    pub data: Vec<u8>,
    /// The whole object is written.
    pub complete_access: bool,
    /// A module's command for the same object replaces it.
    pub overwritten_by_module: bool,
    /// Comment.
    pub comment: String,
}

/// A write of an IDN.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SoeCommand {
    /// Line in the file.
    pub line: u32,
    /// When it is sent.
    pub transitions: Vec<Transition>,
    /// Drive number.
    pub channel: u8,
    /// The IDN.
    pub idn: u16,
    /// The value.
    pub data: Vec<u8>,
    /// Comment.
    pub comment: String,
}

/// A message of AoE or EoE as bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawCommand {
    /// Line in the file.
    pub line: u32,
    /// When it is sent.
    pub transitions: Vec<Transition>,
    /// The message.
    pub data: Vec<u8>,
    /// Comment.
    pub comment: String,
}
