//! Debug interfaces of a master (`enable-debug-if`): `ecdbgmX` of the main link, `ecdbgbX` of the backup link. The
//! daemon makes them, which needs CAP_NET_ADMIN and `/dev/net/tun`; the process that drives the master writes its
//! frames there.
//!
//! As interfaces of EoE they outlast applications and killed daemons. They never have a carrier, so the host sends
//! nothing into them.

use std::collections::BTreeMap;
use std::os::fd::{AsFd, OwnedFd};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ringcat_link::tap::{TapError, TapInterface};

use crate::log::say;

/// Letters of the links in names, the main one first.
const LETTERS: [char; 2] = ['m', 'b'];

/// Debug interfaces of a master.
#[derive(Debug)]
pub struct DebugTaps {
    master: u32,
    made: Mutex<Made>,
}

#[derive(Debug, Default)]
struct Made {
    taps: BTreeMap<String, TapInterface>,
    /// The last failure that was reported.
    reported: Option<String>,
}

impl DebugTaps {
    /// No interface is made yet.
    pub fn new(master: u32) -> DebugTaps {
        DebugTaps { master, made: Mutex::default() }
    }

    fn made(&self) -> MutexGuard<'_, Made> {
        self.made.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Names and duplicates of the interfaces of so many links, which are made if they are not there. One that cannot
    /// be made is reported, and the master is driven without it.
    pub fn all(&self, links: usize) -> Vec<(String, OwnedFd)> {
        let mut made = self.made();
        // Another program may have removed one.
        made.taps.retain(|_, tap| tap.exists());
        let mut all = Vec::new();
        for letter in LETTERS.into_iter().take(links) {
            match made.find(self.master, letter) {
                Ok(found) => all.push(found),
                Err(error) => made.report(self.master, &error),
            }
        }
        all
    }

    /// At the end of the daemon: they last as long as a process has them.
    pub fn end(&self) {
        self.made().taps.values().for_each(TapInterface::end_with_processes);
    }
}

impl Made {
    fn find(&mut self, master: u32, letter: char) -> Result<(String, OwnedFd), TapError> {
        let name = format!("ecdbg{letter}{master}");
        if !self.taps.contains_key(&name) {
            self.taps.insert(name.clone(), TapInterface::create_lasting(&name, mac(master, letter))?);
        }
        let gone = |cause: &str| TapError::Refused { name: name.clone(), cause: cause.to_owned() };
        let tap = self.taps.get(&name).ok_or_else(|| gone("it was removed"))?;
        let descriptor = tap.as_fd().try_clone_to_owned().map_err(|error| gone(&error.to_string()))?;
        Ok((name, descriptor))
    }

    fn report(&mut self, master: u32, error: &TapError) {
        let text = error.to_string();
        if self.reported.as_ref() != Some(&text) {
            say(format_args!("master {master}: no debug interface: {text}"));
            self.reported = Some(text);
        }
    }
}

/// An address that is locally administered.
fn mac(master: u32, letter: char) -> [u8; 6] {
    let [.., high, low] = master.to_be_bytes();
    [0x02, 0xEC, 0xDB, letter as u8, high, low]
}
