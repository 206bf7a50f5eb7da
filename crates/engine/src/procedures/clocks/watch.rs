//! Set-up of the clocks, and their supervision afterwards (protocol 7.2, 7.5).
//!
//! The differences of all clocks are read every millisecond until all are locked, and ten times a second afterwards.
//! When the ring opens or closes, or a SubDevice is lost, the answers also show which SubDevice answers on which link:
//! the model then recomputes the delays from the reference on that link, and posts the references for the cyclic
//! frames. When ports have changed, or SubDevices were lost or added, all delays are measured again; from the cycle
//! that shows changed ports until then the exchange distributes no time.

use core::time::Duration;

use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DcSpeedCounterDifference, DcSpeedCounterStart, DcSystemTimeDifference, map};

use super::changes::{Change, SETTLE, wait_for_change};
use super::measure::Opening;
use super::offsets::{write_missed, write_offsets};
use super::set_up::{measure_again, set_filters, set_up, write_delays};
use super::slide::slide;
use crate::link::Link;
use crate::procedures::shared_segment::SharedSegment;
use crate::segment::clocks::{Answer, Answers, ClockFinding, ClockObservation, ClockVersions, Difference, Due, Node};
use crate::segment::{Changes, Observation};
use crate::supervisor::{Bus, Reply};
use crate::time::Instant;

/// Interval of reads of the differences before all clocks are locked, and while links change.
const PAUSE: Duration = Duration::from_millis(1);
/// Interval of reads afterwards.
const ROUTINE: Duration = Duration::from_millis(100);
/// Pause between the first two attempts to set the clocks up. It doubles with each attempt, until the segment changes.
const RETRY: Duration = Duration::from_millis(100);
/// The longest of these pauses.
const LONGEST_RETRY: Duration = Duration::from_secs(10);
/// Port changes within this time are explained by a ring that opened or closed: in each part the path from clock to
/// clock is unchanged (protocol 7.5), so the distribution does not wait for the measurement.
const EXPLAINED: Duration = Duration::from_millis(20);
/// Pause between two attempts to measure a changed segment.
const AGAIN: Duration = Duration::from_millis(20);
/// If a segment cannot be measured for this time, time is distributed with the old delays.
const PATIENCE: Duration = Duration::from_secs(1);
/// Bytes from DC_SYSTEM_TIME_OFFSET to DC_SYSTEM_TIME_DIFFERENCE.
const DIFFERENCE_BEHIND_OFFSET: usize = 12;
/// Clocks before a reference that are read with it in one frame.
const IN_A_FRAME: usize = 32;

/// Sets the clocks up before other frames are sent, because receive times are latched (protocol 7.1); then the
/// configuration begins. Runs until the MainDevice stops.
pub(in crate::procedures) async fn keep_clocks(bus: Bus, segment: SharedSegment) {
    try_set_up(&bus, &segment, Opening::Branches).await;
    segment.observe(Observation::Started);
    keep(bus, segment).await;
}

async fn try_set_up(bus: &Bus, segment: &SharedSegment, opening: Opening) {
    segment.observe_clocks(ClockObservation::SetUpBegun);
    let versions = segment.view().clock_versions();
    let done = match set_up(bus, segment, versions, opening).await {
        Ok(()) => ClockFinding::SetUp,
        Err(reason) => ClockFinding::SetUpFailed(reason),
    };
    segment.find_of_clocks(versions, done);
}

/// Runs until the MainDevice stops.
pub(super) async fn keep(bus: Bus, segment: SharedSegment) {
    // The first clock may be added by a hot connect group.
    segment.until(|segment| segment.clocks().is_any().then_some(())).await;
    let mut pause = RETRY;
    while !segment.view().clocks().are_set_up() {
        pause = match wait_for_change(&bus, &segment, pause).await {
            Change::None => (2 * pause).min(LONGEST_RETRY),
            Change::FirstAnswer => RETRY,
            Change::Segment => {
                segment.observe_clocks(ClockObservation::SegmentChanged);
                RETRY
            }
        };
        try_set_up(&bus, &segment, Opening::Rings).await;
    }
    watch(&bus, &segment).await;
}

