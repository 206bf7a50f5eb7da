//! Acyclic reads on an undisturbed segment: short frames, so that cyclic frames hardly ever wait behind them.

use std::cell::Cell;
use std::rc::Rc;
use std::time::Duration;

use ringcat::{Instant, MainDevice, Options, automatic};
use ringcat_engine::{Class, class_of};
use scenarios::segments::plant;
use scenarios::tampered_links::{TamperedLinks, Verdict};

/// Longest acyclic frame: 32 us on the wire, and datagrams for few SubDevices.
const LONGEST: usize = 400;

// covers: byte-budget
#[test]
fn in_an_undisturbed_segment_of_50_acyclic_frames_are_short() {
    let (longest, frames) = (Rc::new(Cell::new(0)), Rc::new(Cell::new(0_u32)));
    let (seen, count) = (longest.clone(), frames.clone());
    let links = TamperedLinks::new(plant(50), Instant(10_000_000_000), move |frame| {
        if class_of(frame) == Some(Class::Acyclic) {
            seen.set(seen.get().max(frame.len()));
            count.set(count.get() + 1);
        }
        Verdict::Arrives
    });
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan().expect("all are there");
    let declaration = automatic(&scan.subdevices, Duration::from_millis(1));
    let mut application = main_device.activate(declaration).map_err(|refused| refused.error).expect("fits");
    while !application.all_settled() {
        application.cycle(|_| ());
    }
    (0..100).for_each(|_| application.cycle(|_| ()));
    longest.set(0);
    frames.set(0);
    (0..3_000).for_each(|_| application.cycle(|_| ()));
    assert!(frames.get() > 20, "there were looks: {}", frames.get());
    assert!(longest.get() <= LONGEST, "{} bytes", longest.get());
}
