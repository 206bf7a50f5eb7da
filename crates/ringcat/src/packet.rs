//! Links that are network interfaces: one packet socket each, or two where both halves have threads of their own.
//!
//! Time is `CLOCK_MONOTONIC`. [`ReceiveMode`] selects how [`Links::wait`] waits: asleep, spinning, or first spinning,
//! then asleep. A link that is down drops frames, and works again as soon as it is up.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::sync::Arc;
use std::task::Waker;
use std::time::Duration;

use ringcat_engine::link::Link;
use ringcat_engine::time::Instant;
use ringcat_link::interface;
use ringcat_link::{CarrierWatch, ClassFilter, PacketOptions, PacketSocket, SendingSide, UsualReturn};
use ringcat_link::{WakeUp, monotonic};
use ringcat_wire::frame::MacAddress;

pub use ringcat_link::{HandedSocket, LinkCounters, LinkError, ReceiveMode};

use crate::links::{Arrived, Links, PerLink, SendOn};

/// Interval of the check of the carriers of an INACTIVE MainDevice: it sends frames back where a link is down.
pub const FORWARDING_CARRIER_PERIOD: Duration = Duration::from_millis(1);
/// Slots of a receive ring for each class of frames in it, 2 KiB each: more than the frames of a class that may be on
/// the wire at once ([`ringcat_engine::MAX_IN_FLIGHT`]).
const RING_FRAMES: u32 = 128;
const _: () = assert!(RING_FRAMES as usize > ringcat_engine::MAX_IN_FLIGHT);

/// One or two network interfaces.
#[derive(Debug)]
pub struct PacketLinks {
    main: PacketSocket,
    redundant: Option<PacketSocket>,
    /// Link of the last taken frame.
    taken_from: Link,
    mode: ReceiveMode,
    /// Usual return time of frames, for hybrid waits.
    usual: UsualReturn,
    /// A frame was sent since the last wait.
    has_sent: bool,
    /// Polls the carriers; not for the cyclic half, which evaluates returned frames only.
    carriers: Option<CarrierWatch>,
    /// Ends waits from other threads; not for the cyclic half, which waits for frames and times alone.
    wake_up: Option<WakeUp>,
    /// Names of both interfaces.
    names: [Option<String>; 2],
    /// Interfaces that were switched off to be disconnected.
    disconnected: [bool; 2],
    /// Switches them in place of this process.
    switch: Option<Arc<dyn SwitchLinks>>,
    /// The place in a ring may be in doubt.
    is_searching: bool,
}

/// Switches interfaces of links off and on, in place of the process that uses them.
pub trait SwitchLinks: std::fmt::Debug + Send + Sync {
    /// Switches the interface of a link; false if that is not possible. Does not wait.
    fn switch(&self, link: Link, up: bool) -> bool;
}

/// A socket that another process has opened, with what it said about it.
pub type HandedLink = (OwnedFd, HandedSocket);

impl Drop for PacketLinks {
    fn drop(&mut self) {
        for link in Link::ALL {
            if self.disconnected[link.index()] {
                self.force_disconnect(link, false);
            }
        }
    }
}

impl PacketLinks {
    /// Opens the interfaces.
    ///
    /// # Errors
    /// An interface does not exist or is not Ethernet, or a permission is missing.
    pub fn open(main: &str, redundant: Option<&str>, mode: ReceiveMode) -> Result<PacketLinks, LinkError> {
        let links = PacketLinks::open_class(main, redundant, mode, ClassFilter::All)?;
        links.watch_carriers(main, redundant, CarrierWatch::PERIOD)
    }

    /// As [`PacketLinks::open`], for an INACTIVE MainDevice, which detects the loss of a carrier within
    /// [`FORWARDING_CARRIER_PERIOD`]. The interfaces may be down; [`PacketLinks::switch`] brings them up.
    ///
    /// # Errors
    /// As [`PacketLinks::open`].
    pub fn open_forwarding(main: &str, redundant: &str, mode: ReceiveMode) -> Result<PacketLinks, LinkError> {
        let links = PacketLinks::open_class(main, Some(redundant), mode, ClassFilter::All)?;
        links.watch_carriers(main, Some(redundant), FORWARDING_CARRIER_PERIOD)
    }

