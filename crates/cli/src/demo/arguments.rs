//! Options of `ringcat demo`.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use ringcat::Error;
use ringcat::sim::segment::{DEMO, Segment};

use crate::numbers::number;

/// Above this number of SubDevices a frame takes longer than a millisecond to come back.
const SLOW_ABOVE: usize = 200;
/// Cycle of such a segment.
const SLOW_CYCLE: Duration = Duration::from_millis(4);
/// Cycle of any other.
const CYCLE: Duration = Duration::from_millis(1);

/// Options of `ringcat demo`.
#[derive(Args, Debug, Default)]
pub struct DemoArguments {
    /// Segment file (see docs/segments.md); an embedded ring by default
    #[arg(long, value_name = "FILE.toml", help_heading = "Segment")]
    segment: Option<PathBuf>,
    /// Cycle time in microseconds; 1000 by default, 4000 above 200 SubDevices
    #[arg(
        long,
        value_name = "US",
        help_heading = "Cycle",
        value_parser = number(50u64..=1_000_000, 1_000)
    )]
    cycle_us: Option<u64>,
    /// Run in virtual time, as fast as the machine can
    #[arg(long, help_heading = "Cycle")]
    pub fast: bool,
    /// Show two controllers at the ring, one of which is killed
    ///
    /// Both use the library. One takes over when the other is killed, loses its power or hands its role over, once
    /// while a cable is cut. See docs/standby.md, which begins with a note on patents.
    #[cfg(feature = "standby")]
    #[arg(long, help_heading = "Two controllers")]
    pub standby: bool,
    /// Cycles without the ACTIVE after which the other one takes over; 3 by default
    ///
    /// If the watchdogs of SubDevices expire before that, these leave OP and the demonstration fails.
    #[cfg(feature = "standby")]
    #[arg(
        long,
        value_name = "CYCLES",
        requires = "standby",
        value_parser = number(3_u32..=1000, 10),
        help_heading = "Two controllers"
    )]
    pub timeout: Option<u32>,
}

impl DemoArguments {
    /// The segment.
    pub fn load(&self) -> Result<Segment, Error> {
        Ok(match &self.segment {
            Some(path) => ringcat::esi::load_segment(path)?,
            None => Segment::from_toml(DEMO, Path::new("."))?,
        })
    }

    /// The segment in words.
    pub fn segment_title(&self) -> String {
        self.segment.as_ref().map_or_else(|| "its embedded ring".to_owned(), |path| path.display().to_string())
    }

    /// How fast virtual time passes, in words.
    pub fn pace(&self) -> &'static str {
        if self.fast { "in virtual time" } else { "in real time" }
    }

    /// Cycle time with this number of SubDevices.
    pub fn cycle(&self, subdevices: usize) -> Duration {
        match self.cycle_us {
            Some(us) => Duration::from_micros(us),
            None if subdevices > SLOW_ABOVE => SLOW_CYCLE,
            None => CYCLE,
        }
    }
}
