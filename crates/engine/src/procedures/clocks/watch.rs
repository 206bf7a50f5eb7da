//! The static drift phase, who is locked, and whose time each link distributes (protocol 7.2, 7.5).
//!
//! Two procedures run side by side: one hands the reference time to all clocks many times, as fast as the segment
//! allows, the other reads their differences, every millisecond until all are locked and now and again afterwards. When
//! the ring opens or closes, or a SubDevice is lost, the second one finds out who answers on which link, lets the
//! delays there count from the clock that is followed there, and posts the references for the cyclic frames. When ports
//! have changed, or somebody came or went, it has all delays measured again; from the cycle on in which ports have
//! changed nobody is told a time until that is done.

use core::time::Duration;

use alloc::string::ToString;
use alloc::vec;
use alloc::vec::Vec;

use ringcat_wire::address::{Position, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{DcSpeedCounterDifference, DcSpeedCounterStart, DcSystemTimeDifference, map};

use super::changes::{Change, SETTLE, answering, wait_for_change};
use super::measure::Opening;
use super::set_up::{measure_again, set_filters, set_up, write_delays};
use crate::board::clocks::References;
use crate::clocks::{SyncWindow, extend};
use crate::event::Event;
use crate::link::Link;
use crate::procedures::shared_clocks::HiddenDelay;
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::{Bus, Reply};
use crate::time::Instant;

/// Between two looks at the board, and at the differences before all are locked.
const PAUSE: Duration = Duration::from_millis(1);
/// Between two looks at the differences afterwards.
const ROUTINE: Duration = Duration::from_millis(100);
/// Between the first two tries to set the clocks up. Each further one comes after twice the time, until the segment
/// changes.
const RETRY: Duration = Duration::from_millis(100);
/// The longest time between two of them.
const LONGEST_RETRY: Duration = Duration::from_secs(10);
/// A ring that opened or closed explains ports that change within so long: in each part the way from clock to clock is
/// what it was (protocol 7.5), so that nobody has to wait for the measurement.
const EXPLAINED: Duration = Duration::from_millis(20);
/// Between two tries to measure it.
const AGAIN: Duration = Duration::from_millis(20);
/// A segment that cannot be measured for so long has its clocks followed as they were.
const PATIENCE: Duration = Duration::from_secs(1);
/// Clocks in front of a reference that are read with it in one frame.
const IN_A_FRAME: usize = 32;
/// Distributions in a row; then the bus belongs to others for [`BURST_PAUSE`].
const BURST: u32 = 8;
const BURST_PAUSE: Duration = Duration::from_micros(100);
/// A burst and its pause take at least this: the loops need their time as well as their samples, and what they have not
/// learned by the end of the phase, cycles of a millisecond take seconds for.
const BURST_TIME: Duration = Duration::from_micros(640);

/// The first try to set the clocks up, before anything else is asked of the SubDevices.
pub(crate) async fn begin(bus: &Bus, segment: &SharedSegment) {
    try_set_up(bus, segment, Opening::Branches).await;
    segment.clocks.access().leaves_out = false;
}

async fn try_set_up(bus: &Bus, segment: &SharedSegment, opening: Opening) {
    if let Err(reason) = set_up(bus, segment, opening).await {
        // What has been told is not told again.
        if segment.clocks.access().trouble.replace(reason.clone()).as_ref() != Some(&reason) {
            bus.report(Event::ClocksFailed { reason });
        }
        return;
    }
    post(segment);
    tell_reference(bus, segment);
    tell_hidden(bus, segment, &[]);
    bus.spawn(drift_phase(bus.clone(), segment.clone()));
}

/// Runs for ever.
pub(crate) async fn keep(bus: Bus, segment: SharedSegment) {
    // The first clock may come with a group that joins.
    while !segment.clocks.access().nodes.iter().any(|node| node.has_clock) {
        bus.sleep(RETRY).await;
    }
    let mut pause = RETRY;
    while !segment.clocks.access().is_set_up {
        pause = match wait_for_change(&bus, &segment, pause).await {
            Change::None => (2 * pause).min(LONGEST_RETRY),
            Change::FirstAnswer => RETRY,
            Change::Segment => {
                segment.clocks.access().trouble = None;
                RETRY
            }
        };
        try_set_up(&bus, &segment, Opening::Rings).await;
    }
    let mut next_look = Instant::default();
    let mut seen = (segment.board.ring().changes, answering(&segment));
    let mut next_measurement = Instant::default();
    let mut explained_until = Instant::default();
    segment.board.clocks.guard_ports();
    loop {
        wait(&bus, &segment, next_look, bus.now() < explained_until).await;
        let now = (segment.board.ring().changes, answering(&segment));
        let changed = now != seen;
        if now.0 != seen.0 {
            explained_until = bus.now() + EXPLAINED;
        }
        seen = now;
        if changed || (segment.board.clocks.is_held() && segment.clocks.access().is_doubtful.is_none()) {
            segment.clocks.access().is_doubtful.get_or_insert(bus.now());
            next_measurement = bus.now() + SETTLE;
        }
        let is_locked = segment.clocks.are_locked();
        let is_explained = bus.now() < explained_until;
        if changed || bus.now() >= next_look || (is_explained && segment.board.clocks.is_held()) {
            look(&bus, &segment, is_explained).await;
            let is_open = !is_locked || is_anybody_open(&segment) || segment.clocks.access().moving.is_some();
            next_look = if is_open { bus.now() } else { bus.now() + ROUTINE };
        }
        let doubtful = segment.clocks.access().is_doubtful;
        if let Some(since) = doubtful.filter(|since| bus.now() >= next_measurement.max(*since + SETTLE)) {
            measure_once(&bus, &segment, since).await;
            next_measurement = bus.now() + AGAIN;
        }
    }
}

/// Waits until there is something to do: at once where clocks are not as they should be, otherwise until something is
/// posted or a clock has come back, or the next look is due.
async fn wait(bus: &Bus, segment: &SharedSegment, next_look: Instant, is_explained: bool) {
    let is_doubtful = || segment.clocks.access().is_doubtful.is_some();
    let is_busy = is_explained || is_doubtful() || segment.board.clocks.is_held() || next_look <= bus.now();
    if is_busy {
        return bus.sleep(PAUSE).await;
    }
    segment.until_posted(bus.posted(), next_look, is_doubtful).await;
}

/// Measures the segment after a change.
async fn measure_once(bus: &Bus, segment: &SharedSegment, since: Instant) {
    let hold = || segment.board.clocks.post_references(References::default());
    let holds = segment.board.clocks.holds();
    let hidden = segment.clocks.access().all_hidden();
    match measure_again(bus, segment, hold).await {
        Ok((0, _)) => {}
        Ok((clocks, largest_ns)) => bus.report(Event::DelaysChanged { clocks, largest_ns }),
        Err(_) if bus.now() < since + PATIENCE => return,
        Err(reason) => bus.report(Event::ClocksFailed { reason }),
    }
    elect(bus, segment);
    tell_hidden(bus, segment, &hidden);
    segment.clocks.access().is_doubtful = None;
    post(segment);
    segment.board.clocks.answer(holds);
    set_filters(bus, &segment.clocks).await;
}

/// Whether a clock that is there is not locked, or not again.
fn is_anybody_open(segment: &SharedSegment) -> bool {
    let clocks = segment.clocks.access();
    let samples = clocks.config.as_ref().map_or(0, |config| config.lock_samples);
    clocks.nodes.iter().any(|node| node.has_clock && node.link.is_some() && node.good < samples)
}

/// Hands the reference time out, many times. One of these runs at a time.
pub(super) async fn drift_phase(bus: Bus, segment: SharedSegment) {
    let count = {
        let mut clocks = segment.clocks.access();
        if core::mem::replace(&mut clocks.is_drifting, true) {
            return;
        }
        clocks.config.as_ref().map_or(0, |config| config.drift_distributions)
    };
    let followers = segment.clocks.access().nodes.iter().filter(|node| node.has_clock).count() as u16;
    let (mut next, mut reading) = (bus.now(), None);
    for number in 0..count {
        let (references, _) = segment.board.clocks.references();
        // With a ring that opens or closes right now, the wrong clocks would follow.
        let is_certain = references == wanted(&segment) && !segment.board.clocks.is_held();
        let nobody = StationAddress(0);
        let stations = Link::ALL.map(|link| references.on(link).unwrap_or(nobody));
        if !is_certain || stations == [nobody; 2] {
            bus.sleep(PAUSE).await;
            continue;
        }
        // A link without a reference has nobody who takes a time.
        let time =
            reading.unwrap_or_else(|| (bus.now().0.wrapping_add(segment.clocks.access().epoch) as u32, bus.now()));
        reading = None;
        match bus.distribute_time(stations, map::DC_SYSTEM_TIME, time, Wkc(followers)).await {
            // Clocks in front of the reference are told what it showed last, and what has passed since: by how late
            // this host sent one frame comes back with the other sign in the next one.
            Ok(reply) if reply.redundant == Wkc(0) => {
                reading = reply.data.first_chunk().map(|bytes| (u32::from_le_bytes(*bytes), reply.sent_at));
            }
            Ok(_) => {}
            Err(_) => bus.sleep(PAUSE).await,
        }
        if number % BURST == BURST - 1 {
            next += BURST_TIME;
            bus.sleep_until(next.max(bus.now() + BURST_PAUSE)).await;
        }
    }
    segment.clocks.access().is_drifting = false;
}

/// What one clock said, and on which link.
#[derive(Clone, Copy, Default)]
struct Answer {
    link: Option<Link>,
    difference_ns: Option<i32>,
    /// How much faster its loop makes it run.
    deviation_ppb: i64,
}

/// Reads all differences and draws conclusions.
async fn look(bus: &Bus, segment: &SharedSegment, is_explained: bool) {
    let holds = segment.board.clocks.holds();
    let stations: Vec<Option<StationAddress>> = {
        let clocks = segment.clocks.access();
        clocks.nodes.iter().map(|node| node.has_clock.then_some(node.station)).collect()
    };
    let answers = bus.gather(stations, |bus, station| async move {
        let Some(station) = station else { return Some(Answer::default()) };
        let target = Target::Station(station, map::DC_SYSTEM_TIME_DIFFERENCE);
        // A lost frame says nothing about anybody.
        // With DC_SPEED_COUNTER_START and DC_SPEED_COUNTER_DIFFERENCE behind it.
        let reply = bus.transfer(Command::Fprd, target, vec![0; 8], Some(Wkc(1))).await.ok()?;
        let link = match (reply.main.0, reply.redundant.0) {
            (0, 0) => return Some(Answer::default()),
            (0, _) => Link::Redundant,
            _ => Link::Main,
        };
        let Some([a, b, c, d, start @ .., e, f]) = reply.data.first_chunk::<8>() else {
            return Some(Answer { link: Some(link), ..Answer::default() });
        };
        let start = DcSpeedCounterStart(u16::from_le_bytes(*start));
        let deviation_ppb = DcSpeedCounterDifference(i16::from_le_bytes([*e, *f])).deviation_ppb(start);
        let difference_ns = DcSystemTimeDifference::decode(&[*a, *b, *c, *d]).signed_ns();
        Some(Answer { link: Some(link), difference_ns: Some(difference_ns), deviation_ppb })
    });
    let mut answers: Vec<Option<Answer>> = answers.await;
    look_in_front(bus, segment, &mut answers).await;
    // While nobody is told a time, differences are those of a frame that came another way.
    if !segment.board.clocks.is_held() {
        judge(bus, segment, &answers);
    }
    if follow_links(bus, segment, &answers, is_explained).await {
        segment.board.clocks.answer(holds);
        set_filters(bus, &segment.clocks).await;
    }
    follow_reference(bus, segment).await;
}

/// Clocks that frames meet before the reference are told what the host believes, and what they show of that is by how
/// late it sends. How they differ is seen in what they and the reference show to one and the same frame.
async fn look_in_front(bus: &Bus, segment: &SharedSegment, answers: &mut [Option<Answer>]) {
    let groups: Vec<(usize, Vec<usize>)> = {
        let clocks = segment.clocks.access();
        let group = |link| {
            let reference = clocks.reference_on(link)?;
            let in_front = |index: &usize| clocks.is_in_front(*index, reference);
            Some((reference, (0..clocks.nodes.len()).filter(in_front).collect::<Vec<usize>>()))
        };
        Link::ALL.into_iter().filter_map(group).filter(|(_, some)| !some.is_empty()).collect()
    };
    segment.board.clocks.post_in_front(!groups.is_empty());
    for (reference, in_front) in groups {
        for some in in_front.chunks(IN_A_FRAME) {
            let stations: Vec<StationAddress> = {
                let clocks = segment.clocks.access();
                some.iter().chain([&reference]).map(|index| clocks.nodes[*index].station).collect()
            };
            let read = |station| (Command::Fprd, Target::Station(station, map::DC_SYSTEM_TIME), vec![0; 4]);
            let replies = bus.transfer_all(stations.into_iter().map(read), Some(Wkc(1))).await;
            let Ok(replies) = replies else { continue };
            let Some((of_reference, others)) = replies.split_last() else { continue };
            let time = |reply: &Reply| reply.data.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes));
            let clocks = &mut *segment.clocks.access();
            for (index, reply) in some.iter().zip(others) {
                let Some(answer) = answers[*index].as_mut().filter(|answer| answer.link.is_some()) else { continue };
                // Another frame was met at another time.
                let is_same = reply.frame == of_reference.frame && [reply, of_reference].map(Reply::wkc) == [Wkc(1); 2];
                answer.difference_ns = is_same.then(|| {
                    let delay = clocks.nodes[*index].delay_ns - clocks.nodes[reference].delay_ns;
                    let ahead = time(reply).wrapping_sub(time(of_reference)).wrapping_sub(delay as u32) as i32;
                    clocks.nodes[*index].average(ahead)
                });
                if !is_same {
                    answers[*index] = None;
                }
            }
        }
    }
}

