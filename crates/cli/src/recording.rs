//! `--capture FILE`: what a command exchanges with the segment, as a file that Wireshark reads.
//!
//! Input: the option. Output: [`Tee`]s around the command's links and, at the end of the command, a line with what is
//! in the file.

use std::path::PathBuf;

use clap::Args;
use ringcat::Links;
use ringcat::tee::Tee;
use ringcat_link::recorder::Recorded;
use ringcat_link::{Recorder, RecorderError};

use crate::failure::Failure;
use crate::interfaces::{InterfaceArguments, LinkNames};
use crate::output::{complain, warn};

/// The option.
#[derive(Args, Clone, Debug)]
pub struct RecordingArguments {
    /// Record all frames of both links into this file, for Wireshark
    ///
    /// The file has interface names, directions and times in nanoseconds.
    #[arg(long, value_name = "FILE.pcapng", help_heading = "Output")]
    capture: Option<PathBuf>,
}

impl RecordingArguments {
    /// Begins the recording, if one is wanted.
    pub fn start(&self, interfaces: &InterfaceArguments) -> Result<Recording, Failure> {
        let names: Vec<(&str, &str)> = interfaces.links.all().zip(DESCRIPTIONS).collect();
        let recorder = self.capture.as_ref().map(|path| Recorder::start(path, &names)).transpose()?;
        Ok(Recording { recorder, arguments: self.clone(), links: interfaces.links.clone(), is_reported: false })
    }
}

/// What the interfaces are to the MainDevice.
pub const DESCRIPTIONS: [&str; 2] = ["main link", "redundant link"];

impl From<RecorderError> for Failure {
    fn from(error: RecorderError) -> Failure {
        Failure::new(error.to_string())
    }
}

/// A recording that goes on until it is dropped; then it prints what it recorded.
#[derive(Debug)]
pub struct Recording {
    recorder: Option<Recorder>,
    arguments: RecordingArguments,
    links: LinkNames,
    /// The failure is reported.
    is_reported: bool,
}

impl Recording {
    /// Records these links, of one thread, if that is wanted.
    pub fn tee<L: Links>(&self, links: L) -> Tee<L> {
        Tee::new(links, self.recorder.as_ref().map(Recorder::tap))
    }
}

impl Recording {
    /// Why nothing is recorded any more; once.
    pub fn failure(&mut self) -> Option<String> {
        let failure = self.recorder.as_ref()?.failure()?.to_owned();
        (!std::mem::replace(&mut self.is_reported, true)).then_some(failure)
    }

    /// Completes the file and prints what is in it. The reason, where frames are missing.
    pub fn finish(mut self) -> Option<String> {
        self.end()
    }

    fn end(&mut self) -> Option<String> {
        let (recorder, path) = (self.recorder.take()?, self.arguments.capture.as_ref()?);
        match recorder.finish() {
            Ok(recorded) => {
                for line in lines(self.links.all(), &recorded) {
                    complain(format_args!("{}: {line}", path.display()));
                }
                let lacking: u64 = recorded.iter().map(|frames| frames.lost + frames.lost_by_kernel).sum();
                (lacking > 0).then(|| format!("the capture lacks {lacking} frames"))
            }
            Err(error) => Some(error.to_string()),
        }
    }
}

impl Drop for Recording {
    fn drop(&mut self) {
        // The command has failed for another reason, which is the last line.
        self.end().iter().for_each(warn);
    }
}

/// A line for each interface.
pub fn lines<'a>(
    names: impl Iterator<Item = &'a str> + 'a,
    recorded: &'a [Recorded],
) -> impl Iterator<Item = String> + 'a {
    names.zip(recorded).map(|(name, frames)| {
        let Recorded { received, sent, lost, lost_by_kernel, .. } = frames;
        format!("{name}: {received} frames received, {sent} sent, {} not recorded", lost + lost_by_kernel)
    })
}