    /// Opens the interfaces twice: for the cyclic half, which waits for frames in this mode, and for the acyclic half,
    /// which sleeps.
    ///
    /// # Errors
    /// As [`PacketLinks::open`].
    pub fn open_halves(
        main: &str,
        redundant: Option<&str>,
        cyclic: ReceiveMode,
    ) -> Result<(PacketLinks, PacketLinks), LinkError> {
        Ok((
            PacketLinks::open_class(main, redundant, cyclic, ClassFilter::Cyclic)?,
            PacketLinks::open_class(main, redundant, ReceiveMode::Blocking, ClassFilter::Acyclic)?
                .watch_carriers(main, redundant, CarrierWatch::PERIOD)?
                .with_wake_up()?,
        ))
    }

    /// As [`PacketLinks::open_halves`], for one of two MainDevices; carriers as [`PacketLinks::open_forwarding`].
    ///
    /// # Errors
    /// As [`PacketLinks::open`].
    pub fn open_forwarding_halves(
        main: &str,
        redundant: &str,
        cyclic: ReceiveMode,
    ) -> Result<(PacketLinks, PacketLinks), LinkError> {
        let acyclic = PacketLinks::open_class(main, Some(redundant), ReceiveMode::Blocking, ClassFilter::Acyclic)?;
        Ok((
            PacketLinks::open_class(main, Some(redundant), cyclic, ClassFilter::Cyclic)?,
            acyclic.watch_carriers(main, Some(redundant), FORWARDING_CARRIER_PERIOD)?.with_wake_up()?,
        ))
    }

    fn open_class(
        main: &str,
        redundant: Option<&str>,
        mode: ReceiveMode,
        filter: ClassFilter,
    ) -> Result<PacketLinks, LinkError> {
        let classes = if filter == ClassFilter::All { 2 } else { 1 };
        let ring_frames = RING_FRAMES * classes;
        let options = PacketOptions::default().with_receive(mode).with_filter(filter).with_ring_frames(ring_frames);
        let names = [Some(main.to_owned()), redundant.map(str::to_owned)];
        let redundant = redundant.map(|name| PacketSocket::open(name, &options)).transpose()?;
        let main = PacketSocket::open(main, &options)?;
        Ok(PacketLinks {
            main,
            redundant,
            taken_from: Link::Main,
            mode,
            usual: UsualReturn::default(),
            has_sent: false,
            carriers: None,
            wake_up: None,
            names,
            disconnected: [false; 2],
            switch: None,
            is_searching: false,
        })
    }

    /// Goes on with sockets that another process has opened and that this one has received
    /// ([`ringcat_link::descriptors`]), for all classes of frames. No privilege is needed. Frames that wait are
    /// received first. Where the place in a ring is not given it is found ([`PacketSocket::adopt`]).
    ///
    /// # Errors
    /// A descriptor is no packet socket with a ring of this size, or it is bound to another interface.
    pub fn adopt(main: HandedLink, redundant: Option<HandedLink>) -> Result<PacketLinks, LinkError> {
        PacketLinks::adopt_class(main, redundant)?.watch_own_carriers()
    }

    /// Goes on with sockets of each class: links for the cyclic half and for the acyclic half, as
    /// [`PacketLinks::open_halves`] has them.
    ///
    /// # Errors
    /// As [`PacketLinks::adopt`], or the process has no more descriptors.
    pub fn adopt_halves(
        cyclic: PerLink<HandedLink>,
        acyclic: PerLink<HandedLink>,
    ) -> Result<(PacketLinks, PacketLinks), LinkError> {
        Ok((
            PacketLinks::adopt_class(cyclic.main, cyclic.redundant)?,
            PacketLinks::adopt_class(acyclic.main, acyclic.redundant)?.watch_own_carriers()?.with_wake_up()?,
        ))
    }

    fn adopt_class(main: HandedLink, redundant: Option<HandedLink>) -> Result<PacketLinks, LinkError> {
        let names = [Some(main.1.interface.clone()), redundant.as_ref().map(|(_, it)| it.interface.clone())];
        let mode = main.1.receive;
        let adopt = |(fd, handed): HandedLink| PacketSocket::adopt(fd, &handed);
        Ok(PacketLinks {
            main: adopt(main)?,
            redundant: redundant.map(adopt).transpose()?,
            taken_from: Link::Main,
            mode,
            usual: UsualReturn::default(),
            has_sent: false,
            carriers: None,
            wake_up: None,
            names,
            disconnected: [false; 2],
            switch: None,
            is_searching: true,
        })
    }

