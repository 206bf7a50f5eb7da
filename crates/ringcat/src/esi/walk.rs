//! The descriptions in a folder and in all folders below it: each file and each folder once, also if symbolic links
//! point to it again or form circles, in bounded time.

use std::collections::{BTreeSet, VecDeque};
use std::fs::{self, Metadata};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Maximum depth of folders below the folder.
const MAX_DEPTH: usize = 6;
/// Maximum number of files; the others are left out.
pub const MAX_FILES: usize = 10_000;
/// Maximum number of folder entries that are read; the others are left out.
const MAX_ENTRIES: usize = 200_000;
/// Maximum number of notices.
const MAX_NOTICES: usize = 20;

/// What is in a folder.
#[derive(Debug, Default)]
pub(super) struct Walked {
    /// Files with the ending `xml`.
    pub(super) files: Vec<(PathBuf, Metadata)>,
    /// What was left out, and why.
    pub(super) notices: Vec<String>,
    more_notices: usize,
    entries: usize,
    /// Device and inode of the files and folders that are known.
    known: BTreeSet<(u64, u64)>,
    /// Folders to read, with their depth: real folders first, then those behind links.
    folders: VecDeque<(PathBuf, usize)>,
    links: VecDeque<(PathBuf, usize)>,
}

/// Reads a folder and all folders below it.
///
/// # Errors
/// The folder itself cannot be read.
pub(super) fn walk(folder: &Path) -> io::Result<Walked> {
    let mut walked = Walked::default();
    walked.is_new(&fs::metadata(folder)?);
    walked.look_at(folder, 0)?;
    while let Some((path, depth)) = walked.next() {
        if let Err(error) = walked.look_at(&path, depth) {
            walked.note(format!("{}: cannot be read: {error}", path.display()));
        }
    }
    if walked.more_notices > 0 {
        walked.notices.push(format!("{} more paths are left out", walked.more_notices));
    }
    Ok(walked)
}

impl Walked {
    /// The next folder that was not read; folders behind links come last.
    fn next(&mut self) -> Option<(PathBuf, usize)> {
        if let Some(folder) = self.folders.pop_front() {
            return Some(folder);
        }
        while let Some((path, depth)) = self.links.pop_front() {
            match fs::metadata(&path) {
                Ok(metadata) if metadata.is_dir() => {
                    if self.is_new(&metadata) {
                        return Some((path, depth));
                    }
                }
                Ok(metadata) => self.file(path, metadata),
                Err(error) => self.note(format!("{}: broken link: {error}", path.display())),
            }
        }
        None
    }

    /// Reads the entries of a folder, in the order of names.
    fn look_at(&mut self, folder: &Path, depth: usize) -> io::Result<()> {
        let mut entries = Vec::new();
        for entry in fs::read_dir(folder)? {
            self.entries += 1;
            if self.entries > MAX_ENTRIES {
                self.note(format!("{}: only the first {MAX_ENTRIES} entries are read", folder.display()));
                break;
            }
            entries.push(entry?.path());
        }
        entries.sort_unstable();
        for path in entries {
            // An entry that was removed meanwhile is skipped.
            let Ok(metadata) = fs::symlink_metadata(&path) else { continue };
            let may_be_folder = metadata.is_dir() || metadata.is_symlink();
            if metadata.is_dir() && depth == MAX_DEPTH {
                self.note(format!("{}: more than {MAX_DEPTH} levels of folders: left out", path.display()));
            } else if metadata.is_symlink() {
                self.links.push_back((path, depth + 1));
            } else if !may_be_folder {
                self.file(path, metadata);
            } else if self.is_new(&metadata) {
                self.folders.push_back((path, depth + 1));
            }
        }
        Ok(())
    }

