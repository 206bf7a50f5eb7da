//! `ringcat ring`: the state of a ring, without changing anything: SubDevices on each link, the place of a break, the
//! error counters at the ends of each cable.

use std::time::Duration;

use clap::Args;
use ringcat::Services;
use ringcat::text::Names;
use ringcat::wire::address::{Position, StationAddress};
use ringcat::{Cable, CableErrors, CableReport, Link, LinkCounts, MainDevice, Occupant, RingInspection, RingState};

use crate::access::{Access, AccessArguments};
use crate::ending::EndRequest;
use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::ring;
use crate::output::{counted, say};
use crate::times::time;
use crate::verdict::{Report, Verdict};

/// How to read what it prints.
const ABOUT_RING: &str = "\
It only reads, so that a segment without a MainDevice stays as it is. Beside
another MainDevice it refuses to begin: reading clears registers that the other
one waits for. Counters end at 255, and this command does not clear them: read
them twice (--for) to see which ones rise. A rising counter means a bad plug, a
damaged cable, or a source of disturbance beside the cable.

SubDevices that do not answer are unknown to it: with two breaks, those between
them are missing in the counts, the positions behind are lower, and the break is
named as if the missing SubDevices did not exist. Compare the counts with those
of the machine.

Exit status: 0 the ring is closed (or there is one link), 1 it is open or copies
of frames are lost, 2 it could not be read.";

/// Options of `ringcat ring`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_RING)]
pub struct RingArguments {
    #[command(flatten)]
    access: AccessArguments,
    /// Read again after this time, such as 10s, and show what the counters have gained
    #[arg(long = "for", value_name = "TIME", value_parser = time, help_heading = "Output")]
    lasts: Option<Duration>,
}

/// Reads and prints; it has not held where the ring is open.
pub fn run(arguments: &RingArguments) -> Result<Report, Failure> {
    EndRequest::at_once()?;
    if arguments.access.master.is_some() {
        return of_master(arguments);
    }
    let AccessArguments { interfaces, thread, recording, .. } = &arguments.access;
    let links = interfaces.open(*thread)?;
    let recording = recording.start(interfaces)?;
    let links = recording.tee(links);
    let _awake = thread.apply();
    let mut main_device = MainDevice::request(links, &interfaces.options());
    let inspection = inspect(arguments.lasts, || main_device.inspect_ring())?;
    let two_links = interfaces.links.redundant.is_some();
    drop(main_device);
    Ok(report(&inspection, two_links, [recording.finish()]))
}

/// The ring of a master of the daemon.
fn of_master(arguments: &RingArguments) -> Result<Report, Failure> {
    let access = arguments.access.begin(&arguments.access.interfaces.options())?;
    let Access { interfaces, supervisor, cyclic, recording, daemon_bus, .. } = access;
    let inspection = inspect(arguments.lasts, || supervisor.inspect_ring())?;
    drop(cyclic);
    let reasons = [daemon_bus.end(), recording.finish()];
    Ok(report(&inspection, interfaces.links.redundant.is_some(), reasons))
}

/// Reads once, or twice and what the counters have gained meanwhile.
fn inspect(
    lasts: Option<Duration>,
    mut read: impl FnMut() -> Result<RingInspection, ringcat::Error>,
) -> Result<RingInspection, Failure> {
    let mut inspection = read()?;
    if let Some(lasts) = lasts {
        std::thread::sleep(lasts);
        let before = std::mem::replace(&mut inspection, read()?);
        for (now, earlier) in inspection.cables.iter_mut().zip(&before.cables) {
            if now.cable == earlier.cable {
                now.errors = gained(earlier.errors, now.errors);
            }
        }
    }
    Ok(inspection)
}

fn report(inspection: &RingInspection, two_links: bool, reasons: impl IntoIterator<Item = Option<String>>) -> Report {
    let verdict = reasons.into_iter().fold(verdict(inspection, two_links), Verdict::and);
    lines(inspection, two_links).iter().for_each(|line| say!("{line}"));
    Report { verdict, data: Data::Ring(json(inspection, two_links)) }
}

/// Whether there is a ring where two links are to make one.
fn verdict(inspection: &RingInspection, two_links: bool) -> Verdict {
    let count = counted(
        usize::from(inspection.counts.main) + usize::from(inspection.counts.redundant),
        "SubDevice",
        "SubDevices",
    );
    match inspection.state {
        _ if !two_links => Verdict::Held(format!("one link, {count}")),
        RingState::Closed => Verdict::Held(format!("the ring is closed, {count}")),
        RingState::Open => Verdict::Failed(format!("the ring is open, {count}")),
        RingState::Unknown => Verdict::Failed(format!("not all copies of frames come back, {count}")),
    }
}

