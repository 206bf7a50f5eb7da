//! Largest number of datagrams in a frame, for segments that process fewer than fit into it.

use core::fmt;

/// Smallest possible limit: the datagrams of the distributed clocks must stay in one frame.
pub const MIN_DATAGRAMS_PER_FRAME: u16 = 3;

/// The segment processes fewer datagrams than fit into a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct FrameLimit {
    /// Largest number of datagrams in a frame.
    pub datagrams: u16,
    /// Whether a longer frame comes back, with the further datagrams unprocessed; otherwise it does not come back.
    pub returns: bool,
}

impl FrameLimit {
    /// A limit, and whether longer frames come back.
    pub const fn new(datagrams: u16, returns: bool) -> FrameLimit {
        FrameLimit { datagrams, returns }
    }
}

impl fmt::Display for FrameLimit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let FrameLimit { datagrams, returns } = *self;
        if returns {
            write!(f, "of the datagrams of a frame only the first {datagrams} are processed on this segment")?;
        } else {
            write!(f, "frames with more than {datagrams} datagrams do not come back on this segment")?;
        }
        if datagrams < MIN_DATAGRAMS_PER_FRAME {
            return write!(f, "; RingCAT needs {MIN_DATAGRAMS_PER_FRAME}");
        }
        write!(f, ": set max_datagrams_per_frame to {datagrams} (option --max-datagrams {datagrams} of the program)")
    }
}

#[cfg(test)]
mod tests {
    use alloc::string::ToString;

    use super::*;

    // covers: frame-limit
    #[test]
    fn the_message_names_the_option_unless_the_limit_is_too_small() {
        let message = |datagrams, returns| FrameLimit { datagrams, returns }.to_string();
        assert_eq!(
            message(15, true),
            "of the datagrams of a frame only the first 15 are processed on this segment: set max_datagrams_per_frame \
             to 15 (option --max-datagrams 15 of the program)"
        );
        assert!(
            message(40, false).starts_with("frames with more than 40 datagrams do not come back on this segment: set")
        );
        assert!(message(2, false).ends_with("do not come back on this segment; RingCAT needs 3"));
    }
}
