//! Propagation delays of lines, compared with those of their cables (protocol 7.1).

use std::time::Duration;

use ringcat::{Options, Passage};
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::network::NetworkOptions;
use scenarios::clocks::{clocked, config, delay, with_clocks, world};
use scenarios::segments::line;
use scenarios::world::World;

/// Delay of a pass and of a cable.
const HOP_NS: i64 = 300 + 50;

// covers: 7.1, dc-delays
#[test]
fn delays_of_a_line_are_those_of_its_cables() {
    for count in [2, 7, 30] {
        let mut world = world(1, line(clocked(count, 100), NetworkOptions::default()), config());
        world.until(Duration::from_secs(1), "set up", |world| {
            world
                .network()
                .device(DeviceIndex(1))
                .controller
                .register(ringcat_wire::register::map::DC_SYSTEM_TIME_DELAY, 1)
                != [0]
        });
        world.run_cycles(10);
        for device in 0..count {
            let error = i64::from(delay(world.network(), device)) - HOP_NS * device as i64;
            let limit = 10 + (100.0 * device as f64).sqrt() as i64;
            assert!(error.abs() <= limit, "device {device} of {count}: {error} ns");
        }
    }
}

// covers: 7.1, dc-delays
#[test]
fn longer_processing_than_forwarding_is_an_error_of_delays_unless_declared() {
    const COUNT: usize = 6;
    const LONGER: u64 = 40;
    let mut options = NetworkOptions::default();
    options.processing_delay = options.forwarding_delay + Duration::from_nanos(LONGER);
    let hop = HOP_NS - 300 + options.processing_delay.as_nanos() as i64;
    for (reports, systematic) in [(0, 20), (LONGER as u16, 0)] {
        let config = config().with_passage(Passage::new(reports, 0));
        let mut world = world(1, line(clocked(COUNT, 50), options.clone()), config);
        world.until(Duration::from_secs(1), "set up", |world| delay(world.network(), COUNT - 1) != 0);
        world.run_cycles(10);
        for device in 0..COUNT {
            // Frames are looped back behind the processing unit of the last SubDevice: its cable is right in any case.
            let missed = systematic * device.min(COUNT - 2) as i64;
            let error = i64::from(delay(world.network(), device)) - hop * device as i64 + missed;
            assert!(
                error.abs() <= 10 + (100.0 * device as f64).sqrt() as i64,
                "device {device}, {reports}: {error} ns"
            );
        }
    }
}

/// A coupler, terminals and drives, each with its own passage times: delays are exact if each is configured.
// covers: 7.1, dc-delays
#[test]
fn types_with_configured_passage_times_have_exact_delays() {
    const PASSAGES: [(u64, u64); 7] =
        [(550, 540), (150, 150), (150, 150), (750, 700), (750, 700), (150, 150), (300, 300)];
    let descriptions = || {
        let mut all = clocked(PASSAGES.len(), 50);
        for (device, (processing, forwarding)) in all.iter_mut().zip(PASSAGES) {
            device.processing_delay = Some(Duration::from_nanos(processing));
            device.forwarding_delay = Some(Duration::from_nanos(forwarding));
            device.receive_jitter = Duration::ZERO;
        }
        all
    };
    let errors = |reports: &[(u64, u64)]| -> Vec<i64> {
        let network = line(descriptions(), NetworkOptions::default());
        let mut world = World::with(1, network, &Options::default(), |scan| {
            let mut declaration = with_clocks(scan, config());
            for (subdevice, (processing, forwarding)) in declaration.subdevices.iter_mut().zip(reports) {
                let passage = Passage::new(*processing as u16, *forwarding as u16);
                subdevice.passage = Some(passage);
            }
            declaration
        })
        .expect("it can be activated");
        world.until(Duration::from_secs(1), "set up", |world| delay(world.network(), PASSAGES.len() - 1) != 0);
        world.run_cycles(10);
        let mut truth = 0;
        let error = |(device, (processing, _)): (usize, &(u64, u64))| {
            let error = i64::from(delay(world.network(), device)) - truth;
            truth += *processing as i64 + HOP_NS - 300;
            error
        };
        PASSAGES.iter().enumerate().map(error).collect()
    };
    let (unreported, reports) = (errors(&[]), errors(&PASSAGES));
    assert!(unreported[1] <= -195 && unreported.iter().map(|error| error.abs()).max() > Some(200), "{unreported:?}");
    assert!(reports.iter().all(|error| error.abs() <= 2), "{reports:?}");
}

/// The longest line. The lock and spread of 200 clocks are among the figures (bin `figures`, clocks).
// covers: 7.1, dc-delays
#[test]
fn two_hundred_clocks_in_a_line_have_their_delays() {
    const COUNT: usize = 200;
    let short = config().with_drift_distributions(0);
    let mut world = world(15, line(clocked(COUNT, 100), NetworkOptions::default()), short);
    world.until(Duration::from_secs(2), "set up", |world| delay(world.network(), COUNT - 1) != 0);
    world.run_cycles(5);
    let errors: Vec<i64> =
        (0..COUNT).map(|device| i64::from(delay(world.network(), device)) - HOP_NS * device as i64).collect();
    for (device, error) in errors.iter().enumerate() {
        assert!(error.abs() <= 10 + (100.0 * device as f64).sqrt() as i64, "device {device}: {error} ns");
    }
    assert!(errors.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= 20), "{errors:?}");
}
