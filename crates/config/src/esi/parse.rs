//! From XML to the model: root, vendor, groups; devices, PDOs, mailboxes, dictionaries and slots have modules of their
//! own. The order of elements does not matter, and unknown ones are notices (protocol ES-10).

mod clock;
mod device;
mod dictionary;
mod eeprom;
mod info;
mod mailbox;
mod pdo;
mod profile;
mod slots;

use std::collections::HashMap;
use std::sync::Arc;

use roxmltree::{Document, Node};

use super::element::{Element, File};
use super::error::{COMPANIONS, EsiError, EsiProblem};
use super::limits::{MAX_ATTRIBUTE_BYTES, MAX_DEVICES, MAX_TEXT_BYTES};
use super::model::{Device, Dictionary, Esi, Group, Reference, Vendor};
use super::schema;
use crate::xml::{self, is_cipher, is_signature, shown};

/// The model of a file with devices (root `EtherCATInfo`) or modules (root `EtherCATModule`).
pub(super) fn parse(name: &str, text: &str) -> Result<Esi, EsiError> {
    let document = document(name, text)?;
    let file = File::new(name, text);
    let element = Element::new(document.root_element(), &file);
    let mut esi = root(element)?;
    schema::check(element);
    esi.file = name.to_owned();
    let shared: Arc<str> = name.into();
    esi.modules.iter_mut().for_each(|module| module.file = Arc::clone(&shared));
    esi.notices = file.into_notices().into_list();
    Ok(esi)
}

/// The dictionary of a file with the root `EtherCATDict`.
pub(super) fn dictionary(name: &str, text: &str) -> Result<Dictionary, EsiError> {
    let document = document(name, text)?;
    let file = File::new(name, text);
    let root = Element::new(document.root_element(), &file);
    if root.name() != "EtherCATDict" {
        return Err(root.error(EsiProblem::WrongFile { kind: format!("a file with the root {}", shown(root.name())) }));
    }
    let dictionary = dictionary::dictionary(root.required("Dictionary")?)?;
    Ok(Dictionary { file: Some(name.into()), ..dictionary })
}

fn document<'a>(name: &str, text: &'a str) -> Result<Document<'a>, EsiError> {
    let of_xml = |error| EsiError::of_xml(name, error, text.as_bytes());
    xml::check(text).map_err(of_xml)?;
    let document = xml::parse(text).map_err(of_xml)?;
    let too_long = |node: &Node<'_, '_>| match node.text() {
        Some(text) if node.is_text() && text.len() > MAX_TEXT_BYTES => Some(("bytes of a text", MAX_TEXT_BYTES)),
        _ if node.attributes().any(|attribute| attribute.value().len() > MAX_ATTRIBUTE_BYTES) => {
            Some(("bytes of an attribute", MAX_ATTRIBUTE_BYTES))
        }
        _ => None,
    };
    let found = document.descendants().find_map(|node| too_long(&node).map(|limit| (node, limit)));
    if let Some((node, (what, limit))) = found {
        let file = File::new(name, text);
        let node = node.ancestors().find(Node::is_element).unwrap_or(document.root_element());
        return Err(Element::new(node, &file).error(EsiProblem::TooMuch { what, limit }));
    }
    Ok(document)
}

