//! Device descriptions (`--esi`): names that SubDevices, PDOs, entries and objects do not have themselves.

use std::path::PathBuf;
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use ringcat::config::ObjectNames;
use ringcat::config::esi::{Device, Esi, PlacedModule, detected_modules};
use ringcat::esi::EsiFolder;
use ringcat::{Position, SubDeviceInfo, SupervisorThread};

use crate::failure::Failure;
use crate::modules::{self, Failed};
use crate::output::{counted, warn};

/// Language of the names where none is chosen: English.
pub const ENGLISH: u32 = 1033;
/// Positions without a description that a warning lists.
const LISTED: usize = 8;

/// The option.
#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Output")]
pub struct EsiArgument {
    /// Descriptions (ESI) for names that the devices do not have: a folder or a file
    ///
    /// A name of the device or of the file of a network counts before that of a description. See docs/esi.md.
    #[arg(long, value_name = "DIR|FILE.xml")]
    esi: Option<PathBuf>,
    /// Language of the names of descriptions: 1033 English, 1031 German
    ///
    /// If a description does not have a name in this language, its name in the same language of another country is
    /// used, else the English name, else the first one.
    #[arg(long, value_name = "LCID", requires = "esi", help_heading = "Output")]
    language: Option<u32>,
}

impl EsiArgument {
    /// Opens the folder with its index, where there is one: before anything is sent, so that a wrong path changes
    /// nothing.
    pub fn open(&self) -> Result<Option<Descriptions>, Failure> {
        let Some(path) = &self.esi else { return Ok(None) };
        let kept = EsiFolder::default_index(path);
        let folder = EsiFolder::open(path, kept.as_deref()).map_err(|error| Failure::new(error.to_string()))?;
        folder.notices().iter().for_each(warn);
        let refused = folder.index().files().iter().find_map(|file| file.refused.as_deref());
        if let Some(reason) = refused.filter(|_| !path.is_dir()) {
            return Err(Failure::new(reason.to_owned()));
        }
        let language = self.language.unwrap_or(ENGLISH);
        Ok(Some(Descriptions { folder, loaded: Vec::new(), language }))
    }
}

/// The names of a scan: completes those of the SubDevices, and returns those of their objects. With descriptions, what
/// has none is reported once.
pub fn complete(
    descriptions: Option<&mut Descriptions>,
    found: &mut [SubDeviceInfo],
    idents: &[Vec<u32>],
) -> Result<Vec<ObjectNames>, Failure> {
    let (names, missing) = found_and_described(descriptions, found, idents)?;
    if !missing.is_empty() {
        let more = if missing.len() > LISTED { ", ..." } else { "" };
        let count = counted(missing.len(), "SubDevice", "SubDevices");
        let first: Vec<String> = missing.iter().take(LISTED).map(Position::to_string).collect();
        warn(format!("no description of {count}: position {}{more}", first.join(", ")));
    }
    Ok(names)
}

/// As [`complete`], with the modules that the SubDevices detect; those with slots are in PREOP afterwards.
pub fn complete_by(
    supervisor: &SupervisorThread,
    mut descriptions: Option<&mut Descriptions>,
    found: &mut [SubDeviceInfo],
) -> Result<Vec<ObjectNames>, Failure> {
    let mut idents = Vec::new();
    if let Some(descriptions) = &mut descriptions {
        idents.extend(found.iter().map(|info| match descriptions.has_modules(info) {
            true => {
                let begin = Instant::now();
                let detected = modules::detected(
                    || begin.elapsed(),
                    |limit| {
                        supervisor
                            .subdevice(info.position)
                            .within(limit)
                            .sdo_read(modules::DETECTED, 0)
                            .map_err(Failed::from)
                    },
                    |slot, limit| {
                        let subdevice = supervisor.subdevice(info.position).within(limit);
                        subdevice.sdo_read(modules::DETECTED, slot).map_err(Failed::from)
                    },
                );
                detected.warn_of(info);
                detected.idents
            }
            false => Vec::new(),
        }));
    }
    complete(descriptions, found, &idents)
}

/// As [`complete`], without a report of what has no description.
pub fn objects(
    descriptions: Option<&mut Descriptions>,
    found: &mut [SubDeviceInfo],
    idents: &[Vec<u32>],
) -> Result<Vec<ObjectNames>, Failure> {
    found_and_described(descriptions, found, idents).map(|(names, _)| names)
}

/// Names of objects, and the positions of what has no description.
fn found_and_described(
    descriptions: Option<&mut Descriptions>,
    found: &mut [SubDeviceInfo],
    idents: &[Vec<u32>],
) -> Result<(Vec<ObjectNames>, Vec<Position>), Failure> {
    match descriptions {
        Some(descriptions) => descriptions.complete(found, idents),
        None => Ok((found.iter().map(own).collect(), Vec::new())),
    }
}

