//! Faults of SIIs that a scan reports. They are printed behind it, when the names of their PDOs are known.

use crate::output::complain;
use ringcat::config::ObjectNames;
use ringcat::text::{Names, describe};
use ringcat::{Event, Position, TimedEvent};

/// The faults of a scan, in the order in which they were reported: whose SII, and the text.
#[derive(Debug, Default)]
pub struct SiiWarnings(Vec<(Position, String)>);

impl SiiWarnings {
    /// Keeps a fault of an SII; another event is not kept, and the result is false.
    pub fn keep(&mut self, event: &TimedEvent) -> bool {
        let Event::SiiWarning { position, .. } = event.event else { return false };
        self.0.push((position, describe(event, &Names::default())));
        true
    }

    /// The texts with the names of the objects that they mention; `names` by position. Without names the texts are as
    /// reported.
    fn texts(&self, names: &[ObjectNames]) -> impl Iterator<Item = String> {
        self.0.iter().map(|(position, text)| match names.get(usize::from(position.0)) {
            Some(names) => names.annotate(text),
            None => text.clone(),
        })
    }

    /// Prints them on the standard error output.
    pub fn print(&self, names: &[ObjectNames]) {
        self.texts(names).for_each(complain);
    }
}

#[cfg(test)]
mod tests {
    use ringcat::config::network::model::{Pdo, SubDevice, SyncManager};

    use super::*;

    // covers: esi-use
    #[test]
    fn a_fault_of_an_sii_names_the_pdo_of_its_subdevice() {
        let text = "position 1: PDO 0x1a00 announces 3 entries, but contains 2".to_owned();
        let warnings = SiiWarnings(vec![(Position(1), text)]);
        let mut names = ObjectNames::default();
        let pdo = Pdo { index: 0x1A00, name: "Channel 1".to_owned(), ..Pdo::default() };
        let sm = SyncManager { pdo: vec![pdo], ..SyncManager::default() };
        names.add_declared(&SubDevice { sync_manager: vec![sm], ..SubDevice::default() });
        let all = |names: &[ObjectNames]| warnings.texts(names).collect::<Vec<_>>();
        assert!(all(&[ObjectNames::default(), names.clone()])[0].contains("PDO 0x1a00 \"Channel 1\" announces"));
        assert!(all(&[names])[0].contains("PDO 0x1a00 announces"), "names of another SubDevice");
    }
}
