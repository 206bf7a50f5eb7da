//! A simulated device from a description: the SII image as a tool writes it, the PDOs (also those of modules, and those
//! without room in the image), the object dictionary with its defaults.

use std::collections::BTreeSet;

use ringcat_config::esi::sii::{SiiOptions, SiiProfile, build, code_of};
use ringcat_config::esi::{Device, Esi, Pdo, PlacedModule, SyncManagerRole, place_modules};
use ringcat_sim::description::{DeviceDescription, PdoDescription, PdoEntryDescription};
use ringcat_wire::mailbox::coe::pdo_objects::{RX_MAPPINGS, TX_MAPPINGS};
use ringcat_wire::sii::{Pdo as SiiPdo, PdoDirection};

use super::objects;

/// Bits of a part of an entry that is too long for the format.
const PART: u16 = 248;

/// The device with its modules; the error is a message.
pub(super) fn describe(
    esi: &Esi,
    device: &Device,
    modules: &[Option<String>],
    name: &str,
) -> Result<DeviceDescription, String> {
    let placed = place_modules(esi, device, modules).map_err(|error| error.to_string())?;
    let with = |without_pdos: bool| {
        let mut options = SiiOptions::of(SiiProfile::TwinCat, 1033);
        options.without_pdos = without_pdos;
        // The modes of a clock need the factor, independent of the tool.
        options.sync1_factor = true;
        build(esi, device, &options)
    };
    // TwinCAT does the same with an image that is too large.
    let (image, has_pdos) = match with(false) {
        Ok(image) => (image, true),
        Err(_) => (with(true).map_err(|error| error.to_string())?, false),
    };
    let image = DeviceDescription::from_sii(image.bytes, name);
    let mut description = image.map_err(|error| format!("{}: {}: {error}", esi.file, device.kind.trim()))?;
    if !has_pdos {
        description.pdos = of_device(device);
    }
    add_modules(device, &placed, &mut description)?;
    let objects = objects::objects(esi, device, &placed, &description.pdos)?;
    (description.objects, description.described) = (objects.plain, objects.derived);
    description.controller_fmmus = device.info.fmmu_count.filter(|count| *count > 0);
    Ok(description)
}

/// PDOs of the description, if the image has none.
fn of_device(device: &Device) -> Vec<PdoDescription> {
    let rx = device.rx_pdos.iter().map(|pdo| described(device, pdo, PdoDirection::Rx));
    rx.chain(device.tx_pdos.iter().map(|pdo| described(device, pdo, PdoDirection::Tx))).collect()
}

/// A PDO; it is assigned only to a SyncManager of its direction.
fn described(device: &Device, pdo: &Pdo, direction: PdoDirection) -> PdoDescription {
    let wanted = match direction {
        PdoDirection::Rx => SyncManagerRole::Outputs,
        PdoDirection::Tx => SyncManagerRole::Inputs,
    };
    let fits = |number: &u8| device.sync_managers.get(usize::from(*number)).is_some_and(|sm| sm.role == wanted);
    PdoDescription {
        direction,
        index: pdo.index.index,
        name: pdo.name.english().to_owned(),
        sync_manager: pdo.sync_manager.filter(fits),
        flags: if pdo.is_fixed { SiiPdo::FIXED } else { 0 },
        entries: pdo.entries.iter().flat_map(entry).collect(),
    }
}

/// An entry; an entry of more than 255 bits is split into several parts.
fn entry(of: &ringcat_config::esi::PdoEntry) -> Vec<PdoEntryDescription> {
    let part = |index, sub_index, bits: u16| PdoEntryDescription {
        index,
        sub_index,
        name: of.name.english().to_owned(),
        data_type: code_of(&of.data_type).and_then(|code| u8::try_from(code).ok()).unwrap_or(0),
        bit_length: bits as u8,
    };
    if of.bit_length <= u8::MAX.into() {
        return vec![part(of.index.index, of.sub_index, of.bit_length)];
    }
    let parts = (0..of.bit_length).step_by(PART.into());
    parts.map(|begin| part(0, 0, (of.bit_length - begin).min(PART))).collect()
}

