//! `ringcat scan --pdos`: the PDOs of a SubDevice with their entries, as lines and as keys of JSON.

use ringcat::config::ObjectNames;
use ringcat::config::esi::sii::name_of;
use ringcat::{Direction, SubDeviceInfo};

use crate::json::scan::{Pdo, PdoEntry};

/// All PDOs, with the names that the SubDevice has itself, else those of its description.
pub fn json(info: &SubDeviceInfo, names: &ObjectNames) -> Vec<Pdo> {
    let or = |own: &str, name: Option<&str>| match own.trim() {
        "" => name.unwrap_or_default().to_owned(),
        own => own.to_owned(),
    };
    let pdo = |pdo: &ringcat::PdoInfo| {
        let entries = pdo.entries.iter().map(|it| PdoEntry {
            index: it.index,
            sub_index: it.sub_index,
            bits: it.bit_length,
            data_type: if it.index == 0 { String::new() } else { name_of(it.data_type.into()) },
            name: if it.index == 0 { String::new() } else { or(&it.name, names.entry(it.index, it.sub_index)) },
        });
        Pdo {
            index: pdo.index,
            direction: match pdo.direction {
                Direction::Outputs => "outputs",
                Direction::Inputs => "inputs",
            },
            sync_manager: pdo.sync_manager,
            name: or(&pdo.name, names.object(pdo.index)),
            entries: entries.collect(),
        }
    };
    info.pdos.iter().map(pdo).collect()
}

/// A line for the SubDevice, for each PDO and each entry; nothing without PDOs.
pub fn lines(info: &SubDeviceInfo, pdos: &[Pdo]) -> Vec<String> {
    if pdos.is_empty() {
        return Vec::new();
    }
    let mut lines = vec![format!("position {} \"{}\"", info.position, info.name.escape_debug())];
    for pdo in pdos {
        let place = pdo.sync_manager.map_or_else(|| "not assigned".to_owned(), |number| format!("SM {number}"));
        lines.push(format!("  {:<7} PDO {:#06x}  {place}  {}", pdo.direction, pdo.index, pdo.name.escape_debug()));
        for entry in &pdo.entries {
            let bits = if entry.bits == 1 { "1 bit".to_owned() } else { format!("{} bits", entry.bits) };
            lines.push(match entry.index {
                0 => format!("    gap        {bits}"),
                index => {
                    let PdoEntry { sub_index, data_type, name, .. } = entry;
                    format!("    {index:#06x}:{sub_index:02x}  {bits:<8}  {data_type:<8}  {}", name.escape_debug())
                }
            });
        }
    }
    for line in &mut lines {
        line.truncate(line.trim_end().len());
    }
    lines
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use clap::Parser;
    use ringcat::esi::load_segment;
    use ringcat::sim::network::Network;
    use ringcat::simulated::SimulatedSegment;
    use ringcat::{MainDevice, Options};

    use super::*;
    use crate::descriptions::{EsiArgument, complete};

    const FILES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../config/tests/files");

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        esi: EsiArgument,
    }

    /// A terminal whose EEPROM lacks names that its description has.
    struct Place(PathBuf);

    impl Place {
        fn new() -> Place {
            let place = std::env::temp_dir().join(format!("ringcat-scan-pdos-{}", std::process::id()));
            fs::create_dir_all(place.join("modules")).unwrap();
            let modules = "modules/acme-modules.xml";
            fs::copy(format!("{FILES}/{modules}"), place.join(modules)).unwrap();
            let text = fs::read_to_string(format!("{FILES}/acme.xml")).unwrap();
            let bare = text
                .replace("<Name>AA02 2Ch. Analog Input</Name>", "<Name></Name>")
                .replace("<Name>AI Channel 2</Name>", "<Name></Name>")
                .replace("<Name>Value</Name>", "<Name></Name>");
            assert_ne!(bare, text);
            fs::write(place.join("bare.xml"), bare).unwrap();
            fs::write(place.join("bus.toml"), "[[device]]\nesi = \"bare.xml\"\ntype = \"AA02\"\n").unwrap();
            Place(place)
        }
    }

    impl Drop for Place {
        fn drop(&mut self) {
            let _ = fs::remove_dir_all(&self.0);
        }
    }

    fn listed(found: &mut [SubDeviceInfo], options: &[&str]) -> Vec<String> {
        let line = Line::parse_from([&["ringcat"], options].concat());
        let names = complete(line.esi.open().unwrap().as_mut(), found, &[]).unwrap();
        lines(&found[0], &json(&found[0], &names[0]))
    }

    // covers: esi-use
    #[test]
    fn pdos_are_listed_with_names_of_the_eeprom_else_of_the_description() {
        if !std::path::Path::new(FILES).exists() {
            println!("skipped: a package has no descriptions, {FILES} is not there");
            return;
        }
        let place = Place::new();
        let segment = Network::from_description(load_segment(&place.0.join("bus.toml")).unwrap()).unwrap();
        let mut main_device = MainDevice::request(SimulatedSegment::new(segment), &Options::default());
        let mut found = main_device.scan().unwrap().subdevices;
        let without = listed(&mut found.clone(), &[]);
        assert!(without.contains(&"    0x6000:11  16 bits   INT".to_owned()), "{without:#?}");
        let acme = format!("{FILES}/acme.xml");
        let with = listed(&mut found.clone(), &["--esi", &acme]);
        assert_eq!(with.len(), without.len());
        for line in
            ["    0x6000:11  16 bits   INT       Value", "    0x6000:01  1 bit     BOOL      Status__Underrange"]
        {
            assert!(with.contains(&line.to_owned()), "{line}: {with:#?}");
        }
        assert!(with.iter().any(|line| line.ends_with("PDO 0x1a02  SM 3  AI Channel 2")), "{with:#?}");
        assert!(with.iter().all(|line| line.chars().count() <= 80), "{with:#?}");
        let vendor = found[0].identity.vendor_id;
        found[0].identity.vendor_id = vendor + 1;
        assert_eq!(listed(&mut found, &["--esi", &acme]), without, "no description of this vendor");
        assert!(Line::parse_from(["ringcat", "--esi", "/no-such"]).esi.open().is_err());
    }
}
