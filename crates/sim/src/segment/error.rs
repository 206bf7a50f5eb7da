//! Errors of segments.

use core::fmt;
use std::path::PathBuf;

/// An error in a segment file or in a list of devices and cables, with its position.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct SegmentError {
    /// The file, if the segment comes from a file.
    pub file: Option<PathBuf>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Name of the device concerned.
    pub device: Option<String>,
    /// Expected and actual value.
    pub message: String,
}

impl SegmentError {
    /// An error without a position.
    pub fn new(message: impl Into<String>) -> SegmentError {
        SegmentError { file: None, line: None, device: None, message: message.into() }
    }

    /// The error with the name of the device.
    #[must_use]
    pub fn about(mut self, device: impl Into<String>) -> SegmentError {
        self.device = Some(device.into());
        self
    }

    /// The error with a line.
    #[must_use]
    pub fn at_line(mut self, line: usize) -> SegmentError {
        self.line = Some(line);
        self
    }

    /// The error with a file.
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
    fn the_message_names_file_line_and_device() {
        let error = SegmentError::new("port 3 is taken").about("junction").at_line(12).in_file("a.toml");
        assert_eq!(error.to_string(), "a.toml:12: device \"junction\": port 3 is taken");
    }
}
