//! Network interfaces for EoE, with interfaces of the test's own in the place of the kernel's.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ringcat::eoe::{EthernetEvent, EthernetOptions, HostInterface};
use ringcat::shared_segment::SharedSegment;
use ringcat::{CyclicThread, Error, LastOutputs, Options, SubDeviceId, SupervisorThread, automatic};
use ringcat_link::TapError;
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::al::AlState;

const SEGMENT: &str = "
[segment]
ring = true
[[device]]
type = \"coupler\"
[[device]]
type = \"ethernet-terminal\"
ethernet = \"loop\"
[[device]]
type = \"all-protocols\"
ethernet = \"loop\"
alias = 1000
";
const PERIOD: Duration = Duration::from_millis(2);
const LIMIT: Duration = Duration::from_secs(30);
const OPTIONS: EthernetOptions = EthernetOptions::new(3, [0, 0, 0, 7, 8, 9]);

/// One interface of the host.
#[derive(Default)]
struct Cable {
    name: String,
    mac: [u8; 6],
    carrier: bool,
    to_device: VecDeque<Vec<u8>>,
    to_host: Vec<Vec<u8>>,
}

struct End(Arc<Mutex<Cable>>);

impl HostInterface for End {
    fn receive(&mut self, room: &mut [u8]) -> Option<usize> {
        let frame = self.0.lock().unwrap().to_device.pop_front()?;
        room[..frame.len()].copy_from_slice(&frame);
        Some(frame.len())
    }

    fn send(&mut self, frame: &[u8]) -> bool {
        self.0.lock().unwrap().to_host.push(frame.to_vec());
        true
    }

    fn set_carrier(&mut self, carrier: bool) {
        self.0.lock().unwrap().carrier = carrier;
    }
}

type Cables = Arc<Mutex<Vec<Arc<Mutex<Cable>>>>>;

fn start() -> Result<(SupervisorThread, SharedSegment), Error> {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
    Ok((SupervisorThread::start(acyclic, &Options::default(), || ())?, cyclic))
}

fn cycles(supervisor: &SupervisorThread, cyclic: SharedSegment) -> Result<CyclicThread<SharedSegment>, Error> {
    let scan = supervisor.scan()?;
    let application = supervisor.clone().activate(automatic(&scan.subdevices, PERIOD), cyclic)?;
    application.start_cycles(|| (), |_| ControlFlow::Continue(()))
}

fn wait(what: &str, condition: impl Fn() -> bool) {
    let end = Instant::now() + LIMIT;
    while !condition() {
        assert!(Instant::now() < end, "{what}");
        sleep(Duration::from_millis(1));
    }
}

// covers: eoe-interfaces
#[test]
fn each_eoe_subdevice_has_an_interface_by_position_or_alias_until_the_stop() -> Result<(), Error> {
    let (supervisor, cyclic) = start()?;
    let made: Cables = Cables::default();
    let cables = made.clone();
    let make = move |name: &str, mac| {
        let cable = Arc::new(Mutex::new(Cable { name: name.to_owned(), mac, ..Cable::default() }));
        cables.lock().unwrap().push(cable.clone());
        Ok(Box::new(End(cable)) as Box<dyn HostInterface>)
    };
    let ethernet = supervisor.start_ethernet_on(OPTIONS, Box::new(make))?;
    let cycles = cycles(&supervisor, cyclic)?;
    wait("both have a carrier", || {
        let made = made.lock().unwrap();
        made.len() == 2 && made.iter().all(|cable| cable.lock().unwrap().carrier)
    });
    let cables: Vec<Arc<Mutex<Cable>>> = made.lock().unwrap().drain(..).collect();
    let names = cables.iter().map(|cable| cable.lock().unwrap().name.clone()).collect::<Vec<_>>();
    assert_eq!(names, ["eoe3s1", "eoe3a1000"]);
    assert_eq!(cables[1].lock().unwrap().mac, [0x06, 7, 8, 9, 0x03, 0xE8]);
    let frame = |cable: usize, number: usize| vec![(cable * 16 + number) as u8; 60 + number * 37];
    for (number, cable) in cables.iter().enumerate() {
        // More than the queue of a mailbox holds.
        cable.lock().unwrap().to_device.extend((0..39).map(|at| frame(number, at)));
    }
    for (number, cable) in cables.iter().enumerate() {
        wait("all frames come back", || cable.lock().unwrap().to_host.len() == 39);
        let came = &cable.lock().unwrap().to_host;
        assert!((0..39).all(|at| came[at] == frame(number, at)), "in order, each to its own");
    }
    wait("statistics follow", || {
        let interfaces = ethernet.interfaces();
        interfaces.len() == 2
            && interfaces.iter().all(|interface| {
                let counters = interface.status.counters;
                interface.status.up && (counters.tx_frames, counters.rx_frames) == (39, 39)
            })
    });
    let events = ethernet.take_events();
    assert_eq!(events[0], EthernetEvent::Made { name: "eoe3s1".to_owned(), subdevice: SubDeviceId(1).into() });
    assert!(events.iter().any(|events| events.to_string() == "eoe3a1000: frames can pass"), "{events:?}");
    cycles.supervisor().all_settled();
    let supervisor = cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?.supervisor;
    wait("the interfaces go", || cables.iter().all(|cable| Arc::strong_count(cable) == 1));
    drop(supervisor);
    Ok(())
}