pub(super) async fn watch(bus: &Bus, segment: &SharedSegment) {
    let mut next_read = Instant::default();
    let mut seen = segment.view().changes();
    let mut seen_times = segment.board.clocks.times.posted();
    let mut next_measurement = Instant::default();
    let mut explained_until = Instant::default();
    loop {
        wait(bus, segment, (next_read, next_measurement), bus.now() < explained_until, seen).await;
        segment.observe_words();
        let now = segment.view().changes();
        let changed = now.segment != seen.segment;
        if now.ring != seen.ring {
            explained_until = bus.now() + EXPLAINED;
        }
        seen = now;
        let is_held = segment.board.clocks.is_held();
        if changed || (is_held && doubtful_since(segment).is_none()) {
            segment.observe_clocks(ClockObservation::SegmentChanged);
            next_measurement = bus.now() + SETTLE;
        }
        let were_locked = segment.view().clocks().are_locked();
        let times = segment.board.clocks.times.posted();
        if times != seen_times {
            (seen_times, next_read) = (times, bus.now());
        }
        let is_explained = bus.now() < explained_until;
        if changed || bus.now() >= next_read || (is_explained && is_held) {
            read_all(bus, segment, is_explained).await;
            slide(bus, segment, seen.ring).await;
            let is_routine = {
                let view = segment.view();
                let is_certain = !view.clocks().are_links_unconfirmed() && !view.clocks().is_time_pending();
                were_locked && !view.clocks().is_any_outside() && is_certain
            };
            next_read = if is_routine { bus.now() + ROUTINE } else { bus.now() };
        }
        if let Some(since) = doubtful_since(segment).filter(|since| bus.now() >= next_measurement.max(*since + SETTLE))
        {
            measure_once(bus, segment, since).await;
            next_measurement = bus.now() + AGAIN;
        }
    }
}

fn doubtful_since(segment: &SharedSegment) -> Option<Instant> {
    segment.view().clocks().doubtful_since()
}

/// Waits until the differences have to be read or the segment measured, or until words are posted or a clock has come
/// back. While clocks are outside or links change, differences are read every [`PAUSE`].
async fn wait(
    bus: &Bus,
    segment: &SharedSegment,
    (next_read, next_measurement): (Instant, Instant),
    is_explained: bool,
    seen: Changes,
) {
    let posted = bus.posted();
    let doubtful = doubtful_since(segment);
    let is_held = segment.board.clocks.is_held();
    let reads = next_read <= bus.now() || (is_explained && is_held);
    if reads || doubtful.is_some() || is_held {
        bus.sleep(PAUSE).await;
    }
    if reads || (is_held && doubtful.is_none()) {
        return;
    }
    let measures = doubtful.map(|since| next_measurement.max(since + SETTLE));
    let until = measures.map_or(next_read, |at| at.min(next_read));
    let has_come_back = || doubtful.is_none() && doubtful_since(segment).is_some();
    let is_changed = || has_come_back() || segment.view().changes() != seen;
    segment.until_posted(posted, until, is_changed).await;
}

/// Measures the segment after a change.
async fn measure_once(bus: &Bus, segment: &SharedSegment, since: Instant) {
    let versions = segment.view().clock_versions();
    let failed = match measure_again(bus, segment, versions).await {
        Ok(()) => None,
        Err(_) if bus.now() < since + PATIENCE => return,
        Err(reason) => Some(reason),
    };
    segment.find_of_clocks(versions, ClockFinding::MeasurementEnded { failed });
    set_filters(bus, segment).await;
}

/// Reads all differences, and executes the resulting actions.
async fn read_all(bus: &Bus, segment: &SharedSegment, is_explained: bool) {
    let versions = segment.view().clock_versions();
    let clocks = segment.view().clocks().to_read();
    let answers = bus.gather(clocks, |bus, (key, offset_ns)| async move {
        let (register, before) = match offset_ns {
            Some(_) => (map::DC_SYSTEM_TIME_OFFSET, DIFFERENCE_BEHIND_OFFSET),
            None => (map::DC_SYSTEM_TIME_DIFFERENCE, 0),
        };
        // Including DC_SPEED_COUNTER_START and DC_SPEED_COUNTER_DIFFERENCE. A lost frame gives no information.
        let target = Target::Station(key.station, register);
        let reply = bus.transfer(Command::Fprd, target, vec![0; before + 8], Some(Wkc(1))).await.ok()?;
        let answer = decode(&reply, before);
        let read = reply.data.first_chunk().map(|low| u32::from_le_bytes(*low));
        let offset = offset_ns.zip(read).filter(|_| answer.link.is_some());
        Some((key, answer, offset))
    });
    let answers: Vec<_> = answers.await.into_iter().flatten().collect();
    for (key, _, offset) in &answers {
        if let Some((written_ns, read)) = *offset {
            segment.find_of_clocks(versions, ClockFinding::OffsetRead { key: *key, written_ns, read });
        }
    }
    let mut answers: Answers = answers.into_iter().map(|(key, answer, _)| (key, answer)).collect();
    read_in_front(bus, segment, &mut answers).await;
    segment.find_of_clocks(versions, ClockFinding::Answers { answers: &answers, is_explained });
    let due = segment.view().clocks().due();
    match due {
        Due::Nothing | Due::Offsets => {}
        Due::Filters => set_filters(bus, segment).await,
        Due::Delays => {
            let links = segment.view().clocks().unwritten();
            let written = ClockVersions { holds: versions.holds, ..segment.view().clock_versions() };
            for link in links {
                if let Err(error) = write_delays(bus, segment, link).await {
                    segment.find_of_clocks(written, ClockFinding::DelaysNotWritten(error.to_string()));
                }
            }
            // Stops of the distribution since the answers are not answered yet.
            segment.find_of_clocks(written, ClockFinding::Followed);
            set_filters(bus, segment).await;
        }
    }
    follow_reference(bus, segment).await;
    if segment.view().clocks().are_offsets_due() {
        write_offsets(bus, segment).await;
        set_filters(bus, segment).await;
    }
    write_missed(bus, segment).await;
}

