//! From listening to cycles, in a thread of its own, which forwards meanwhile.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::thread::JoinHandle;

use ringcat::standby::Policy;
use ringcat::text::Names;
use ringcat::{CyclicThread, Declaration, ProcessData, Scan, SupervisorThread, Trigger, automatic};

use super::beating::{Beats, HalfLinks};
use crate::failure::Failure;
use crate::run::configured::ConfiguredNetwork;
use crate::run::declared::DeclarationArguments;
use crate::run::watched::{Watched, Work};
use crate::thread::ThreadArguments;

/// What joins.
#[derive(Clone)]
pub struct Joiner {
    pub supervisor: SupervisorThread,
    pub policy: Policy,
    pub declared: Arc<DeclarationArguments>,
    pub network: Option<Arc<ConfiguredNetwork>>,
    pub thread: ThreadArguments,
    /// The other MainDevice is ready to take over, as determined while this one is ACTIVE.
    pub partner_ready: Arc<AtomicBool>,
    pub beats: Arc<Beats>,
    /// Names of the SubDevices, when they are known.
    pub names: Arc<OnceLock<Names>>,
}

/// Cycles that run.
pub struct Joined {
    pub cycles: CyclicThread<HalfLinks>,
    /// Variables of the file that are printed.
    pub watched: Watched,
}

/// What was declared.
#[derive(Default)]
struct Declared {
    trigger: Option<Trigger>,
    /// Why there is no declaration.
    failure: Option<Failure>,
}

impl Joiner {
    /// Starts the thread.
    pub fn start(self, cyclic: HalfLinks) -> Result<JoinHandle<Result<Joined, Failure>>, Failure> {
        let thread = std::thread::Builder::new().name("joining".to_owned()).spawn(move || self.join(cyclic));
        thread.map_err(|error| Failure::new(format!("a thread cannot be started: {error}")))
    }

    fn join(self, cyclic: HalfLinks) -> Result<Joined, Failure> {
        self.thread.prepare_cycles();
        let noted = Arc::new(Mutex::new(Declared::default()));
        let (declarer, for_closure) = (self.clone(), noted.clone());
        let declare = move |scan: &Scan| declarer.declare(scan, &for_closure);
        let joined = self.supervisor.clone().join(&self.policy, declare, cyclic);
        let Declared { trigger, failure } = std::mem::take(&mut *noted.lock().unwrap_or_else(PoisonError::into_inner));
        // The substitute of a wrong declaration is not used.
        if let Some(failure) = failure {
            return Err(failure);
        }
        let mut application = joined.map_err(|refused| match &self.network {
            Some(network) => network.explain(refused.error),
            None => Failure::from(refused.error),
        })?;
        if let Some(trigger) = trigger {
            application.set_trigger(trigger);
        }
        let (file, watched) = match &self.network {
            Some(network) => {
                let (work, watched) = network.work(application.directory())?;
                application.set_copies(work.copies()).map_err(|error| Failure::new(error.to_string()))?;
                (Some(work), watched)
            }
            None => (None, Watched::default()),
        };
        let thread = self.thread;
        let cycles = application.start_cycles(move || thread.prepare_cycles(), work(file, self.partner_ready))?;
        self.beats.cycles_run.store(true, Ordering::Relaxed);
        Ok(Joined { cycles, watched })
    }

    /// The declaration for a scan, or that of no SubDevice, with the reason noted.
    fn declare(&self, scan: &Scan, noted: &Mutex<Declared>) -> Declaration {
        let found = &scan.subdevices;
        let declared = self.declared.declare(self.network.as_deref(), found);
        let mut noted = noted.lock().unwrap_or_else(PoisonError::into_inner);
        // Only the first declaration names them.
        let _ = self.names.set(match &self.network {
            Some(network) => network.names(),
            None => Names(found.iter().map(|info| info.name.clone()).collect()),
        });
        match declared {
            Ok(declaration) => {
                noted.trigger = self.declared.trigger(&declaration);
                declaration
            }
            Err(failure) => {
                noted.failure = Some(failure);
                automatic(&[], self.declared.cycle)
            }
        }
    }
}

/// The work of each cycle, in both roles.
fn work(
    mut file: Option<Work>,
    ready: Arc<AtomicBool>,
) -> impl FnMut(&mut ProcessData<'_>) -> ControlFlow<()> + Send + 'static {
    move |data| {
        if let Some(file) = &mut file {
            file.cycle(data);
        }
        ready.store(data.partner().is_ready(), Ordering::Relaxed);
        ControlFlow::Continue(())
    }
}
