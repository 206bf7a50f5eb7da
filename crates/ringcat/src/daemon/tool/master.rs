//! The master as a whole: links, frames, clocks, network interfaces.

use std::time::Duration;

use ringcat_control::tool::{CycleReport, EthernetLine, LinkReport, MasterReport, Traffic, TrafficRate};
use ringcat_engine::link::Link;
use ringcat_engine::main_device::snapshot::Activity;
use ringcat_engine::main_device::{MainDevice as Engine, MainDevicePhase};

use crate::error::Error;
use crate::link_figures::{LinkFigures, LinkRate};
use crate::supervisor_thread::SupervisorThread;

/// An application whose cycles run answers within this time; another one has no times.
const CYCLE: Duration = Duration::from_millis(200);

/// The master as a whole.
pub(super) fn report(supervisor: &SupervisorThread) -> Result<MasterReport, Error> {
    let mut report = supervisor.act(of_engine)?;
    for (link, line) in Link::ALL.into_iter().zip(&mut report.links) {
        line.traffic = traffic(&supervisor.link_figures(link));
    }
    let observer = supervisor.observer();
    let snapshot = observer.as_ref().and_then(|observer| observer.snapshot(CYCLE).ok());
    if let (Some(snapshot), Some(observer)) = (snapshot, observer) {
        report.reference_time_ns = snapshot.reference_time.unwrap_or(0);
        report.application_time_ns = snapshot.application_time;
        let pace = observer.pace();
        report.cycles = Some(CycleReport {
            number: snapshot.cycle,
            at_ns: snapshot.taken_at.0,
            late_skipped_incomplete: [pace.late, pace.skipped, snapshot.counters.incomplete],
            longest_delay_ns: pace.longest_delay.as_nanos() as u64,
        });
    }
    Ok(report)
}

fn of_engine(engine: &mut Engine) -> MasterReport {
    let snapshot = engine.snapshot();
    let phase = engine.phase();
    let links = engine.interfaces().into_iter().zip(snapshot.ring.links);
    let links = links
        .filter_map(|(mac, link)| Some(LinkReport { mac: mac?.0, carrier: link.carrier, traffic: Traffic::default() }));
    MasterReport {
        // It has links here; a daemon checks whether their devices are present.
        is_orphaned: false,
        is_active: phase == MainDevicePhase::Operation,
        is_scanning: snapshot.activity == Activity::Scanning,
        subdevices: engine.scanned_count().unwrap_or(0) as u32,
        links: links.collect(),
        reference: snapshot.clocks.iter().find(|clock| clock.is_reference).map(|clock| clock.position),
        ..MasterReport::default()
    }
}

fn traffic(figures: &LinkFigures) -> Traffic {
    let rate = |rate: LinkRate| TrafficRate {
        frames_per_s: rate.frames_per_s,
        bytes_per_s: rate.bytes_per_s,
        lost_per_s: rate.lost_per_s,
        lost_bytes_per_s: rate.lost_bytes_per_s,
    };
    Traffic {
        frames: figures.frames,
        bytes: figures.bytes,
        lost: figures.lost,
        lost_bytes: figures.lost_bytes,
        rates: figures.rates.map(rate),
    }
}

/// Network interfaces of EoE in this process.
#[cfg(feature = "eoe")]
pub(super) fn ethernet(supervisor: &SupervisorThread) -> Result<Vec<EthernetLine>, Error> {
    let interfaces = supervisor.ethernet_interfaces();
    let line = |it: crate::eoe::EthernetInterface| EthernetLine {
        name: it.name,
        position: it.subdevice.position.0,
        is_up: it.status.up,
        bytes: [it.status.counters.rx_bytes, it.status.counters.tx_bytes],
        rates: [it.status.rx_rate.bytes, it.status.tx_rate.bytes],
        queue: [it.status.queued as u32, ringcat_engine::mail::eoe::QUEUE as u32],
    };
    Ok(interfaces.into_iter().map(line).collect())
}

/// Without the feature `eoe` there are none.
#[cfg(not(feature = "eoe"))]
pub(super) fn ethernet(_supervisor: &SupervisorThread) -> Result<Vec<EthernetLine>, Error> {
    Ok(Vec::new())
}