/// The registers of the difference begin at an offset.
fn decode(reply: &Reply, at: usize) -> Answer {
    let link = match (reply.main.0, reply.redundant.0) {
        (0, 0) => return Answer::default(),
        (0, _) => Link::Redundant,
        _ => Link::Main,
    };
    let registers = reply.data.get(at..).and_then(<[u8]>::first_chunk::<8>);
    let Some([a, b, c, d, start @ .., e, f]) = registers else {
        return Answer { link: Some(link), ..Answer::default() };
    };
    let start = DcSpeedCounterStart(u16::from_le_bytes(*start));
    let deviation_ppb = DcSpeedCounterDifference(i16::from_le_bytes([*e, *f])).deviation_ppb(start);
    let difference = Difference::Own(DcSystemTimeDifference::decode(&[*a, *b, *c, *d]).signed_ns());
    Answer { link: Some(link), difference, deviation_ppb }
}

/// Clocks that frames pass before the reference receive the time predicted by the host, so their own differences
/// contain the sending delay of the host. Their true differences are computed from one frame that reads them and the
/// reference.
async fn read_in_front(bus: &Bus, segment: &SharedSegment, answers: &mut Answers) {
    let delayed = |node: &Node| (node.key(), node.delay_ns);
    let groups: Vec<_> = {
        let view = segment.view();
        let groups = Link::ALL.into_iter().filter_map(|link| view.clocks().in_front_on(link));
        let with_delays = |(reference, in_front): (&Node, Vec<&Node>)| {
            (delayed(reference), in_front.into_iter().map(delayed).collect::<Vec<_>>())
        };
        groups.map(with_delays).collect()
    };
    for (reference, in_front) in groups {
        for some in in_front.chunks(IN_A_FRAME) {
            let stations = some.iter().chain([&reference]).map(|(key, _)| key.station);
            let read = |station| (Command::Fprd, Target::Station(station, map::DC_SYSTEM_TIME), vec![0; 4]);
            let replies = bus.transfer_all(stations.map(read), Some(Wkc(1))).await;
            let Ok(replies) = replies else { continue };
            let Some((of_reference, others)) = replies.split_last() else { continue };
            let time = |reply: &Reply| reply.data.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
            for ((key, delay_ns), reply) in some.iter().zip(others) {
                let Some(answer) = answers.get_mut(key).filter(|answer| answer.link.is_some()) else { continue };
                // Another frame passed at another time.
                if reply.frame != of_reference.frame || [reply, of_reference].map(Reply::wkc) != [Wkc(1); 2] {
                    answers.remove(key);
                    continue;
                }
                let way = (delay_ns - reference.1) as u32;
                let ahead = time(reply).wrapping_sub(time(of_reference)).wrapping_sub(way) as i32;
                answer.difference = Difference::InFront(ahead);
            }
        }
    }
}

/// Reads the reference clock: the system time at a host time.
async fn follow_reference(bus: &Bus, segment: &SharedSegment) {
    let versions = segment.view().clock_versions();
    let Some(key) = segment.view().clocks().reference_node().map(Node::key) else { return };
    let target = Target::Station(key.station, map::DC_SYSTEM_TIME);
    let Ok(reply) = bus.transfer(Command::Fprd, target, vec![0; 4], Some(Wkc(1))).await else { return };
    let (Some(bytes), Wkc(1)) = (reply.data.first_chunk(), reply.wkc()) else { return };
    let (low, sent_at) = (u32::from_le_bytes(*bytes), reply.sent_at.0);
    segment.find_of_clocks(versions, ClockFinding::ReferenceTime { key, low, sent_at });
}