/// Descriptions of a folder; each file is read once.
#[derive(Debug)]
pub struct Descriptions {
    folder: EsiFolder,
    loaded: Vec<(String, Rc<Esi>)>,
    /// Language of their names.
    pub language: u32,
}

/// The description of a SubDevice.
#[derive(Debug)]
pub struct Described {
    esi: Rc<Esi>,
    at: usize,
    /// The file.
    pub path: String,
}

/// What decides the names of a description: file, device, idents of modules by slot.
type Kind = (String, usize, Vec<(u16, u32)>);

impl Described {
    fn kind(&self, modules: &[PlacedModule<'_>]) -> Kind {
        let modules = modules.iter().map(|placed| (placed.slot, placed.module.ident));
        (self.path.clone(), self.at, modules.collect())
    }

    /// The device.
    pub fn device(&self) -> &Device {
        &self.esi.devices[self.at]
    }

    /// The modules in its slots: by the idents that it has detected, else by its PDOs.
    pub fn modules(&self, info: &SubDeviceInfo, idents: &[u32]) -> Vec<PlacedModule<'_>> {
        detected_modules(&self.esi, self.device(), idents, &info.pdos)
    }
}

impl Descriptions {
    /// The description that counts for a SubDevice.
    pub fn of(&mut self, info: &SubDeviceInfo) -> Result<Option<Described>, Failure> {
        let of = &info.identity;
        let Some(found) = self.folder.index().find(of.vendor_id, of.product_code, of.revision, true) else {
            return Ok(None);
        };
        let path = found.file.path.clone();
        let esi = match self.loaded.iter().find(|(known, _)| *known == path) {
            Some((_, esi)) => esi.clone(),
            None => {
                let esi = Rc::new(self.folder.load(&found).map_err(|error| Failure::new(error.to_string()))?);
                self.loaded.push((path.clone(), esi.clone()));
                esi
            }
        };
        let wanted = (found.device.product_code, found.device.revision);
        let at = esi.devices.iter().position(|device| (device.product_code, device.revision) == wanted);
        Ok(at.map(|at| Described { esi, at, path }))
    }

    /// Whether a SubDevice has slots for modules, and objects in which it can list them.
    pub fn has_modules(&mut self, info: &SubDeviceInfo) -> bool {
        info.protocols.coe() && info.mailbox.is_some() && self.has_slots(info)
    }

    fn has_slots(&mut self, info: &SubDeviceInfo) -> bool {
        self.of(info).is_ok_and(|described| described.is_some_and(|described| described.device().slots.is_some()))
    }

    /// Fills in the names of SubDevices whose EEPROM has none.
    pub fn name_subdevices(&mut self, found: &mut [SubDeviceInfo]) {
        let language = self.language;
        for info in found.iter_mut().filter(|info| info.name.trim().is_empty()) {
            if let Ok(Some(described)) = self.of(info) {
                name(info, described.device(), language);
            }
        }
    }

    /// The same, and the names of all objects.
    fn complete(
        &mut self,
        found: &mut [SubDeviceInfo],
        idents: &[Vec<u32>],
    ) -> Result<(Vec<ObjectNames>, Vec<Position>), Failure> {
        self.name_subdevices(found);
        let (mut all, mut missing) = (Vec::with_capacity(found.len()), Vec::new());
        let mut known: Vec<(Kind, Arc<ObjectNames>)> = Vec::new();
        for (at, info) in found.iter().enumerate() {
            let mut names = own(info);
            match self.of(info)? {
                Some(described) => {
                    let modules = described.modules(info, idents.get(at).map_or(&[], Vec::as_slice));
                    let kind = described.kind(&modules);
                    let shared = match known.iter().find(|(other, _)| *other == kind) {
                        Some((_, shared)) => shared.clone(),
                        None => {
                            let mut shared = ObjectNames::default();
                            shared.add_described(described.device(), &modules, self.language);
                            shared.add_modules(&described.esi.modules);
                            let shared = Arc::new(shared);
                            known.push((kind, shared.clone()));
                            shared
                        }
                    };
                    names.share(shared);
                }
                None => missing.push(info.position),
            }
            all.push(names);
        }
        Ok((all, missing))
    }
}

/// The names that a SubDevice has itself.
fn own(info: &SubDeviceInfo) -> ObjectNames {
    let mut names = ObjectNames::default();
    names.add_found(info);
    names
}

/// Names a SubDevice that has no name: the name of the description, and its type where there is no order code.
fn name(info: &mut SubDeviceInfo, device: &Device, language: u32) {
    let texts = [device.name.in_language(language), device.kind.as_str()].map(str::trim);
    info.name = texts.into_iter().find(|text| !text.is_empty()).unwrap_or_default().to_owned();
    if info.order_code.trim().is_empty() {
        device.kind.trim().clone_into(&mut info.order_code);
    }
}
