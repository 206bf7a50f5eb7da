//! Settings of the file that are not followed. Equal notices are combined.

use std::collections::HashMap;

use crate::configuration::Notice;
use crate::eni::{Eni, Place};

/// Maximum number of different notices; further notices are counted.
const MAX_NOTICES: usize = 500;

/// The list of notices.
#[derive(Default)]
pub(super) struct Notices {
    list: Vec<Notice>,
    known: HashMap<(String, String), usize>,
    more: usize,
}

impl Notices {
    /// Adds a notice about the file or a SubDevice.
    pub fn add(
        &mut self,
        place: Option<Place>,
        subdevice: Option<usize>,
        subject: impl Into<String>,
        reason: impl Into<String>,
    ) {
        let (subject, reason) = (subject.into(), reason.into());
        if let Some(number) = self.known.get(&(subject.clone(), reason.clone())) {
            let notice = &mut self.list[*number];
            notice.times += 1;
            if let Some(subdevice) = subdevice
                && notice.subdevices.last() != Some(&subdevice)
            {
                notice.subdevices.push(subdevice);
            }
        } else if self.list.len() < MAX_NOTICES {
            self.known.insert((subject.clone(), reason.clone()), self.list.len());
            self.list.push(Notice { subject, reason, place, times: 1, subdevices: subdevice.into_iter().collect() });
        } else {
            self.more += 1;
        }
    }

    /// All notices, including unknown elements.
    pub fn into_list(mut self, eni: &Eni) -> Vec<Notice> {
        for unknown in &eni.unknown {
            self.add(Some(unknown.place), None, unknown.element.clone(), "this element is not known");
        }
        let more = self.more + eni.more_unknown;
        if more > 0 {
            let subject = format!("{more} more");
            let reason = "not listed one by one".to_owned();
            self.list.push(Notice { subject, reason, place: None, times: more, subdevices: Vec::new() });
        }
        self.list
    }
}