/// Notes the differences; all locked is an event.
fn judge(bus: &Bus, segment: &SharedSegment, answers: &[Option<Answer>]) {
    let clocks = &mut *segment.clocks.access();
    let Some(config) = &clocks.config else { return };
    let references = Link::ALL.map(|link| clocks.reference_on(link));
    let (mut all, mut largest) = (clocks.reference.is_some(), 0);
    for (position, (node, answer)) in clocks.nodes.iter_mut().zip(answers).enumerate() {
        let Some(Answer { difference_ns: Some(difference), deviation_ppb, .. }) = answer else {
            all &= !node.has_clock || node.link.is_none();
            continue;
        };
        // Nothing is written to a reference, so that its own difference is none.
        let difference = if references.contains(&Some(position)) { 0 } else { *difference };
        let magnitude = difference.unsigned_abs();
        node.difference_ns = Some(difference);
        node.good =
            if magnitude <= config.lock_window_ns && !clocks.is_drifting { node.good.saturating_add(1) } else { 0 };
        if node.good >= config.lock_samples || (node.worst_ns > 0 && clocks.is_locked) {
            node.worst_ns = node.worst_ns.max(magnitude);
        }
        all &= node.good >= config.lock_samples;
        if node.good >= config.lock_samples && !references.contains(&Some(position)) {
            // What the loop makes up for, now that it has settled (protocol 7.2.1).
            node.drift_ppb = -deviation_ppb;
        }
        largest = largest.max(magnitude);
    }
    // Where a reference is steered, the exchange does not see how far the others are from theirs.
    let is_steered = references.iter().all(Option::is_some) || segment.board.clocks.is_host_told();
    let inside = largest <= config.sync_window_ns;
    if !clocks.is_locked || !(is_steered || clocks.window.is_outside()) {
        clocks.window.skip();
    } else if clocks.window.take(inside) {
        bus.report(Event::SyncWindow { inside, spread_ns: largest });
    }
    if all && !clocks.is_locked {
        clocks.is_locked = true;
        clocks.window = SyncWindow::inside();
        segment.board.clocks.watch_window();
        bus.report(Event::ClocksLocked { largest_ns: largest });
        if is_steered {
            bus.report(Event::SyncWindow { inside: true, spread_ns: largest });
        }
    }
}

