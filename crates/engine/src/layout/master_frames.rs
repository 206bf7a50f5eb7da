//! The master frames of a cycle: areas, their fragments, and the frames that carry them (protocol 9.8).
//!
//! Input: a layout of process data, and the sizes that the application chooses. Output: frames of fragments, the same
//! on both MainDevices of a ring as long as their configuration is. Header and answer are whole fragments of the first
//! frame; the other areas follow in a fixed order and are cut where a frame ends.

use alloc::vec::Vec;
use core::time::Duration;

use ringcat_wire::datagram::{MAX_DATA, OVERHEAD};
use ringcat_wire::frame::{MIN_FRAME, frame_len, wire_time_ns};
use ringcat_wire::master_frame::{Answer, Area, Diagnosis, DomainRecord, FragmentHead, Header, Lengths};

use super::{Layout, LayoutError};
use crate::direction::Direction;
use crate::domain::DomainId;
use crate::ring::identity::DATAGRAMS_AT;

/// Room for datagrams in a frame.
const ROOM: usize = MAX_DATA + OVERHEAD;
/// Bytes of a fragment without its part of the area.
const EACH: usize = OVERHEAD + FragmentHead::LEN;
/// Fewer bytes of an area do not share a frame with others, unless they are all of it.
const LEAST: usize = 64;
/// Knowledge is cut at multiples of this: whole words of other threads.
pub const KNOWLEDGE_GRAIN: usize = 8;
/// Most bytes of knowledge in a cycle: one fragment.
pub const MOST_KNOWLEDGE: usize = (MAX_DATA - FragmentHead::LEN) / KNOWLEDGE_GRAIN * KNOWLEDGE_GRAIN;
/// Most fragments in a cycle.
pub const MOST_FRAGMENTS: usize = 512;

/// Sizes that an application chooses for the master frames (protocol FR-12, FR-13).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct MasterSizes {
    /// Bytes of process data of the ACTIVE for the INACTIVE.
    pub to_inactive: u16,
    /// Bytes of process data of the INACTIVE for the ACTIVE.
    pub to_active: u16,
    /// Whether the INACTIVE gets the inputs of the SubDevices.
    pub inputs: bool,
    /// Bytes of knowledge of the segment per cycle, at most `MOST_KNOWLEDGE`; rounded up to a multiple of 8. With 0
    /// the INACTIVE gets no knowledge, and cannot take over without a scan.
    pub knowledge: u16,
}

impl Default for MasterSizes {
    fn default() -> MasterSizes {
        MasterSizes { to_inactive: 0, to_active: 0, inputs: true, knowledge: 512 }
    }
}

/// A part of an area in a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlannedFragment {
    /// The area.
    pub area: Area,
    /// First byte in the area.
    pub offset: usize,
    /// Bytes.
    pub length: usize,
}

/// Bytes of the area of inputs, in the image of a domain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct InputRun {
    /// The domain.
    pub domain: DomainId,
    /// First byte in its image.
    pub image_offset: usize,
    /// First byte in the area.
    pub offset: usize,
    /// Bytes.
    pub length: usize,
}

/// The master frames of a cycle.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PlannedMasterFrames {
    /// Fragments of each frame.
    pub frames: Vec<Vec<PlannedFragment>>,
    /// Bytes of the areas.
    pub lengths: Lengths,
    /// The area of inputs.
    pub inputs: Vec<InputRun>,
    /// Bytes of knowledge in a cycle.
    pub knowledge: usize,
}

