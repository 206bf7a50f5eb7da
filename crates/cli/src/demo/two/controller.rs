//! The program of each controller: it joins the ring, and writes the number of its cycle to all outputs, in both roles.
//!
//! In: links of a host. Out: a board with the state of the controller. As ACTIVE it keeps its images; the other
//! controller compares its own images with them.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use ringcat::sim::cable::Host;
use ringcat::simulated::two_hosts::HostLinks;
use ringcat::standby::{Policy, RoleControl, StandbyOptions};
use ringcat::{
    Application, Direction, DomainId, Error, Links, MainDevice, MainDeviceRole, Options, ProcessData, RingState,
    SubDeviceId, TimedEvent, automatic,
};

use super::super::drive::Drive;

/// The only domain.
const DOMAIN: DomainId = DomainId(0);
/// Images of the ACTIVE that are kept: the INACTIVE shows one of the last cycles.
const KEPT: usize = 8;

/// State of a controller.
#[derive(Debug, Default)]
pub struct Board {
    /// Bytes 3 to 5 of its addresses.
    pub identity: [u8; 3],
    /// Its role, while it has an application.
    pub role: Option<MainDeviceRole>,
    /// Requests another role.
    pub control: Option<RoleControl>,
    /// As ACTIVE: the other controller is ready to take over.
    pub is_other_ready: bool,
    /// As ACTIVE: all SubDevices are in OP.
    pub is_settled: bool,
    /// State of the ring.
    pub ring: RingState,
    /// Why it has ended.
    pub failure: Option<String>,
    /// Events that have not been printed yet.
    pub events: Vec<TimedEvent>,
}

/// Images of the ACTIVE, and what their comparison with those of the INACTIVE has shown.
#[derive(Debug, Default)]
pub struct Images {
    kept: VecDeque<Vec<u8>>,
    /// Comparisons.
    pub compared: u64,
    /// Comparisons that failed.
    pub different: u64,
}

/// Where the process data of a SubDevice lies.
#[derive(Clone, Debug, Default)]
pub struct Place {
    /// Its outputs in the image.
    pub outputs: Vec<Range<usize>>,
    /// Its inputs in the image.
    pub inputs: Vec<Range<usize>>,
    /// If it is a drive: first bytes of the target position in its outputs, and of the statusword in its inputs.
    pub drive: Option<(usize, usize)>,
}

/// Process data of the segment, the same for both controllers.
#[derive(Debug, Default)]
pub struct Layout {
    /// Process data by SubDevice.
    pub places: Vec<Place>,
    /// Bytes of all process data.
    pub bytes: usize,
}

/// Shared by the controllers and the demonstration.
#[derive(Debug, Default)]
pub struct Shared {
    boards: [Mutex<Board>; 2],
    images: Mutex<Images>,
    /// Process data of the segment, once one of them has an application.
    pub layout: OnceLock<Layout>,
}

/// How both run.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// Cycle time.
    pub cycle: Duration,
    /// When they take over.
    pub policy: Policy,
}

