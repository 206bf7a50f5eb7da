//! A folder of device descriptions with its index, which is kept between runs: only files that are new or have changed
//! are read.

use std::collections::HashMap;
use std::fs::{self, Metadata};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use ringcat_config::esi::Esi;
use ringcat_config::esi::index::{Described, Index, IndexedFile, Stamp};

use super::file::{EsiFailure, bytes_of, load, load_noting};
use super::walk::walk;

/// A folder of device descriptions.
#[derive(Debug)]
pub struct EsiFolder {
    path: PathBuf,
    index: Index,
    read: usize,
    not_kept: Option<io::Error>,
    notices: Vec<String>,
}

impl EsiFolder {
    /// Opens a folder with all folders in it, or a single file. `kept`: the file in which the index is kept; without
    /// one all files are read. A file that is refused is in the index with its reason. Links are followed, and each
    /// file and each folder counts once; [`EsiFolder::notices`] names paths that are left out.
    ///
    /// # Errors
    /// The folder or the file cannot be read.
    pub fn open(path: &Path, kept: Option<&Path>) -> Result<EsiFolder, EsiFailure> {
        let (mut found, mut notices) = (Vec::new(), Vec::new());
        let failed = |error| EsiFailure::Read { path: path.to_owned(), error };
        let about = fs::metadata(path).map_err(failed)?;
        let path = if about.is_dir() {
            let walked = walk(path).map_err(failed)?;
            notices = walked.notices;
            found.extend(walked.files.into_iter().map(|(file, metadata)| (file, stamp(&metadata))));
            path
        } else {
            found.push((path.to_owned(), stamp(&about)));
            path.parent().unwrap_or(Path::new(""))
        };
        found.sort_by(|a, b| a.0.cmp(&b.0));
        let bytes = kept.and_then(|kept| bytes_of(kept).ok());
        let before = bytes.and_then(|bytes| Index::from_text(std::str::from_utf8(&bytes).ok()?)).unwrap_or_default();
        let mut read = 0;
        let stamps = Stamps::new(path, &found);
        let files = found.iter().map(|(file, stamp)| {
            let name = below(path, file);
            before.unchanged(&name, *stamp, |other| stamps.now(other)).cloned().unwrap_or_else(|| {
                read += 1;
                entry(file, &name, *stamp, &stamps)
            })
        });
        let index = Index::new(files.collect());
        let has_changed = read > 0 || index.files().len() != before.files().len();
        let not_kept = kept.filter(|_| has_changed).and_then(|kept| keep(kept, &index).err());
        Ok(EsiFolder { path: path.to_owned(), index, read, not_kept, notices })
    }

    /// The file in which the index of a folder is kept by default, in the cache of the user; `None` without a home.
    pub fn default_index(path: &Path) -> Option<PathBuf> {
        let absolute = |path: PathBuf| Some(path).filter(|path| path.is_absolute());
        let cache = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from).and_then(absolute);
        let home = || Some(absolute(PathBuf::from(std::env::var_os("HOME")?))?.join(".cache"));
        let mut hasher = DefaultHasher::new();
        fs::canonicalize(path).ok()?.hash(&mut hasher);
        Some(cache.or_else(home)?.join("ringcat").join(format!("esi-{:016x}.index", hasher.finish())))
    }

    /// The index.
    pub fn index(&self) -> &Index {
        &self.index
    }

    /// Files that were read, the others were in the index.
    pub fn files_read(&self) -> usize {
        self.read
    }

    /// Paths in the folder that are left out, with the reason: broken links, folders that may not be read or are too
    /// deep, files beyond [`MAX_FILES`](super::MAX_FILES).
    pub fn notices(&self) -> &[String] {
        &self.notices
    }

    /// Why the index could not be kept for the next time.
    pub fn not_kept(&self) -> Option<&io::Error> {
        self.not_kept.as_ref()
    }

    /// Reads the whole description of a device.
    ///
    /// # Errors
    /// The file is no longer as the index describes it.
    pub fn load(&self, described: &Described<'_>) -> Result<Esi, EsiFailure> {
        load(&self.path.join(&described.file.path))
    }
}

fn stamp(metadata: &Metadata) -> Stamp {
    let since = metadata.modified().ok().and_then(|time| time.duration_since(UNIX_EPOCH).ok()).unwrap_or_default();
    Stamp { bytes: metadata.len(), modified_ns: u64::try_from(since.as_nanos()).unwrap_or(u64::MAX) }
}

