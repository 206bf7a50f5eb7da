//! Why a segment cannot be made.

use core::fmt;
use std::path::PathBuf;

/// What is wrong with a segment file or a list of devices and cables, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SegmentError {
    /// The file, where the segment comes from one.
    pub file: Option<PathBuf>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Name of the device concerned.
    pub device: Option<String>,
    /// What was expected and what is there.
    pub message: String,
}

impl SegmentError {
    /// An error without a place.
    pub fn new(message: impl Into<String>) -> SegmentError {
        SegmentError { file: None, line: None, device: None, message: message.into() }
    }

    /// The same error, about this device.
    #[must_use]
    pub fn about(mut self, device: impl Into<String>) -> SegmentError {
        self.device = Some(device.into());
        self
    }

    /// The same error, at this line.
    #[must_use]
    pub fn at_line(mut self, line: usize) -> SegmentError {
        self.line = Some(line);
        self
    }

    /// The same error, in this file.
    #[must_use]
    pub fn in_file(mut self, file: impl Into<PathBuf>) -> SegmentError {
        self.file = Some(file.into());
        self
    }
}

impl fmt::Display for SegmentError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.file, self.line) {
            (Some(file), Some(line)) => write!(f, "{}:{line}: ", file.display())?,
            (Some(file), None) => write!(f, "{}: ", file.display())?,
            (None, Some(line)) => write!(f, "line {line}: ")?,
            (None, None) => {}
        }
        if let Some(device) = &self.device {
            write!(f, "device \"{device}\": ")?;
        }
        f.write_str(&self.message)
    }
}

impl std::error::Error for SegmentError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_text_names_file_line_and_device() {
        let error = SegmentError::new("port 3 is taken").about("junction").at_line(12).in_file("a.toml");
        assert_eq!(error.to_string(), "a.toml:12: device \"junction\": port 3 is taken");
    }
}
