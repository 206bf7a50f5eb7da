//! An exchange with the answering double as its segment, measured by the benches and tests of the cyclic path.
//!
//! In: number of SubDevices, their process data, the cabling. Out: whole cycles, one call each: receive, evaluate,
//! change the image, queue, send on the in-memory links.

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use ringcat::links::Links;
use ringcat::memory::MemoryLinks;
use ringcat_engine::Board;
use ringcat_engine::Identity;
use ringcat_engine::direction::Direction;
use ringcat_engine::domain::{DomainId, DomainStatus};
use ringcat_engine::exchange::Exchange;
use ringcat_engine::layout::{AreaSpec, DomainSpec, ImageOrder, Layout, LayoutError, RepeatRule};
use ringcat_engine::link::LinkSet;
use ringcat_engine::time::Instant;
use ringcat_engine::{Consumer, queue};
use ringcat_wire::frame::MacAddress;
use ringcat_wire::source_address::MacCodec;

use crate::answering_double::{AnsweringDouble, Cabling};

/// Time between two cycles.
pub const PERIOD: Duration = Duration::from_millis(1);
/// Frames that fit into each queue of the links.
const LINK_QUEUE: usize = 64;
/// Time from departure to return of frames, where lost frames are sent again.
const FLIGHT: Duration = Duration::from_micros(50);
/// Events that fit between the halves.
const EVENTS: usize = 64;
const MAIN: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x01]);
const REDUNDANT: MacAddress = MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x02]);

/// Parameters of the exchange.
#[derive(Clone, Copy, Debug)]
pub struct LoadSpec {
    /// Number of SubDevices.
    pub subdevices: usize,
    /// Bytes of outputs, and of inputs, of each of them.
    pub bytes: u16,
    /// Number of domains; each contains a part of the SubDevices.
    pub domains: usize,
    /// Limit of cycles of a domain under way.
    pub under_way: u8,
    /// Whether the SubDevices support LRW.
    pub lrw: bool,
    /// Whether the supervision datagram is included.
    pub supervision: bool,
    /// Links and paths of the copies.
    pub cabling: Cabling,
}

impl LoadSpec {
    /// Frames of a cycle, bytes of their datagrams, and bytes of presence datagrams among them.
    ///
    /// # Errors
    /// Process data that cannot be laid out.
    pub fn bytes(&self) -> Result<(usize, usize, usize), LayoutError> {
        let links = if self.cabling == Cabling::Line { LinkSet::Single } else { LinkSet::Ring };
        let layout = Layout::new(&domains(self), links, self.supervision)?;
        let frames: Vec<_> = layout.domains.iter().flat_map(|domain| &domain.frames).collect();
        let bytes = frames.iter().map(|frame| frame.bytes()).sum();
        let presence = frames.iter().filter_map(|frame| frame.presence.as_ref()).map(|it| it.bytes()).sum();
        Ok((frames.len(), bytes, presence))
    }
}

/// The exchange with its environment.
#[derive(Debug)]
pub struct CyclicLoad {
    /// The exchange.
    pub exchange: Exchange,
    /// The links between it and the double.
    pub links: MemoryLinks,
    /// Board shared with the absent acyclic half.
    pub board: Arc<Board>,
    /// Events of the exchange.
    pub events: Consumer,
    /// The double.
    pub double: AnsweringDouble,
    /// Time of the cycle.
    pub now: Instant,
}

impl CyclicLoad {
    /// An exchange in which all SubDevices take part.
    ///
    /// # Errors
    /// Process data that cannot be laid out.
    pub fn new(spec: &LoadSpec) -> Result<CyclicLoad, LayoutError> {
        CyclicLoad::with(spec, |_, _| Ok(()))
    }

    /// The same, and lost frames are sent again within their cycle: for [`CyclicLoad::cycle_with_tries`].
    ///
    /// # Errors
    /// Process data that cannot be laid out.
    pub fn sending_again(spec: &LoadSpec) -> Result<CyclicLoad, LayoutError> {
        let rules = vec![RepeatRule::default(); spec.subdevices];
        CyclicLoad::with(spec, |exchange, layout| {
            exchange.send_lost_frames_again(layout, &rules, |_| true);
            Ok(())
        })
    }