/// A path as the index has it.
fn below(folder: &Path, file: &Path) -> String {
    file.strip_prefix(folder).unwrap_or(file).to_string_lossy().into_owned()
}

/// Sizes and times of the files to which descriptions refer. Most are descriptions themselves, and known already.
struct Stamps<'a> {
    folder: &'a Path,
    /// By path in lower case, as references are found.
    found: HashMap<String, Stamp>,
}

impl<'a> Stamps<'a> {
    fn new(folder: &'a Path, found: &[(PathBuf, Stamp)]) -> Stamps<'a> {
        let found = found.iter().map(|(file, stamp)| (below(folder, file).to_lowercase(), *stamp)).collect();
        Stamps { folder, found }
    }

    fn now(&self, path: &str) -> Option<Stamp> {
        let known = self.found.get(&path.to_lowercase()).copied();
        known.or_else(|| fs::metadata(self.folder.join(path)).ok().map(|metadata| stamp(&metadata)))
    }
}

/// Reads a file for the index.
fn entry(file: &Path, name: &str, stamp: Stamp, stamps: &Stamps<'_>) -> IndexedFile {
    let (loaded, references) = load_noting(file);
    let entry = match loaded {
        Ok(esi) => IndexedFile::of(name, stamp, &esi),
        // It belongs to a description, and has no devices of its own.
        Err(EsiFailure::Esi(error)) if error.is_companion() => IndexedFile::of(name, stamp, &Esi::default()),
        Err(error) => IndexedFile::refused(name, stamp, &error.to_string()),
    };
    let references = references.iter().map(|other| below(stamps.folder, other));
    entry.with_references(references.map(|other| (other.clone(), stamps.now(&other))).collect())
}

/// Writes the index beside its place first, so that another process never reads a half of it.
fn keep(kept: &Path, index: &Index) -> io::Result<()> {
    if let Some(folder) = kept.parent() {
        fs::create_dir_all(folder)?;
    }
    let beside = kept.with_extension(format!("{}.new", std::process::id()));
    fs::write(&beside, index.to_text())?;
    fs::rename(&beside, kept)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder of its own, removed on drop.
    struct Place(PathBuf);

    impl Place {
        fn new(name: &str) -> Place {
            let place = Place(std::env::temp_dir().join(format!("ringcat-esi-{}-{name}", std::process::id())));
            fs::create_dir_all(place.0.join("descriptions/more")).expect("a temporary folder");
            place
        }

        fn write(&self, name: &str, text: &str) {
            fs::write(self.0.join("descriptions").join(name), text).expect("it is writable");
        }

        fn open(&self) -> EsiFolder {
            EsiFolder::open(&self.0.join("descriptions"), Some(&self.kept())).expect("a folder")
        }

        fn kept(&self) -> PathBuf {
            self.0.join("cache/kept.index")
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn description(product: u32, name: &str) -> String {
        format!(
            "<EtherCATInfo><Vendor><Id>71</Id></Vendor><Descriptions><Groups/><Devices><Device Physics=\"YY\"><Type \
             ProductCode=\"{product}\" RevisionNo=\"1\">A{product}</Type><Name LcId=\"1033\">{name}</Name></Device>\
             </Devices></Descriptions></EtherCATInfo>"
        )
    }

    // covers: esi-read
    #[test]
    fn only_new_and_changed_files_are_read_again_and_removed_ones_are_gone() {
        let place = Place::new("changes");
        place.write("one.xml", &description(1, "first"));
        place.write("more/two.XML", &description(2, "second"));
        place.write("notes.txt", "no description");
        let read = |place: &Place| {
            let folder = place.open();
            assert!(folder.not_kept().is_none());
            (folder.files_read(), folder.index().devices().count())
        };
        assert_eq!(read(&place), (2, 2));
        assert_eq!(read(&place), (0, 2));
        place.write("one.xml", &description(1, "first, with another length"));
        place.write("three.xml", &description(3, "third"));
        assert_eq!(read(&place), (2, 3));
        fs::remove_file(place.0.join("descriptions/more/two.XML")).expect("it is writable");
        assert_eq!(read(&place), (0, 2));
        let folder = place.open();
        let found = folder.index().find(71, 3, 1, false).expect("it is described");
        assert_eq!(folder.load(&found).expect("it is there").devices[0].name.english(), "third");
    }

    // covers: esi-read
    #[test]
    fn files_that_a_description_refers_to_count_like_the_file_itself() {
        let place = Place::new("referred");
        let profile = |file: &str| format!("<Profile><DictionaryFile>{file}</DictionaryFile></Profile></Device>");
        place.write("x.xml", &description(1, "first").replace("</Device>", &profile("D.xml")));
        place.write("more/y.xml", &description(2, "second").replace("</Device>", &profile("sub/e.dict")));
        let dictionary = "<EtherCATDict><Dictionary/></EtherCATDict>";
        place.write("d.xml", "<EtherCATDict>\n<Dictionary><Objects><Object/></Objects></Dictionary></EtherCATDict>");
        let opened = |place: &Place| {
            let folder = place.open();
            let refused: Vec<String> = folder.index().files().iter().filter_map(|file| file.refused.clone()).collect();
            (folder.files_read(), folder.index().devices().count(), refused)
        };
        let (read, devices, refused) = opened(&place);
        assert_eq!((read, devices, refused.len()), (3, 1, 1), "a dictionary is no description: {refused:?}");
        assert!(refused[0].contains("x.xml:1: device \"A1\": a file that it refers to: "), "{refused:?}");
        assert!(refused[0].contains("D.xml:2"), "{refused:?}");
        assert_eq!(opened(&place), (0, 1, refused));
        place.write("d.xml", dictionary);
        assert_eq!(opened(&place), (2, 2, Vec::new()), "it and the file that refers to it");
        assert_eq!(opened(&place), (0, 2, Vec::new()));
        fs::create_dir_all(place.0.join("descriptions/more/sub")).expect("it is writable");
        place.write("more/sub/e.dict", dictionary);
        assert_eq!(opened(&place), (1, 2, Vec::new()), "one that was not there");
        assert_eq!(opened(&place), (0, 2, Vec::new()));
        place.write("more/sub/e.dict", "<EtherCATDict/>");
        assert_eq!(opened(&place).1, 1, "a description that was accepted depends on it too");
        fs::remove_file(place.0.join("descriptions/more/sub/e.dict")).expect("it is writable");
        assert_eq!(opened(&place), (1, 2, Vec::new()));
    }

    // covers: esi-read
    #[test]
    fn a_single_file_is_opened_like_a_folder_without_its_neighbours() {
        let place = Place::new("single");
        place.write("one.xml", &description(1, "first"));
        place.write("two.xml", &description(2, "second"));
        let folder = EsiFolder::open(&place.0.join("descriptions/two.xml"), Some(&place.kept())).expect("a file");
        assert_eq!((folder.files_read(), folder.index().devices().count()), (1, 1));
        let found = folder.index().find(71, 2, 1, false).expect("it is described");
        assert_eq!(folder.load(&found).expect("it is there").devices[0].name.english(), "second");
        let again = EsiFolder::open(&place.0.join("descriptions/two.xml"), Some(&place.kept())).expect("a file");
        assert_eq!(again.files_read(), 0);
    }

    // covers: esi-read
    #[test]
    fn a_damaged_index_and_one_that_cannot_be_kept_cost_only_time() {
        let place = Place::new("damage");
        place.write("one.xml", &description(1, "first"));
        place.write("bad.xml", "<EtherCATInfo>");
        let folder = place.open();
        assert_eq!((folder.files_read(), folder.index().devices().count()), (2, 1));
        let refused: Vec<&str> = folder.index().files().iter().filter_map(|file| file.refused.as_deref()).collect();
        assert!(refused.len() == 1 && refused[0].contains("bad.xml"), "{refused:?}");
        let text = fs::read_to_string(place.kept()).expect("it was kept");
        for damaged in ["", "other\n", &text[..text.len() / 2]] {
            fs::write(place.kept(), damaged).expect("it is writable");
            assert_eq!(place.open().files_read(), 2, "{damaged}");
        }
        fs::remove_dir_all(place.0.join("cache")).expect("it is writable");
        fs::write(place.0.join("cache"), "a file in the place of the folder").expect("it is writable");
        let folder = place.open();
        assert!(folder.not_kept().is_some() && folder.index().devices().count() == 1);
        assert!(EsiFolder::open(&place.0.join("nowhere"), None).is_err());
    }
}
