//! The acyclic half in its own thread, with its own links.
//!
//! The thread sleeps until a frame, a deadline or a request comes, and reads once per cycle whether the cyclic half has
//! posted anything new; the cyclic half makes no system call for this. It sends in the windows that the cyclic half
//! leaves ([`crate::window`]). So neither half waits for the other, and supervision goes on for an application that
//! only runs its cycles.

mod half;
mod handover;
#[cfg(feature = "standby")]
mod joining;
mod looking;
mod worker;

use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::task::Waker;
use std::thread::JoinHandle;
use std::time::Duration;

use ringcat_engine::AcyclicCounters;
use ringcat_engine::JunctionConnection;
use ringcat_engine::Scan;
use ringcat_engine::config::{SubDeviceConfig, data_words};
use ringcat_engine::domain::DomainId;
use ringcat_engine::event::TimedEvent;
use ringcat_engine::main_device::{ActivateError, Declaration, MainDevice as Engine, Pending, SubDeviceState};
use ringcat_engine::ring_status::RingStatus;
use ringcat_engine::time::Instant;
#[cfg(feature = "eoe")]
use ringcat_link::WakeUp;
use ringcat_wire::al::AlState;

use crate::application::Application;
use crate::error::Error;
use crate::job::{InOrder, Job, Task, job};
use crate::links::Links;
use crate::main_device::{Options, Refused, take_data_words};
use crate::window::Window;
use worker::{Attention, Published, Request, Rest, Worker};

/// Stack of the thread, whose procedures are on the heap. A program that has locked its memory has all of it locked,
/// usually of 8 MiB.
const STACK_BYTES: usize = 512 << 10;

/// Interval of other work in a thread that waits for a scan.
const MEANWHILE: Duration = Duration::from_millis(10);

/// Handle of a MainDevice with its acyclic half in its own thread. Any thread may have a copy.
///
/// The thread ends when the last handle is dropped.
#[derive(Clone, Debug)]
pub struct SupervisorThread(Arc<Handle>);

#[derive(Debug)]
struct Handle {
    requests: Option<Sender<Request>>,
    events: Mutex<Receiver<TimedEvent>>,
    published: Arc<Published>,
    window: Arc<Window>,
    /// Ends a sleep of the thread.
    waker: Option<Waker>,
    #[cfg(feature = "eoe")]
    wake_up: Option<WakeUp>,
    thread: Option<JoinHandle<()>>,
}

impl SupervisorThread {
    /// Starts the thread on links that carry the frames of the acyclic half. `prepare` runs in it first: the place to
    /// set its priority and processor.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start<L>(links: L, options: &Options, prepare: impl FnOnce() + Send + 'static) -> Result<Self, Error>
    where
        L: Links + Send + 'static,
    {
        Self::start_with(links, options, prepare, |_| ())
    }

    fn start_with<L>(
        links: L,
        options: &Options,
        prepare: impl FnOnce() + Send + 'static,
        begin: impl FnOnce(&mut Engine) + Send + 'static,
    ) -> Result<Self, Error>
    where
        L: Links + Send + 'static,
    {
        let (requests, incoming) = channel();
        let (outgoing, events) = channel();
        let published = Arc::new(Published::default());
        let window = Arc::new(Window::new(options.acyclic_bytes));
        let options = options.clone();
        let waker = links.waker();
        #[cfg(feature = "eoe")]
        let wake_up = links.wake_up();
        let (shared, windows) = (published.clone(), window.clone());
        let body = move || {
            prepare();
            // The engine is created in this thread, because its procedures cannot move to another one.
            let mut engine = options.engine(&links);
            begin(&mut engine);
            let of_two = options.of_two(&links);
            Worker::new(links, (engine, of_two), windows, outgoing, shared).run(&incoming);
        };
        let builder = std::thread::Builder::new().name("supervisor".into()).stack_size(STACK_BYTES);
        let thread = builder.spawn(body).map_err(Error::Thread)?;
        let (requests, events) = (Some(requests), Mutex::new(events));
        Ok(SupervisorThread(Arc::new(Handle {
            requests,
            events,
            published,
            window,
            waker,
            #[cfg(feature = "eoe")]
            wake_up,
            thread: Some(thread),
        })))
    }