/// Follows SubDevices from link to link, and replaces a reference that is gone. Returns whether references were posted
/// with which clocks may be told a time; `is_explained` is for changes of ports that come of a ring that opened or
/// closed.
async fn follow_links(bus: &Bus, segment: &SharedSegment, answers: &[Option<Answer>], is_explained: bool) -> bool {
    let moved = {
        let mut clocks = segment.clocks.access();
        // Answers that came while a ring opened or closed are of both states: another look has to say the same.
        let links: Vec<Option<Option<Link>>> = answers.iter().map(|answer| answer.map(|answer| answer.link)).collect();
        let before = clocks.moving.take();
        let is_certain = |(index, link): (usize, &Option<Option<Link>>)| {
            let has_moved = link.is_some_and(|link| clocks.nodes[index].has_clock && link != clocks.nodes[index].link);
            !has_moved || before.as_ref().is_some_and(|before| before.get(index) == Some(link))
        };
        if !links.iter().enumerate().all(is_certain) {
            clocks.moving = Some(links);
            return false;
        }
        let mut moved = false;
        for (node, answer) in clocks.nodes.iter_mut().zip(answers) {
            let Some(answer) = answer.filter(|_| node.has_clock) else { continue };
            moved |= answer.link != node.link;
            node.link = answer.link;
        }
        moved
    };
    let elected = elect(bus, segment);
    let is_other = segment.board.clocks.references().0 != wanted(segment);
    if segment.clocks.access().is_doubtful.is_some() && !is_explained {
        return false;
    }
    if !(moved || is_other || elected || segment.board.clocks.is_held()) {
        return false;
    }
    let changed: Vec<Link> = {
        let mut clocks = segment.clocks.access();
        if Link::ALL.iter().any(|link| clocks.is_mixed(*link)) {
            // What is between them is not known before the segment has been measured.
            clocks.is_doubtful.get_or_insert(bus.now());
            return false;
        }
        Link::ALL.into_iter().filter(|link| clocks.refer(*link)).collect()
    };
    if !changed.is_empty() {
        // Nobody is told a time while delays count from different clocks.
        segment.board.clocks.post_references(References::default());
        for link in changed {
            if let Err(error) = write_delays(bus, &segment.clocks, link).await {
                bus.report(Event::ClocksFailed { reason: error.to_string() });
            }
        }
    }
    post(segment);
    true
}

