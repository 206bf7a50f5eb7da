//! `InitCmds` of a SubDevice: identity, SyncManagers, FMMUs, watchdogs, SYNC signals, state changes, and the start-up
//! commands to registers, each transition in the order in which a MainDevice sends them.

use std::time::Duration;

use ringcat_engine::config::{
    DeclaredSyncManager, Expected, RegisterAccess, RegisterCommand, StartupAction, StartupCommand, SubDeviceConfig,
    Transition as EngineTransition,
};
use ringcat_wire::address::RegisterAddress;
use ringcat_wire::al::AlState;
use ringcat_wire::command::Command;
use ringcat_wire::register::{Fmmu, SyncManager, map};

use super::clocks;
use crate::eni::{Datagram, EcatCommand, Place, Requires, Target, Transition, Validate};
use crate::follow::{HIGH_WORD, LOW_WORD};

/// Repetitions of a command with a wrong working counter.
const RETRIES: u16 = 3;
/// Time for a read of the EEPROM, in milliseconds.
const EEPROM_MS: u32 = 100;
/// Time to INIT before the bring-up, in milliseconds.
const INIT_MS: u32 = 3000;
/// AL control: an error is acknowledged.
const ACKNOWLEDGE: u8 = 0x10;
/// Time for an identification, in milliseconds.
const IDENTIFY_MS: u32 = 100;
/// AL control: the identification is requested.
const ID_REQUEST: u8 = 0x20;
/// State in AL status; with the error bit, which has to be clear on the way up.
const STATE_MASK: [u8; 2] = [0x0F, 0];
const STATE_AND_ERROR: [u8; 2] = [0x1F, 0];
/// A read of the EEPROM, in register SII_CONTROL.
const READ: [u8; 2] = [0x00, 0x01];

/// Addresses of a SubDevice.
#[derive(Clone, Copy)]
pub(super) struct Own {
    pub station: u16,
    pub auto_increment: u16,
    /// Place of the commands, by which the sections of the file are ordered.
    pub place: Place,
}

struct Commands {
    own: Own,
    list: Vec<EcatCommand>,
}

/// The commands of a SubDevice whose SyncManagers are declared.
pub(super) fn complete(
    config: &SubDeviceConfig,
    declared: &[DeclaredSyncManager],
    fmmus: &[Fmmu],
    own: Own,
) -> Vec<EcatCommand> {
    use EngineTransition as At;
    use Transition::{Bi, Ib, Ip, Oi, Op, Os, Pi, Po, Ps, Si, So, Sp};
    let mut out = Commands { own, list: Vec::new() };
    out.state(config, &[Pi, Si, Oi, Bi], AlState::Init);
    [At::Pi, At::Si, At::Oi, At::Bi, At::Ii].into_iter().for_each(|transition| out.raw(config, transition));
    let (mailboxes, data): (Vec<_>, Vec<_>) = declared.iter().partition(|it| it.role.direction().is_none());
    let has_mailbox = !mailboxes.is_empty();
    out.begin(config, has_mailbox);
    let ways: &[Transition] =
        if config.declared_bootstrap.is_some() { &[Ip, Ib, Pi, Si, Oi, Bi] } else { &[Ip, Ib, Pi, Si, Oi] };
    mailboxes.iter().for_each(|it| out.clear_sync_manager(ways, it.index));
    mailboxes.into_iter().for_each(|it| out.sync_manager(Ip, it.index, &it.register));
    if let Some(both) = &config.declared_bootstrap {
        both.iter().for_each(|it| out.sync_manager(Ib, it.index, &it.register));
    }
    out.raw(config, EngineTransition::Ib);
    if config.declared_bootstrap.is_some() {
        out.eeprom_to_pdi(Ib);
        out.eeprom_back(Bi);
    }
    out.state(config, &[Ib], AlState::Boot);
    if config.sync.is_some() {
        out.write(&[Ip], "clear DC activation", map::DC_CYCLIC_UNIT_CONTROL, vec![0; 2]);
    }
    out.raw(config, EngineTransition::Ip);
    // The application of a SubDevice reads the EEPROM while it starts (protocol ES-116); the engine does the same.
    if has_mailbox || config.sii_to_pdi {
        out.eeprom_to_pdi(Ip);
    }
    out.state(config, &[Ip], AlState::PreOp);
    if has_mailbox && !config.sii_to_pdi {
        out.eeprom_back(Ip);
    }
    out.process_data(config, &data, fmmus);
    out.raw(config, EngineTransition::Pp);
    out.raw(config, EngineTransition::Ps);
    out.state(config, &[Ps], AlState::SafeOp);
    data.iter().filter(|it| it.op_only).for_each(|it| out.sync_manager(So, it.index, &it.register));
    out.raw(config, EngineTransition::Ss);
    out.raw(config, EngineTransition::So);
    out.state(config, &[So, Po], AlState::Op);
    out.raw(config, EngineTransition::Os);
    out.state(config, &[Os], AlState::SafeOp);
    out.raw(config, EngineTransition::Sp);
    out.state(config, &[Sp, Op], AlState::PreOp);
    data.iter().for_each(|it| out.clear_sync_manager(&[Sp, Si, Op, Oi], it.index));
    for (number, _) in (0_u8..).zip(fmmus) {
        out.write(&[Sp, Si, Op, Oi], &format!("clear fmmu {number}"), map::fmmu(number), vec![0; Fmmu::LEN]);
    }
    if config.sync.is_some() {
        out.write(&[Sp, Op, Si, Oi], "clear DC activation", map::DC_CYCLIC_UNIT_CONTROL, vec![0; 2]);
    }
    out.list
}