    fn watch_own_carriers(mut self) -> Result<PacketLinks, LinkError> {
        let names = self.names.clone();
        let names: Vec<&str> = names.iter().flatten().map(String::as_str).collect();
        let carriers = Some(CarrierWatch::start_for_any(&names, CarrierWatch::PERIOD)?);
        self.carriers = carriers;
        Ok(self)
    }

    /// Another process switches the interfaces.
    #[must_use]
    pub fn with_switch(mut self, switch: Arc<dyn SwitchLinks>) -> PacketLinks {
        self.switch = Some(switch);
        self
    }

    /// What another process needs to continue with the sockets, beside duplicates of their descriptors.
    pub fn handed(&self) -> PerLink<HandedSocket> {
        PerLink::new(self.main.handed(), self.redundant.as_ref().map(PacketSocket::handed))
    }

    /// The descriptors of both sockets, to be duplicated for another process.
    pub fn descriptors(&self) -> PerLink<BorrowedFd<'_>> {
        PerLink::new(self.main.as_fd(), self.redundant.as_ref().map(PacketSocket::as_fd))
    }

    #[cold]
    fn find_places(&mut self) {
        let is_found = self.main.find_place() & self.redundant.as_mut().is_none_or(PacketSocket::find_place);
        self.is_searching = !is_found;
    }

    /// A hybrid wait for the first frame that comes back.
    fn wait_as_usual(&mut self, now: Instant, until: Instant, spin: Duration) {
        match &self.redundant {
            Some(redundant) => self.usual.wait(&[&self.main, redundant], now.0, until.0, spin),
            None => self.usual.wait(&[&self.main], now.0, until.0, spin),
        };
    }

    fn watch_carriers(
        mut self,
        main: &str,
        redundant: Option<&str>,
        period: Duration,
    ) -> Result<PacketLinks, LinkError> {
        let interfaces: Vec<&str> = core::iter::once(main).chain(redundant).collect();
        self.carriers = Some(CarrierWatch::start(&interfaces, period)?);
        Ok(self)
    }

    fn with_wake_up(mut self) -> Result<PacketLinks, LinkError> {
        self.wake_up = Some(WakeUp::new()?);
        Ok(self)
    }

    /// Switches all interfaces on, or off for good: also when these links are dropped they stay off. A controller in
    /// a ring of two MainDevices has its links up only while it forwards or is ACTIVE (protocol MR-21). Not for the
    /// cyclic path.
    ///
    /// # Errors
    /// It is not permitted (CAP_NET_ADMIN). All interfaces were tried.
    pub fn switch(&mut self, up: bool) -> Result<(), LinkError> {
        self.disconnected = [false; 2];
        let switched = self.names.iter().flatten().map(|name| interface::switch(name, up));
        switched.fold(Ok(()), Result::and)
    }

    /// Counters of frames sent, received and lost by an interface; `None` if there is no such interface.
    pub fn counters(&self, link: Link) -> Option<LinkCounters> {
        match link {
            Link::Main => Some(self.main.counters()),
            Link::Redundant => self.redundant.as_ref().map(PacketSocket::counters),
        }
    }
}

impl Links for PacketLinks {
    #[inline(always)]
    fn now(&self) -> Instant {
        Instant(monotonic::now_ns())
    }

    fn addresses(&self) -> PerLink<MacAddress> {
        PerLink::new(MacAddress(self.main.mac()), self.redundant.as_ref().map(|socket| MacAddress(socket.mac())))
    }

    #[inline(always)]
    fn send(&mut self, link: Link, frame: &[u8]) {
        self.has_sent = true;
        match link {
            Link::Main => self.main.send(frame),
            // The socket counts frames that it could not send; the engine detects that they do not return.
            Link::Redundant => self.redundant.as_mut().is_some_and(|socket| socket.send(frame)),
        };
    }

    #[inline(always)]
    fn receive(&mut self, take: &mut dyn FnMut(Link, &[u8])) -> bool {
        self.taken_from = Link::Main;
        if self.main.receive(&mut |frame| take(Link::Main, frame)) {
            return true;
        }
        let Some(redundant) = &mut self.redundant else { return false };
        self.taken_from = Link::Redundant;
        redundant.receive(&mut |frame| take(Link::Redundant, frame))
    }

