//! Files that a description refers to: modules (`InfoReference`) and dictionaries (`DictionaryFile`); protocol ES-07.
//!
//! The caller opens files; this module decides which, and refuses paths that leave the folder, circles and chains
//! without end. A file that is not there is a notice.

use super::error::{EsiError, Notice};
use super::limits::MAX_REFERENCES;
use super::model::{Esi, Profile, Reference};
use super::{parse, read};
use crate::xml::{self, shown};

/// Opens files beside a description. `path` is relative to its folder, with `/` between names; letters of either case
/// are equal.
pub trait References {
    /// The bytes of a file; `None` if it is not there.
    fn open(&self, path: &str) -> Option<Vec<u8>>;
}

/// No file is there.
#[derive(Clone, Copy, Debug, Default)]
pub struct NoReferences;

impl References for NoReferences {
    fn open(&self, _path: &str) -> Option<Vec<u8>> {
        None
    }
}

/// Reads a file with the modules and dictionaries that it refers to.
///
/// # Errors
/// The errors of [`read`] for each file; references that leave the folder or form a circle.
pub fn read_with(name: &str, bytes: &[u8], references: &dyn References) -> Result<Esi, EsiError> {
    let mut esi = read(name, bytes)?;
    let mut files = Files { opened: vec![own_name(name)], references };
    files.modules(&mut esi)?;
    for index in 0..esi.devices.len() {
        let mut profiles = std::mem::take(&mut esi.devices[index].profiles);
        files.dictionaries(&mut esi, &mut profiles)?;
        esi.devices[index].profiles = profiles;
    }
    for index in 0..esi.modules.len() {
        let mut profiles = std::mem::take(&mut esi.modules[index].profiles);
        files.dictionaries(&mut esi, &mut profiles)?;
        esi.modules[index].profiles = profiles;
    }
    Ok(esi)
}

fn own_name(name: &str) -> String {
    name.rsplit(['/', '\\']).next().unwrap_or(name).to_lowercase()
}

/// The files of one description.
struct Files<'a> {
    /// Paths in lower case, from the folder of the description.
    opened: Vec<String>,
    references: &'a dyn References,
}

impl Files<'_> {
    /// Modules of referenced files, including indirectly referenced files.
    fn modules(&mut self, esi: &mut Esi) -> Result<(), EsiError> {
        let mut waiting: Vec<(String, u32, String)> =
            esi.references.iter().map(|it| (esi.file.clone(), it.line, it.path.clone())).collect();
        waiting.reverse();
        while let Some((from, line, written)) = waiting.pop() {
            let folder = if from == esi.file { "" } else { from.rsplit_once('/').map_or("", |(folder, _)| folder) };
            let path = checked(&from, line, folder, &written)?;
            let key = path.to_lowercase();
            if self.opened.contains(&key) {
                let reason =
                    format!("InfoReference {}: the file refers to itself, or is referred to twice", shown(&written));
                return Err(EsiError::rule(&from, line, "", reason));
            }
            if self.opened.len() > MAX_REFERENCES {
                let reason = format!("more than {MAX_REFERENCES} files in a chain of references");
                return Err(EsiError::rule(&from, line, "", reason));
            }
            self.opened.push(key);
            let Some(bytes) = self.references.open(&path) else {
                let text = format!("InfoReference {}: no such file, its modules are missing", shown(&written));
                esi.notices.push(Notice { line, text, times: 1 });
                esi.missing.push(Reference { line, path: written });
                continue;
            };
            let other = read(&path, &bytes)?;
            waiting.extend(other.references.iter().rev().map(|it| (path.clone(), it.line, it.path.clone())));
            for module in other.modules {
                let is_known =
                    esi.modules.iter().any(|known| (known.ident, known.vendor_id) == (module.ident, module.vendor_id));
                if is_known {
                    let text = format!("module {:#010x} of {} is there already: not used", module.ident, shown(&path));
                    esi.notices.push(Notice { line, text, times: 1 });
                } else {
                    esi.modules.push(module);
                }
            }
        }
        Ok(())
    }

    /// Dictionaries in files of their own.
    fn dictionaries(&self, esi: &mut Esi, profiles: &mut [Profile]) -> Result<(), EsiError> {
        for profile in profiles.iter_mut().filter(|profile| profile.dictionary.is_none()) {
            let Some(written) = profile.dictionary_file.clone() else { continue };
            let path = checked(&esi.file, 0, "", &written)?;
            match self.references.open(&path) {
                Some(bytes) => {
                    let (text, _) = xml::decode_utf8_first(&bytes).map_err(|error| EsiError::of_xml(&path, error))?;
                    profile.dictionary = Some(parse::dictionary(&path, &text)?);
                }
                None => {
                    let text = format!("DictionaryFile {}: no such file", shown(&written));
                    esi.notices.push(Notice { line: 1, text, times: 1 });
                }
            }
        }
        Ok(())
    }
}

/// A path below the folder, with `/` between names.
fn checked(file: &str, line: u32, folder: &str, written: &str) -> Result<String, EsiError> {
    let path = written.trim().replace('\\', "/");
    let leaves = path.starts_with('/')
        || path.contains(':')
        || path.contains('\0')
        || path.split('/').any(|part| part == ".." || part.is_empty())
        || path.is_empty();
    if leaves {
        let reason = format!("a reference has to stay in the folder of the file, got {}", shown(written));
        return Err(EsiError::rule(file, line, "", reason));
    }
    Ok(if folder.is_empty() { path } else { format!("{folder}/{path}") })
}
