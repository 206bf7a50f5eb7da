//! The bench: both exchanges, the ring between them, and what a cycle does.

use core::time::Duration;
use std::boxed::Box;
use std::sync::Arc;
use std::vec;
use std::vec::Vec;

use ringcat_wire::frame::MacAddress;
use ringcat_wire::master_frame::{Area, fragments_mut, is_master_frame};
use ringcat_wire::source_address::{FORWARDED_ON_MAIN, FORWARDED_ON_REDUNDANT, MacCodec};

use crate::board::Board;
use crate::board::live::{Life, Presence};
use crate::board::standby::StandbyWords;
use crate::direction::Direction;
use crate::domain::DomainId;
use crate::event::{CyclicEvent, CyclicStandbyEvent};
use crate::exchange::{Exchange, StandbySetup};
use crate::layout::{AreaSpec, DomainSpec, ImageOrder, Layout, MasterSizes, PlannedMasterFrames};
use crate::link::{Link, LinkSet};
use crate::queue::{Consumer, queue};
use crate::ring::Identity;
use crate::role::{MainDeviceRole, RoleControl};
use crate::time::Instant;

pub const DOMAIN: DomainId = DomainId(0);
pub const PERIOD: Duration = Duration::from_millis(1);

/// One MainDevice.
pub struct Device {
    pub exchange: Exchange,
    pub board: Arc<Board>,
    pub words: Arc<StandbyWords>,
    pub control: RoleControl,
    events: Consumer,
}

impl Device {
    pub fn new(last: u8, role: MainDeviceRole, sizes: MasterSizes, (identity, items): (u64, &[u32])) -> Device {
        let area = |subdevice, direction| AreaSpec { subdevice, sync_manager: direction as u8, direction, length: 1 };
        let areas = (0..3).flat_map(|s| [area(s, Direction::Outputs), area(s, Direction::Inputs)]).collect();
        let spec = DomainSpec { period: PERIOD, under_way: 1, lrw: true, areas, image: ImageOrder::Packed };
        let layout = Layout::new(&[spec], LinkSet::Ring, true).unwrap();
        let board = Arc::new(Board::new(3));
        if role == MainDeviceRole::Active {
            (0..3).for_each(|subdevice| board.set_taking_part(subdevice, true));
            let life = Life { presence: Presence::Settled, al_status: 8, code: 0 };
            (0..3).for_each(|subdevice| board.live.post_life(subdevice, life));
        }
        board.live.post_carriers([Some(true); 2]);
        let (producer, events) = queue(256);
        let (main, redundant) = (MacAddress([0, 1, 2, 3, 4, last]), MacAddress([0, 1, 2, 3, 4, last + 1]));
        let own = Identity::new(MacCodec::FlagsFirst, main, Some(redundant));
        let mut exchange = Exchange::new(own, LinkSet::Ring, &layout, board.clone(), producer);
        let (words, control) = (Arc::<StandbyWords>::default(), RoleControl::new(role));
        let planned = PlannedMasterFrames::new(sizes, &layout, 3).unwrap();
        let setup = StandbySetup {
            planned,
            items: items.into(),
            identity,
            session: 0,
            exchanges_from: [4, 4, 4].into(),
            yields_without_links: true,
            goes_through_init: false,
            control: control.clone(),
            words: words.clone(),
            memory: None,
        };
        exchange.set_up_standby(&layout, setup);
        Device { exchange, board, words, control, events }
    }

    /// All events since the last call.
    pub fn events(&mut self) -> Vec<CyclicEvent> {
        core::iter::from_fn(|| self.events.pop()).map(|words| CyclicEvent::unpack(words).unwrap()).collect()
    }

    /// Those of MainDevice redundancy.
    pub fn standby_events(&mut self) -> Vec<CyclicStandbyEvent> {
        let of = |event| if let CyclicEvent::Standby(event) = event { Some(event) } else { None };
        self.events().into_iter().filter_map(of).collect()
    }

    pub fn is_active(&self) -> bool {
        self.exchange.role() == MainDeviceRole::Active
    }

    /// Areas and lengths of the fragments that were sent last.
    pub fn fragment_lengths(&mut self) -> Vec<(Area, usize)> {
        let mut sent = Vec::new();
        self.exchange.send(Instant(0), &mut |_, bytes| sent.push(bytes.to_vec()));
        sent.iter_mut().flat_map(|frame| fragments_mut(frame).map(|it| (it.head.area, it.data.len()))).collect()
    }
}

/// What is behind the last SubDevice, and behind the redundant link of the ACTIVE.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// The other MainDevice, which forwards.
    Forwards,
    /// Nothing: ports are closed, and the other MainDevice has failed.
    Closed,
}

/// Whether a copy is lost on its way to the INACTIVE.
type Lost = Box<dyn FnMut(&[u8]) -> bool>;

