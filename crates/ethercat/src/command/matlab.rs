//! PDOs as a function of MATLAB, as `pdos --skin etherlab` prints them.

use ringcat_control::is_hidden;
use ringcat_control::tool::{Description, SyncManagerLine};

use crate::append::append;
use crate::selection::Slave;

/// The function of one SubDevice.
pub fn function(master: u32, slave: &Slave, details: &Description) -> String {
    let position = slave.line.position;
    let order: String =
        slave.line.order.chars().map(|it| if it.is_control() || is_hidden(it) { ' ' } else { it }).collect();
    let [vendor, product, ..] = slave.line.identity;
    let mut text =
        format!("%\n% Master {master}, Slave {position}, \"{order}\"\n%\nfunction rv = slave{position}()\n\n");
    append!(text, "% Slave configuration\n\nrv.SlaveConfig.vendor = {vendor};\n");
    append!(text, "rv.SlaveConfig.product = hex2dec('{product:08x}');\n");
    append!(text, "rv.SlaveConfig.description = '{}';\nrv.SlaveConfig.sm = {{ ...\n", order.replace('\'', "''"));
    for (number, own) in details.sync_managers.iter().enumerate() {
        text += &sync_manager(number, own);
    }
    text += "    };\n\n% Port configuration\n\n";
    text + &ports(details) + "end\n"
}

fn direction(own: &SyncManagerLine) -> u8 {
    if own.is_output { 0 } else { 1 }
}

fn sync_manager(number: usize, own: &SyncManagerLine) -> String {
    let mut text = format!("    {{{number}, {}, {{\n", direction(own));
    for pdo in &own.pdos {
        append!(text, "        {{hex2dec('{:04x}'), [\n", pdo.index);
        for entry in &pdo.entries {
            let (index, sub_index, bits) = (entry.index, entry.sub_index, entry.bits);
            append!(text, "            hex2dec('{index:04x}'), hex2dec('{sub_index:02x}'), {bits:>3}; ...\n");
        }
        text += "            ]}, ...\n";
    }
    text + "        }}, ...\n"
}

/// Entries as ports: inputs of the SubDevice are inputs of its block. Gaps have no port.
fn ports(details: &Description) -> String {
    let (mut text, mut inputs, mut outputs) = (String::new(), 0, 0);
    for (number, own) in details.sync_managers.iter().enumerate() {
        for (pdo_number, pdo) in own.pdos.iter().enumerate() {
            for (entry_number, entry) in pdo.entries.iter().enumerate().filter(|(_, entry)| entry.index != 0) {
                let (kind, count) = if own.is_output { ("input", &mut inputs) } else { ("output", &mut outputs) };
                *count += 1;
                let port = format!("rv.PortConfig.{kind}({count})");
                append!(text, "{port}.pdo = [{number}, {pdo_number}, {entry_number}, 0];\n");
                append!(text, "{port}.pdo_data_type = {};\n\n", 1000 + u16::from(entry.bits));
            }
        }
    }
    text
}
