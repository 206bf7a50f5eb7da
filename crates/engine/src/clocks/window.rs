//! Whether clocks are within the sync window. Input: single results. Output: changes to report.
//!
//! A change counts after several consecutive results. Clocks that leave the window soon after they came back must stay
//! inside for longer each time before this is reported, so that clocks at the edge of the window do not cause events
//! for ever.

/// Consecutive results until a change is reported.
const RESULTS: u32 = 3;
/// Largest number of consecutive results inside until clocks that have left repeatedly count as back.
const MOST_RESULTS: u32 = 20_000;
/// Clocks count as steady after this multiple of the results that were required.
const CALM: u32 = 10;

/// The reported state.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SyncWindow {
    /// `None`: the clocks have never been inside.
    is_inside: Option<bool>,
    /// Consecutive results that contradict the reported state.
    contrary: u32,
    /// Consecutive results inside that are required for a report.
    waits: u32,
    /// Results since the last report.
    since: u32,
}

impl Default for SyncWindow {
    fn default() -> SyncWindow {
        SyncWindow { is_inside: None, contrary: 0, waits: RESULTS, since: 0 }
    }
}

impl SyncWindow {
    /// The state of clocks that are inside.
    pub(crate) fn inside() -> SyncWindow {
        SyncWindow { is_inside: Some(true), ..SyncWindow::default() }
    }

    /// Whether clocks are outside, by the last report.
    pub(crate) fn is_outside(&self) -> bool {
        self.is_inside == Some(false)
    }

    /// Takes a result without evidence.
    pub(crate) fn skip(&mut self) {
        self.contrary = 0;
    }

    /// Takes a result; true if it is a change to report.
    pub(crate) fn take(&mut self, inside: bool) -> bool {
        self.since = self.since.saturating_add(1);
        if self.is_inside.unwrap_or(false) == inside {
            self.contrary = 0;
            return false;
        }
        self.contrary += 1;
        let wanted = if inside { self.waits } else { RESULTS };
        if self.contrary < wanted {
            return false;
        }
        if !inside {
            let is_calm = self.since >= CALM * self.waits;
            self.waits = if is_calm { RESULTS } else { (2 * self.waits).min(MOST_RESULTS) };
        }
        (self.is_inside, self.contrary, self.since) = (Some(inside), 0, 0);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changes(window: &mut SyncWindow, results: impl IntoIterator<Item = bool>) -> usize {
        results.into_iter().filter(|inside| window.take(*inside)).count()
    }

    #[test]
    fn three_consecutive_results_are_a_change_and_the_first_change_is_to_inside() {
        let mut window = SyncWindow::default();
        assert_eq!(changes(&mut window, [false; 10]), 0);
        assert_eq!(changes(&mut window, [true, true, false, true, true]), 0);
        assert_eq!(changes(&mut window, [true]), 1);
        assert_eq!(changes(&mut window, [false, false, true, false, false]), 0);
        assert!(window.take(false) && window.is_outside());
    }

    // covers: dc-late-host
    #[test]
    fn clocks_at_the_edge_of_the_window_are_reported_less_and_less_often() {
        let mut window = SyncWindow::default();
        let flaps = (0..100_000).map(|number| number % 20 < 10);
        assert!(changes(&mut window, flaps) < 12);
        // After a steady time three results are enough again.
        changes(&mut window, [true; 300_000]);
        assert_eq!(changes(&mut window, [false, false, false, true, true, true]), 2);
    }
}
