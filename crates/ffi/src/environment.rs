//! Which links a master has: from variables of the environment.
//!
//! `RINGCAT_SOCKET` names the socket of a daemon, and comes first. Without it the library opens links itself that
//! variables name; where none does, it connects to the daemon in the usual places. Master 0 takes `RINGCAT_SIM` (a
//! segment file that is simulated in this process), or `RINGCAT_MAIN` and `RINGCAT_REDUNDANT` (network interfaces);
//! master 1 takes `RINGCAT_SIM_1`, `RINGCAT_MAIN_1`, `RINGCAT_REDUNDANT_1`, and so on. `RINGCAT_SIM` comes before
//! `RINGCAT_MAIN`.

use std::path::{Path, PathBuf};

use ringcat::daemon::{BusSettings, find_socket};

/// The socket of a daemon that `RINGCAT_SOCKET` names, or one in the usual places if no variable names links. An empty
/// variable counts as missing.
pub fn socket(master: u32, variable: impl Fn(&str) -> Option<String>) -> Option<PathBuf> {
    let named = variable("RINGCAT_SOCKET").filter(|path| !path.is_empty());
    match (named, source(master, &variable)) {
        (Some(path), _) => Some(path.into()),
        (None, Some(_)) => None,
        (None, None) => Some(find_socket(|name| variable(name).map(Into::into))),
    }
}

/// Settings of a master whose links this process opens, and what is wrong with their variables. Empty variables count
/// as missing.
pub fn settings(variable: impl Fn(&str) -> Option<String>) -> (BusSettings, Vec<String>) {
    let (mut settings, mut mistakes) = (BusSettings::default(), Vec::new());
    for name in BusSettings::variables() {
        let value = variable(&format!("RINGCAT_{name}")).filter(|value| !value.is_empty());
        let set = value.map(|value| settings.set(name, &value));
        mistakes.extend(set.and_then(Result::err).map(|mistake| format!("RINGCAT_{name}: {mistake}")));
    }
    (settings, mistakes)
}

/// The name with which a daemon names this process to others.
pub fn program_name() -> String {
    let program = std::env::args_os().next().unwrap_or_default();
    Path::new(&program).file_name().unwrap_or(program.as_os_str()).to_string_lossy().into_owned()
}

/// Links of a master.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A segment file.
    Simulated(String),
    /// Network interfaces: main, redundant.
    Interfaces(String, Option<String>),
}

/// The links of a master; `None` if no variable names them. Empty variables count as missing.
pub fn source(master: u32, variable: impl Fn(&str) -> Option<String>) -> Option<Source> {
    let value = |name: &str| {
        let numbered = variable(&format!("{name}_{master}"));
        let plain = if master == 0 { variable(name) } else { None };
        numbered.or(plain).filter(|value| !value.is_empty())
    };
    if let Some(file) = value("RINGCAT_SIM") {
        return Some(Source::Simulated(file));
    }
    Some(Source::Interfaces(value("RINGCAT_MAIN")?, value("RINGCAT_REDUNDANT")))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: c-interface, daemon
    #[test]
    fn a_named_daemon_comes_first_and_the_default_one_last() {
        let set = [("RINGCAT_SOCKET", "/tmp/s"), ("RINGCAT_SIM", "ring.toml")];
        let of = |set: &[(&str, &str)], master| {
            socket(master, |name| set.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned()))
        };
        assert_eq!(of(&set, 0), Some("/tmp/s".into()));
        assert_eq!(of(&set[1..], 0), None);
        let usual = find_socket(|_| None);
        assert_eq!(of(&set[1..], 1), Some(usual.clone()));
        assert_eq!(of(&[("RINGCAT_SOCKET", "")], 0), Some(usual));
    }

    // covers: c-interface
    #[test]
    fn settings_come_from_variables_and_mistakes_are_named() {
        let set = [("RINGCAT_WILDCARDS", "yes"), ("RINGCAT_REGALIAS", ""), ("RINGCAT_SII_ASSIGN", "on")];
        let (settings, mistakes) =
            settings(|name| set.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned()));
        let mut expected = BusSettings::default();
        expected.has_wildcards = true;
        assert_eq!(settings, expected);
        assert_eq!(mistakes, ["RINGCAT_SII_ASSIGN: expected yes or no, got \"on\""]);
    }

    // covers: c-interface
    #[test]
    fn each_master_has_variables_of_its_own_and_a_segment_file_comes_first() {
        let set = [("RINGCAT_SIM_1", "ring.toml"), ("RINGCAT_MAIN", "eth1"), ("RINGCAT_REDUNDANT", "")];
        let variable = |name: &str| set.iter().find(|(key, _)| *key == name).map(|(_, value)| (*value).to_owned());
        assert_eq!(source(0, variable), Some(Source::Interfaces("eth1".into(), None)));
        assert_eq!(source(1, variable), Some(Source::Simulated("ring.toml".into())));
        assert_eq!(source(2, variable), None);
        let both = |name: &str| Some(format!("{name}!"));
        assert_eq!(source(0, both), Some(Source::Simulated("RINGCAT_SIM_0!".into())));
    }
}
