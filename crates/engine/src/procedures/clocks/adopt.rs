//! Clocks that another MainDevice has set up: they are read and not written, and go on without a jump (protocol 7.2).
//!
//! What was measured is known from that MainDevice. Offset, delay and filters of each clock and the time of the
//! reference are read; where a delay differs from the known one the segment is measured again, as after a change.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::map;

use super::watch::{keep, watch};
use crate::event::Subject;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::clocks::{AdoptedClock, AdoptedClocks, ClockFinding, ClockObservation};
use crate::supervisor::{Bus, BusError, Reply};

/// DC_SYSTEM_TIME_OFFSET and DC_SYSTEM_TIME_DELAY.
const REGISTERS: usize = 12;
/// Attempts to read them: frames may be lost.
const ATTEMPTS: usize = 3;

/// Adopts the clocks, and supervises them. Runs until the MainDevice stops.
pub(in crate::procedures) async fn keep_adopted_clocks(bus: Bus, segment: SharedSegment) {
    let mut adopted = Err("not tried".to_string());
    for _ in 0..ATTEMPTS {
        adopted = adopt(&bus, &segment).await;
        if adopted.is_ok() {
            return watch(&bus, &segment).await;
        }
    }
    if let Err(reason) = adopted {
        let versions = segment.view().clock_versions();
        segment.find_of_clocks(versions, ClockFinding::SetUpFailed(reason));
    }
    keep(bus, segment).await;
}

async fn adopt(bus: &Bus, segment: &SharedSegment) -> Result<(), String> {
    let known = segment.view().known_clocks().ok_or_else(|| "nothing is known of the clocks".to_string())?;
    segment.observe_clocks(ClockObservation::SetUpBegun);
    let versions = segment.view().clock_versions();
    let (reference, stations): (_, Vec<StationAddress>) = {
        let view = segment.view();
        let with_clock = view.clocks().nodes.iter().filter(|node| node.has_clock);
        (view.clocks().reference, with_clock.map(|node| node.station).collect())
    };
    let reference = reference.ok_or_else(|| "no SubDevice has a clock".to_string())?;
    let read = bus.gather(stations, |bus, station| async move { read(&bus, station).await });
    let clocks: Vec<AdoptedClock> = read.await.into_iter().flatten().collect();
    let text = |error: BusError| error.to_string();
    let target = Target::Station(reference, map::DC_SYSTEM_TIME);
    let reply = bus.transfer(Command::Fprd, target, vec![0; 8], Some(Wkc(1))).await.map_err(text)?;
    let time = reply.data.first_chunk().filter(|_| reply.wkc() == Wkc(1));
    let time = time.ok_or_else(|| format!("the reference clock {reference} does not answer"))?;
    bus.step(Subject::Clocks, || format!("{} clocks adopted, reference {reference}", clocks.len()));
    let (time, sent_at) = (u64::from_le_bytes(*time), reply.sent_at);
    let adopted = AdoptedClocks { known: &known, clocks: &clocks, time, sent_at };
    segment.find_of_clocks(versions, ClockFinding::Adopted(&adopted));
    Ok(())
}

/// The registers of a clock; `None` if it does not answer.
async fn read(bus: &Bus, station: StationAddress) -> Option<AdoptedClock> {
    let registers = [(map::DC_SYSTEM_TIME_OFFSET, REGISTERS), (map::DC_FILTER_DIFFERENCE, 2)];
    let reads =
        registers.map(|(register, length)| (Command::Fprd, Target::Station(station, register), vec![0; length]));
    let replies = bus.transfer_all(reads, Some(Wkc(1))).await.ok()?;
    let [offset, filters] = &replies[..] else { return None };
    if [offset, filters].map(Reply::wkc) != [Wkc(1); 2] {
        return None;
    }
    let [a, b, c, d, e, f, g, h, delay @ ..] = offset.data.first_chunk::<REGISTERS>()?;
    Some(AdoptedClock {
        station,
        offset_ns: i64::from_le_bytes([*a, *b, *c, *d, *e, *f, *g, *h]),
        delay_ns: u32::from_le_bytes(*delay),
        filters: *filters.data.first_chunk()?,
    })
}
