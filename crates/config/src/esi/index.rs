//! An index over device descriptions: which file describes a device, without reading the files again (protocol ES-25,
//! ES-29, ES-30).
//!
//! Input: descriptions that were read once, with size and time of their files and of those to which they refer.
//! Output: choices by identity, lists of devices, and a text to keep. A text of another version, or with a wrong
//! checksum, is no index: the caller reads the files again. The caller opens files; nothing here does.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fmt::Write as _;

use super::model::Esi;
use super::rules::{Choice, choose};

/// First line of the text.
const HEAD: &str = "RingCAT index of device descriptions 3";
/// Begin of the last line.
const END: &str = "end\t";
/// Most characters of a text in the index.
const MAX_TEXT: usize = 200;

/// Size and time of a file: another one is read again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Stamp {
    /// Bytes.
    pub bytes: u64,
    /// Time of its last change, in nanoseconds since 1970.
    pub modified_ns: u64,
}

/// A file of the index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct IndexedFile {
    /// Its path as the caller named it.
    pub path: String,
    /// Size and time.
    pub stamp: Stamp,
    /// Files to which it refers, by path as its own: another size or time of one counts like its own. `None`: there was
    /// none.
    pub refers_to: Vec<(String, Option<Stamp>)>,
    /// Why it was refused; it has no devices then.
    pub refused: Option<String>,
    /// Devices in document order.
    pub devices: Vec<IndexedDevice>,
}

/// A device of the index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct IndexedDevice {
    /// Vendor.
    pub vendor_id: u32,
    /// Product code.
    pub product_code: u32,
    /// Revision.
    pub revision: u32,
    /// Line in the file.
    pub line: u32,
    /// `Type`.
    pub kind: String,
    /// Name in English, or the first.
    pub name: String,
    /// Descriptions that lists do not show because of this one: product code and revision.
    hides: Vec<(u32, u32)>,
}

/// A description of a device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Described<'a> {
    /// The file.
    pub file: &'a IndexedFile,
    /// The device.
    pub device: &'a IndexedDevice,
    /// How it was chosen; not `None`.
    pub choice: Choice,
}

/// An index over files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Index {
    files: Vec<IndexedFile>,
    /// Files by path.
    paths: HashMap<String, usize>,
    /// Places of each identity, the newest file first.
    places: BTreeMap<Key, Vec<Place>>,
    hidden: BTreeSet<Key>,
}

/// File and device in it.
type Place = (usize, usize);
/// Vendor, product code, revision.
type Key = (u32, u32, u32);

impl IndexedFile {
    /// The devices of a description.
    pub fn of(path: &str, stamp: Stamp, esi: &Esi) -> IndexedFile {
        let devices = esi.devices.iter().filter(|device| !device.is_invisible).map(|device| {
            let hides = device
                .hides
                .iter()
                .filter_map(|other| Some((other.product_code.unwrap_or(device.product_code), other.revision?)));
            IndexedDevice {
                vendor_id: device.vendor_id,
                product_code: device.product_code,
                revision: device.revision,
                line: device.line,
                kind: one_line(device.kind.trim()),
                name: one_line(device.name.english().trim()),
                hides: hides.collect(),
            }
        });
        let devices = devices.collect();
        IndexedFile { path: path.to_owned(), stamp, devices, ..IndexedFile::default() }
    }

    /// A file that was refused, with the reason.
    pub fn refused(path: &str, stamp: Stamp, reason: &str) -> IndexedFile {
        let refused = Some(one_line(reason));
        IndexedFile { path: path.to_owned(), stamp, refused, ..IndexedFile::default() }
    }

    /// The file with those to which it refers.
    #[must_use]
    pub fn with_references(self, refers_to: Vec<(String, Option<Stamp>)>) -> IndexedFile {
        IndexedFile { refers_to, ..self }
    }

    /// Whether its paths can be kept in a line each.
    fn can_be_kept(&self) -> bool {
        let mut paths = std::iter::once(&self.path).chain(self.refers_to.iter().map(|(path, _)| path));
        !paths.any(|path| path.contains(char::is_control))
    }
}

impl IndexedDevice {
    const fn key(&self) -> Key {
        (self.vendor_id, self.product_code, self.revision)
    }
}