/// What elements of encryption, at any level, or of a signature make of a file (protocol ES-153).
fn protection(root: Element<'_>) -> Option<&'static str> {
    if root.names_below().any(is_cipher) {
        return Some("an encrypted file (XML encryption)");
    }
    let is_signed = is_signature(root.name()) || root.all().any(|child| is_signature(child.name()));
    is_signed.then_some("a signed file (an XML signature, which RingCAT cannot check)")
}

fn root(root: Element<'_>) -> Result<Esi, EsiError> {
    let version = root.attribute("Version").map(str::to_owned);
    if let Some(kind) = protection(root) {
        return Err(root.error(EsiProblem::WrongFile { kind: kind.to_owned() }));
    }
    match root.name() {
        "EtherCATInfo" => {}
        "EtherCATModule" => {
            let vendor = root.child("Vendor").map(vendor).transpose()?.unwrap_or_default();
            let modules = modules(root, vendor.id)?;
            return Ok(Esi { version, vendor, modules, ..Esi::default() });
        }
        other => return Err(root.error(EsiProblem::WrongFile { kind: kind(other) })),
    }
    let vendor = vendor(root.required("Vendor")?)?;
    let descriptions = root.required("Descriptions")?;
    let references = root.children("InfoReference");
    let references = references.map(|it| Reference { line: it.line(), path: it.raw().trim().to_owned() }).collect();
    let groups = descriptions.child("Groups").into_iter().flat_map(|groups| groups.children("Group"));
    let groups: Vec<Group> = groups.map(group).collect::<Result<_, _>>()?;
    let devices = devices(descriptions, vendor.id)?;
    note_groups(descriptions, &groups, &devices);
    let modules = modules(descriptions, vendor.id)?;
    Ok(Esi { version, vendor, groups, devices, modules, references, ..Esi::default() })
}

/// The kind of a file with another root.
fn kind(root: &str) -> String {
    if let Some((_, kind)) = COMPANIONS.iter().find(|(companion, _)| *companion == root) {
        return (*kind).to_owned();
    }
    match root {
        "EtherCATConfig" => "a network configuration (ENI), which `ringcat eni` reads".to_owned(),
        "EtherCATInfoList" => "a list that `ethercat xml` prints".to_owned(),
        other => format!("an XML file with the root {}", shown(other)),
    }
}

fn vendor(element: Element<'_>) -> Result<Vendor, EsiError> {
    let id = element.required_number("Id")?;
    let file_version = element.number_in("FileVersion")?;
    Ok(Vendor { id, name: element.names("Name")?, file_version })
}

fn group(element: Element<'_>) -> Result<Group, EsiError> {
    Ok(Group {
        line: element.line(),
        key: element.text_of("Type"),
        name: element.names("Name")?,
        parent: element.attribute("ParentGroup").map(str::to_owned),
        sort_order: element.number_in("SortOrder")?,
    })
}

/// Adds a notice for a second group with the same key, and for each key without a group, once (protocol ES-15).
fn note_groups(descriptions: Element<'_>, groups: &[Group], devices: &[Device]) {
    let mut lines: HashMap<&str, u32> = HashMap::new();
    for group in groups {
        if let Some(line) = lines.get(group.key.trim()) {
            let text = format!("Group {} is defined in line {line} already: not used", shown(group.key.trim()));
            descriptions.note_at(group.line, text);
        } else {
            lines.insert(group.key.trim(), group.line);
        }
    }
    for device in devices {
        let key = device.group.trim();
        if !key.is_empty() && !lines.contains_key(key) {
            descriptions.note_at(device.line, format!("GroupType {}: there is no such group", shown(key)));
            lines.insert(key, device.line);
        }
    }
}

fn devices(descriptions: Element<'_>, vendor_id: u32) -> Result<Vec<Device>, EsiError> {
    let mut devices: Vec<Device> = Vec::new();
    let mut known: HashMap<(u32, u32), u32> = HashMap::new();
    for element in descriptions.child("Devices").into_iter().flat_map(|devices| devices.children("Device")) {
        if devices.len() == MAX_DEVICES {
            return Err(element.error(EsiProblem::TooMuch { what: "devices", limit: MAX_DEVICES }));
        }
        let device = Device { vendor_id, ..device::device(element)? };
        let key = (device.product_code, device.revision);
        // Devices without a controller have no identity.
        if !device.is_invisible
            && let Some(first_line) = known.insert(key, device.line)
        {
            let what = format!("the device with product code {:#010x}, revision {:#010x}", key.0, key.1);
            return Err(element.error(EsiProblem::Duplicate { what, first_line }));
        }
        devices.push(device);
    }
    Ok(devices)
}

fn modules(parent: Element<'_>, vendor_id: u32) -> Result<Vec<super::model::Module>, EsiError> {
    let mut modules: Vec<super::model::Module> = Vec::new();
    let mut known: HashMap<u32, u32> = HashMap::new();
    for element in parent.child("Modules").into_iter().flat_map(|modules| modules.children("Module")) {
        if modules.len() == MAX_DEVICES {
            return Err(element.error(EsiProblem::TooMuch { what: "modules", limit: MAX_DEVICES }));
        }
        let module = slots::module(element, vendor_id)?;
        if let Some(first_line) = known.insert(module.ident, module.line) {
            let what = format!("the module with ident {:#010x}", module.ident);
            return Err(element.error(EsiProblem::Duplicate { what, first_line }));
        }
        modules.push(module);
    }
    Ok(modules)
}
