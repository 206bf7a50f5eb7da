//! An application on a bus that a daemon has handed over, in the steps of one with a MainDevice: request, scan,
//! activate.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use ringcat_control::socket::to_connect_to as find_socket;
use ringcat_engine::Scan;
use ringcat_engine::main_device::Declaration;
use ringcat_link::realtime;

use super::error::DaemonError;
use super::links::DaemonLinks;
use super::owned::OwnedBus;
use crate::application::Application;
use crate::error::Error;
use crate::main_device::Options;
use crate::supervisor_thread::SupervisorThread;

/// Where the daemon listens: the variable `RINGCAT_SOCKET` of the environment, or the usual place of this user or of
/// root ([`find_socket`]).
pub fn socket() -> PathBuf {
    find_socket(|name| std::env::var_os(name))
}

/// Name of this program, without its directory.
fn program() -> String {
    let program: OsString = std::env::args_os().next().unwrap_or_default();
    Path::new(&program).file_name().unwrap_or(&program).to_string_lossy().into_owned()
}

impl OwnedBus {
    /// Takes the bus of a master from the daemon at [`socket`], as [`OwnedBus::take`]. Its threads have normal priority
    /// on all processors, whatever the calling thread has.
    ///
    /// # Errors
    /// As [`OwnedBus::take`].
    pub fn request(master: u32, options: &Options) -> Result<OwnedBus, DaemonError> {
        OwnedBus::take(&socket(), master, &program(), options, realtime::leave)
    }

    /// What is on the bus: what the daemon knew and was found again at the hand-over, otherwise a new scan.
    ///
    /// # Errors
    /// As [`SupervisorThread::scan`].
    pub fn scan(&self) -> Result<Scan, Error> {
        match &self.scan {
            Some(scan) => Ok(scan.clone()),
            None => self.supervisor().scan(),
        }
    }

    /// Starts the application. It ends before this bus is given back; otherwise its outputs last until the daemon has
    /// the SubDevices in PREOP. The acyclic half keeps its own thread.
    ///
    /// # Errors
    /// The declaration does not fit. The links are back for another attempt; [`Error::Gone`] if an application has
    /// them.
    pub fn activate(&mut self, declaration: Declaration) -> Result<Application<DaemonLinks, SupervisorThread>, Error> {
        let links = self.take_links().ok_or(Error::Gone)?;
        self.supervisor().clone().activate(declaration, links).map_err(|refused| {
            let links = refused.main_device.links;
            self.give_links_back(links);
            refused.error
        })
    }
}