/// Replaces a reference that is gone. Returns whether there is another one.
fn elect(bus: &Bus, segment: &SharedSegment) -> bool {
    {
        let mut clocks = segment.clocks.access();
        let before = clocks.reference;
        let is_there = |index: &usize| clocks.nodes[*index].link.is_some() && !clocks.nodes[*index].is_unset;
        if before.as_ref().is_none_or(|index| !is_there(index)) {
            clocks.reference = clocks.elect(|_, node| node.link.is_some() && node.unit.is_some());
        }
        if clocks.reference == before {
            return false;
        }
    }
    tell_reference(bus, segment);
    true
}

fn tell_reference(bus: &Bus, segment: &SharedSegment) {
    let reference = {
        let clocks = segment.clocks.access();
        clocks.reference.map(|index| (Position(clocks.nodes[index].position), clocks.nodes[index].station))
    };
    let event = Event::ReferenceClock { position: reference.map(|(position, _)| position) };
    match reference {
        Some((_, station)) => bus.report_of(event, segment.view().occupant(station)),
        None => bus.report(event),
    }
}

/// Tells whose delay is not known, but for those that were told before.
fn tell_hidden(bus: &Bus, segment: &SharedSegment, before: &[Option<HiddenDelay>]) {
    let now = segment.clocks.access().all_hidden();
    for (index, hidden) in now.into_iter().enumerate() {
        let told = before.get(index).copied().flatten();
        let Some(HiddenDelay { fork, range_ns, is_estimated }) = hidden.filter(|hidden| {
            told.is_none_or(|told| (told.fork, told.is_estimated) != (hidden.fork, hidden.is_estimated))
        }) else {
            continue;
        };
        let (position, station) = {
            let clocks = segment.clocks.access();
            (Position(clocks.nodes[index].position), clocks.nodes[index].station)
        };
        let event = Event::DelayUnknown { position, fork, range_ns, is_estimated };
        bus.report_of(event, segment.view().occupant(station));
    }
}

