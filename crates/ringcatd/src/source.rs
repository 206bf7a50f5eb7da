//! The links of a master as the option `--master` or a configuration file names them.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use ringcat::AlState;

use crate::device::Device;

/// Where the frames of a master go.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// A segment file, simulated in a process of its own.
    Simulated(PathBuf),
    /// Network interfaces: main, redundant.
    Interfaces(Device, Option<Device>),
}

/// A master with its links: `0=eth1`, `0=eth1,eth2`, `0=00:00:08:44:ab:66`, `0=sim:FILE`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MasterOption {
    /// Its number.
    pub master: u32,
    /// Its links.
    pub source: Source,
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Source::Simulated(file) => write!(f, "sim:{}", file.display()),
            Source::Interfaces(main, None) => main.fmt(f),
            Source::Interfaces(main, Some(redundant)) => write!(f, "{main},{redundant}"),
        }
    }
}

impl FromStr for MasterOption {
    type Err = String;

    fn from_str(text: &str) -> Result<MasterOption, String> {
        let expected = || format!("expected NUMBER=INTERFACE[,INTERFACE] or NUMBER=sim:FILE, got {text:?}");
        let (number, links) = text.split_once('=').ok_or_else(expected)?;
        let master = number.parse().map_err(|_| expected())?;
        if let Some(file) = links.strip_prefix("sim:") {
            return match file {
                "" => Err(expected()),
                file => Ok(MasterOption { master, source: Source::Simulated(file.into()) }),
            };
        }
        let mut names = links.split(',');
        let main: Device = names.next().unwrap_or_default().parse()?;
        let redundant: Option<Device> = names.next().map(str::parse).transpose()?;
        if names.next().is_some() {
            return Err(expected());
        }
        if redundant.as_ref() == Some(&main) {
            return Err(format!("{text:?} names one interface for both ends of a ring"));
        }
        if redundant == Some(Device::First) {
            return Err(format!("{text:?}: {} stands for the main interface only", Device::First));
        }
        Ok(MasterOption { master, source: Source::Interfaces(main, redundant) })
    }
}

/// The safe state of a master: `0=INIT`, `0=PREOP`, `0=SAFEOP`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SafeState {
    /// Number of the master.
    pub master: u32,
    /// Its SubDevices are in this state after the end of an application.
    pub state: AlState,
}

impl FromStr for SafeState {
    type Err = String;

    fn from_str(text: &str) -> Result<SafeState, String> {
        let expected = || format!("expected NUMBER=INIT, NUMBER=PREOP or NUMBER=SAFEOP, got {text:?}");
        let (number, state) = text.split_once('=').ok_or_else(expected)?;
        let state = match state.to_ascii_uppercase().as_str() {
            "INIT" => AlState::Init,
            "PREOP" => AlState::PreOp,
            "SAFEOP" => AlState::SafeOp,
            _ => return Err(expected()),
        };
        Ok(SafeState { master: number.parse().map_err(|_| expected())?, state })
    }
}

/// Checks that each master and each interface occurs once.
///
/// # Errors
/// What occurs twice, or that there is no master.
pub fn check(masters: &[MasterOption]) -> Result<(), String> {
    if masters.is_empty() {
        return Err("expected at least one --master".to_owned());
    }
    let mut numbers: Vec<u32> = masters.iter().map(|it| it.master).collect();
    let mut names: Vec<String> = masters.iter().flat_map(|it| it.source.devices()).map(Device::to_string).collect();
    numbers.sort_unstable();
    names.sort_unstable();
    if let Some(pair) = numbers.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(format!("master {} is given twice", pair[0]));
    }
    match names.windows(2).find(|pair| pair[0] == pair[1]) {
        Some(pair) => Err(format!("interface {} belongs to two masters", pair[0])),
        None => Ok(()),
    }
}

impl Source {
    /// Its network interfaces.
    pub fn devices(&self) -> impl Iterator<Item = &Device> {
        let (main, redundant) = match self {
            Source::Simulated(_) => (None, None),
            Source::Interfaces(main, redundant) => (Some(main), redundant.as_ref()),
        };
        main.into_iter().chain(redundant)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<MasterOption, String> {
        text.parse()
    }

    // covers: daemon
    #[test]
    fn a_master_has_a_number_and_one_link_two_links_or_a_segment_file() {
        for text in ["0=eth1", "3=eth1,eth2", "0=sim:a=b,c.toml", "0=00:01:02:03:04:05,eth2", "1=ff:ff:ff:ff:ff:ff"] {
            let option = parse(text).expect("it is right");
            assert_eq!(format!("{}={}", option.master, option.source), text);
        }
        for text in
            ["", "eth1", "x=eth1", "0=", "0=sim:", "0=a,", "0=,a", "0=a,b,c", "-1=a", "0=a,a", "0=a,ff:ff:ff:ff:ff:ff"]
        {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    // covers: daemon
    #[test]
    fn a_safe_state_is_one_without_outputs() {
        let state = |text: &str| text.parse::<SafeState>().map(|it| (it.master, it.state));
        assert_eq!(state("0=init"), Ok((0, AlState::Init)));
        assert_eq!(state("3=SAFEOP"), Ok((3, AlState::SafeOp)));
        for text in ["", "0", "0=OP", "0=BOOT", "x=INIT", "=INIT"] {
            assert!(state(text).is_err(), "{text}");
        }
    }

    // covers: daemon
    #[test]
    fn a_master_or_an_interface_that_is_given_twice_is_named() {
        let all = |texts: &[&str]| texts.iter().map(|text| parse(text).expect("it is right")).collect::<Vec<_>>();
        assert_eq!(check(&all(&["0=a", "1=b,c", "2=sim:f", "3=sim:f"])), Ok(()));
        assert_eq!(check(&all(&["1=a", "1=b"])), Err("master 1 is given twice".to_owned()));
        assert_eq!(check(&all(&["0=a", "1=b,a"])), Err("interface a belongs to two masters".to_owned()));
        assert!(check(&[]).is_err());
    }
}