impl PlannedMasterFrames {
    /// Plans the frames beside those of a layout.
    ///
    /// # Errors
    /// More frames than may be on the wire at once.
    pub fn new(sizes: MasterSizes, layout: &Layout, subdevices: usize) -> Result<PlannedMasterFrames, LayoutError> {
        let inputs = if sizes.inputs { input_runs(layout) } else { Vec::new() };
        let input_bytes: usize = inputs.iter().map(|run| run.length).sum();
        let diagnosis = Diagnosis::LEN + DomainRecord::LEN * layout.domains.len();
        let knowledge = usize::from(sizes.knowledge).next_multiple_of(KNOWLEDGE_GRAIN).min(MOST_KNOWLEDGE);
        let mut cutter = Cutter { frames: Vec::new(), used: ROOM, most: layout.most };
        cutter.whole(Area::Header, Header::LEN);
        cutter.whole(Area::Answer, Answer::LEN);
        let areas = [
            (Area::SubDevices, subdevices),
            (Area::Diagnosis, diagnosis),
            (Area::ToInactive, usize::from(sizes.to_inactive)),
            (Area::ToActive, usize::from(sizes.to_active)),
            (Area::Inputs, input_bytes),
        ];
        areas.into_iter().for_each(|(area, length)| cutter.cut(area, length));
        if knowledge > 0 {
            cutter.whole(Area::Knowledge, knowledge);
        }
        let lengths = Lengths {
            subdevices: subdevices as u32,
            inputs: input_bytes as u32,
            diagnosis: diagnosis as u32,
            to_inactive: sizes.to_inactive.into(),
            to_active: sizes.to_active.into(),
        };
        let planned = PlannedMasterFrames { frames: cutter.frames, lengths, inputs, knowledge };
        layout.check_beside(planned.frames.len())?;
        Ok(planned)
    }

    /// Whether a cycle holds its frames: those of all domains, master frames, and one acyclic frame of at most
    /// `acyclic` bytes. Further acyclic frames take what is left of a cycle.
    ///
    /// # Errors
    /// [`LayoutError::CycleTooShort`].
    pub fn check_time(&self, layout: &Layout, acyclic: usize) -> Result<(), LayoutError> {
        let fastest = layout.domains.iter().filter(|domain| domain.period > Duration::ZERO);
        let Some(fastest) = fastest.min_by_key(|domain| domain.period) else { return Ok(()) };
        let cyclic = layout.domains.iter().flat_map(|domain| &domain.frames);
        let cyclic = cyclic.map(|frame| (DATAGRAMS_AT + frame.bytes()).max(MIN_FRAME));
        let times: Vec<u64> = cyclic.chain(self.frame_lengths()).map(wire_time_ns).collect();
        let on_wire = Duration::from_nanos(times.iter().sum::<u64>() + wire_time_ns(acyclic.max(MIN_FRAME)));
        // The other MainDevice sends a frame on when it has all of it, twice if a cable is broken (protocol 9.9).
        let needed = on_wire + 2 * Duration::from_nanos(times.iter().copied().max().unwrap_or_default());
        let period = fastest.period * u32::from(fastest.under_way.max(1));
        // Cycles that overlap on the wire must not be sent faster than the wire takes their frames.
        let limits = [(needed, period), (on_wire, fastest.period)];
        match limits.into_iter().find(|(needed, period)| needed > period) {
            Some((needed, period)) => Err(LayoutError::CycleTooShort { needed, period }),
            None => Ok(()),
        }
    }

    /// Number of fragments.
    pub fn fragments(&self) -> usize {
        self.frames.iter().map(Vec::len).sum()
    }

    /// Bytes of all frames, without FCS.
    pub fn bytes(&self) -> usize {
        self.frame_lengths().sum()
    }

    fn frame_lengths(&self) -> impl Iterator<Item = usize> {
        let of_frame = |frame: &Vec<PlannedFragment>| frame_len(frame.iter().map(|it| it.length + FragmentHead::LEN));
        self.frames.iter().map(of_frame)
    }
}

/// Inputs of all domains in the order of their images; adjacent ones are one run.
fn input_runs(layout: &Layout) -> Vec<InputRun> {
    let mut runs: Vec<InputRun> = Vec::new();
    for (number, domain) in layout.domains.iter().enumerate() {
        let areas = domain.areas.iter().filter(|placed| placed.area.direction == Direction::Inputs);
        for placed in areas {
            let (image_offset, length) = (placed.image_offset as usize, usize::from(placed.area.length));
            let offset = runs.last().map_or(0, |last| last.offset + last.length);
            match runs.last_mut() {
                Some(last) if last.domain.0 == number && last.image_offset + last.length == image_offset => {
                    last.length += length;
                }
                _ => runs.push(InputRun { domain: DomainId(number), image_offset, offset, length }),
            }
        }
    }
    runs
}

