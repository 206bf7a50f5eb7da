//! Files that a description refers to: modules (`InfoReference`) and dictionaries (`DictionaryFile`); protocol ES-07.
//!
//! The caller opens files; this module decides which, each once, and refuses paths that leave the folder, circles,
//! chains without end and more bytes than a limit. A file that is not there is a notice.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use super::error::{EsiError, EsiProblem, Notices};
use super::limits::{MAX_DEVICES, MAX_DICTIONARIES, MAX_REFERENCED_BYTES, MAX_REFERENCES};
use super::model::{Dictionary, Esi, Module, Profile, Reference};
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
/// The errors of [`read`] for each file; references that leave the folder or form a circle; more files, modules or
/// bytes than a description has. An error in another file names the description too ([`EsiProblem::Referred`]).
pub fn read_with(name: &str, bytes: &[u8], references: &dyn References) -> Result<Esi, EsiError> {
    let mut esi = read(name, bytes)?;
    let mut files = Files { references, left: MAX_REFERENCED_BYTES, dictionaries: HashMap::new() };
    let mut notices = Notices::default();
    files.modules(&mut esi, &mut notices)?;
    let file = &esi.file;
    for device in &mut esi.devices {
        files.dictionaries((file, &device.kind), &mut device.profiles, &mut notices)?;
    }
    for module in &mut esi.modules {
        // The dictionary of a module is beside the description, also if the module has a file of its own.
        let read = files.dictionaries((&module.file, &module.kind), &mut module.profiles, &mut notices);
        read.map_err(|error| referred(file, 0, error))?;
    }
    esi.notices.extend(notices.into_list());
    Ok(esi)
}

fn own_name(name: &str) -> String {
    name.rsplit(['/', '\\']).next().unwrap_or(name).to_lowercase()
}

/// The files of one description.
struct Files<'a> {
    references: &'a dyn References,
    /// Bytes that further files may have.
    left: usize,
    /// Dictionaries by path; `None` if there is no such file.
    dictionaries: HashMap<String, Option<Arc<Dictionary>>>,
}

/// A file of modules that was opened.
struct Opened {
    /// Path in lower case, from the folder of the description.
    key: String,
    /// The one that refers to it first.
    parent: Option<usize>,
}

/// A reference that was not followed yet.
struct Waiting {
    /// The file that it is in: name, and number of those that were opened.
    from: (String, usize),
    reference: Reference,
    /// Line of the description from which it comes.
    line: u32,
}

