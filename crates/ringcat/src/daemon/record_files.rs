//! The files of a record: ringcat-MASTER-TIME-REASON.pcapng. A file gets this name when it is complete; then the
//! surplus of old ones is removed.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Only the user of the process and its group read what was on the bus.
const MODE: u32 = 0o640;
/// Digits of the time in a name.
const DIGITS: usize = 13;
/// Name of a complete file.
const COMPLETE: &str = ".pcapng";
/// Name of a file that is being written.
const PARTIAL: &str = ".pcapng.part";
/// Writing a file takes less time than this: the process that wrote an older partial file has ended.
const ABANDONED: Duration = Duration::from_secs(600);

/// Why a file is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RecordReason {
    /// A SubDevice no longer answers.
    Lost,
    /// A SubDevice has left its state without a request.
    StateLeft,
    /// A domain was incomplete for too many cycles.
    WorkingCounter,
    /// An interface has lost its carrier.
    LinkDown,
    /// The daemon has taken the bus back.
    TakenBack,
    /// The application has ended without a release, or was stopped.
    OwnerLost,
    /// A user has requested it, without a fault.
    Requested,
}

impl RecordReason {
    const ALL: [RecordReason; 7] = [
        RecordReason::Lost,
        RecordReason::StateLeft,
        RecordReason::WorkingCounter,
        RecordReason::LinkDown,
        RecordReason::TakenBack,
        RecordReason::OwnerLost,
        RecordReason::Requested,
    ];

    /// In the name of a file.
    const fn word(self) -> &'static str {
        match self {
            RecordReason::Lost => "lost",
            RecordReason::StateLeft => "state-left",
            RecordReason::WorkingCounter => "working-counter",
            RecordReason::LinkDown => "link-down",
            RecordReason::TakenBack => "taken-back",
            RecordReason::OwnerLost => "owner-lost",
            RecordReason::Requested => "requested",
        }
    }

    /// Whether its files are removed before those of other reasons.
    const fn is_removed_first(self) -> bool {
        matches!(self, RecordReason::OwnerLost | RecordReason::Requested)
    }
}

/// Where the files of a master are.
#[derive(Clone, Copy, Debug)]
pub(super) struct RecordFiles<'a> {
    pub directory: &'a Path,
    pub master: u32,
    /// Most files.
    pub most: u32,
}

/// Time and reason in the name of a file.
type Named = (u64, RecordReason);

impl RecordFiles<'_> {
    /// Writes a new file. There is none after an error.
    pub(super) fn save(
        &self,
        reason: RecordReason,
        write: impl FnOnce(BufWriter<File>) -> io::Result<()>,
    ) -> io::Result<PathBuf> {
        // A clock before 1970 was never set.
        let at_ms = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |at| at.as_millis());
        let stem = format!("ringcat-{}-{at_ms:0DIGITS$}-{}", self.master, reason.word());
        let path = self.directory.join(format!("{stem}{COMPLETE}"));
        let partial = self.directory.join(format!("{stem}{PARTIAL}"));
        let file = OpenOptions::new().write(true).create_new(true).mode(MODE).open(&partial)?;
        let written = write(BufWriter::with_capacity(1 << 18, file)).and_then(|()| std::fs::rename(&partial, &path));
        if let Err(error) = written {
            // What has failed is the first error.
            let _ = std::fs::remove_file(&partial);
            return Err(error);
        }
        self.prune(&path, u64::try_from(at_ms).unwrap_or(u64::MAX));
        Ok(path)
    }

    /// Removes the surplus beside a new file. The new one is there in any case: what cannot be removed stays.
    fn prune(&self, new: &Path, now_ms: u64) {
        let Ok(entries) = std::fs::read_dir(self.directory) else { return };
        let mut old: Vec<(Named, PathBuf)> = Vec::new();
        for entry in entries.flatten().filter(|it| it.file_type().is_ok_and(|kind| kind.is_file())) {
            let (name, path) = (entry.file_name(), entry.path());
            let Some(name) = name.to_str() else { continue };
            if let Some(named) = self.parse(name, COMPLETE).filter(|_| path != new) {
                old.push((named, path));
            } else if self.parse(name, PARTIAL).is_some_and(|(at, _)| is_abandoned(at, now_ms)) {
                let _ = std::fs::remove_file(path);
            }
        }
        // An application that is started again and again, and requests, must not remove the file of a fault.
        old.sort_unstable_by_key(|((at, reason), _)| (!reason.is_removed_first(), *at));
        let surplus = (old.len() + 1).saturating_sub(self.most as usize);
        for (_, path) in old.iter().take(surplus) {
            let _ = std::fs::remove_file(path);
        }
    }

    /// Time and reason in the name of a file of this master.
    fn parse(&self, name: &str, end: &str) -> Option<Named> {
        let begin = format!("ringcat-{}-", self.master);
        let (at, word) = name.strip_prefix(&begin)?.strip_suffix(end)?.split_once('-')?;
        let is_time = at.len() == DIGITS && at.bytes().all(|digit| digit.is_ascii_digit());
        let reason = RecordReason::ALL.into_iter().find(|reason| reason.word() == word)?;
        Some((at.parse().ok().filter(|_| is_time)?, reason))
    }
}

fn is_abandoned(at_ms: u64, now_ms: u64) -> bool {
    u128::from(now_ms.saturating_sub(at_ms)) > ABANDONED.as_millis()
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::*;

    fn names(directory: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(directory).expect("it is there").flatten();
        let mut names: Vec<String> = entries.filter_map(|it| it.file_name().into_string().ok()).collect();
        names.sort_unstable();
        names
    }

    // covers: daemon, capture
    #[test]
    fn only_complete_files_remain_and_those_of_lost_owners_go_first() {
        let directory = std::env::temp_dir().join(format!("ringcat-record-files-{}", std::process::id()));
        std::fs::create_dir_all(&directory).expect("it can be made");
        let others = ["ringcat-0-1-lost.pcapng", "ringcat-0-1000000000000-mine.pcapng", "ringcat-01-other.pcapng"];
        let ours = [
            "ringcat-0-0000000000001-lost.pcapng",
            "ringcat-0-0000000000002-owner-lost.pcapng",
            "ringcat-0-0000000000003-owner-lost.pcapng",
        ];
        let abandoned = "ringcat-0-0000000000001-lost.pcapng.part";
        for name in others.into_iter().chain(ours).chain([abandoned]) {
            std::fs::write(directory.join(name), []).expect("it can be written");
        }
        let files = RecordFiles { directory: &directory, master: 0, most: 2 };
        let fails = files.save(RecordReason::OwnerLost, |mut out| {
            out.write_all(&[1; 1 << 19])?;
            Err(io::Error::other("full"))
        });
        assert!(fails.is_err());
        assert_eq!(names(&directory).len(), 7, "nothing was removed or added: {:?}", names(&directory));
        let path = files.save(RecordReason::OwnerLost, |mut out| out.write_all(b"frames")).expect("it is written");
        assert_eq!(std::fs::read(&path).expect("it is there"), b"frames");
        let new = path.file_name().and_then(|it| it.to_str()).expect("it is text");
        let mut expected: Vec<&str> = others.into_iter().chain([ours[0], new]).collect();
        expected.sort_unstable();
        assert_eq!(names(&directory), expected);
        // It is below the directory for temporary files.
        let _ = std::fs::remove_dir_all(&directory);
    }
}