    /// Starts a task in the thread.
    fn begin(&self, begin: impl FnOnce(&mut Engine, Instant) -> Task + Send + 'static) -> Result<(), Error> {
        self.request(Attention::Engine, begin)
    }

    fn request(
        &self,
        attention: Attention,
        begin: impl FnOnce(&mut Engine, Instant) -> Task + Send + 'static,
    ) -> Result<(), Error> {
        let requests = self.0.requests.as_ref().ok_or(Error::Gone)?;
        requests.send(Request { attention, begin: Box::new(begin) }).map_err(|_| Error::Gone)?;
        self.0.wake();
        Ok(())
    }

    /// Starts work of the engine in the thread. All services from other threads use this method.
    pub(crate) fn start_work<T: Send + 'static>(
        &self,
        start: impl FnOnce(&mut Engine) -> Pending<T> + Send + 'static,
    ) -> Job<T> {
        let (job, reply) = job(self.clone());
        // If the thread has ended the reply is dropped, and the job fails.
        let _ = self.begin(move |engine, _| reply.follow(start(engine)));
        job
    }

    /// Calls `question` in each turn of the thread until it returns a result.
    fn ask<R: Send + 'static>(&self, question: impl FnMut(&mut Engine) -> Option<R> + Send + 'static) -> Job<R> {
        let (job, reply) = job(self.clone());
        let _ = self.begin(move |_, _| reply.answer(question));
        job
    }

    /// Calls a closure with the engine in each turn of the thread, until it returns true: when the engine has worked,
    /// after a call of [`SupervisorThread::waker`], and every 10 ms.
    #[cfg(any(feature = "eoe", feature = "gateway"))]
    pub(crate) fn attend(&self, work: impl FnMut(&mut Engine, Instant) -> bool + Send + 'static) -> Result<(), Error> {
        self.request(Attention::Engine, move |_, _| Box::new(work))
    }

    /// The same, and every half millisecond.
    #[cfg(feature = "eoe")]
    pub(crate) fn attend_often(
        &self,
        work: impl FnMut(&mut Engine, Instant) -> bool + Send + 'static,
    ) -> Result<(), Error> {
        self.request(Attention::Often, move |_, _| Box::new(work))
    }

    /// Ends a sleep of the thread; does nothing where links have no waker, because the thread wakes often then.
    #[cfg(any(feature = "eoe", feature = "gateway"))]
    pub(crate) fn waker(&self) -> Waker {
        self.0.waker.clone().unwrap_or_else(|| Waker::noop().clone())
    }

    /// With descriptors that end a sleep of the thread.
    #[cfg(feature = "eoe")]
    pub(crate) fn wake_up(&self) -> Option<WakeUp> {
        self.0.wake_up.clone()
    }

    /// Runs `act` with the engine in the thread, and waits for its result.
    ///
    /// # Errors
    /// The thread has ended.
    pub(crate) fn act<R: Send + 'static>(
        &self,
        act: impl FnOnce(&mut Engine) -> R + Send + 'static,
    ) -> Result<R, Error> {
        let mut act = Some(act);
        self.ask(move |engine| act.take().map(|act| act(engine))).wait()
    }

    /// Starts an async function of the engine in the thread: `make` gets the engine, and may take mailboxes from it.
    /// SubDevices are named by their index in the declaration, before activation by their position.
    #[cfg(any(feature = "daemon", feature = "engine"))]
    pub(crate) fn start_procedure<T, W>(&self, make: impl FnOnce(&mut Engine) -> W + Send + 'static) -> Job<T>
    where
        T: Send + 'static,
        W: Future<Output = T> + 'static,
    {
        self.start_work(move |engine| {
            let work = make(engine);
            engine.start(work)
        })
    }

    /// Scans the segment; all SubDevices are in INIT afterwards.
    ///
    /// # Errors
    /// [`Error::Scan`]: no frame returns, no SubDevice answers, the number of SubDevices does not settle, an SII cannot
    /// be read, and others ([`ScanError`](crate::ScanError)).
    pub fn scan(&self) -> Result<Scan, Error> {
        self.scan_while(|| ())
    }

    /// Scans like [`SupervisorThread::scan`], and calls `meanwhile` about every 10 ms, for example to take events.
    ///
    /// # Errors
    /// As [`SupervisorThread::scan`].
    pub fn scan_while(&self, meanwhile: impl FnMut()) -> Result<Scan, Error> {
        self.act(Engine::start_scan)??;
        self.finish_scan(meanwhile)
    }

    /// Scans like [`SupervisorThread::scan`], and ends a scan that is under way: one that idle operation has begun, or
    /// one that another thread waits for, which then gets the result of this one.
    ///
    /// # Errors
    /// As [`SupervisorThread::scan`].
    pub fn restart_scan(&self) -> Result<Scan, Error> {
        self.act(Engine::restart_scan)??;
        self.finish_scan(|| ())
    }

    /// Reads the data words by which declared SubDevices are found; after that [`SupervisorThread::subdevices`] has
    /// them.
    ///
    /// # Errors
    /// [`Error::Gone`]: the thread has ended.
    pub fn learn_data_words(&self, declared: &[SubDeviceConfig]) -> Result<(), Error> {
        let words = data_words(declared);
        if !words.is_empty() {
            self.start_work(move |engine| engine.start_data_words(words)).wait()?;
        }
        Ok(())
    }

    /// As [`crate::MainDevice::read_data_words`].
    ///
    /// # Errors
    /// [`Error::Gone`]: the thread has ended.
    pub fn read_data_words(&self, declared: &[SubDeviceConfig], scan: &mut Scan) -> Result<(), Error> {
        let words = data_words(declared);
        take_data_words(self.start_work(move |engine| engine.start_data_words(words)).wait()?, scan);
        Ok(())
    }

    /// Waits for the end of a scan that the engine has begun.
    pub(crate) fn finish_scan(&self, mut meanwhile: impl FnMut()) -> Result<Scan, Error> {
        let mut scan = self.ask(|engine| engine.scan_result());
        let result = loop {
            meanwhile();
            if let Some(result) = scan.wait_for(MEANWHILE) {
                break result?;
            }
        };
        meanwhile();
        Ok(result?)
    }

    /// Lays out process data, starts the configuration of all SubDevices, and returns the running application. Its
    /// cycles use `links`, which carry the frames of the cyclic half on the same interfaces.
    ///
    /// # Errors
    /// The declaration does not fit the scan, or process data does not fit into frames. The error contains the handle
    /// and the links for another attempt.
    pub fn activate<C: Links>(self, declaration: Declaration, links: C) -> Activated<C> {
        match self.load(declaration) {
            Ok(()) => self.apply(links),
            Err(error) => Err(Box::new(Refused { error, main_device: Ended { supervisor: self, links } })),
        }
    }

    /// First of the steps that [`SupervisorThread::activate`] combines, as [`crate::MainDevice::load`].
    ///
    /// # Errors
    /// Errors in the declaration alone.
    pub fn load(&self, declaration: Declaration) -> Result<(), Error> {
        Ok(self.act(move |engine| engine.load(declaration))??)
    }

    /// Gives back the memory for the image of a domain after a failed activation ([`Declaration::place_image`]).
    pub fn unused_memory(&self, domain: DomainId) -> Option<&'static mut [u8]> {
        self.act(move |engine| engine.unused_memory(domain)).ok().flatten()
    }

    /// The same of the memory for process data between both MainDevices
    /// ([`Declaration::place_partner_data`](crate::Declaration::place_partner_data)).
    #[cfg(feature = "standby")]
    pub fn unused_partner_memory(&self) -> Option<crate::standby::PartnerMemory> {
        self.act(|engine| engine.unused_partner_memory()).ok().flatten()
    }

    /// Second step, as [`crate::MainDevice::add_junction_connection`].
    ///
    /// # Errors
    /// Nothing is loaded, or the connection is wrong.
    pub fn add_junction_connection(&self, connection: JunctionConnection) -> Result<(), Error> {
        let added = self.act(move |engine| engine.add_junction_connection(connection))?;
        Ok(added.map_err(ActivateError::Junction)?)
    }

    /// Last step, as [`crate::MainDevice::apply`]; cycles run on `links`.
    ///
    /// # Errors
    /// Nothing is loaded, or the declaration does not fit the scan.
    pub fn apply<C: Links>(self, links: C) -> Activated<C> {
        // From then on the windows of the cyclic half apply, so its first cycle must begin soon.
        let published = self.0.published.clone();
        let apply = move |engine: &mut Engine| {
            let applied = engine.apply();
            published.states_of(engine);
            applied
        };
        let apply = || self.act(apply)?.map_err(Error::from);
        match self.read_loaded_data_words().and_then(|()| self.check_connections()).and_then(|()| apply()) {
            Ok(active) => {
                let (window, published) = (self.0.window.clone(), self.0.published.clone());
                let application = Application::new(links, self, active, window);
                published.observes(&application.cyclic.observed);
                Ok(application)
            }
            Err(error) => Err(Box::new(Refused { error, main_device: Ended { supervisor: self, links } })),
        }
    }

    /// Reads the data words by which the loaded declaration finds SubDevices.
    fn read_loaded_data_words(&self) -> Result<(), Error> {
        Ok(self.start_work(|engine| engine.start_loaded_data_words()).wait()??)
    }

    /// Checks that the declared rings close as declared.
    fn check_connections(&self) -> Result<(), Error> {
        let checked = self.start_work(|engine| engine.start_connection_check()).wait()?;
        Ok(checked.map_err(ActivateError::Junction)?)
    }

    /// Brings all SubDevices down to a state.
    pub(crate) fn stop(&self, state: AlState, limit: Duration) -> Result<(), Error> {
        let (begun, reply) = job(self.clone());
        self.begin(move |engine, now| {
            engine.start_stop(state, limit, now);
            reply.answer(|engine| engine.stop_result())
        })?;
        Ok(begun.wait()??)
    }

    /// Brings all SubDevices to PREOP, without an application.
    pub(crate) fn deactivate(&self, limit: Duration) -> Result<(), Error> {
        let (ended, reply) = job(self.clone());
        let published = self.0.published.clone();
        self.begin(move |engine, now| {
            let mut begun = Some(engine.start_deactivate(limit, now).map_err(Error::from));
            reply.answer(move |engine| match begun.take() {
                Some(Err(error)) => Some(Err(error)),
                Some(Ok(())) | None => {
                    let result = engine.stop_result()?;
                    published.states_of(engine);
                    Some(result.map_err(Error::from))
                }
            })
        })?;
        ended.wait()?
    }

    fn rest(&self) -> Rest {
        self.0.published.rest.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Number of events that were dropped because they were not taken in time.
    pub fn events_dropped(&self) -> u64 {
        self.rest().events_dropped
    }

    /// State of each declared SubDevice, at most some milliseconds old.
    pub fn states(&self) -> Vec<SubDeviceState> {
        self.rest().states
    }

    /// The ring and both links, at most some milliseconds old.
    pub fn ring_status(&self) -> RingStatus {
        self.rest().ring
    }

    /// Whether every declared SubDevice is in its target state. Reads one atomic.
    pub fn all_settled(&self) -> bool {
        self.0.published.settled.load(Ordering::Acquire)
    }

    /// Takes the oldest event.
    pub fn pop_event(&self) -> Option<TimedEvent> {
        let event = self.0.events.lock().unwrap_or_else(PoisonError::into_inner).try_recv().ok()?;
        self.0.published.waiting.fetch_sub(1, Ordering::AcqRel);
        Some(event)
    }

    /// Counters of everything but process data, at most some milliseconds old.
    pub fn counters(&self) -> AcyclicCounters {
        self.rest().counters
    }
}

impl InOrder for SupervisorThread {
    fn catch_up(&self) -> Result<(), Error> {
        self.act(|_| ())
    }

    fn wake(&self) {
        self.0.wake();
    }
}

impl Handle {
    fn wake(&self) {
        self.waker.iter().for_each(Waker::wake_by_ref);
    }
}

impl Drop for Handle {
    fn drop(&mut self) {
        self.requests = None;
        self.wake();
        if let Some(thread) = self.thread.take() {
            // The panic handler has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}

/// The rest of an application with two threads that has ended or was refused: another one may be activated with both.
#[derive(Debug)]
#[non_exhaustive]
pub struct Ended<L> {
    /// The thread of the acyclic half.
    pub supervisor: SupervisorThread,
    /// The links of the cycles.
    pub links: L,
}

/// A running application, or the handle and the links for another attempt.
pub type Activated<C> = Result<Application<C, SupervisorThread>, Box<Refused<Ended<C>>>>;