fn gained(before: CableErrors, now: CableErrors) -> CableErrors {
    let mut gained = CableErrors::default();
    gained.invalid_frames = now.invalid_frames.saturating_sub(before.invalid_frames);
    gained.lost_links = now.lost_links.saturating_sub(before.lost_links);
    gained
}

/// The station address of a position, where the MainDevice in charge has given one.
fn station(inspection: &RingInspection, position: Position) -> Option<StationAddress> {
    inspection.stations.get(usize::from(position.0)).copied().filter(|station| station.0 != 0)
}

/// The SubDevices at both ends of a cable. This command has no declaration.
fn ends(inspection: &RingInspection, cable: Cable) -> [Option<Occupant>; 2] {
    cable.positions().map(|position| Some(Occupant::new(station(inspection, position?)?, None)))
}

fn lines(inspection: &RingInspection, two_links: bool) -> Vec<String> {
    let names = Names::default();
    let LinkCounts { main, redundant, .. } = inspection.counts;
    let state = match inspection.state {
        _ if !two_links => "one link",
        RingState::Closed => "closed",
        RingState::Open => "OPEN: the next break isolates SubDevices",
        RingState::Unknown => "unknown: not all copies come back",
    };
    let mut lines = vec![format!("ring        {state}")];
    for (link, count) in [(Link::Main, main), (Link::Redundant, redundant)].into_iter().take(1 + usize::from(two_links))
    {
        lines.push(format!("{:<11} {count} SubDevices", link.to_string()));
    }
    if two_links && inspection.topology.is_assumed() {
        let swapped = "interfaces swapped: MAIN is plugged in at the end of the ring";
        let crossed = "line crossed, or a branch on port 2: which SubDevices are neighbours is assumed below";
        lines.push(format!("cabling     {}", if inspection.topology.main_count == 0 { swapped } else { crossed }));
    }
    if let Some(place) = inspection.place {
        lines.push(format!("line break  {}", names.cable(place, ends(inspection, place))));
    }
    lines.push(String::from("damaged frames, lost links of each cable:"));
    for CableReport { cable, errors, .. } in &inspection.cables {
        let mark = if inspection.place == Some(*cable) { "  <- line break" } else { "" };
        lines.push(format!(
            "{:>6} {:>6}  {}{mark}",
            errors.invalid_frames,
            errors.lost_links,
            names.cable(*cable, ends(inspection, *cable))
        ));
    }
    lines
}

fn json(inspection: &RingInspection, two_links: bool) -> ring::Ring {
    let end = |port: Option<ringcat::PortOf>| {
        port.map(|at| ring::CableEnd {
            position: usize::from(at.position().0),
            station: station(inspection, at.position()).map(|it| it.0),
            port: at.port(),
        })
    };
    let cable = |cable: Cable| ring::Cable { near: end(cable.near), far: end(cable.far) };
    let errors = |it: &CableReport| ring::CableErrors {
        near: end(it.cable.near),
        far: end(it.cable.far),
        damaged_frames: it.errors.invalid_frames,
        lost_links: it.errors.lost_links,
    };
    ring::Ring {
        ring: two_links.then(|| inspection.state.into()),
        main_subdevices: inspection.counts.main,
        redundant_subdevices: inspection.counts.redundant,
        line_break: inspection.place.map(cable),
        cables: inspection.cables.iter().map(errors).collect(),
    }
}

#[cfg(test)]
mod tests {
    use ringcat::Options;
    use ringcat::simulated::SimulatedSegment;

    use super::*;

    const RING: &str = "[segment]\nring = true\n[[device]]\ntype = \"coupler\"\n[[device]]\n\
                        type = \"digital-output-8\"\n[[device]]\ntype = \"digital-input-8\"\n";

    fn counts(inspection: &RingInspection) -> (u16, u16) {
        (inspection.counts.main, inspection.counts.redundant)
    }

    fn look(cut: Option<usize>, corrupt: Option<usize>) -> RingInspection {
        let mut segment = SimulatedSegment::from_toml(RING).unwrap();
        let network = segment.network_mut();
        network.advance_by(Duration::from_millis(20));
        if let Some(cable) = cut {
            network.cut(ringcat::sim::cable::CableId(cable));
        }
        if let Some(cable) = corrupt {
            let cable = ringcat::sim::cable::CableId(cable);
            network.apply(ringcat::sim::fault::Fault::Corrupt { cable, direction: None, count: 2 });
        }
        network.advance_by(Duration::from_millis(20));
        MainDevice::request(segment, &Options::default()).inspect_ring().unwrap()
    }

