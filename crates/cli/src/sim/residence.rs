//! How long frames were in this simulator: from the kernel's receive stamp to the call that sends the answer.
//!
//! A round trip less this time is the share of the MainDevice's host: its program, and the kernel's way of a frame in
//! both directions. The last frames count, so that a measurement is over before it is read.

/// Number of frames that are remembered.
const REMEMBERED: usize = 4096;

/// The last frames.
#[derive(Clone, Debug)]
pub struct Residence {
    ns: Vec<u64>,
    next: usize,
}

impl Default for Residence {
    fn default() -> Residence {
        Residence { ns: Vec::with_capacity(REMEMBERED), next: 0 }
    }
}

impl Residence {
    /// Records a frame.
    pub fn note(&mut self, ns: u64) {
        if self.ns.len() < REMEMBERED {
            self.ns.push(ns);
        } else {
            self.ns[self.next] = ns;
        }
        self.next = (self.next + 1) % REMEMBERED;
    }

    /// For the status; nothing without frames.
    pub fn summary(&self) -> Option<String> {
        let mut sorted = self.ns.clone();
        sorted.sort_unstable();
        let us = |ns: &u64| *ns as f64 / 1e3;
        let (median, longest) = (sorted.get(sorted.len() / 2).map(us)?, sorted.last().map(us)?);
        Some(format!(
            "residence of the last {} frames in this simulator: median {median:.2} us, longest {longest:.2} us",
            sorted.len()
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: sim-interfaces
    #[test]
    fn the_median_residence_is_that_of_the_last_frames_only() {
        let mut residence = Residence::default();
        assert_eq!(residence.summary(), None);
        (0..3 * REMEMBERED).for_each(|_| residence.note(9_000));
        (0..REMEMBERED - 1).for_each(|_| residence.note(2_000));
        let summary = residence.summary().expect("there were frames");
        assert!(summary.ends_with("last 4096 frames in this simulator: median 2.00 us, longest 9.00 us"), "{summary}");
    }
}