/// Puts areas into frames.
struct Cutter {
    frames: Vec<Vec<PlannedFragment>>,
    /// Bytes of the last frame that are used.
    used: usize,
    /// Largest number of datagrams in a frame.
    most: Option<usize>,
}

impl Cutter {
    /// Room for bytes of an area in the last frame.
    fn room(&self) -> usize {
        let is_full = self.frames.last().is_none_or(|frame| self.most.is_some_and(|most| frame.len() >= most));
        if is_full { 0 } else { (ROOM - self.used).saturating_sub(EACH) }
    }

    fn put(&mut self, fragment: PlannedFragment) {
        if self.room() < fragment.length.max(1) {
            self.frames.push(Vec::new());
            self.used = 0;
        }
        self.used += EACH + fragment.length;
        self.frames.last_mut().into_iter().for_each(|frame| frame.push(fragment));
    }

    /// An area in one fragment.
    fn whole(&mut self, area: Area, length: usize) {
        self.put(PlannedFragment { area, offset: 0, length });
    }

    /// An area in as many fragments as it needs.
    fn cut(&mut self, area: Area, length: usize) {
        let mut offset = 0;
        while offset < length {
            let left = length - offset;
            let room = if self.room() < LEAST.min(left) { ROOM - EACH } else { self.room() };
            let part = left.min(room);
            self.put(PlannedFragment { area, offset, length: part });
            offset += part;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::string::ToString;
    use std::vec;

    use super::*;
    use crate::layout::{AreaSpec, DomainSpec, ImageOrder};
    use crate::link::LinkSet;

    fn layout(subdevices: usize, bytes: u16) -> Layout {
        let area =
            |subdevice, direction| AreaSpec { subdevice, sync_manager: direction as u8, direction, length: bytes };
        let areas = (0..subdevices).flat_map(|it| [area(it, Direction::Outputs), area(it, Direction::Inputs)]);
        let period = Duration::from_millis(1);
        let spec = DomainSpec { period, under_way: 1, lrw: true, areas: areas.collect(), image: ImageOrder::Packed };
        Layout::new(&[spec], LinkSet::Ring, true).unwrap()
    }

    // covers: FR-03, FR-04, FR-12, standby
    #[test]
    fn a_small_cycle_has_one_master_frame_with_all_areas() {
        let sizes = MasterSizes { to_inactive: 8, to_active: 4, ..MasterSizes::default() };
        let planned = PlannedMasterFrames::new(sizes, &layout(3, 2), 3).unwrap();
        assert_eq!(planned.frames.len(), 1);
        let areas: Vec<_> = planned.frames[0].iter().map(|it| (it.area, it.offset, it.length)).collect();
        let expected = vec![
            (Area::Header, 0, 64),
            (Area::Answer, 0, 32),
            (Area::SubDevices, 0, 3),
            (Area::Diagnosis, 0, 57),
            (Area::ToInactive, 0, 8),
            (Area::ToActive, 0, 4),
            (Area::Inputs, 0, 6),
            (Area::Knowledge, 0, 512),
        ];
        assert_eq!(areas, expected);
        let run = InputRun { domain: DomainId(0), image_offset: 6, offset: 0, length: 6 };
        assert_eq!(planned.inputs, [run], "inputs of one datagram are adjacent");
    }

    // covers: FR-12, FR-13, standby
    #[test]
    fn areas_without_bytes_are_absent() {
        let sizes = MasterSizes { inputs: false, knowledge: 0, ..MasterSizes::default() };
        let planned = PlannedMasterFrames::new(sizes, &layout(3, 2), 3).unwrap();
        let areas: Vec<_> = planned.frames.iter().flatten().map(|it| it.area).collect();
        assert_eq!(areas, [Area::Header, Area::Answer, Area::SubDevices, Area::Diagnosis]);
        assert_eq!((planned.lengths.inputs, planned.lengths.to_inactive, planned.lengths.to_active), (0, 0, 0));
    }

    // covers: FR-14, 9.8, standby
    #[test]
    fn large_areas_are_cut_into_full_frames_without_a_gap() {
        let sizes = MasterSizes { to_inactive: 3000, to_active: 2000, ..MasterSizes::default() };
        let planned = PlannedMasterFrames::new(sizes, &layout(33, 76), 33).unwrap();
        assert_eq!(planned.lengths.inputs, 33 * 76);
        for area in [Area::ToInactive, Area::ToActive, Area::Inputs] {
            let parts: Vec<_> = planned.frames.iter().flatten().filter(|it| it.area == area).collect();
            let mut next = 0;
            for part in &parts {
                assert_eq!(part.offset, next);
                next += part.length;
            }
            let total = match area {
                Area::ToInactive => 3000,
                Area::ToActive => 2000,
                _ => 33 * 76,
            };
            assert!(next == total && parts.len() > 1, "{area:?}: {parts:?}");
        }
        for frame in &planned.frames {
            let used: usize = frame.iter().map(|it| it.length + EACH).sum();
            assert!(used <= ROOM, "{used}");
        }
        assert_eq!(planned.frames.len(), 6, "{} bytes", planned.bytes());
        assert_eq!(planned.fragments(), planned.frames.iter().map(Vec::len).sum::<usize>());
    }

    // covers: frame-limit, standby
    #[test]
    fn frames_hold_no_more_datagrams_than_are_allowed() {
        let mut layout = layout(3, 2);
        layout.most = Some(3);
        let planned = PlannedMasterFrames::new(MasterSizes::default(), &layout, 3).unwrap();
        assert!(planned.frames.iter().all(|frame| frame.len() <= 3) && planned.frames.len() == 2);
    }

    // covers: standby
    #[test]
    fn more_frames_than_may_be_on_the_wire_are_refused() {
        let sizes = MasterSizes { to_inactive: u16::MAX, to_active: u16::MAX, ..MasterSizes::default() };
        let error = PlannedMasterFrames::new(sizes, &layout(33, 1000), 33).unwrap_err();
        assert!(matches!(error, LayoutError::TooManyFrames { frames } if frames > 96), "{error}");
    }

    /// 1,000 bytes of process data and one master frame of about 730 bytes.
    // covers: standby
    #[test]
    fn a_cycle_that_does_not_hold_its_frames_is_refused_with_the_time() {
        let planned = |layout: &Layout| PlannedMasterFrames::new(MasterSizes::default(), layout, 10).unwrap();
        let with_period = |us: u64| {
            let mut layout = layout(10, 50);
            layout.domains[0].period = Duration::from_micros(us);
            layout
        };
        let error = |us: u64, acyclic: usize| {
            let layout = with_period(us);
            planned(&layout).check_time(&layout, acyclic).err()
        };
        let Some(LayoutError::CycleTooShort { needed, period }) = error(100, 0) else { panic!("it is refused") };
        assert_eq!(period, Duration::from_micros(100));
        let exactly = needed.as_nanos().div_ceil(1_000) as u64;
        assert_eq!((error(exactly, 0), error(exactly - 1, 0).is_some()), (None, true));
        // 1,514 bytes instead of the shortest frame of 60.
        assert!(error(exactly, 1_514).is_some_and(|error| error.to_string().contains("us on the wire")));
        assert_eq!(error(exactly + 117, 1_514), None);
        // With two cycles under way only the frames of one have to fit into it.
        let mut layout = with_period(exactly - 1);
        layout.domains[0].under_way = 2;
        assert_eq!(planned(&layout).check_time(&layout, 0), Ok(()));
        // Many frames with their forwarding fit into two cycles, but without it not into one.
        let mut layout = self::layout(40, 100);
        let planned = PlannedMasterFrames::new(MasterSizes::default(), &layout, 40).unwrap();
        layout.domains[0].period = Duration::from_micros(1);
        let Err(LayoutError::CycleTooShort { needed, .. }) = planned.check_time(&layout, 0) else {
            panic!("too short")
        };
        (layout.domains[0].period, layout.domains[0].under_way) = (needed / 2 + Duration::from_nanos(1), 2);
        let Err(LayoutError::CycleTooShort { needed, period }) = planned.check_time(&layout, 0) else {
            panic!("the wire takes longer than a period")
        };
        assert!(needed > period && period == layout.domains[0].period, "{needed:?}, {period:?}");
    }
}