/// The start-up commands to registers alone, for a SubDevice that is left to its EEPROM.
pub(super) fn raw(config: &SubDeviceConfig, own: Own) -> Vec<EcatCommand> {
    let mut out = Commands { own, list: Vec::new() };
    config.startup.iter().for_each(|command| out.startup(command));
    out.list
}

/// The identification of a hot connect group by its alias.
pub(super) fn alias(auto_increment: u16, alias: u16) -> Vec<EcatCommand> {
    vec![identify(auto_increment, Command::Aprd, map::STATION_ALIAS, vec![0; 2], Some(alias))]
}

/// The identification of a hot connect group by the value that its head shows in AL status code on request (protocol
/// 5.3).
pub(super) fn identification(auto_increment: u16, value: u16) -> Vec<EcatCommand> {
    let request = vec![AlState::Init.code() | ID_REQUEST, 0];
    vec![
        identify(auto_increment, Command::Apwr, map::AL_CONTROL, request, None),
        identify(auto_increment, Command::Aprd, map::AL_STATUS_CODE, vec![0; 2], Some(value)),
    ]
}

/// The identification of a hot connect group by a word in the memory of its head (protocol 4.3).
pub(super) fn data_word(auto_increment: u16, register: RegisterAddress, value: u16) -> Vec<EcatCommand> {
    vec![identify(auto_increment, Command::Aprd, register, vec![0; 2], Some(value))]
}

fn identify(
    auto_increment: u16,
    command: Command,
    ado: RegisterAddress,
    data: Vec<u8>,
    value: Option<u16>,
) -> EcatCommand {
    let own = Own { station: 0, auto_increment, place: Place::default() };
    let validate =
        value.map(|value| Validate { data: value.to_le_bytes().to_vec(), mask: None, timeout_ms: IDENTIFY_MS });
    Commands { own, list: Vec::new() }.command(&[], "identify", command, ado, data, validate)
}

impl Commands {
    fn command(
        &self,
        transitions: &[Transition],
        comment: &str,
        command: Command,
        ado: RegisterAddress,
        data: Vec<u8>,
        validate: Option<Validate>,
    ) -> EcatCommand {
        let adp = match command {
            Command::Aprd | Command::Apwr => self.own.auto_increment,
            _ => self.own.station,
        };
        EcatCommand {
            place: self.own.place,
            transitions: transitions.to_vec(),
            before_subdevices: false,
            comment: comment.to_owned(),
            requires: None,
            datagram: Datagram { command, target: Target::Register { adp, ado }, data, count: Some(1) },
            retries: RETRIES,
            validate,
            timeout_ms: None,
        }
    }

    fn write(&mut self, transitions: &[Transition], comment: &str, ado: RegisterAddress, data: Vec<u8>) {
        let command = self.command(transitions, comment, Command::Fpwr, ado, data, None);
        self.list.push(command);
    }