    pub(crate) fn with(
        spec: &LoadSpec,
        set_up: impl FnOnce(&mut Exchange, &Layout) -> Result<(), LayoutError>,
    ) -> Result<CyclicLoad, LayoutError> {
        let (links, redundant) = match spec.cabling {
            Cabling::Line => (LinkSet::Single, None),
            Cabling::ClosedRing | Cabling::CutRing { .. } => (LinkSet::Ring, Some(REDUNDANT)),
        };
        let layout = Layout::new(&domains(spec), links, spec.supervision)?;
        let board = Arc::new(Board::new(spec.subdevices));
        for subdevice in 0..spec.subdevices {
            board.set_taking_part(subdevice, true);
        }
        let (producer, events) = queue(EVENTS);
        let identity = Identity::new(MacCodec::FlagsFirst, MAIN, redundant);
        let mut exchange = Exchange::new(identity, links, &layout, board.clone(), producer);
        set_up(&mut exchange, &layout)?;
        Ok(CyclicLoad {
            exchange,
            links: MemoryLinks::new(MAIN, redundant, LINK_QUEUE),
            board,
            events,
            double: AnsweringDouble::new(&layout, spec.subdevices, spec.cabling),
            now: Instant::default(),
        })
    }

    /// The MainDevice's part of a cycle: all frames are received and evaluated, the application copies two bytes, all
    /// frames are sent. Returns the last domain's status.
    #[inline(never)]
    pub fn exchange_once(&mut self) -> DomainStatus {
        self.exchange_inline()
    }

    #[inline(always)]
    pub(crate) fn exchange_inline(&mut self) -> DomainStatus {
        let CyclicLoad { exchange, links, now, .. } = self;
        *now += PERIOD;
        links.set_now(*now);
        let mut status = DomainStatus::default();
        while links.receive(&mut |link, frame| {
            exchange.receive(link, frame, *now);
        }) {}
        for domain in (0..exchange.domain_count()).map(DomainId) {
            status = exchange.process(domain, *now);
            let image = exchange.image_mut(domain);
            // Outputs are first, inputs follow: the application copies an input to an output.
            if let [first, second, .., last] = image {
                *first = first.wrapping_add(1);
                *second = *last;
            }
            exchange.queue(domain, *now);
        }
        exchange.send(*now, &mut |link, frame| links.send(link, frame));
        black_box(status)
    }

    /// A whole cycle in which lost frames are sent again, segment included: frames leave, `lose` takes some of them
    /// from the links, the others come back, and what is lost is sent again until the next cycle begins.
    pub fn cycle_with_tries(&mut self, lose: impl FnOnce(&mut MemoryLinks)) {
        let CyclicLoad { exchange, links, now, .. } = self;
        for domain in (0..exchange.domain_count()).map(DomainId) {
            exchange.process(domain, *now);
            exchange.queue(domain, *now);
        }
        exchange.send(*now, &mut |link, frame| links.send(link, frame));
        let end = *now + PERIOD;
        exchange.expect_next(end);
        exchange.follow_departures(*now);
        lose(links);
        self.come_back();
        while self.exchange.decide_at() < end {
            self.now = self.now.max(self.exchange.decide_at());
            let CyclicLoad { exchange, links, now, .. } = self;
            exchange.decide(*now, *now, &mut |link, frame| links.send(link, frame));
            self.come_back();
        }
        self.now = end;
    }

    /// The segment answers, and the frames are received.
    fn come_back(&mut self) {
        self.answer();
        self.now += FLIGHT;
        let CyclicLoad { exchange, links, now, .. } = self;
        links.set_now(*now);
        while links.receive(&mut |link, frame| {
            exchange.receive_and_follow(link, frame, *now);
        }) {}
    }

    /// The segment's part of a cycle.
    pub fn answer(&mut self) {
        self.double.answer(&mut self.links.sent, &mut self.links.arriving);
    }

    /// The same work for the double in the other direction, so that it can run alone.
    pub fn answer_back(&mut self) {
        self.double.answer(&mut self.links.arriving, &mut self.links.sent);
    }
}

fn domains(spec: &LoadSpec) -> Vec<DomainSpec> {
    let (under_way, lrw) = (spec.under_way, spec.lrw);
    let domain = DomainSpec { period: PERIOD, under_way, lrw, areas: Vec::new(), image: ImageOrder::Packed };
    let mut domains = vec![domain; spec.domains.max(1)];
    let count = domains.len();
    for subdevice in 0..spec.subdevices {
        let area = |sync_manager, direction| AreaSpec { subdevice, sync_manager, direction, length: spec.bytes };
        let areas = &mut domains[subdevice * count / spec.subdevices].areas;
        areas.push(area(2, Direction::Outputs));
        areas.push(area(3, Direction::Inputs));
    }
    domains
}