impl Shared {
    /// The board of a controller.
    pub fn board(&self, host: Host) -> MutexGuard<'_, Board> {
        self.boards[host as usize].lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The images.
    pub fn images(&self) -> MutexGuard<'_, Images> {
        self.images.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Images {
    /// An image as the ACTIVE has sent it.
    fn keep(&mut self, image: &[u8]) {
        if self.kept.len() == KEPT {
            self.kept.pop_front();
        }
        self.kept.push_back(image.to_vec());
    }

    /// Compares an image of the INACTIVE: its outputs are those of one cycle of the ACTIVE, its inputs those of one
    /// cycle.
    fn compare(&mut self, image: &[u8], places: &[Place]) {
        let same = |of: fn(&Place) -> &Vec<Range<usize>>| {
            let is_of = |kept: &Vec<u8>| {
                places.iter().flat_map(of).all(|area| kept.get(area.clone()) == image.get(area.clone()))
            };
            self.kept.iter().any(is_of)
        };
        let agrees = same(|place| &place.outputs) && same(|place| &place.inputs);
        self.compared += 1;
        self.different += u64::from(!agrees);
    }
}

/// The program.
pub fn run(mut links: HostLinks, settings: &Settings, shared: &Shared) {
    let host = links.host();
    let [.., a, b, c] = links.addresses().main.0;
    *shared.board(host) = Board { identity: [a, b, c], ..Board::default() };
    // Links are up only while the program forwards or is ACTIVE.
    links.switch(true);
    if let Err(error) = exchange(links, settings, shared) {
        let mut board = shared.board(host);
        (board.role, board.failure) = (None, Some(error.to_string()));
    }
}

/// Joins, and runs cycles until the program is killed.
fn exchange(links: HostLinks, settings: &Settings, shared: &Shared) -> Result<(), Error> {
    let (host, cycle) = (links.host(), settings.cycle);
    // The simulated computer switches its links off.
    let options = Options::default().with_standby(StandbyOptions::default().with_needs_guard(false));
    let main_device = MainDevice::request(links, &options);
    let mut application = main_device.join(&settings.policy, |scan| automatic(&scan.subdevices, cycle))?;
    let layout = shared.layout.get_or_init(|| Layout::of(&application));
    let mut drives: Vec<Drive> =
        (0..layout.places.len()).filter_map(|subdevice| Drive::find(&application, subdevice)).collect();
    shared.board(host).control = application.role_control();
    let mut comparison = Comparison::default();
    loop {
        let is_other_ready = application.cycle(|data| {
            if comparison.is_due(data, shared.board(host.other()).is_other_ready) {
                shared.images().compare(data.image(DOMAIN), &layout.places);
            }
            work(data, layout, &mut drives, cycle);
            if data.role() == MainDeviceRole::Active {
                shared.images().keep(data.image(DOMAIN));
            }
            data.partner().is_ready()
        });
        let mut board = shared.board(host);
        board.role = Some(application.role());
        board.is_other_ready = is_other_ready;
        board.is_settled = application.all_settled();
        board.ring = application.ring();
        while let Some(event) = application.pop_event() {
            board.events.push(event);
        }
    }
}

/// Writes the number of the cycle to all outputs but those of drives.
fn work(data: &mut ProcessData<'_>, layout: &Layout, drives: &mut [Drive], cycle: Duration) {
    let number = number_at(data.now().0, cycle).to_le_bytes();
    for area in layout.places.iter().filter(|place| place.drive.is_none()).flat_map(|place| place.outputs.clone()) {
        let bytes = data.outputs_mut(DOMAIN, area).unwrap_or_default();
        bytes.iter_mut().zip(number.into_iter().cycle()).for_each(|(to, from)| *to = from);
    }
    drives.iter_mut().for_each(|drive| drive.go_on(data));
}

/// Which images are compared.
#[derive(Debug, Default)]
struct Comparison {
    /// The ACTIVE has reported that this controller is ready to take over; before that, its image may be empty.
    has_begun: bool,
    was_active: bool,
}

impl Comparison {
    /// Whether the image of this cycle is compared. In the first cycle after its time as ACTIVE it contains the
    /// inputs that this controller received last itself.
    fn is_due(&mut self, data: &ProcessData<'_>, is_ready: bool) -> bool {
        self.has_begun |= is_ready;
        let is_active = data.role() == MainDeviceRole::Active;
        let was_active = std::mem::replace(&mut self.was_active, is_active);
        self.has_begun && !is_active && !was_active
    }
}

/// The number of the cycle at a time of the segment, the same for both controllers.
pub fn number_at(at_ns: u64, cycle: Duration) -> u16 {
    (at_ns / cycle.as_nanos().max(1) as u64) as u16
}

impl Layout {
    fn of(application: &Application<HostLinks>) -> Layout {
        let count = application.states().len();
        let places: Vec<Place> = (0..count).map(|subdevice| Place::of(application, subdevice)).collect();
        let areas = places.iter().flat_map(|place| place.outputs.iter().chain(&place.inputs));
        let bytes = areas.map(|area| area.len()).sum();
        Layout { places, bytes }
    }
}

impl Place {
    fn of(application: &Application<HostLinks>, subdevice: usize) -> Place {
        let areas = |direction| -> Vec<Range<usize>> {
            let areas = application.directory().areas(SubDeviceId(subdevice)).iter();
            let areas = areas.filter(|area| area.direction == direction);
            areas
                .map(|area| {
                    let begin = area.placed.image_offset as usize;
                    begin..begin + usize::from(area.placed.area.length)
                })
                .collect()
        };
        let (outputs, inputs) = (areas(Direction::Outputs), areas(Direction::Inputs));
        let drive = Drive::find(application, subdevice).and_then(|drive| {
            let [target, status] = drive.watched();
            let within = |area: Option<&Range<usize>>, at: usize| at.checked_sub(area?.start);
            within(outputs.first(), target).zip(within(inputs.first(), status))
        });
        Place { outputs, inputs, drive }
    }
}