impl Index {
    /// An index over these files.
    pub fn new(files: Vec<IndexedFile>) -> Index {
        let mut places: BTreeMap<Key, Vec<Place>> = BTreeMap::new();
        let mut hidden = BTreeSet::new();
        for (at, file) in files.iter().enumerate() {
            for (number, device) in file.devices.iter().enumerate() {
                places.entry(device.key()).or_default().push((at, number));
                hidden.extend(device.hides.iter().map(|(product, revision)| (device.vendor_id, *product, *revision)));
            }
        }
        for places in places.values_mut() {
            places.sort_by_key(|(at, _)| std::cmp::Reverse(files[*at].stamp.modified_ns));
        }
        let paths = files.iter().enumerate().map(|(at, file)| (file.path.clone(), at)).collect();
        Index { files, paths, places, hidden }
    }

    /// The files.
    pub fn files(&self) -> &[IndexedFile] {
        &self.files
    }

    /// The entry of a file that has not changed, nor any file to which it refers; `now` gives their size and time.
    pub fn unchanged(&self, path: &str, stamp: Stamp, now: impl Fn(&str) -> Option<Stamp>) -> Option<&IndexedFile> {
        let file = self.files.get(*self.paths.get(path)?)?;
        let is_same = file.stamp == stamp && file.refers_to.iter().all(|(path, known)| now(path) == *known);
        is_same.then_some(file)
    }

    /// All descriptions by identity; of an identity in several files that of the newest file.
    pub fn devices(&self) -> impl Iterator<Item = (&IndexedFile, &IndexedDevice)> {
        self.places.values().filter_map(|places| self.at(*places.first()?))
    }

    fn at(&self, (file, device): Place) -> Option<(&IndexedFile, &IndexedDevice)> {
        let file = self.files.get(file)?;
        Some((file, file.devices.get(device)?))
    }

    /// Whether another description hides this one from lists. It is valid nevertheless.
    pub fn is_hidden(&self, device: &IndexedDevice) -> bool {
        self.hidden.contains(&device.key())
    }

    /// Identities that several files describe, with the files, the one that counts first.
    pub fn duplicates(&self) -> impl Iterator<Item = (&IndexedDevice, Vec<&IndexedFile>)> {
        let several = self.places.values().filter(|places| places.iter().any(|(file, _)| *file != places[0].0));
        several.filter_map(|places| {
            let (_, device) = self.at(*places.first()?)?;
            Some((device, places.iter().filter_map(|place| Some(self.at(*place)?.0)).collect()))
        })
    }

    /// The description of a device on the bus, chosen by [`choose`].
    pub fn find(&self, vendor_id: u32, product_code: u32, revision: u32, accept_newer: bool) -> Option<Described<'_>> {
        let key = |revision| (vendor_id, product_code, revision);
        let described = self.places.range(key(0)..=key(u32::MAX)).map(|((.., revision), _)| *revision);
        let choice = choose(described, revision, accept_newer);
        let (Choice::Exact(chosen) | Choice::Older(chosen) | Choice::Newer(chosen)) = choice else { return None };
        let (file, device) = self.at(*self.places.get(&key(chosen))?.first()?)?;
        Some(Described { file, device, choice })
    }

    /// The text to keep.
    pub fn to_text(&self) -> String {
        let mut text = format!("{HEAD}\n");
        for file in self.files.iter().filter(|file| file.can_be_kept()) {
            let Stamp { bytes, modified_ns } = file.stamp;
            // Writing into a String cannot fail.
            let _ = writeln!(text, "file\t{bytes}\t{modified_ns}\t{}", file.path);
            for (path, known) in &file.refers_to {
                let _ = match known {
                    Some(Stamp { bytes, modified_ns }) => writeln!(text, "refers\t{bytes}\t{modified_ns}\t{path}"),
                    None => writeln!(text, "lacks\t{path}"),
                };
            }
            if let Some(reason) = &file.refused {
                let _ = writeln!(text, "refused\t{reason}");
            }
            for it in &file.devices {
                let (vendor, product, revision) = it.key();
                let _ =
                    writeln!(text, "device\t{vendor}\t{product}\t{revision}\t{}\t{}\t{}", it.line, it.kind, it.name);
                for (product, revision) in &it.hides {
                    let _ = writeln!(text, "hides\t{product}\t{revision}");
                }
            }
        }
        with_end(text)
    }

    /// The index of a kept text; `None` if it is damaged or of another version.
    pub fn from_text(text: &str) -> Option<Index> {
        let (text, _) = text.rsplit_once(END).filter(|(body, _)| with_end((*body).to_owned()) == text)?;
        let mut lines = text.lines();
        if lines.next() != Some(HEAD) {
            return None;
        }
        let mut files: Vec<IndexedFile> = Vec::new();
        for line in lines {
            let (kind, rest) = line.split_once('\t').unwrap_or((line, ""));
            match kind {
                "file" => files.push(file_line(rest)?),
                "refers" => {
                    let IndexedFile { path, stamp, .. } = file_line(rest)?;
                    files.last_mut()?.refers_to.push((path, Some(stamp)));
                }
                "lacks" => files.last_mut()?.refers_to.push((rest.to_owned(), None)),
                "refused" => files.last_mut()?.refused = Some(rest.to_owned()),
                "device" => files.last_mut()?.devices.push(device_line(rest)?),
                "hides" => {
                    let (product, revision) = rest.split_once('\t')?;
                    let hidden = (product.parse().ok()?, revision.parse().ok()?);
                    files.last_mut()?.devices.last_mut()?.hides.push(hidden);
                }
                _ => return None,
            }
        }
        Some(Index::new(files))
    }
}

