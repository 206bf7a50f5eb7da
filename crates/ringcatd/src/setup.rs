//! What the daemon is to do: from options, and from a configuration file. An option has priority over a variable.

use std::path::PathBuf;

use clap::Args;
use ringcat_control::BusSettings;

use crate::conf::Conf;
use crate::device::{Device, Found};
use crate::rights::{Rights, group, mode};
use crate::source::{MasterOption, SafeState, check};

/// An application that is stopped for this time loses its master, in milliseconds.
const STOP_LIMIT: u64 = 100;

/// Options that say what the daemon does.
#[derive(Args, Clone, Debug, Default)]
pub struct SetupOptions {
    /// A master and its links: 0=eth1, 0=eth1,eth2 (a ring), 0=sim:FILE (a simulated segment)
    ///
    /// An interface is named by its name or its address; ff:ff:ff:ff:ff:ff is the first one that nothing else uses. Can
    /// be given several times. A simulated segment runs in a process of its own and needs no permission.
    #[arg(long = "master", value_name = "NUMBER=LINKS",
        required_unless_present_any = ["conf", "check", "simulate", "open_sockets"], conflicts_with = "conf")]
    pub masters: Vec<MasterOption>,
    /// Where the daemon listens
    ///
    /// By default /run/ringcat/control as root; as another user ringcat/control in XDG_RUNTIME_DIR or /run/user/UID, or
    /// /tmp/ringcat-UID/control where there is neither.
    #[arg(long, value_name = "PATH")]
    pub socket: Option<PathBuf>,
    /// Which users may read (r) and change the bus (w): bits for the daemon's user, the group, others [default: 0660]
    ///
    /// 0664: all users may read. 0666: all users may change the bus. Root may in any case.
    #[arg(long, value_parser = mode)]
    pub mode: Option<u32>,
    /// Group of the socket; without one no user is a member
    #[arg(long, value_name = "GROUP", value_parser = group)]
    pub group: Option<u32>,
    /// An application that is stopped (SIGSTOP, a debugger) for this time loses its master [default: 100]
    #[arg(long, value_name = "MS")]
    pub stop_limit: Option<u64>,
    /// State of all SubDevices of a master after the end of an application: INIT, PREOP, SAFEOP
    ///
    /// PREOP by default. Can be given once for each master.
    #[arg(long = "safe-state", value_name = "NUMBER=STATE")]
    pub safe_states: Vec<SafeState>,
    /// Make no network interfaces for SubDevices with Ethernet over EtherCAT
    ///
    /// Otherwise they are eoeXsY with the master's number X and the position Y, or eoeXaY with the alias Y. They stay
    /// when applications begin and end. Needs CAP_NET_ADMIN.
    #[arg(long)]
    pub no_eoe: bool,
    /// Make debug interfaces: ecdbgmX and, of a ring, ecdbgbX with the master's number X
    ///
    /// While one is up (ip link set ecdbgm0 up), tcpdump and Wireshark see all frames of the link on it, also those of
    /// an application. Needs CAP_NET_ADMIN.
    #[arg(long)]
    pub debug_if: bool,
    /// End with the standard input: the daemon of one command
    #[arg(long, hide = true)]
    pub while_input_is_open: bool,
    /// A ring is not driven while one of its interfaces is absent
    #[arg(long, hide = true)]
    pub needs_backup: bool,
}

/// What the daemon does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Setup {
    /// Its masters.
    pub masters: Vec<MasterOption>,
    /// Where it listens; `None`: at the place of its user.
    pub socket: Option<PathBuf>,
    /// Which users may read, and which may change the bus.
    pub rights: Rights,
    /// In milliseconds.
    pub stop_limit: u64,
    /// States after the end of an application.
    pub safe_states: Vec<SafeState>,
    /// Whether there are network interfaces of EoE.
    pub has_eoe: bool,
    /// Whether there are debug interfaces.
    pub has_debug_interfaces: bool,
    /// Interfaces that are switched on and off with it.
    pub up_down: Vec<String>,
    /// Level of messages at the beginning.
    pub debug_level: u32,
    /// Settings of the masters, for the daemon and for applications.
    pub bus: BusSettings,
    /// A master waits until its backup interface is there.
    pub needs_backup: bool,
    /// It ends with the standard input.
    pub ends_with_input: bool,
}

