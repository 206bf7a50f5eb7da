//! Whether clocks are in their window, as it is told: results one by one in, changes worth telling out.
//!
//! A change counts when some results in a row show it. Clocks that leave their window soon after they came back have to
//! be inside for longer each time, so that those at its edge are not told for ever.

/// Results in a row until a change is told.
const RESULTS: u32 = 3;
/// Most of them, inside, until clocks that have left again and again count as back.
const MOST_RESULTS: u32 = 20_000;
/// So many results inside for each that was waited for make them count as calm.
const CALM: u32 = 10;

/// The state as it was told last.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SyncWindow {
    /// `None`: they have never been inside, so that there is nothing to leave.
    is_inside: Option<bool>,
    /// Results in a row that contradict that.
    contrary: u32,
    /// Results inside until that is told.
    waits: u32,
    /// Results since they came back.
    since: u32,
}

impl Default for SyncWindow {
    fn default() -> SyncWindow {
        SyncWindow { is_inside: None, contrary: 0, waits: RESULTS, since: 0 }
    }
}

impl SyncWindow {
    /// Clocks are known to be inside.
    pub(crate) fn inside() -> SyncWindow {
        SyncWindow { is_inside: Some(true), ..SyncWindow::default() }
    }

    /// Whether clocks are outside, as told last.
    pub(crate) fn is_outside(&self) -> bool {
        self.is_inside == Some(false)
    }

    /// A result says nothing.
    pub(crate) fn skip(&mut self) {
        self.contrary = 0;
    }

    /// Takes a result; true where it is to be told that it is the state now.
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
    fn three_results_in_a_row_are_a_change_and_the_first_one_is_to_the_inside() {
        let mut window = SyncWindow::default();
        assert_eq!(changes(&mut window, [false; 10]), 0);
        assert_eq!(changes(&mut window, [true, true, false, true, true]), 0);
        assert_eq!(changes(&mut window, [true]), 1);
        assert_eq!(changes(&mut window, [false, false, true, false, false]), 0);
        assert!(window.take(false) && window.is_outside());
    }

    // covers: dc-late-host
    #[test]
    fn clocks_at_the_edge_of_their_window_are_told_less_and_less_often() {
        let mut window = SyncWindow::default();
        let flaps = (0..100_000).map(|number| number % 20 < 10);
        assert!(changes(&mut window, flaps) < 12);
        // After a calm time it begins anew.
        changes(&mut window, [true; 300_000]);
        assert_eq!(changes(&mut window, [false, false, false, true, true, true]), 2);
    }
}