    /// In the slot of the ring of its socket.
    fn receive_and_pass(&mut self, since: Instant, pass: &mut dyn FnMut(Arrived<'_>, &mut dyn SendOn)) -> bool {
        let between = (since.0, monotonic::now_ns());
        let PacketLinks { main, redundant, carriers, .. } = self;
        let carriers = carriers.as_ref();
        let from_main = main.receive_in_place(between, &mut |frame, at, main| {
            let redundant = redundant.as_mut().map(PacketSocket::sender);
            let arrived = Arrived::new(Link::Main, Instant(at), frame);
            pass(arrived, &mut Sides { main, redundant, carriers });
        });
        let Some(redundant) = redundant.as_mut().filter(|_| !from_main) else { return from_main };
        redundant.receive_in_place(between, &mut |frame, at, redundant| {
            let arrived = Arrived::new(Link::Redundant, Instant(at), frame);
            pass(arrived, &mut Sides { main: main.sender(), redundant: Some(redundant), carriers });
        })
    }

    #[inline(always)]
    fn has_frame(&self) -> bool {
        self.main.has_frame() || self.redundant.as_ref().is_some_and(PacketSocket::has_frame)
    }

    fn has_arrival_times(&self) -> bool {
        true
    }

    /// The kernel's receive time.
    #[inline(always)]
    fn received_at(&mut self, sent_at: Instant, now: Instant) -> Option<Instant> {
        let socket = match self.taken_from {
            Link::Main => Some(&mut self.main),
            Link::Redundant => self.redundant.as_mut(),
        };
        socket.map(|socket| Instant(socket.received_at_ns(sent_at.0, now.0)))
    }

    fn carrier(&self, link: Link) -> Option<bool> {
        let has_link = link == Link::Main || self.redundant.is_some();
        self.carriers.as_ref().filter(|_| has_link).map(|watch| watch.carrier(link.index()).is_up())
    }

    fn waker(&self) -> Option<Waker> {
        self.wake_up.as_ref().map(WakeUp::waker)
    }

    #[cfg(feature = "eoe")]
    fn wake_up(&self) -> Option<WakeUp> {
        self.wake_up.clone()
    }

    fn take_call(&mut self) -> bool {
        self.wake_up.as_ref().is_some_and(WakeUp::take_call)
    }

    fn wait(&mut self, until: Instant) {
        self.wait_from(self.now(), until);
    }

    #[inline(always)]
    fn wait_from(&mut self, now: Instant, until: Instant) {
        if self.is_searching {
            self.find_places();
        }
        let is_first = core::mem::take(&mut self.has_sent);
        if let ReceiveMode::Hybrid { spin } = self.mode
            && is_first
        {
            self.wait_as_usual(now, until, spin);
            return;
        }
        if let Some(wake_up) = &self.wake_up {
            match &self.redundant {
                Some(redundant) => ringcat_link::wait_or_wake(&[&self.main, redundant], wake_up, now.0, until.0),
                None => ringcat_link::wait_or_wake(&[&self.main], wake_up, now.0, until.0),
            };
            return;
        }
        match &self.redundant {
            Some(redundant) => ringcat_link::wait_from(&[&self.main, redundant], now.0, until.0, self.mode),
            None => ringcat_link::wait_from(&[&self.main], now.0, until.0, self.mode),
        };
    }

    #[inline(always)]
    fn sleep(&mut self, until: Instant) {
        match self.mode {
            // A spinning processor does not enter a sleep state, and reacts at once.
            ReceiveMode::BusyPoll => self.wait(until),
            _ => monotonic::sleep_until_ns(until.0),
        }
    }

    /// Switches the interface off or on, which needs CAP_NET_ADMIN here, or in the process that does it.
    fn force_disconnect(&mut self, link: Link, disconnect: bool) -> bool {
        let Some(name) = &self.names[link.index()] else { return false };
        let done = match &self.switch {
            Some(switch) => switch.switch(link, !disconnect),
            None => interface::switch(name, !disconnect).is_ok(),
        };
        if done {
            self.disconnected[link.index()] = disconnect;
        }
        done
    }
}

/// The sending sides of both sockets, while a frame of one of them is held.
struct Sides<'a> {
    main: SendingSide<'a>,
    redundant: Option<SendingSide<'a>>,
    carriers: Option<&'a CarrierWatch>,
}

impl SendOn for Sides<'_> {
    fn is_up(&self, link: Link) -> bool {
        let has_link = link == Link::Main || self.redundant.is_some();
        has_link && self.carriers.is_none_or(|watch| watch.carrier(link.index()).is_up())
    }

    fn send(&mut self, link: Link, frame: &[u8]) -> bool {
        match link {
            Link::Main => self.main.send(frame),
            Link::Redundant => self.redundant.as_mut().is_some_and(|side| side.send(frame)),
        }
    }
}