    /// A read whose answer has to be this.
    fn check(&mut self, transitions: &[Transition], comment: &str, ado: RegisterAddress, validate: Validate) {
        let data = vec![0; validate.data.len()];
        let command = self.command(transitions, comment, Command::Fprd, ado, data, Some(validate));
        self.list.push(command);
    }

    /// Whatever its state is, a SubDevice begins in INIT; one with a mailbox may have an error to acknowledge.
    fn begin_in_init(&mut self, config: &SubDeviceConfig, has_mailbox: bool) {
        use Transition::{Ib, Ip};
        let first: &[Transition] = if config.declared_bootstrap.is_some() { &[Ip, Ib] } else { &[Ip] };
        let state = AlState::Init.code();
        let code = vec![if has_mailbox { state | ACKNOWLEDGE } else { state }, 0];
        let comment = format!("set device state to {}", AlState::Init);
        let mut request = self.command(first, &comment, Command::Apwr, map::AL_CONTROL, code, None);
        request.requires = Some(Requires::Cycle);
        let validate = Validate { data: vec![state, 0], mask: Some(STATE_MASK.to_vec()), timeout_ms: INIT_MS };
        let comment = format!("check device state for {}", AlState::Init);
        let check = self.command(first, &comment, Command::Aprd, map::AL_STATUS, vec![0; 2], Some(validate));
        self.list.extend([request, check]);
    }

    /// SyncManagers and FMMUs of process data, SYNC signals.
    fn process_data(&mut self, config: &SubDeviceConfig, data: &[&DeclaredSyncManager], fmmus: &[Fmmu]) {
        use Transition::Ps;
        for it in data {
            let mut early = it.register;
            early.activate.enable &= !it.op_only;
            self.sync_manager(Ps, it.index, &early);
        }
        for (number, fmmu) in (0_u8..).zip(fmmus) {
            self.write(&[Ps], &format!("set fmmu {number}"), map::fmmu(number), fmmu.encode().to_vec());
        }
        for (comment, ado, data) in config.sync.iter().flat_map(clocks::registers) {
            self.write(&[Ps], comment, ado, data);
        }
    }

    fn eeprom_to_pdi(&mut self, transition: Transition) {
        self.write(&[transition], "assign EEPROM to PDI", map::SII_CONFIGURATION, vec![1]);
    }

    fn eeprom_back(&mut self, transition: Transition) {
        self.write(&[transition], "assign EEPROM back to ECAT", map::SII_CONFIGURATION, vec![0]);
    }

    /// INIT, address, identity, watchdogs.
    fn begin(&mut self, config: &SubDeviceConfig, has_mailbox: bool) {
        use Transition::{Ib, Ip};
        self.begin_in_init(config, has_mailbox);
        let station = self.own.station.to_le_bytes().to_vec();
        let boot = config.declared_bootstrap.is_some();
        let first: &[Transition] = if boot { &[Ip, Ib] } else { &[Ip] };
        let set = self.command(first, "set physical address", Command::Apwr, map::STATION_ADDRESS, station, None);
        self.list.push(set);
        self.write(first, "assign EEPROM to ECAT", map::SII_CONFIGURATION, vec![0]);
        self.identity(first, &config.expected);
        let watchdogs = [
            ("set watchdog divider", map::WATCHDOG_DIVIDER, config.watchdog_divider),
            ("set PDI watchdog", map::WATCHDOG_TIME_PDI, config.pdi_watchdog_intervals),
            ("set SM watchdog", map::WATCHDOG_TIME_PROCESS_DATA, config.watchdog_intervals),
        ];
        for (comment, ado, value) in watchdogs {
            if let Some(value) = value {
                self.write(&[Ip], comment, ado, value.to_le_bytes().to_vec());
            }
        }
    }

