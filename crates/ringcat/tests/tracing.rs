//! What an application's subscriber receives from the acyclic half: in a program of its own, since there is one
//! subscriber.

use std::error::Error;
use std::fmt::Debug;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use ringcat::sim::cable::DeviceIndex;
use ringcat::simulated::SimulatedSegment;
use ringcat::{Declaration, MainDevice, Options, SubDeviceConfig};
use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Level, Metadata, Subscriber};

#[derive(Clone, Default)]
struct Lines(Arc<Mutex<Vec<(Level, String)>>>);

struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        if field.name() == "message" {
            self.0 = format!("{value:?}");
        }
    }
}

impl Subscriber for Lines {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target() == "ringcat" && *metadata.level() <= Level::INFO
    }

    fn new_span(&self, _: &Attributes<'_>) -> Id {
        Id::from_u64(1)
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, event: &Event<'_>) {
        let mut message = Message(String::new());
        event.record(&mut message);
        self.0.lock().expect("no panic").push((*event.metadata().level(), message.0));
    }

    fn enter(&self, _: &Id) {}

    fn exit(&self, _: &Id) {}
}

// covers: api
#[test]
fn events_reach_a_subscriber_once_with_their_levels() -> Result<(), Box<dyn Error>> {
    let lines = Lines::default();
    tracing::subscriber::set_global_default(lines.clone()).expect("it is the only one");
    let segment = "[segment]\n[[device]]\ntype = \"coupler\"\n[[device]]\ntype = \"digital-output-8\"\n";
    let mut main_device = MainDevice::request(SimulatedSegment::from_toml(segment)?, &Options::default());
    main_device.scan()?;
    let mut declaration = Declaration::new(Duration::from_millis(1));
    declaration.add(SubDeviceConfig::at_position(0));
    declaration.add(SubDeviceConfig::at_position(1));
    let mut application = main_device.activate(declaration)?;
    application.wait_until_op(Duration::from_secs(10))?;
    application.links_mut().network_mut().power_off(DeviceIndex(1));
    for _ in 0..100 {
        application.cycle(|_| ());
    }
    // Taking events reports those that came meanwhile; those that were kept are not reported again.
    while application.pop_event().is_some() {}
    let lines = lines.0.lock().expect("no panic");
    let count = |level: Level, text: &str| lines.iter().filter(|line| line.0 == level && line.1 == text).count();
    assert_eq!(count(Level::INFO, "SubDevice 1: OP"), 1, "{lines:?}");
    assert_eq!(count(Level::WARN, "SubDevice 1: no longer answers"), 1, "{lines:?}");
    assert!(!lines.iter().any(|(_, text)| text.contains("working counter")), "{lines:?}");
    Ok(())
}