    // covers: ring-status
    #[test]
    fn a_closed_ring_is_shown_with_every_cable() {
        let inspection = look(None, None);
        assert_eq!((inspection.state, counts(&inspection), inspection.place), (RingState::Closed, (3, 0), None));
        let lines = lines(&inspection, true);
        assert_eq!(lines[0], "ring        closed");
        assert_eq!(lines[2], "REDUNDANT   0 SubDevices");
        assert_eq!(lines[4], "     0      0  between the MAIN interface and SubDevice 0 port 0");
        assert_eq!(lines.len(), 8);
    }

    // covers: ring-status
    #[test]
    fn swapped_interfaces_of_a_ring_are_shown_and_a_silent_pair_is_no_ring() {
        use ringcat::sim::cable::{CableId, DeviceIndex, Endpoint, HostLink};
        use ringcat::sim::frame::Port;
        let device = || ringcat::sim::device::Device::new(ringcat::sim::catalogue::by_name("coupler").unwrap());
        let port = |device, port| Endpoint::Device(DeviceIndex(device), port);
        let builder = ringcat::sim::network::builder::SegmentBuilder::new().device(device()).device(device());
        let network = builder
            .cable(Endpoint::Host(HostLink::Redundant), port(0, Port::A))
            .cable(port(0, Port::B), port(1, Port::A))
            .cable(port(1, Port::B), Endpoint::Host(HostLink::Main))
            .build();
        let mut segment = SimulatedSegment::new(network.unwrap());
        segment.network_mut().advance_by(Duration::from_millis(20));
        let mut main_device = MainDevice::request(segment, &Options::default());
        let inspection = main_device.inspect_ring().unwrap();
        assert_eq!((inspection.state, counts(&inspection)), (RingState::Closed, (0, 2)));
        let lines = lines(&inspection, true);
        assert!(lines[3].contains("interfaces swapped"), "{lines:?}");
        assert!(lines[5].ends_with("between SubDevice 0 port 0 and the REDUNDANT interface"), "{lines:?}");
        assert!(lines[7].ends_with("between the MAIN interface and SubDevice 1 port 1"), "{lines:?}");
        [0, 2].map(CableId).into_iter().for_each(|cable| main_device.links_mut().network_mut().cut(cable));
        let error = main_device.inspect_ring().unwrap_err().to_string();
        assert!(error.contains("no frame returns"), "{error}");
    }

    // covers: ring-status
    #[test]
    fn interfaces_that_are_joined_without_any_subdevice_are_no_closed_ring() {
        use ringcat::sim::cable::{Endpoint, HostLink};
        let builder = ringcat::sim::network::builder::SegmentBuilder::new();
        let joined = builder.cable(Endpoint::Host(HostLink::Main), Endpoint::Host(HostLink::Redundant)).build();
        let mut segment = SimulatedSegment::new(joined.unwrap());
        segment.network_mut().advance_by(Duration::from_millis(20));
        let error = MainDevice::request(segment, &Options::default()).inspect_ring().unwrap_err();
        let text = Failure::from(error).to_string();
        assert!(text.contains("frames return, but no SubDevice processes them"), "{text}");
        assert!(text.ends_with("something sends the frames back unchanged: is this the cable to the SubDevices?"));
    }

    // covers: ring-status
    #[test]
    fn the_place_of_a_break_and_damaged_frames_are_shown_wherever_they_are() {
        for cable in 0..=3 {
            let inspection = look(Some(cable), None);
            assert_eq!((inspection.state, counts(&inspection)), (RingState::Open, (cable as u16, 3 - cable as u16)));
            assert_eq!(inspection.place, Some(inspection.cables[cable].cable), "cable {cable}");
            assert!(lines(&inspection, true).iter().any(|line| line.ends_with("<- line break")));
            assert_eq!(json(&inspection, true).ring, Some(crate::json::values::Ring::Open));
        }
        for cable in 0..=3 {
            let inspection = look(None, Some(cable));
            let counted: Vec<u64> = inspection.cables.iter().map(|it| it.errors.invalid_frames).collect();
            let at_the_host = cable == 0 || cable == 3;
            // No port counts what is damaged on the way to the host.
            let expected = if at_the_host { 1..=2 } else { 2..=4 };
            assert!(expected.contains(&counted[cable]), "cable {cable}: {counted:?}");
            assert_eq!(counted.iter().sum::<u64>(), counted[cable], "cable {cable}: {counted:?}");
        }
    }
}