    /// The checks of the identity. Of a revision the whole number is compared, or a word (protocol ES-121).
    fn identity(&mut self, first: &[Transition], expected: &Expected) {
        let whole = |value: Option<u32>| value.map(|value| value.to_le_bytes().to_vec());
        let word = |value: u32| (value as u16).to_le_bytes().to_vec();
        let revision = match expected.revision_mask {
            LOW_WORD => ("check revision number (lo word)", 0x000C, expected.revision.map(word)),
            HIGH_WORD => ("check revision number (hi word)", 0x000D, expected.revision.map(|value| word(value >> 16))),
            _ => ("check revision number", 0x000C, whole(expected.revision)),
        };
        let words = [
            ("check vendor id", 0x0008_u32, whole(expected.vendor_id)),
            ("check product code", 0x000A, whole(expected.product_code)),
            revision,
            ("check serial number", 0x000E, whole(expected.serial)),
        ];
        for (comment, word, value) in words {
            let Some(data) = value else { continue };
            self.write(first, comment, map::SII_CONTROL, [&READ[..], &word.to_le_bytes()].concat());
            let validate = Validate { data, mask: None, timeout_ms: EEPROM_MS };
            self.check(first, comment, map::SII_DATA, validate);
        }
    }

    fn sync_manager(&mut self, transition: Transition, number: u8, register: &SyncManager) {
        let comment = format!("set sm {number}");
        self.write(&[transition], &comment, map::sync_manager(number), register.encode().to_vec());
    }

    /// A SyncManager takes new settings while it is disabled.
    fn clear_sync_manager(&mut self, transitions: &[Transition], number: u8) {
        self.write(transitions, &format!("clear sm {number}"), map::sync_manager(number), vec![0; SyncManager::LEN]);
    }

    /// The request of a state, and the check of each transition with its limit.
    fn state(&mut self, config: &SubDeviceConfig, transitions: &[Transition], state: AlState) {
        let boots = config.declared_bootstrap.is_some();
        let limit = |transition| {
            let (from, to) = crate::follow::states(transition);
            config.state_timeouts.iter().find(|it| (it.from, it.to) == (from, to)).and_then(|it| ms(it.limit))
        };
        // These are in a file only where they mean something.
        let is_possible = |it: &Transition| match it {
            Transition::Ib | Transition::Bi => boots || limit(*it).is_some(),
            Transition::Po => limit(*it).is_some(),
            _ => true,
        };
        let transitions: Vec<Transition> = transitions.iter().copied().filter(is_possible).collect();
        if transitions.is_empty() {
            return;
        }
        let (to, code) = (state.to_string(), vec![state.code(), 0]);
        let mut request = self.command(
            &transitions,
            &format!("set device state to {to}"),
            Command::Fpwr,
            map::AL_CONTROL,
            code,
            None,
        );
        request.requires = Some(Requires::Cycle);
        self.list.push(request);
        for transition in transitions {
            let Some(timeout_ms) = limit(transition) else { continue };
            let mask = match transition {
                Transition::Ip | Transition::Ps | Transition::So | Transition::Ib | Transition::Po => STATE_AND_ERROR,
                _ => STATE_MASK,
            };
            let validate = Validate { data: vec![state.code(), 0], mask: Some(mask.to_vec()), timeout_ms };
            self.check(&[transition], &format!("check device state for {to}"), map::AL_STATUS, validate);
        }
    }

    /// The start-up commands to registers at a transition.
    fn raw(&mut self, config: &SubDeviceConfig, transition: EngineTransition) {
        let of_transition = config.startup.iter().filter(|command| command.transition == transition);
        of_transition.for_each(|command| self.startup(command));
    }

    fn startup(&mut self, command: &StartupCommand) {
        let StartupAction::Register(RegisterCommand { address, access, retries, required, .. }) = &command.action
        else {
            return;
        };
        let (code, data, validate) = match access {
            RegisterAccess::Write(data) => (Command::Fpwr, data.clone(), None),
            RegisterAccess::Check { data, mask, limit } => {
                let timeout_ms = ms(*limit).unwrap_or_default();
                let validate = Validate { data: data.clone(), mask: mask.clone(), timeout_ms };
                (Command::Fprd, vec![0; data.len()], Some(validate))
            }
        };
        let comment = command.comment.as_deref().unwrap_or_default();
        let transitions = [super::transitions::transition(command.transition)];
        let mut made = self.command(&transitions, comment, code, *address, data, validate);
        (made.retries, made.datagram.count) = (*retries, required.then_some(1));
        self.list.push(made);
    }
}

/// Whole milliseconds.
pub(super) fn ms(limit: Duration) -> Option<u32> {
    u32::try_from(limit.as_millis()).ok()
}
