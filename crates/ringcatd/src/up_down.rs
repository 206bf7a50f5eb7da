//! Interfaces that are switched on with the daemon and off with it (`UPDOWN_INTERFACES`).
//!
//! One that is absent is switched on when it comes. At the end those stay on that an application may use: it drives its
//! bus without the daemon.

use ringcat_link::interface;

use crate::log::say;

/// The interfaces.
#[derive(Debug)]
pub struct UpDown {
    all: Vec<Switched>,
}

#[derive(Debug)]
struct Switched {
    name: String,
    state: State,
}

#[derive(Clone, Debug, PartialEq, Eq)]
enum State {
    /// It is not there.
    Absent,
    /// The daemon has switched it on, or found it so.
    On,
    /// Why it cannot be switched on.
    Failed(String),
}

impl UpDown {
    /// Switches all on that are there.
    pub fn start(names: &[String]) -> UpDown {
        let all = names.iter().map(|name| Switched { name: name.clone(), state: State::Absent }).collect();
        let mut started = UpDown { all };
        for absent in started.look() {
            say(format_args!("interface {absent} is not there; it is switched on when it comes"));
        }
        started
    }

    /// Switches those on that have come, and tries again what failed; to be called about each second. Those that are
    /// absent.
    pub fn look(&mut self) -> Vec<&str> {
        if self.all.is_empty() {
            return Vec::new();
        }
        let present = interface::list();
        for one in &mut self.all {
            let found = present.iter().find(|it| it.name == one.name);
            let state = match found {
                None => State::Absent,
                // Switched off later by its operator: it stays off.
                Some(_) if one.state == State::On => State::On,
                Some(found) if found.up => State::On,
                Some(_) => {
                    interface::switch(&one.name, true).map_or_else(|e| State::Failed(e.to_string()), |()| State::On)
                }
            };
            if let State::Failed(cause) = &state
                && one.state != state
            {
                say(format_args!("{cause}"));
            }
            one.state = state;
        }
        self.all.iter().filter(|one| one.state == State::Absent).map(|one| one.name.as_str()).collect()
    }

    /// The end of the daemon: switches them off, unless an application drives a bus.
    pub fn end(&self, is_driven: bool) {
        for one in self.all.iter().filter(|one| one.state == State::On) {
            if is_driven {
                say(format_args!("interface {} stays on: an application drives a bus", one.name));
            } else if let Err(error) = interface::switch(&one.name, false) {
                say(format_args!("{error}"));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn an_interface_that_is_absent_is_waited_for_and_one_that_is_on_stays_so() {
        let lo = interface::list().into_iter().find(|it| it.loopback && it.up);
        let Some(lo) = lo else {
            println!("skipped: the loopback is off");
            return;
        };
        let mut both = UpDown::start(&[lo.name.clone(), "no-such".to_owned()]);
        assert_eq!(both.look(), ["no-such"]);
        assert_eq!(both.all[0].state, State::On);
        both.end(true);
        assert!(interface::list().iter().any(|it| it.name == lo.name && it.up));
    }
}
