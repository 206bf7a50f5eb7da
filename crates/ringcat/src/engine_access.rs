//! The engine below the library (feature `engine`), for procedures of one's own on its bus, runtimes of one's own, and
//! checkers. An application needs none of it: the services of a SubDevice are in [`SubDevice`](crate::SubDevice), what
//! is known of the segment in methods of [`MainDevice`], [`Application`] and [`SupervisorThread`].
//!
//! The library runs the engine: an application that also calls its functions for frames and orders (`receive`, `poll`,
//! `transmit`, `take_link_order`) takes frames and orders away from the library.

use ringcat_engine::main_device::MainDevice as Engine;

use crate::acyclic::Inline;
use crate::application::Application;
use crate::error::Error;
use crate::job::Job;
use crate::links::Links;
use crate::main_device::MainDevice;
use crate::supervisor_thread::SupervisorThread;

impl<L: Links> MainDevice<L> {
    /// The engine.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    /// The engine.
    pub fn engine_mut(&mut self) -> &mut Engine {
        &mut self.engine
    }

    /// Runs an async function of the engine to its end.
    pub fn run<T: 'static>(&mut self, work: impl Future<Output = T> + 'static) -> T {
        self.perform(work)
    }
}

impl<L: Links> Application<L, Inline> {
    /// The acyclic half.
    pub fn engine(&self) -> &Engine {
        &self.acyclic.engine
    }

    /// The acyclic half.
    pub fn engine_mut(&mut self) -> &mut Engine {
        &mut self.acyclic.engine
    }
}

impl SupervisorThread {
    /// Calls `act` with the engine in the thread, and waits for its result.
    ///
    /// # Errors
    /// The thread has ended.
    pub fn with<R: Send + 'static>(&self, act: impl FnOnce(&mut Engine) -> R + Send + 'static) -> Result<R, Error> {
        self.act(act)
    }

    /// Runs an async function of the engine in the thread and waits for its end: `make` gets the engine, and may take
    /// mailboxes from it. SubDevices are named by their index in the declaration, before activation by their position.
    ///
    /// # Errors
    /// The thread has ended, or the MainDevice was stopped meanwhile.
    pub fn run<T, W>(&self, make: impl FnOnce(&mut Engine) -> W + Send + 'static) -> Result<T, Error>
    where
        T: Send + 'static,
        W: Future<Output = T> + 'static,
    {
        self.start_procedure(make).wait()
    }

    /// Starts an async function of the engine in the thread; as [`SupervisorThread::run`], but does not wait for its
    /// end.
    pub fn start_job<T, W>(&self, make: impl FnOnce(&mut Engine) -> W + Send + 'static) -> Job<T>
    where
        T: Send + 'static,
        W: Future<Output = T> + 'static,
    {
        self.start_procedure(make)
    }
}
