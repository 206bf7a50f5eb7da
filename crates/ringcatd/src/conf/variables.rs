//! What the variables of a configuration file mean.
//!
//! In: assignments. Out: a [`Conf`], and mistakes. Each variable of the IgH manual (7.4.2) has an effect, or a sentence
//! that explains why it has none; of several assignments of one variable the last one is used, as in `sh`. An unknown
//! name with a known beginning is a mistake: a misspelt setting must not be silently without effect.

mod own;

use std::collections::{BTreeMap, HashMap};

use super::model::{Conf, Mistake, Understood};
use super::syntax::Assignment;
use crate::device::Device;
use crate::source::{MasterOption, Source};

/// Most masters.
const MOST_MASTERS: u32 = 32;
/// Most interfaces that are switched.
const MOST_SWITCHED: usize = 64;

/// A variable that has a meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variable<'a> {
    /// `MASTERx_DEVICE`.
    Device(u32),
    /// `MASTERx_BACKUP`.
    Backup(u32),
    DeviceModules,
    UpDownInterfaces,
    ModprobeFlags,
    /// `RINGCAT_` and what follows.
    Own(&'a str),
}

impl Variable<'_> {
    fn of(name: &str) -> Result<Option<Variable<'_>>, String> {
        if let Some(own) = name.strip_prefix("RINGCAT_") {
            return Ok(Some(Variable::Own(own)));
        }
        if let Some(rest) = name.strip_prefix("MASTER") {
            return match master(rest) {
                Some((number, "DEVICE")) => Ok(Some(Variable::Device(number))),
                Some((number, "BACKUP")) => Ok(Some(Variable::Backup(number))),
                _ => Err(format!("expected MASTERx_DEVICE or MASTERx_BACKUP with x from 0 to {}", MOST_MASTERS - 1)),
            };
        }
        Ok(match name {
            "DEVICE_MODULES" => Some(Variable::DeviceModules),
            "UPDOWN_INTERFACES" => Some(Variable::UpDownInterfaces),
            "MODPROBE_FLAGS" => Some(Variable::ModprobeFlags),
            _ => None,
        })
    }
}

/// The number of a master and what follows behind `_`.
fn master(text: &str) -> Option<(u32, &str)> {
    let (number, rest) = text.split_once('_')?;
    let is_plain = number == "0" || !number.starts_with('0') && number.bytes().all(|it| it.is_ascii_digit());
    let number = number.parse().ok().filter(|number| is_plain && *number < MOST_MASTERS)?;
    Some((number, rest))
}

/// The links of a master with the lines that name them.
#[derive(Debug, Default)]
struct Links {
    main: Option<(usize, Device)>,
    backup: Option<(usize, Device)>,
    simulated: Option<(usize, String)>,
}

/// What is understood so far.
#[derive(Debug, Default)]
struct Reading {
    conf: Conf,
    links: BTreeMap<u32, Links>,
    /// Masters with further variables, and their lines.
    named: Vec<(u32, usize)>,
}

/// Understands assignments, and adds mistakes.
pub fn understand(assignments: Vec<Assignment>, mistakes: &mut Vec<Mistake>) -> Conf {
    let last: HashMap<String, usize> = assignments.iter().map(|it| (it.name.clone(), it.line)).collect();
    let mut reading = Reading::default();
    for Assignment { line, name, value } in assignments {
        let later = last.get(&name).filter(|later| **later != line);
        let understood = match later {
            Some(later) => Ok(format!("line {later} counts instead")),
            None => reading.take(line, &name, &value),
        };
        match understood {
            Ok(text) => reading.conf.understood.push(Understood { line, name, text }),
            Err(text) => mistakes.push(Mistake { line: Some(line), text: format!("{name}: {text}") }),
        }
    }
    reading.masters(mistakes);
    if reading.conf.masters.is_empty() && mistakes.is_empty() {
        let text =
            "there is no master; expected MASTER0_DEVICE with the address or the name of an interface".to_owned();
        mistakes.push(Mistake { line: None, text });
    }
    reading.conf
}