/// Both, and the ring.
pub struct Duo {
    pub first: Device,
    pub second: Device,
    pub now: Instant,
    /// Inputs of the SubDevices: this plus their number.
    pub base: u8,
    pub answering: Vec<usize>,
    pub end: End,
    /// The INACTIVE forwards and does nothing else.
    pub is_bare: bool,
    /// What happens at the INACTIVE between both copies of a frame.
    pub between_copies: Option<fn(&mut Device)>,
    lost: Option<Lost>,
    /// They are lost now.
    pub is_losing: bool,
    /// Frames that left in the last cycle, and that came back.
    pub sent: Vec<(Link, Vec<u8>)>,
    pub back: Vec<(Link, Vec<u8>)>,
    /// Outputs that each SubDevice has received, cycle by cycle.
    pub received: Vec<Vec<u8>>,
}

impl Duo {
    pub fn new(sizes: MasterSizes) -> Duo {
        Duo::with_items(sizes, (7, &[1]), (7, &[1]))
    }

    pub fn with_items(sizes: MasterSizes, first: (u64, &[u32]), second: (u64, &[u32])) -> Duo {
        Duo {
            first: Device::new(0x10, MainDeviceRole::Active, sizes, first),
            second: Device::new(0x20, MainDeviceRole::Inactive, sizes, second),
            now: Instant(1_000_000_000),
            base: 0x40,
            answering: vec![0, 1, 2],
            end: End::Forwards,
            is_bare: false,
            between_copies: None,
            lost: None,
            is_losing: false,
            sent: Vec::new(),
            back: Vec::new(),
            received: vec![Vec::new(); 3],
        }
    }

    /// From now on these copies are lost on their way to the INACTIVE.
    pub fn drop_frame(&mut self, lost: impl FnMut(&[u8]) -> bool + 'static) {
        self.lost = Some(Box::new(lost));
        self.is_losing = true;
    }

    /// Forgets all events.
    pub fn drain(&mut self) {
        self.first.events();
        self.second.events();
    }

    /// One cycle of both: first of the ACTIVE, whose frames pass the ring, then of the INACTIVE.
    pub fn cycle(&mut self) {
        self.now += PERIOD;
        let now = self.now;
        let order = if self.first.is_active() { [true, false] } else { [false, true] };
        for is_first in order {
            let device = if is_first { &mut self.first } else { &mut self.second };
            device.exchange.begin_role(now);
            if device.is_active() {
                self.run_active(is_first);
            }
        }
    }

    /// The cycle of a MainDevice that is ACTIVE, after its beginning.
    pub fn run_active(&mut self, is_first: bool) {
        let now = self.now;
        let device = if is_first { &mut self.first } else { &mut self.second };
        device.exchange.process(DOMAIN, now);
        device.exchange.queue(DOMAIN, now);
        let mut sent = Vec::new();
        device.exchange.send(now, &mut |link, bytes| sent.push((link, bytes.to_vec())));
        self.sent = sent.clone();
        self.back.clear();
        for (number, (link, mut frame)) in sent.into_iter().enumerate() {
            let back = self.pass(is_first, link, &mut frame).map(|link| (link, frame));
            let device = if is_first { &mut self.first } else { &mut self.second };
            if let Some((link, frame)) = &back {
                device.exchange.receive(*link, frame, now);
            }
            self.back.extend(back);
            if let (Some(between), 0) = (self.between_copies, number % 2) {
                between(if is_first { &mut self.second } else { &mut self.first });
            }
        }
    }

    /// The way of a copy through the ring: where it comes back.
    fn pass(&mut self, is_first: bool, link: Link, frame: &mut [u8]) -> Option<Link> {
        if link == Link::Main {
            self.process(frame);
        }
        if self.end == End::Closed {
            // The redundant link of the ACTIVE has no partner, and the last port is closed.
            return (link == Link::Main).then_some(Link::Main);
        }
        if self.is_losing && self.lost.as_mut().is_some_and(|lost| lost(frame)) {
            return None;
        }
        let other = if is_first { &mut self.second } else { &mut self.first };
        let arrived_on = link.other();
        if !self.is_bare {
            other.exchange.fill(arrived_on, frame, self.now);
        }
        frame[6] |= if arrived_on == Link::Main { FORWARDED_ON_REDUNDANT } else { FORWARDED_ON_MAIN };
        if !self.is_bare {
            other.exchange.take_forwarded(frame);
        }
        Some(arrived_on)
    }

    /// The SubDevices process a copy.
    pub fn process(&mut self, frame: &mut [u8]) {
        frame[6] |= 0x02;
        if is_master_frame(frame) || frame[16] != 11 {
            return;
        }
        for subdevice in self.answering.clone() {
            self.received[subdevice].push(frame[26 + subdevice]);
            frame[41 + subdevice] |= self.base + subdevice as u8;
            frame[56 + subdevice] |= 0x08;
            for at in [29, 44, 59, 73] {
                frame[at] += 1;
            }
            frame[71] |= 0x08;
        }
    }
}
