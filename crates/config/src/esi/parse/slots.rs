//! Slots and modules (protocol ES-64 to ES-67).

use super::mailbox::{coe, transition};
use super::pdo::pdos;
use super::profile::profiles;
use crate::esi::element::Element;
use crate::esi::error::EsiError;
use crate::esi::model::{AllowedModule, Module, ModuleClass, Slot, SlotDistances, SlotGroupData, Slots, Transition};
use crate::esi::modules::MAX_SLOTS;
use crate::xml::shown;

pub(super) fn slots(element: Element<'_>) -> Result<Slots, EsiError> {
    Ok(Slots {
        line: element.line(),
        distances: distances(element)?,
        most: element.number_in("MaxSlotCount")?,
        download_idents: element.is("DownloadModuleIdentList")?,
        download_transition: download_transition(element),
        download_addresses: element.is("DownloadModuleAddressList")?,
        slots: element.children("Slot").map(slot).collect::<Result<_, _>>()?,
        groups: element.children("SlotGroupData").map(group).collect::<Result<_, _>>()?,
    })
}

/// When the list of modules is written: PS, which an edition prints as SP (protocol ES-70).
fn download_transition(element: Element<'_>) -> Transition {
    let Some(text) = element.attribute("DownloadModuleListTransition") else { return Transition::Ps };
    match transition(text) {
        Some(found @ (Transition::Ip | Transition::Ps | Transition::So)) => found,
        Some(Transition::Sp) => Transition::Ps,
        _ => {
            element.note(format!("DownloadModuleListTransition {}: taken as PS", shown(text)));
            Transition::Ps
        }
    }
}

fn distances(element: Element<'_>) -> Result<SlotDistances, EsiError> {
    Ok(SlotDistances {
        pdo: element.number_in("SlotPdoIncrement")?,
        object: element.number_in("SlotIndexIncrement")?,
        group_pdo: element.number_in("SlotGroupPdoIncrement")?,
        group_object: element.number_in("SlotGroupIndexIncrement")?,
    })
}

fn slot(element: Element<'_>) -> Result<Slot, EsiError> {
    let module = |module: Element<'_>| -> Result<AllowedModule, EsiError> {
        let is_default = module.number_in::<u32>("Default")?.is_some_and(|number| number != 0);
        Ok(AllowedModule { ident: module.number()?, is_default })
    };
    let class = |class: Element<'_>| -> Result<ModuleClass, EsiError> {
        let name = class.text_of("Class").trim().to_owned();
        Ok(ModuleClass { class: name, vendor_id: class.number_of("VendorId")? })
    };
    let least = element.number_in("MinInstances")?.unwrap_or(0);
    if usize::from(least) > MAX_SLOTS {
        element.note(format!("MinInstances {least}: a device has at most {MAX_SLOTS} slots"));
    }
    Ok(Slot {
        line: element.line(),
        name: element.names("Name")?,
        least,
        most: element.number_in("MaxInstances")?.unwrap_or(1),
        group: element.number_in("SlotGroup")?,
        distances: distances(element)?,
        modules: element.children("ModuleIdent").map(module).collect::<Result<_, _>>()?,
        classes: element.children("ModuleClass").map(class).collect::<Result<_, _>>()?,
    })
}

fn group(element: Element<'_>) -> Result<SlotGroupData, EsiError> {
    let pdo_group = |it: Element<'_>| Ok((it.text(), it.number_in("Alignment")?.unwrap_or(8)));
    let pdo_groups = element.children("ModulePdoGroup").map(pdo_group).collect::<Result<_, EsiError>>()?;
    Ok(SlotGroupData { group: element.number_in("SlotGroup")?.unwrap_or(0), pdo_groups })
}

pub(super) fn module(element: Element<'_>, vendor_id: u32) -> Result<Module, EsiError> {
    let kind = element.required("Type")?;
    let coe = element.child("Mailbox").and_then(|mailbox| mailbox.child("CoE")).map(coe).transpose()?;
    Ok(Module {
        line: element.line(),
        kind: kind.text(),
        ident: kind.number_in("ModuleIdent")?.unwrap_or(0),
        class: kind.attribute("ModuleClass").map(|class| class.trim().to_owned()),
        name: element.names("Name")?,
        rx_pdos: pdos(element, "RxPdo")?,
        tx_pdos: pdos(element, "TxPdo")?,
        commands: coe.map(|coe| coe.commands).unwrap_or_default(),
        profiles: profiles(element)?,
        op_mode: element.child("DcOpModeName").map(|name| name.text().trim().to_owned()),
        vendor_id,
        file: "".into(),
    })
}