/// Whose time the copies are to distribute.
fn wanted(segment: &SharedSegment) -> References {
    let clocks = segment.clocks.access();
    let station = |link| clocks.reference_on(link).map(|position| clocks.nodes[position].station);
    let leads = clocks.reference.and_then(|position| clocks.nodes[position].link) == Some(Link::Redundant);
    References { main: station(Link::Main), redundant: station(Link::Redundant), redundant_leads: leads }
}

fn post(segment: &SharedSegment) {
    segment.board.clocks.post_references(wanted(segment));
}

/// Keeps in mind what the reference clock shows at which host time.
async fn follow_reference(bus: &Bus, segment: &SharedSegment) {
    let station = {
        let clocks = segment.clocks.access();
        clocks.reference.map(|position| clocks.nodes[position].station)
    };
    let Some(station) = station else { return };
    let target = Target::Station(station, map::DC_SYSTEM_TIME);
    let Ok(reply) = bus.transfer(Command::Fprd, target, vec![0; 4], Some(Wkc(1))).await else { return };
    let (Some(bytes), Wkc(1)) = (reply.data.first_chunk(), reply.wkc()) else { return };
    let mut clocks = segment.clocks.access();
    let near = reply.sent_at.0.wrapping_add(clocks.epoch);
    clocks.epoch = extend(u32::from_le_bytes(*bytes), near).wrapping_sub(reply.sent_at.0);
}