/// A text with its last line: the checksum of all lines before it (FNV-1a).
fn with_end(mut text: String) -> String {
    let step = |sum: u64, byte: &u8| (sum ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01B3);
    let sum = text.as_bytes().iter().fold(0xCBF2_9CE4_8422_2325, step);
    // Writing into a String cannot fail.
    let _ = writeln!(text, "{END}{sum:016x}");
    text
}

fn file_line(rest: &str) -> Option<IndexedFile> {
    let mut parts = rest.splitn(3, '\t');
    let bytes = parts.next()?.parse().ok()?;
    let modified_ns = parts.next()?.parse().ok()?;
    let path = parts.next()?.to_owned();
    Some(IndexedFile { path, stamp: Stamp { bytes, modified_ns }, ..IndexedFile::default() })
}

fn device_line(rest: &str) -> Option<IndexedDevice> {
    let mut parts = rest.splitn(6, '\t');
    let mut number = || parts.next()?.parse().ok();
    let (vendor_id, product_code, revision, line) = (number()?, number()?, number()?, number()?);
    let (kind, name) = (parts.next()?.to_owned(), parts.next()?.to_owned());
    Some(IndexedDevice { vendor_id, product_code, revision, line, kind, name, hides: Vec::new() })
}

/// The text in one line without tabs, shortened.
fn one_line(text: &str) -> String {
    let words: Vec<&str> =
        text.split(|c: char| c.is_whitespace() || c.is_control()).filter(|it| !it.is_empty()).collect();
    words.join(" ").chars().take(MAX_TEXT).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::esi::read;

    fn description(devices: &str) -> Esi {
        let text = format!(
            "<EtherCATInfo><Vendor><Id>#x47</Id><Name>Acme</Name></Vendor><Descriptions><Groups/><Devices>{devices}\
             </Devices></Descriptions></EtherCATInfo>"
        );
        read("acme.xml", text.as_bytes()).expect("a good description")
    }

    fn device(kind: &str, product: u32, revision: u32, more: &str) -> String {
        format!(
            "<Device Physics=\"YY\"><Type ProductCode=\"#x{product:08x}\" RevisionNo=\"#x{revision:08x}\">{kind}</Type>\
             {more}<Name LcId=\"1033\">{kind}\tof\nAcme</Name></Device>"
        )
    }

    fn file(path: &str, modified_ns: u64, devices: &[String]) -> IndexedFile {
        IndexedFile::of(path, Stamp { bytes: 7, modified_ns }, &description(&devices.concat()))
    }

    /// Revisions 0x00100000 and 0x00120000 of one product, another variant, another product; a newer file.
    fn index() -> Index {
        let old = [
            device("A1", 1, 0x0010_0000, ""),
            device("A1", 1, 0x0012_0000, "<HideType RevisionNo=\"#x00100000\">A1</HideType>"),
            device("A1-0010", 1, 0x0011_000A, ""),
            device("B1", 2, 0x0003_0000, ""),
        ];
        let new = [device("A1 new", 1, 0x0012_0000, "")];
        Index::new(vec![file("old.xml", 5, &old), file("new.xml", 6, &new), {
            let refused = IndexedFile::refused("bad.xml", Stamp::default(), "bad.xml:3: no\nVendor");
            refused.with_references(vec![("d.xml".to_owned(), Some(Stamp::default())), ("gone".to_owned(), None)])
        }])
    }

    // covers: ES-29, esi-read
    #[test]
    fn a_device_gets_its_own_revision_or_the_next_older_one_of_its_variant() {
        let index = index();
        let find = |product, revision, newer| index.find(0x47, product, revision, newer).map(|it| it.choice);
        assert_eq!(find(1, 0x0010_0000, false), Some(Choice::Exact(0x0010_0000)));
        assert_eq!(find(1, 0x0011_0000, false), Some(Choice::Older(0x0010_0000)));
        assert_eq!(find(1, 0xFFFF_0000, false), Some(Choice::Older(0x0012_0000)));
        assert_eq!(find(1, 0x0012_000A, false), Some(Choice::Older(0x0011_000A)), "another variant");
        assert_eq!(find(1, 0x0012_0001, true), None, "never another low word");
        assert_eq!(find(2, 0x0001_0000, false), None);
        assert_eq!(find(2, 0x0001_0000, true), Some(Choice::Newer(0x0003_0000)));
        assert_eq!(index.find(0x48, 1, 0x0010_0000, true), None);
    }

    // covers: ES-25, esi-read
    #[test]
    fn of_two_files_with_one_identity_the_newer_counts_and_both_are_reported() {
        let index = index();
        let found = index.find(0x47, 1, 0x0012_0000, false).expect("it is described");
        assert_eq!((found.file.path.as_str(), found.device.kind.as_str()), ("new.xml", "A1 new"));
        let duplicates: Vec<_> = index.duplicates().collect();
        assert_eq!(duplicates.len(), 1);
        let paths: Vec<&str> = duplicates[0].1.iter().map(|file| file.path.as_str()).collect();
        assert_eq!(paths, ["new.xml", "old.xml"]);
        assert_eq!(index.devices().count(), 4);
    }

    // covers: ES-30, esi-read
    #[test]
    fn hidden_descriptions_stay_valid() {
        let index = index();
        let hidden: Vec<u32> =
            index.devices().filter(|(_, it)| index.is_hidden(it)).map(|(_, it)| it.revision).collect();
        assert_eq!(hidden, [0x0010_0000]);
        assert!(index.find(0x47, 1, 0x0010_0000, false).is_some());
    }

    // covers: esi-read
    #[test]
    fn the_text_gives_the_index_back_and_a_damaged_one_gives_none() {
        let index = index();
        let text = index.to_text();
        assert_eq!(Index::from_text(&text), Some(index.clone()));
        assert_eq!(index.files()[0].devices[0].name, "A1 of Acme", "one line without tabs");
        let whole = Index::from_text(&text).expect("it is whole");
        let none = |_: &str| None;
        assert_eq!(whole.unchanged("old.xml", Stamp { bytes: 7, modified_ns: 5 }, none), index.files().first());
        assert_eq!(whole.unchanged("old.xml", Stamp { bytes: 8, modified_ns: 5 }, none), None);
        let bad = |now: fn(&str) -> Option<Stamp>| whole.unchanged("bad.xml", Stamp::default(), now).is_some();
        assert!(bad(|path| (path == "d.xml").then(Stamp::default)));
        assert!(!bad(|_| None) && !bad(|_| Some(Stamp::default())), "one is gone, one has appeared");
        let odd = Index::new(vec![file("odd\nname.xml", 5, &[])]);
        assert_eq!(Index::from_text(&odd.to_text()), Some(Index::default()), "a name of two lines is not kept");
        for end in (0..text.len() - 1).filter(|end| text.is_char_boundary(*end)) {
            assert_eq!(Index::from_text(&text[..end]), None, "cut at {end}");
        }
        for wrong in ["device\t1\t2\n", "hides\t1\t2\n", "file\tx\t1\ta.xml\n", "other\n"] {
            assert_eq!(Index::from_text(&with_end(format!("{HEAD}\n{wrong}"))), None, "{wrong}");
        }
        for (at, _) in text.match_indices(|c: char| c.is_ascii_digit()) {
            let mut changed = text.clone().into_bytes();
            changed[at] ^= 1;
            let changed = String::from_utf8(changed).expect("a digit is another digit");
            assert_eq!(Index::from_text(&changed), None, "a wrong digit at {at}");
        }
    }
}
