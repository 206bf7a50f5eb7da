//! Send windows: how cyclic and acyclic frames share a wire of 100 Mbit/s, check 9 of [`crate::capture`].
//!
//! The sent frames go in, with link, class, length and time; a measurement comes out. A frame occupies its link for 80
//! ns per byte and 24 bytes more (preamble, FCS, gap; protocol 1.3), after the frames that were sent before it.
//!
//! The grid of the cycles is derived from the capture: the period is given or the usual distance of the cycles' first
//! frames, the phase is that of the earliest of them. A cyclic frame is **due** at its point of the grid and is sent a
//! little later, when the thread has woken up. An acyclic frame is **in time** if it is sent after the cyclic frames of
//! a cycle and has left the wire by the next point of the grid. A frame that was sent before this point and is still on
//! the wire **crosses** it; a frame that was sent after the point and before the cyclic frames **pushes in**. If a
//! cyclic frame then finds the wire occupied, it is **held up**.
//!
//! A sender with windows decides in time and may be stopped by its machine between the decision and sending. If the
//! cycle begins late as well, by more than a tenth of the period, this **stall** of the machine is visible in the
//! capture and such frames are counted separately. So is a second copy that was sent more than a tenth of the period
//! after the first copy of the same frame: the sender makes no decision between the two. `Windows::by_chance` is the
//! share of a sender without windows: the wire time of acyclic frames.

use std::fmt;
use std::time::Duration;

/// Additional bytes of a frame on the wire.
const OVERHEAD: u64 = 24;
/// Shortest frame without FCS.
const SHORTEST: u64 = 60;
const BYTE_NS: u64 = 80;
/// A delay of more than this fraction of the period is a stall.
const STALL_FRACTION: i64 = 10;

/// A frame that was sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Send time.
    pub time_ns: u64,
    /// Link.
    pub link: usize,
    /// Whether it is acyclic.
    pub acyclic: bool,
    /// Whether it is sent again within its cycle: it begins none.
    pub again: bool,
    /// Its bytes without FCS.
    pub length: usize,
    /// Delay after the first copy, if it is the second copy.
    pub behind_ns: u64,
}

/// Measurement of a link.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Windows {
    /// The period of the grid; zero if there are too few cycles.
    pub period: Duration,
    /// Cycles.
    pub cycles: u64,
    /// Cycles that began more than a tenth of the period late.
    pub late: u64,
    /// Acyclic frames between the first and the last cycle.
    pub acyclic: u64,
    /// Acyclic frames that cross a point of the grid, or push in, if the cycle is not late.
    pub crossed: u64,
    /// The same if the cycle is late, or the frame is long after its first copy: a stall of the machine.
    pub crossed_in_stalls: u64,
    /// Cycles with a first frame that found an acyclic frame on the wire.
    pub held_up: u64,
    /// Longest such delay.
    pub longest_hold_up: Duration,
    /// Largest time by which a frame of `crossed` exceeds its point.
    pub furthest: Duration,
    /// Frames sent again that found an acyclic frame on the wire.
    pub tries_held_up: u64,
    /// Crossings that a sender without windows would have made by chance.
    pub by_chance: u64,
}

impl fmt::Display for Windows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Windows { period, cycles, late, acyclic, crossed, crossed_in_stalls, held_up, .. } = self;
        writeln!(
            f,
            "windows: {cycles} cycles of {period:?}, {late} of them late; {acyclic} acyclic frames between them"
        )?;
        writeln!(
            f,
            "  not through by the next cycle: {crossed} (by {:?} at most), in stalls of the machine \
             {crossed_in_stalls}; by chance it would be {}",
            self.furthest, self.by_chance
        )?;
        writeln!(f, "  cycles held up by an acyclic frame: {held_up}, by {:?} at most", self.longest_hold_up)?;
        if self.tries_held_up > 0 {
            writeln!(f, "  frames sent again behind an acyclic frame: {}", self.tries_held_up)?;
        }
        Ok(())
    }
}

const fn wire_ns(length: usize) -> u64 {
    let length = length as u64;
    (if length < SHORTEST { SHORTEST } else { length } + OVERHEAD) * BYTE_NS
}

/// Measures frames in the order of time; empty if they are too few for a grid.
pub fn measure(sent: &[Sent], links: usize, period: Option<Duration>) -> Vec<Windows> {
    let of_link = |link| sent.iter().copied().filter(|frame| frame.link == link).collect::<Vec<Sent>>();
    let grids = (0..links).map(of_link).filter_map(|sent| Some((Grid::find(&sent, period)?, sent)));
    grids.map(|(grid, sent)| measure_link(&sent, &grid)).collect()
}

/// The grid of a link's cycles.
#[derive(Debug)]
struct Grid {
    period_ns: i64,
    /// One point of it.
    point_ns: i64,
    /// First frames of the cycles.
    starts: Vec<u64>,
}

