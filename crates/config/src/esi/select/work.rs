//! What the steps of a selection share.

use crate::esi::choices::Choices;
use crate::esi::error::{EsiError, Notice};
use crate::esi::model::{Device, Esi, OpMode};
use crate::esi::modules::PlacedModule;

/// A device with its choices, modules and operation mode, and the notices so far.
pub(super) struct Work<'a> {
    pub esi: &'a Esi,
    pub device: &'a Device,
    pub choices: &'a Choices,
    pub modules: Vec<PlacedModule<'a>>,
    pub mode: Option<&'a OpMode>,
    pub notices: Vec<Notice>,
}

impl Work<'_> {
    /// An error at a line of the description.
    pub fn error(&self, line: u32, reason: impl Into<String>) -> EsiError {
        EsiError::rule(&self.esi.file, line, self.device.kind.trim(), reason)
    }

    pub fn note(&mut self, line: u32, text: impl Into<String>) {
        let text = text.into();
        match self.notices.last_mut().filter(|known| known.text == text) {
            Some(known) => known.times += 1,
            None => self.notices.push(Notice { line, text, times: 1 }),
        }
    }
}