impl Setup {
    /// From options and a file.
    ///
    /// # Errors
    /// What does not fit together, for the operator.
    pub fn new(options: SetupOptions, conf: Conf) -> Result<Setup, String> {
        let Conf { masters, up_down, own, understood: _ } = conf;
        let masters = if options.masters.is_empty() { masters } else { options.masters };
        check(&masters)?;
        let mut safe_states = options.safe_states;
        safe_states.extend(own.safe_states);
        let is_known = |safe: &&SafeState| masters.iter().any(|it| it.master == safe.master);
        if let Some(safe) = safe_states.iter().find(|safe| !is_known(safe)) {
            return Err(format!("--safe-state names master {}, which does not exist", safe.master));
        }
        let mode = options.mode.or(own.mode).unwrap_or(Rights::default().mode);
        Ok(Setup {
            masters,
            socket: options.socket.or(own.socket),
            rights: Rights { group: options.group.or(own.group), mode },
            stop_limit: options.stop_limit.or(own.stop_limit).unwrap_or(STOP_LIMIT),
            safe_states,
            has_eoe: !options.no_eoe && own.eoe.unwrap_or(true),
            has_debug_interfaces: options.debug_if || own.has_debug_interfaces,
            up_down,
            debug_level: own.debug_level.unwrap_or(0),
            bus: own.bus,
            needs_backup: options.needs_backup || own.needs_backup,
            ends_with_input: options.while_input_is_open,
        })
    }

    /// Interfaces of other masters than this one.
    pub fn others(&self, master: u32) -> Vec<Device> {
        let others = self.masters.iter().filter(|it| it.master != master);
        others.flat_map(|it| it.source.devices()).cloned().collect()
    }

    /// Checks that no interface belongs to two links by its name and by its address.
    ///
    /// # Errors
    /// Which does, for the operator.
    pub fn check_interfaces(&self) -> Result<(), String> {
        let mut seen: Vec<(Found, &Device)> = Vec::new();
        for device in self.masters.iter().flat_map(|it| it.source.devices()).filter(|it| **it != Device::First) {
            let Some(found) = device.find(&[]).ok().flatten() else { continue };
            if let Some((_, other)) = seen.iter().find(|(it, _)| it.interface.index == found.interface.index) {
                return Err(format!("{other} and {device} are one interface: {}", found.name));
            }
            seen.push((found, device));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn options_count_before_variables_and_defaults_behind_both() {
        let text = "MASTER0_DEVICE=eth0\nRINGCAT_MODE=0664\nRINGCAT_STOP_LIMIT=7\nRINGCAT_EOE=yes\n\
                    RINGCAT_MASTER0_SAFE_STATE=INIT\n";
        let conf = || Conf::from_bytes(text.as_bytes()).expect("it is right");
        let setup = Setup::new(SetupOptions::default(), conf()).expect("it fits");
        assert_eq!((setup.rights.mode, setup.stop_limit, setup.has_eoe), (0o664, 7, true));
        assert!(!setup.has_debug_interfaces);
        let safe = "0=SAFEOP".parse().expect("it is right");
        let options =
            SetupOptions { mode: Some(0o666), no_eoe: true, safe_states: vec![safe], ..SetupOptions::default() };
        let setup = Setup::new(options, conf()).expect("it fits");
        assert_eq!((setup.rights.mode, setup.stop_limit, setup.has_eoe), (0o666, 7, false));
        let with = |text: &str, debug_if| {
            let conf = Conf::from_bytes(format!("MASTER0_DEVICE=eth0\n{text}").as_bytes()).expect("it is right");
            Setup::new(SetupOptions { debug_if, ..SetupOptions::default() }, conf)
                .expect("it fits")
                .has_debug_interfaces
        };
        assert_eq!(
            [with("", true), with("RINGCAT_DEBUG_IF=yes", false), with("RINGCAT_DEBUG_IF=no", false)],
            [true, true, false]
        );
        // The first that names a master counts.
        assert_eq!(setup.safe_states[0], safe);
        let masters = vec!["0=a".parse().expect("right"), "1=b,c".parse().expect("right")];
        let setup = Setup::new(SetupOptions { masters, ..SetupOptions::default() }, Conf::default()).expect("it fits");
        assert_eq!((setup.rights, setup.stop_limit), (Rights::default(), STOP_LIMIT));
        assert_eq!(setup.others(0), [Device::Name("b".to_owned()), Device::Name("c".to_owned())]);
        let unknown = SetupOptions { safe_states: vec!["4=INIT".parse().expect("right")], ..SetupOptions::default() };
        assert!(Setup::new(unknown, conf()).expect_err("no master 4").contains("names master 4"));
        assert!(Setup::new(SetupOptions::default(), Conf::default()).is_err());
    }
}
