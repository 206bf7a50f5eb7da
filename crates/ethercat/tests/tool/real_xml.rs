//! SubDevices of an output of `ethercat xml`, one element a line.

use crate::real_bus::{Pdo, Shown, SyncManager, number};

/// The value of an attribute.
fn attribute<'t>(line: &'t str, name: &str) -> &'t str {
    let (_, rest) = line.split_once(&format!(" {name}=\"")).unwrap_or_else(|| panic!("{name} in {line}"));
    rest.split_once('"').expect("its end").0
}

/// The text of an element that is one line.
fn content(line: &str) -> &str {
    let text = line.split_once('>').expect("its begin").1;
    let text = text.rsplit_once("</").expect("its end").0;
    text.strip_prefix("<![CDATA[").and_then(|text| text.strip_suffix("]]>")).unwrap_or(text)
}

/// All SubDevices up to the last one; those that are not in the list are empty.
pub fn slaves(text: &str) -> Vec<Shown> {
    let mut all: Vec<Shown> = Vec::new();
    let mut in_pdo = InPdo::default();
    for line in text.lines().map(str::trim) {
        if let Some(position) = line.strip_prefix("<!-- Slave ") {
            let position = number(position.trim_end_matches(" -->"));
            all.resize_with(position as usize + 1, Shown::default);
        }
        let Some(own) = all.last_mut() else { continue };
        let element = line.trim_start_matches('<').split([' ', '>']).next().unwrap_or_default();
        match element {
            "Id" => own.identity[0] = number(content(line)),
            "Type" => {
                own.identity[1] = number(attribute(line, "ProductCode"));
                own.identity[2] = number(attribute(line, "RevisionNo"));
                own.order = content(line).to_owned();
            }
            "Sm" => {
                let names = ["StartAddress", "DefaultSize", "ControlByte", "Enable"];
                let [start, length, control, enable] = names.map(|name| number(attribute(line, name)));
                let (start, length, control) = (start as u16, length as u16, control as u8);
                own.sync_managers.push(SyncManager { start, length, control, enable: enable as u8, pdos: Vec::new() });
            }
            "Name" if !in_pdo.is_open => own.name = content(line).to_owned(),
            _ => in_pdo.line(own, element, line),
        }
    }
    all
}

/// The place in an element of a PDO.
#[derive(Default)]
struct InPdo {
    is_open: bool,
    manager: usize,
}

impl InPdo {
    fn line(&mut self, own: &mut Shown, element: &str, line: &str) {
        if let "RxPdo" | "TxPdo" = element {
            (self.is_open, self.manager) = (true, number(attribute(line, "Sm")) as usize);
            let pdo = Pdo { is_output: element == "RxPdo", ..Pdo::default() };
            own.sync_managers[self.manager].pdos.push(pdo);
        } else if let "/RxPdo" | "/TxPdo" = element {
            self.is_open = false;
        }
        if !self.is_open {
            return;
        }
        let pdo = own.sync_managers[self.manager].pdos.last_mut().expect("it is open");
        match (element, pdo.entries.last_mut()) {
            ("Entry", _) => pdo.entries.push((0, 0, 0, String::new())),
            ("Index", None) => pdo.index = number(content(line)) as u16,
            ("Index", Some(entry)) => entry.0 = number(content(line)) as u16,
            ("SubIndex", Some(entry)) => entry.1 = number(content(line)) as u8,
            ("BitLen", Some(entry)) => entry.2 = number(content(line)) as u8,
            ("Name", None) => pdo.name = content(line).to_owned(),
            ("Name", Some(entry)) => entry.3 = content(line).to_owned(),
            _ => {}
        }
    }
}