impl Files<'_> {
    /// Modules of referenced files, including indirectly referenced files.
    fn modules(&mut self, esi: &mut Esi, notices: &mut Notices) -> Result<(), EsiError> {
        let mut opened = vec![Opened { key: own_name(&esi.file), parent: None }];
        let own = esi.file.clone();
        let mut known: HashSet<(u32, u32)> = esi.modules.iter().map(identity).collect();
        let waiting = esi.references.iter().rev();
        let mut waiting: Vec<Waiting> =
            waiting.map(|it| Waiting { from: (esi.file.clone(), 0), reference: it.clone(), line: it.line }).collect();
        while let Some(Waiting { from: (from, parent), reference, line }) = waiting.pop() {
            let Reference { line: at, path: written } = &reference;
            let named = |error: EsiError| referred(&own, line, error);
            let rule = |reason: String| named(EsiError::rule(&from, *at, "", reason));
            let folder = if parent == 0 { "" } else { from.rsplit_once('/').map_or("", |(folder, _)| folder) };
            let path = checked(folder, written).map_err(rule)?;
            let key = path.to_lowercase();
            if let Some(again) = opened.iter().position(|it| it.key == key) {
                if is_around(&opened, again, parent) {
                    return Err(rule(format!("InfoReference {}: the file refers to itself", shown(written))));
                }
                continue;
            }
            if opened.len() > MAX_REFERENCES {
                return Err(rule(format!("more than {MAX_REFERENCES} files in a chain of references")));
            }
            opened.push(Opened { key, parent: Some(parent) });
            let Some(bytes) = self.open(&path).map_err(|problem| named(EsiError::at_line(&from, *at, "", problem)))?
            else {
                let text = format!("InfoReference {}: no such file, its modules are missing", shown(written));
                notices.add(*at, text);
                esi.missing.push(reference);
                continue;
            };
            let other = read(&path, &bytes).map_err(named)?;
            let next = |it: &Reference| Waiting { from: (path.clone(), opened.len() - 1), reference: it.clone(), line };
            waiting.extend(other.references.iter().rev().map(next));
            let mut modules = other.modules.into_iter();
            let added = modules.try_for_each(|it| add(esi, it, &mut known, (&path, *at), notices));
            added.map_err(|error| referred(&own, line, error))?;
        }
        Ok(())
    }

    /// Dictionaries in files of their own; `file` and `kind`: where a device or module is, and what.
    fn dictionaries(
        &mut self,
        (file, kind): (&str, &str),
        profiles: &mut [Profile],
        notices: &mut Notices,
    ) -> Result<(), EsiError> {
        for profile in profiles.iter_mut().filter(|profile| profile.dictionary.is_none()) {
            let Some(Reference { line, path: written }) = &profile.dictionary_file else { continue };
            let about = |problem| EsiError::at_line(file, *line, kind.trim(), problem);
            let path = checked("", written).map_err(|reason| about(EsiProblem::Rule { reason }))?;
            let key = path.to_lowercase();
            if let Some(known) = self.dictionaries.get(&key) {
                profile.dictionary.clone_from(known);
                continue;
            }
            if self.dictionaries.len() == MAX_DICTIONARIES {
                return Err(about(EsiProblem::TooMuch { what: "files of dictionaries", limit: MAX_DICTIONARIES }));
            }
            let bytes = self.open(&path).map_err(about)?;
            let found = bytes.map(|bytes| dictionary(&path, &bytes)).transpose();
            let found = found.map_err(|error| EsiError::referred(file, *line, kind.trim(), error))?;
            if found.is_none() {
                notices.add(*line, format!("DictionaryFile {}: no such file", shown(written)));
            }
            let found = found.map(Arc::new);
            profile.dictionary.clone_from(&found);
            self.dictionaries.insert(key, found);
        }
        Ok(())
    }

    fn open(&mut self, path: &str) -> Result<Option<Vec<u8>>, EsiProblem> {
        let Some(bytes) = self.references.open(path) else { return Ok(None) };
        let what = "bytes in the files that it refers to";
        let left = self.left.checked_sub(bytes.len());
        self.left = left.ok_or(EsiProblem::TooMuch { what, limit: MAX_REFERENCED_BYTES })?;
        Ok(Some(bytes))
    }
}

fn dictionary(path: &str, bytes: &[u8]) -> Result<Dictionary, EsiError> {
    let (text, _) = xml::decode_utf8_first(bytes).map_err(|error| EsiError::of_xml(path, error, bytes))?;
    parse::dictionary(path, &text)
}

/// An error in a file that the description refers to, or in the description itself.
fn referred(own: &str, line: u32, error: EsiError) -> EsiError {
    if *error.file == *own { error } else { EsiError::referred(own, line, "", error) }
}

/// Adds a module of another file: `path`, referred to in line `at`.
fn add(
    esi: &mut Esi,
    module: Module,
    known: &mut HashSet<(u32, u32)>,
    (path, at): (&str, u32),
    notices: &mut Notices,
) -> Result<(), EsiError> {
    if !known.insert(identity(&module)) {
        notices.add(at, format!("module {:#010x} of {} is defined already: not used", module.ident, shown(path)));
    } else if esi.modules.len() == MAX_DEVICES {
        let problem = EsiProblem::TooMuch { what: "modules", limit: MAX_DEVICES };
        return Err(EsiError::at_line(path, module.line, module.kind.trim(), problem));
    } else {
        esi.modules.push(module);
    }
    Ok(())
}

/// What a module is found by.
const fn identity(module: &Module) -> (u32, u32) {
    (module.ident, module.vendor_id)
}

/// Whether a file leads to another one, or is it.
fn is_around(opened: &[Opened], file: usize, inner: usize) -> bool {
    let parent = |at: &usize| opened.get(*at).and_then(|it| it.parent);
    std::iter::successors(Some(inner), parent).any(|at| at == file)
}

/// A path below the folder, with `/` between names.
fn checked(folder: &str, written: &str) -> Result<String, String> {
    let path = written.trim().replace('\\', "/");
    let leaves = path.starts_with('/')
        || path.contains(':')
        || path.contains(char::is_control)
        || path.split('/').any(|part| part == ".." || part.is_empty())
        || path.is_empty();
    if leaves {
        return Err(format!("a reference has to stay in the folder of the file, got {}", shown(written)));
    }
    Ok(if folder.is_empty() { path } else { format!("{folder}/{path}") })
}
