//! Whether the controller has the SyncManagers, FMMUs and memory of a plan (protocol 3.1, 3.11, 5.2), and the SubDevice
//! the mailbox protocols.

use alloc::vec::Vec;

use ringcat_wire::mailbox::Header;
use ringcat_wire::mailbox::foe::FoeMessage;
use ringcat_wire::register::{SyncManager, SyncManagerDirection};

use super::areas::{PROCESS_RAM, occupied};
use super::error::PlanProblem;
use super::subdevice::{AreaPlan, SmPlan};
use crate::config::{
    FileRead, FileWrite, IdnRead, IdnWrite, MailMessage, SdoDownload, SdoUpload, StartupAction, StartupCommand,
    Transition,
};
use crate::info::SubDeviceInfo;
use crate::order::InOrder;

/// Checks mailbox and process data SyncManagers against the controller and against each other.
pub(super) fn check(info: &SubDeviceInfo, mailbox: &[SmPlan], areas: &[AreaPlan]) -> Result<(), PlanProblem> {
    let available = info.controller.sync_manager_count;
    if let Some(sm) = mailbox.iter().find(|sm| sm.index >= available) {
        return Err(PlanProblem::NoSuchSyncManager { sync_manager: sm.index, available });
    }
    let areas = areas.iter().map(|area| (area.sync_manager, &area.register));
    let process_data = areas.clone().filter(|(_, register)| register.length > 0).count();
    if process_data > usize::from(info.controller.fmmu_count) {
        return Err(PlanProblem::TooFewFmmus { expected: process_data, got: info.controller.fmmu_count });
    }
    let mut spans: Vec<Span> = mailbox
        .iter()
        .map(|sm| (sm.index, &sm.register))
        .chain(areas)
        .filter(|(_, register)| register.length > 0)
        .map(|(index, register)| Span::of(index, register))
        .collect();
    for span in &spans {
        inside(info, span)?;
    }
    spans.put_in_order_by_key(|span| span.start);
    match spans.windows(2).find(|pair| pair[0].end > u32::from(pair[1].start)) {
        Some([a, b]) => Err(PlanProblem::Overlap {
            first: a.index,
            first_bytes: u32::from(a.start)..a.end,
            second: b.index,
            second_bytes: u32::from(b.start)..b.end,
        }),
        _ => Ok(()),
    }
}

/// Mailbox protocols that a SubDevice supports.
#[derive(Clone, Copy)]
pub(super) struct SupportedProtocols {
    coe: bool,
    soe: bool,
    eoe: bool,
    aoe: bool,
    voe: bool,
    foe: bool,
}

impl SupportedProtocols {
    /// From the SII; a configuration file that declares the mailboxes overrides it.
    pub(super) fn new(declared: bool, info: &SubDeviceInfo, mailbox: bool) -> SupportedProtocols {
        let protocols = info.protocols;
        SupportedProtocols {
            coe: mailbox && (declared || protocols.coe()),
            soe: mailbox && (declared || protocols.soe()),
            eoe: mailbox && (declared || protocols.eoe()),
            aoe: mailbox && (declared || protocols.aoe()),
            voe: mailbox && (declared || protocols.voe()),
            foe: mailbox && (declared || protocols.foe()),
        }
    }
}

/// Whether a SubDevice supports a start-up command.
pub(super) fn command(supported: SupportedProtocols, command: &StartupCommand) -> Result<(), PlanProblem> {
    let is_register = matches!(command.action, StartupAction::Register(_));
    if command.transition == Transition::Ii && !is_register {
        return Err(PlanProblem::NoMailInInit);
    }
    match &command.action {
        StartupAction::Sdo(SdoDownload { index, sub_index, .. })
        | StartupAction::Upload(SdoUpload { index, sub_index, .. })
            if !supported.coe =>
        {
            Err(PlanProblem::NoCoe { index: *index, sub_index: *sub_index })
        }
        StartupAction::Idn(IdnWrite { drive, idn, .. }) if !supported.soe => {
            Err(PlanProblem::NoSoe { drive: *drive, idn: *idn })
        }
        StartupAction::IdnRead(IdnRead { drive, idn, .. }) if !supported.soe => {
            Err(PlanProblem::NoSoe { drive: *drive, idn: *idn })
        }
        StartupAction::Ip(_) if !supported.eoe => Err(PlanProblem::NoEoe),
        StartupAction::Mail(MailMessage::Aoe(_)) if !supported.aoe => Err(PlanProblem::NoProtocol("AoE")),
        StartupAction::Mail(MailMessage::Voe(_)) if !supported.voe => Err(PlanProblem::NoProtocol("VoE")),
        StartupAction::FileWrite(_) | StartupAction::FileRead(_) if !supported.foe => {
            Err(PlanProblem::NoProtocol("FoE"))
        }
        StartupAction::Mail(message) if !message.is_sound() => Err(PlanProblem::Message),
        StartupAction::Register(command) if !command.is_sound() => {
            let (data, mask) = command.lengths();
            Err(PlanProblem::RegisterCommand { register: command.address, data, mask })
        }
        StartupAction::Sdo(_)
        | StartupAction::Upload(_)
        | StartupAction::Idn(_)
        | StartupAction::IdnRead(_)
        | StartupAction::Mail(_)
        | StartupAction::FileWrite(_)
        | StartupAction::FileRead(_)
        | StartupAction::Ip(_)
        | StartupAction::Register(_) => Ok(()),
    }
}

