//! Largest number of datagrams in a frame, where fewer than fit are processed.

use core::fmt;

/// Smallest possible limit: the datagrams of the distributed clocks must stay in one frame.
pub const MIN_DATAGRAMS_PER_FRAME: u16 = 3;

/// Fewer datagrams are processed than fit a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameLimit {
    /// Largest number of datagrams in a frame.
    pub datagrams: u16,
    /// Whether a longer frame comes back, with the further datagrams unprocessed; otherwise it does not come back.
    pub returns: bool,
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
    fn what_to_set_is_said_unless_nothing_helps() {
        let said = |datagrams, returns| FrameLimit { datagrams, returns }.to_string();
        assert_eq!(
            said(15, true),
            "of the datagrams of a frame only the first 15 are processed on this segment: set max_datagrams_per_frame \
             to 15 (option --max-datagrams 15 of the program)"
        );
        assert!(
            said(40, false).starts_with("frames with more than 40 datagrams do not come back on this segment: set")
        );
        assert!(said(2, false).ends_with("do not come back on this segment; RingCAT needs 3"));
    }
}