// covers: eoe-interfaces
#[test]
fn interfaces_of_idle_operation_stay_while_an_application_begins() -> Result<(), Error> {
    let segment = Segment::from_toml(SEGMENT, Path::new(".")).expect("a good segment");
    let (cyclic, acyclic) = SharedSegment::halves(Network::from_description(segment).expect("it can be built"));
    let supervisor = SupervisorThread::start(acyclic, &Options::default().with_idle_operation(true), || ())?;
    let made: Cables = Cables::default();
    let cables = made.clone();
    let make = move |name: &str, mac| {
        let cable = Arc::new(Mutex::new(Cable { name: name.to_owned(), mac, ..Cable::default() }));
        cables.lock().unwrap().push(cable.clone());
        Ok(Box::new(End(cable)) as Box<dyn HostInterface>)
    };
    let ethernet = supervisor.start_ethernet_on(OPTIONS, Box::new(make))?;
    let frames_return = |count: usize| {
        made.lock().unwrap().iter().for_each(|cable| cable.lock().unwrap().to_device.push_back(vec![7; 100]));
        wait("frames come back", || {
            let made = made.lock().unwrap();
            made.iter().all(|cable| cable.lock().unwrap().to_host.len() == count)
        });
    };
    let have_carrier = || {
        let made = made.lock().unwrap();
        made.len() == 2 && made.iter().all(|cable| cable.lock().unwrap().carrier)
    };
    wait("both have a carrier without an application", have_carrier);
    frames_return(1);
    let found = supervisor.subdevices()?;
    let application = supervisor.clone().activate(automatic(&found, PERIOD), cyclic)?;
    let cycles = application.start_cycles(|| (), |_| ControlFlow::Continue(()))?;
    wait("all are in OP", || cycles.supervisor().all_settled());
    wait("both have a carrier again", have_carrier);
    frames_return(2);
    assert_eq!(made.lock().unwrap().len(), 2, "none was made again");
    let declared = |at: usize| {
        let interfaces = ethernet.interfaces();
        interfaces.get(at).is_some_and(|interface| interface.subdevice.subdevice == SubDeviceId(at + 1).into())
    };
    wait("they lead to declared SubDevices", || declared(0) && declared(1));
    let supervisor = cycles.end()?.stop(LastOutputs::Zero, AlState::Init, LIMIT)?.supervisor;
    drop(supervisor);
    Ok(())
}

// covers: eoe-interfaces
#[test]
fn an_interface_that_cannot_be_created_is_reported_once_and_all_else_continues() -> Result<(), Error> {
    let (supervisor, cyclic) = start()?;
    let make = |name: &str, _| Err(TapError::Permission { name: name.to_owned() });
    let ethernet = supervisor.start_ethernet_on(OPTIONS, Box::new(make))?;
    let cycles = cycles(&supervisor, cyclic)?;
    wait("all are in OP", || cycles.supervisor().all_settled());
    sleep(Duration::from_millis(100));
    let reports: Vec<String> = ethernet.take_events().iter().map(ToString::to_string).collect();
    assert_eq!(reports.len(), 2, "{reports:?}");
    assert!(
        reports[0].starts_with("EoE: not permitted to make the network interface eoe3s1; run as root"),
        "{reports:?}"
    );
    assert_eq!(ethernet.interfaces(), []);
    Ok(())
}