impl Grid {
    fn find(sent: &[Sent], period: Option<Duration>) -> Option<Grid> {
        let cyclic: Vec<u64> =
            sent.iter().filter(|frame| !frame.acyclic && !frame.again).map(|frame| frame.time_ns).collect();
        let period_ns = period.map_or_else(|| usual_distance(&cyclic), |period| period.as_nanos() as i64);
        if cyclic.len() < 10 || period_ns <= 0 {
            return None;
        }
        // The frames of one cycle leave together.
        let mut starts: Vec<u64> = Vec::new();
        for time in cyclic {
            if starts.last().is_none_or(|start| (time - start) as i64 > period_ns / 2) {
                starts.push(time);
            }
        }
        let first = *starts.first()?;
        let phase = |time: u64| (time - first) as i64 % period_ns;
        // Most cycles are in time: the bin with the most frames is around the grid, and frames up to half a period
        // before it are late by more than half a period.
        let mut bins = [0u32; 50];
        for start in &starts {
            bins[(phase(*start) * bins.len() as i64 / period_ns) as usize] += 1;
        }
        let densest = (0..bins.len()).max_by_key(|bin| bins[*bin])? as i64 * period_ns / bins.len() as i64;
        let around = |time: u64| (phase(time) - densest + period_ns / 2).rem_euclid(period_ns) - period_ns / 2;
        let mut delays: Vec<i64> = starts.iter().map(|start| around(*start)).collect();
        delays.sort_unstable();
        let promptest = delays[delays.len() / 100];
        Some(Grid { period_ns, point_ns: first as i64 + densest + promptest, starts })
    }

    /// The point of a cycle: the last one before it, or one shortly after it.
    fn point_of(&self, start: u64) -> i64 {
        let since = start as i64 - self.point_ns + self.period_ns / 4;
        start as i64 - (since.rem_euclid(self.period_ns) - self.period_ns / 4)
    }
}

/// The usual distance of frames of different cycles, to a microsecond.
fn usual_distance(times: &[u64]) -> i64 {
    let mut distances: Vec<u64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    distances.sort_unstable();
    let longest = distances.last().copied().unwrap_or(0);
    let usual = distances.iter().copied().filter(|distance| *distance > longest.min(1_000_000) / 8).collect::<Vec<_>>();
    usual.get(usual.len() / 2).map_or(0, |distance| (distance + 500) as i64 / 1000 * 1000)
}

fn measure_link(sent: &[Sent], grid: &Grid) -> Windows {
    let mut windows = Windows { period: Duration::from_nanos(grid.period_ns as u64), ..Windows::default() };
    let (Some(first), Some(last)) = (grid.starts.first(), grid.starts.last()) else { return windows };
    let (mut free_ns, mut chance_ns, mut acyclic_until) = (0, 0, 0);
    // Acyclic frames since the last cycle: times at which they have left the wire.
    let mut waiting: Vec<(u64, bool)> = Vec::new();
    let mut starts = grid.starts.iter().copied().peekable();
    for frame in sent {
        if starts.next_if(|start| *start == frame.time_ns && !frame.acyclic).is_some() {
            cycle(&mut windows, grid, frame.time_ns, &waiting);
            waiting.clear();
        }
        let busy_ns = wire_ns(frame.length);
        windows.tries_held_up += u64::from(frame.again && acyclic_until > frame.time_ns);
        free_ns = free_ns.max(frame.time_ns) + busy_ns;
        acyclic_until = if frame.acyclic { free_ns } else { acyclic_until };
        if frame.acyclic && (*first..*last).contains(&frame.time_ns) {
            windows.acyclic += 1;
            chance_ns += busy_ns;
            waiting.push((free_ns, frame.behind_ns as i64 > grid.period_ns / STALL_FRACTION));
        }
    }
    windows.by_chance = chance_ns / grid.period_ns as u64;
    windows
}

/// A cycle begins after acyclic frames that have left the wire at these times, some of them delayed by a stall.
fn cycle(windows: &mut Windows, grid: &Grid, start: u64, waiting: &[(u64, bool)]) {
    let point = grid.point_of(start);
    let late = start as i64 - point > grid.period_ns / STALL_FRACTION;
    windows.cycles += 1;
    windows.late += u64::from(late);
    for (through, stalled) in waiting {
        let beyond = *through as i64 - point;
        if beyond <= 0 {
            continue;
        }
        if late || *stalled {
            windows.crossed_in_stalls += 1;
        } else {
            windows.crossed += 1;
            windows.furthest = windows.furthest.max(Duration::from_nanos(beyond as u64));
        }
    }
    if let Some(hold_up) = waiting.last().and_then(|(through, _)| through.checked_sub(start)).filter(|ns| *ns > 0) {
        windows.held_up += 1;
        windows.longest_hold_up = windows.longest_hold_up.max(Duration::from_nanos(hold_up));
    }
}