    fn file(&mut self, path: PathBuf, metadata: Metadata) {
        let is_description = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("xml"));
        if !metadata.is_file() || !is_description || !self.is_new(&metadata) {
            return;
        }
        match self.files.len() < MAX_FILES {
            true => self.files.push((path, metadata)),
            false => self.note(format!("{}: more than {MAX_FILES} files: left out", path.display())),
        }
    }

    fn is_new(&mut self, metadata: &Metadata) -> bool {
        self.known.insert((metadata.dev(), metadata.ino()))
    }

    fn note(&mut self, notice: String) {
        if self.notices.len() < MAX_NOTICES {
            self.notices.push(notice);
        } else {
            self.more_notices += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;
    use std::time::{Duration, Instant};

    use super::*;

    /// A folder of its own, removed on drop.
    struct Place(PathBuf);

    impl Place {
        fn new(name: &str) -> Place {
            let place = Place(std::env::temp_dir().join(format!("ringcat-walk-{}-{name}", std::process::id())));
            fs::create_dir_all(&place.0).expect("a temporary folder");
            place
        }

        fn folder(&self, name: &str) -> PathBuf {
            let path = self.0.join(name);
            fs::create_dir_all(&path).expect("it is writable");
            path
        }

        fn file(&self, name: &str) {
            fs::write(self.0.join(name), name).expect("it is writable");
        }

        fn link(&self, to: &str, name: &str) {
            symlink(self.0.join(to), self.0.join(name)).expect("it is writable");
        }

        /// Paths of the files below the folder, and the notices.
        fn walked(&self) -> (Vec<String>, Vec<String>) {
            let begin = Instant::now();
            let walked = walk(&self.0).expect("a folder");
            assert!(begin.elapsed() < Duration::from_secs(5), "in bounded time");
            let below = |(path, _): &(PathBuf, Metadata)| {
                path.strip_prefix(&self.0).expect("it is below").display().to_string()
            };
            let mut files: Vec<String> = walked.files.iter().map(below).collect();
            files.sort();
            (files, walked.notices)
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    // covers: esi-read
    #[test]
    fn circular_links_give_each_folder_and_file_once() {
        let place = Place::new("circles");
        place.folder("vendor/more");
        for name in ["one.xml", "vendor/two.xml", "vendor/more/three.XML", "notes.txt"] {
            place.file(name);
        }
        // In circles, to each other, and to a folder that is there itself: the real path counts.
        for name in ["again", "vendor/up", "vendor/more/top", "vendor/more/top2", "vendor/more/top3"] {
            place.link(".", name);
        }
        place.link("vendor/more", "a-link");
        place.link("one.xml", "a-link.xml");
        place.link("circle-2", "circle-1");
        place.link("circle-1", "circle-2");
        let (files, notices) = place.walked();
        assert_eq!(files, ["one.xml", "vendor/more/three.XML", "vendor/two.xml"]);
        assert_eq!(notices.len(), 2, "{notices:?}");
        assert!(notices.iter().all(|it| it.contains("/circle-") && it.contains("broken link")), "{notices:?}");
    }

    // covers: esi-read
    #[test]
    fn a_link_out_of_the_folder_is_followed_once_and_a_broken_one_is_a_notice() {
        let (place, other) = (Place::new("links"), Place::new("elsewhere"));
        other.folder("deep");
        other.file("deep/four.xml");
        symlink(&other.0, place.0.join("first")).expect("it is writable");
        symlink(&other.0, place.0.join("second")).expect("it is writable");
        place.link("nothing.xml", "gone.xml");
        let (files, notices) = place.walked();
        assert_eq!(files, ["first/deep/four.xml"]);
        assert_eq!(notices.len(), 1, "{notices:?}");
        assert!(notices[0].contains("gone.xml: broken link: "), "{notices:?}");
    }

    // covers: esi-read
    #[test]
    fn folders_beyond_the_limit_are_left_out_with_a_notice() {
        let place = Place::new("deep");
        place.folder("1/2/3/4/5/6/7");
        place.file("1/2/3/4/5/6/in.xml");
        place.file("1/2/3/4/5/6/7/out.xml");
        for name in ["x", "y", "z"] {
            for number in 0..20 {
                place.link("nothing", &format!("{name}{number}"));
            }
        }
        let (files, notices) = place.walked();
        assert_eq!(files, ["1/2/3/4/5/6/in.xml"]);
        assert!(notices.iter().any(|it| it.contains("6/7: more than 6 levels of folders")), "{notices:?}");
        assert_eq!((notices.len(), notices[20].as_str()), (21, "41 more paths are left out"));
    }
}
