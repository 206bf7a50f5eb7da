//! Delays in port reports without an application, compared with the true delays.
//!
//! A report has the right delay of every SubDevice, or none: none behind forks without a clock, of SubDevices that
//! process frames of the other link, and while the segment changes. After it all rings are closed again.

use std::time::Duration;

use ringcat::{JunctionMode, MainDevice, Options, Services, SubDevicePorts};
use ringcat_sim::cable::CableId;
use ringcat_sim::device::Device;
use ringcat_sim::fault::Fault;
use ringcat_sim::network::Network;
use ringcat_wire::register::map;

use super::{Place, Plan, Shape, devices, from_known, latched, places, remove_clocks, spread_broadcast};
use crate::clocks::wired;
use crate::dice::Dice;
use crate::tap::Tap;
use crate::world::station;

/// Time after which idle operation has certainly processed a change of the cables.
const FOLLOWED: Duration = Duration::from_millis(2_500);
/// Time after [`FOLLOWED`] during which the cables do not change.
const CALM: Duration = Duration::from_millis(500);

/// Results of reports.
#[derive(Clone, Debug, Default)]
pub struct Reported {
    /// Reported delays that are right.
    pub right: usize,
    /// SubDevices on the link of the first clock without a reported delay.
    pub missing: usize,
    /// Missing delays in reports of segments without a cut cable in which all SubDevices have a clock.
    pub missing_when_whole: Vec<String>,
    /// Wrong delays, and SubDevices that are left with a closed port.
    pub wrong: Vec<String>,
}

impl Reported {
    /// Adds other results.
    pub fn add(&mut self, other: Reported) {
        (self.right, self.missing) = (self.right + other.right, self.missing + other.missing);
        self.missing_when_whole.extend(other.missing_when_whole);
        self.wrong.extend(other.wrong);
    }
}

/// Runs a seed: a segment of this shape, reports before, between and after this many cuts and repairs.
pub fn report(shape: Shape, mode: JunctionMode, seed: u64, cuts: usize) -> Reported {
    let mut dice = Dice::new(seed);
    let plan = Plan::new(shape, &mut dice);
    let mut devices = devices(plan.devices, &mut dice);
    remove_clocks(shape, &mut devices, &mut dice);
    let options = Options::default().with_idle_operation(true).with_junctions(mode);
    let mut main_device = MainDevice::request(Tap::new(wired(devices, &plan.cables)), &options);
    main_device.attend(FOLLOWED);
    let mut reported = Reported::default();
    let what = |text: &str| format!("{shape:?}, {mode}, seed {seed}, {text}");
    let is_complete = |is_whole: bool| is_whole && shape != Shape::Gaps && mode == JunctionMode::Automatic;
    compare(&mut main_device, &mut reported, is_complete(true), &what("at the start"));
    for _ in 0..cuts {
        let cable = CableId(*dice.pick(&plan.cut));
        for (fault, is_whole) in [(Fault::Cut(cable), false), (Fault::Heal(cable), true)] {
            main_device.links_mut().network_mut().apply(fault.clone());
            main_device.attend(FOLLOWED);
            compare(&mut main_device, &mut reported, is_complete(is_whole), &what(&format!("{fault:?}")));
        }
    }
    reported
}

/// Rings are examined once after a change, not again and again: no port is closed any more.
fn stay_calm(main_device: &mut MainDevice<Tap>, reported: &mut Reported, what: &str) {
    let until = main_device.now() + CALM;
    while main_device.now() < until {
        main_device.attend(Duration::from_millis(1));
        let is_open = |device: &Device| device.controller.register(map::DL_CONTROL, 2)[1] == 0;
        if !main_device.links_mut().network().devices().all(is_open) {
            return reported.wrong.push(format!("{what}: ports are still closed at {:?}", main_device.now()));
        }
    }
}

fn compare(main_device: &mut MainDevice<Tap>, reported: &mut Reported, is_complete: bool, what: &str) {
    stay_calm(main_device, reported, what);
    let report = main_device.port_report().expect("it can be asked");
    for (number, device) in main_device.links_mut().network().devices().enumerate() {
        let loops = device.controller.register(map::DL_CONTROL, 2)[1];
        if loops != 0 {
            reported.wrong.push(format!("{what}: ports of device {number} are left closed: {loops:#04x}"));
        }
    }
    let all = truth(main_device);
    let network = main_device.links_mut().network();
    // Delays are relative to the first clock by position, which is the first that the frame reaches.
    for place in from_known(&all, &[]) {
        let of = network.devices().nth(place.device).map(station);
        let Some(it) = report.iter().find(|it| Some(it.station.0) == of) else {
            reported.wrong.push(format!("{what}: device {} is not in the report", place.device));
            continue;
        };
        judge(it, &place, all[0].frame, reported, is_complete, what);
    }
}

fn judge(it: &SubDevicePorts, place: &Place, frame: u64, reported: &mut Reported, is_complete: bool, what: &str) {
    let text = || format!("{what}: device {}: {:?} instead of {} ns", place.device, it.delay_ns, place.delay_ns);
    match it.delay_ns {
        Some(delay) if place.frame != frame || place.is_wrong(delay as u32) => reported.wrong.push(text()),
        Some(_) => reported.right += 1,
        None if place.frame != frame => {}
        None => {
            reported.missing += 1;
            if is_complete {
                reported.missing_when_whole.push(text());
            }
        }
    }
}

fn truth(main_device: &mut MainDevice<Tap>) -> Vec<Place> {
    let before = latched(main_device.links_mut().network());
    let work = main_device.engine_mut().start_datagrams(vec![spread_broadcast()]);
    main_device.attend(Duration::from_millis(20));
    drop(work);
    let network: &Network = main_device.links_mut().network();
    places(network, &before)
}