/// Bytes of the mailboxes that the SubDevice reads, in PREOP and above, and in BOOT.
#[derive(Clone, Copy)]
pub(super) struct MailboxSizes {
    standard: Option<u16>,
    bootstrap: Option<u16>,
}

impl MailboxSizes {
    pub(super) fn new(mailbox: &[SmPlan], bootstrap: &[SmPlan]) -> MailboxSizes {
        let written = |pair: &[SmPlan]| pair.first().map(|sm| sm.register.length);
        MailboxSizes { standard: written(mailbox), bootstrap: written(bootstrap) }
    }

    /// Whether the message of a command, or the request with the name of a file, fits its mailbox.
    pub(super) fn holds(self, command: &StartupCommand) -> Result<(), PlanProblem> {
        let message = match &command.action {
            StartupAction::FileWrite(FileWrite { name, .. }) | StartupAction::FileRead(FileRead { name, .. }) => {
                FoeMessage::OVERHEAD + name.len()
            }
            StartupAction::Mail(MailMessage::Aoe(data) | MailMessage::Voe(data)) => data.len(),
            _ => return Ok(()),
        };
        let mailbox = match command.transition {
            Transition::Ib | Transition::Bi => self.bootstrap,
            _ => self.standard,
        };
        let bytes = Header::LEN + message;
        match mailbox {
            Some(mailbox) if bytes > usize::from(mailbox) => Err(PlanProblem::MailTooLong { bytes, mailbox }),
            _ => Ok(()),
        }
    }
}

/// Memory below the process RAM, and the possible directions.
struct Memory {
    start: u32,
    end: u32,
    directions: &'static [SyncManagerDirection],
}

const WRITTEN: &[SyncManagerDirection] = &[SyncManagerDirection::Write];
const READ: &[SyncManagerDirection] = &[SyncManagerDirection::Read];
const BOTH: &[SyncManagerDirection] = &[SyncManagerDirection::Write, SyncManagerDirection::Read];

/// Digital outputs, general purpose outputs and inputs, user RAM (protocol 3.13). The rest is register space.
const BELOW_PROCESS_RAM: [Memory; 4] = [
    Memory { start: 0x0F00, end: 0x0F04, directions: WRITTEN },
    Memory { start: 0x0F10, end: 0x0F18, directions: WRITTEN },
    Memory { start: 0x0F18, end: 0x0F20, directions: READ },
    Memory { start: 0x0F80, end: 0x1000, directions: BOTH },
];

/// Bytes of a SyncManager, all buffers included.
struct Span {
    index: u8,
    start: u16,
    end: u32,
    direction: SyncManagerDirection,
}

impl Span {
    fn of(index: u8, register: &SyncManager) -> Span {
        let end = u32::from(register.start) + occupied(register);
        Span { index, start: register.start, end, direction: register.control.direction }
    }
}

fn inside(info: &SubDeviceInfo, span: &Span) -> Result<(), PlanProblem> {
    let start = u32::from(span.start);
    let memory_end = match (span.start < PROCESS_RAM, info.controller.ram_kib) {
        (true, _) => {
            let holds = |memory: &&Memory| {
                (memory.start..memory.end).contains(&start) && memory.directions.contains(&span.direction)
            };
            let no_memory = PlanProblem::NoMemory { sync_manager: span.index, start: span.start };
            BELOW_PROCESS_RAM.iter().find(holds).ok_or(no_memory)?.end
        }
        // The controller does not report its RAM size.
        (false, 0) => 0x1_0000,
        (false, kib) => u32::from(PROCESS_RAM) + 1024 * u32::from(kib),
    };
    if span.end <= memory_end {
        return Ok(());
    }
    Err(PlanProblem::OutsideMemory {
        sync_manager: span.index,
        start: span.start,
        bytes: span.end - u32::from(span.start),
        memory_end,
    })
}
