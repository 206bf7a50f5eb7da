//! The options of every command that works with a segment: its interfaces, the thread that sends and receives, a
//! recording.

use clap::Args;
use ringcat::packet::PacketLinks;
use ringcat::tee::Tee;

use crate::failure::Failure;
use crate::interfaces::InterfaceArguments;
use crate::recording::{Recording, RecordingArguments};
use crate::thread::ThreadArguments;

/// The options.
#[derive(Args, Clone, Debug)]
pub struct AccessArguments {
    #[command(flatten)]
    pub interfaces: InterfaceArguments,
    #[command(flatten)]
    pub thread: ThreadArguments,
    #[command(flatten)]
    pub recording: RecordingArguments,
}

impl AccessArguments {
    /// Begins the recording, if one is wanted, and puts it around both halves.
    pub fn record(
        &self,
        (cyclic, acyclic): (PacketLinks, PacketLinks),
    ) -> Result<(Recording, Tee<PacketLinks>, Tee<PacketLinks>), Failure> {
        let recording = self.recording.start(&self.interfaces)?;
        let (cyclic, acyclic) = (recording.tee(cyclic), recording.tee(acyclic));
        Ok((recording, cyclic, acyclic))
    }
}