/// Adds the PDOs of the modules behind those of the device, and removes placeholders of missing PDOs.
fn add_modules(
    device: &Device,
    placed: &[PlacedModule<'_>],
    description: &mut DeviceDescription,
) -> Result<(), String> {
    let mut added = Vec::new();
    for module in placed {
        for (pdos, direction) in
            [(&module.module.rx_pdos, PdoDirection::Rx), (&module.module.tx_pdos, PdoDirection::Tx)]
        {
            let pdos = module.pdos(pdos).map_err(|error| error.to_string())?;
            added.extend(pdos.iter().map(|pdo| described(device, pdo, direction)));
        }
    }
    if !added.is_empty() {
        let of_file = |index: u16| device.rx_pdos.iter().chain(&device.tx_pdos).any(|pdo| pdo.index.index == index);
        let is_new = |index: u16| added.iter().any(|pdo| pdo.index == index);
        description.pdos.retain(|pdo| of_file(pdo.index) && !is_new(pdo.index));
        description.pdos.extend(added);
    }
    add_copies(device, description);
    Ok(())
}

/// Bytes that the copies of PDOs of a device may take together, with their names.
const COPIES: usize = 16 << 20;

/// Adds the copies of PDOs with oversampling (protocol ES-47), as many as may be assigned and have room. No copy is
/// assigned by default.
fn add_copies(device: &Device, description: &mut DeviceDescription) {
    let modes = device.clock.iter().flat_map(|clock| &clock.modes).flat_map(|mode| &mode.sync_managers);
    let of_modes: Vec<(u16, u32)> =
        modes.flat_map(|sm| &sm.pdos).filter_map(|(index, factor)| Some((*index, (*factor)?))).collect();
    let mut indices_used: BTreeSet<u16> = description.pdos.iter().map(|pdo| pdo.index).collect();
    let mut room = COPIES;
    for pdo in device.rx_pdos.iter().chain(&device.tx_pdos) {
        let Some([default, _, most, distance]) = pdo.oversampling else { continue };
        let Some(own) = description.pdos.iter().find(|it| it.index == pdo.index.index).cloned() else { continue };
        let range = match own.direction {
            PdoDirection::Rx => RX_MAPPINGS,
            PdoDirection::Tx => TX_MAPPINGS,
        };
        let listed = of_modes.iter().filter(|(index, _)| *index == own.index).map(|(_, factor)| *factor);
        let count = listed.chain([default, most]).max().unwrap_or(1);
        let indices = (1..count).map_while(|copy| copy.checked_mul(distance)?.checked_add(own.index.into()));
        let indices = indices.map_while(|index| u16::try_from(index).ok().filter(|index| range.contains(index)));
        // With a distance of 0 the first copy has the index of the PDO itself; above 0 no index repeats.
        for index in indices.take_while(|index| *index != own.index) {
            if indices_used.insert(index) {
                let Some(left) = room.checked_sub(size(&own)) else { return };
                room = left;
                description.pdos.push(PdoDescription { index, sync_manager: None, ..own.clone() });
            }
        }
    }
}

/// Bytes of a PDO in memory.
fn size(pdo: &PdoDescription) -> usize {
    let entries = pdo.entries.iter().map(|entry| size_of_val(entry) + entry.name.len());
    size_of_val(pdo) + pdo.name.len() + entries.sum::<usize>()
}

#[cfg(test)]
mod tests {
    use ringcat_config::esi::read;

    use super::*;

    /// Objects with a value of 64 KiB each, from an index on.
    fn profile(first: u32, objects: u32) -> String {
        let object = |index: u32| {
            format!("<Object><Index>{index}</Index><Name>o</Name><Type>T</Type><BitSize>524288</BitSize></Object>\n")
        };
        let objects: String = (first..first + objects).map(object).collect();
        format!("<Profile><Dictionary><Objects>\n{objects}</Objects></Dictionary></Profile>")
    }

    /// A device with objects, and a module with more of them in its slot.
    fn described(own: u32, of_module: u32) -> Result<DeviceDescription, String> {
        let device = format!(
            "<Device Physics=\"YY\"><Type ProductCode=\"1\" RevisionNo=\"1\">A1</Type><Name>n</Name>{}<Slots>\
             <Slot MaxInstances=\"1\" MinInstances=\"1\"><Name>s</Name><ModuleIdent>7</ModuleIdent></Slot>\
             </Slots></Device>",
            profile(0x2000, own)
        );
        let profile = profile(0x3000, of_module);
        let module = format!("<Module><Type ModuleIdent=\"7\">M1</Type><Name>m</Name>{profile}</Module>");
        let text = format!(
            "<EtherCATInfo><Vendor><Id>71</Id></Vendor><Descriptions><Groups/><Devices>{device}</Devices>\
             <Modules>{module}</Modules></Descriptions></EtherCATInfo>"
        );
        let esi = read("acme.xml", text.as_bytes()).expect("a description");
        describe(&esi, &esi.devices[0], &[], "a")
    }

    // covers: esi-use, ES-47
    #[test]
    fn copies_by_oversampling_are_in_the_device_and_not_assigned_by_default() {
        let of = |attributes: &str, mode: &str| {
            let text = format!(
                "<EtherCATInfo><Vendor><Id>71</Id></Vendor><Descriptions><Groups/><Devices><Device Physics=\"YY\">\
                 <Type ProductCode=\"1\" RevisionNo=\"1\">A1</Type><Name>n</Name>\
                 <Sm StartAddress=\"#x1100\" ControlByte=\"#x20\" Enable=\"1\">Inputs</Sm>\
                 <TxPdo Sm=\"0\" {attributes}><Index>#x1A00</Index><Name>s</Name><Entry><Index>#x6000</Index>\
                 <SubIndex>1</SubIndex><BitLen>16</BitLen><Name>v</Name><DataType>INT</DataType></Entry></TxPdo>\
                 <TxPdo><Index>#x1A10</Index><Name>t</Name></TxPdo>{mode}</Device></Devices></Descriptions>\
                 </EtherCATInfo>"
            );
            let esi = read("acme.xml", text.as_bytes()).expect("a description");
            let device = describe(&esi, &esi.devices[0], &[], "a").expect("a device");
            let shown = device.pdos.iter().map(|pdo| (pdo.index, pdo.sync_manager, pdo.entries.len()));
            shown.collect::<Vec<_>>()
        };
        let plain = [(0x1A00, Some(0), 1), (0x1A10, None, 0)];
        let copies = [(0x1A20, None, 1), (0x1A30, None, 1)];
        let sampled = "OSFac=\"2\" OSMin=\"1\" OSMax=\"4\" OSIndexInc=\"16\"";
        assert_eq!(of("", ""), plain);
        assert_eq!(of(sampled, ""), [&plain[..], &copies].concat(), "0x1a10 is a PDO of its own");
        let mode = "<Dc><OpMode><Name>D</Name><AssignActivate>0</AssignActivate><Sm No=\"0\"><Pdo OSFac=\"5\">#x1A00\
                    </Pdo></Sm></OpMode></Dc>";
        assert_eq!(of(sampled, mode), [&plain[..], &copies, &[(0x1A40, None, 1)]].concat());
        assert_eq!(of(&sampled.replace("\"16\"", "\"0\""), ""), plain);
        let many = of(&sampled.replace("\"4\"", "\"4294967295\"").replace("\"16\"", "\"1\""), "");
        assert_eq!((many.len(), many.last()), (0x200, Some(&(0x1BFF, None, 1))));
    }

    // covers: esi-use, ES-72
    #[test]
    fn a_device_and_its_modules_have_room_for_values_together() {
        let room = "too much for a device description: more than 16777216 bytes of values and names of the objects \
                    of a device with its modules";
        assert_eq!(described(120, 120).map(|it| it.objects.len()), Ok(240));
        assert_eq!(described(300, 0).map(|_| ()), Err(format!("acme.xml:257: device \"A1\": {room}")));
        assert_eq!(described(120, 200).map(|_| ()), Err(format!("acme.xml:258: device \"M1\": {room}")));
    }
}
