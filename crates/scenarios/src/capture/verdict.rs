//! Result of the checks of a capture: counts and findings.

use std::fmt;
use std::time::Duration;

use super::windows::Windows;

/// Findings that are kept as text; all are counted.
const REPORTED: usize = 20;

/// Result of the checks.
#[derive(Debug, Default)]
pub struct Verdict {
    /// Frames sent, by link.
    pub sent: [u64; 2],
    /// Frames received, by link.
    pub received: [u64; 2],
    /// Sent reads with checked zero data.
    pub reads: u64,
    /// Frames whose copies on both links were compared.
    pub pairs: u64,
    /// Frames that were sent again within their cycle, on the main link.
    pub again: u64,
    /// Copies that came back.
    pub returned: u64,
    /// Copies that did not come back.
    pub missing: u64,
    /// Longest time between the copies of a frame on both links.
    pub longest_pair: Duration,
    /// Number of restarts of a class's numbers at 1.
    pub anew: u64,
    /// How cyclic and acyclic frames shared the wire, by link; empty without cycles.
    pub windows: Vec<Windows>,
    /// Number of findings.
    pub broken: u64,
    /// The first findings as text.
    pub findings: Vec<String>,
}

impl Verdict {
    pub(super) fn find(&mut self, frame: usize, text: impl fmt::Display) {
        self.broken += 1;
        if self.findings.len() < REPORTED {
            self.findings.push(format!("frame {frame}: {text}"));
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Verdict { sent, received, reads, pairs, returned, missing, .. } = self;
        writeln!(
            f,
            "frames sent: {} on MAIN, {} on REDUNDANT; received: {}, {}",
            sent[0], sent[1], received[0], received[1]
        )?;
        writeln!(f, "reads sent as zeros: {reads}; pairs alike: {pairs}, at most {:?} apart", self.longest_pair)?;
        writeln!(f, "copies that came back: {returned}, that did not: {missing}")?;
        if self.again > 0 {
            writeln!(f, "sent again within their cycle: {}", self.again)?;
        }
        for windows in &self.windows {
            write!(f, "{windows}")?;
        }
        writeln!(f, "promises broken: {}", self.broken)?;
        for finding in &self.findings {
            writeln!(f, "  {finding}")?;
        }
        Ok(())
    }
}