impl Reading {
    /// Evaluates a variable. Returns its meaning.
    fn take(&mut self, line: usize, name: &str, value: &str) -> Result<String, String> {
        match Variable::of(name)? {
            Some(Variable::Device(_)) if value.is_empty() => Ok("empty: no master".to_owned()),
            Some(Variable::Device(number)) => {
                let device: Device = value.parse()?;
                let text = format!("master {number} on {}", described(&device));
                self.links.entry(number).or_default().main = Some((line, device));
                Ok(text)
            }
            Some(Variable::Backup(_)) if value.is_empty() => Ok("empty: no ring".to_owned()),
            Some(Variable::Backup(number)) => {
                let device: Device = value.parse()?;
                if device == Device::First {
                    return Err(format!("{device} stands for a main interface only; expected an address or a name"));
                }
                let text = format!("master {number} has a ring with {}", described(&device));
                self.links.entry(number).or_default().backup = Some((line, device));
                Ok(text)
            }
            Some(Variable::DeviceModules) if value.is_empty() => Ok("empty, and not needed".to_owned()),
            Some(Variable::DeviceModules) => Ok(format!(
                "not needed: ringcatd uses interfaces with the drivers that they have; {value:?} is neither loaded \
                 nor replaced"
            )),
            Some(Variable::ModprobeFlags) => Ok("not needed: no kernel module is loaded".to_owned()),
            Some(Variable::UpDownInterfaces) => self.up_down(value),
            Some(Variable::Own(own)) => self.own(line, own, value),
            None => Ok("not a variable of ringcatd: without effect".to_owned()),
        }
    }

    fn up_down(&mut self, value: &str) -> Result<String, String> {
        let names: Vec<String> = value.split_whitespace().map(str::to_owned).collect();
        if names.is_empty() {
            return Ok("empty: no interface is switched".to_owned());
        }
        if names.len() > MOST_SWITCHED {
            return Err(format!("expected at most {MOST_SWITCHED} interfaces"));
        }
        for name in &names {
            if !matches!(name.parse(), Ok(Device::Name(_))) {
                return Err(format!("expected names of interfaces with blanks between, got {name:?}"));
            }
        }
        let text = format!("switched on with the daemon, and off with it: {}", names.join(", "));
        self.conf.up_down = names;
        Ok(text)
    }

    /// Puts the masters together. An absent part is a mistake only if no other mistake explains it.
    fn masters(&mut self, mistakes: &mut Vec<Mistake>) {
        let is_whole = mistakes.is_empty();
        let mut wrong = |line: usize, text: String| mistakes.push(Mistake { line: Some(line), text });
        let mut devices: HashMap<String, usize> = HashMap::new();
        let mut expected = 0;
        for (number, links) in std::mem::take(&mut self.links) {
            let lines =
                [&links.main, &links.backup].into_iter().flatten().map(|(line, device)| (*line, device.to_string()));
            for (line, device) in lines.collect::<Vec<_>>() {
                if let Some(first) = devices.insert(device.clone(), line) {
                    wrong(line.max(first), format!("{device} is named in line {} already", line.min(first)));
                }
            }
            let source = match (links.main, links.backup, links.simulated) {
                (Some(_), _, Some((line, _))) => {
                    wrong(
                        line,
                        format!("master {number} has an interface and a simulated segment; expected one of them"),
                    );
                    continue;
                }
                (None, Some((line, _)), _) => {
                    if is_whole {
                        wrong(line, format!("MASTER{number}_BACKUP: expected MASTER{number}_DEVICE, too"));
                    }
                    continue;
                }
                (Some((line, main)), backup, None) => (line, Source::Interfaces(main, backup.map(|(_, it)| it))),
                (None, None, Some((line, file))) => (line, Source::Simulated(file.into())),
                (None, None, None) => continue,
            };
            let (line, source) = source;
            if number != expected && is_whole {
                wrong(
                    line,
                    format!("master {number}: expected master {expected} before it; masters are numbered from 0"),
                );
            }
            expected = number + 1;
            self.conf.masters.push(MasterOption { master: number, source });
        }
        for (number, line) in std::mem::take(&mut self.named) {
            if is_whole && !self.conf.masters.iter().any(|it| it.master == number) {
                wrong(line, format!("there is no master {number}; expected MASTER{number}_DEVICE"));
            }
        }
    }
}

fn described(device: &Device) -> String {
    match device {
        Device::Name(name) => format!("interface {name}"),
        Device::Address(_) => format!("the interface with address {device}"),
        Device::First => "the first interface that nothing else uses".to_owned(),
    }
}

#[cfg(test)]
mod tests;
