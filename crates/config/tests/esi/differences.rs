//! What a SubDevice of the bus and its description say differently.

use std::time::Duration;

use ringcat_config::esi::{Choices, select};
use ringcat_config::network::model::SubDevice;

use crate::reading::acme;

const ANALOG: usize = 2;

// covers: esi-declare, ES-40, ES-47
#[test]
fn differences_of_a_subdevice_to_its_description_are_named_once_each() {
    let esi = acme();
    let device = &esi.devices[ANALOG];
    let choices = Choices::default();
    let selection = select(&esi, device, &choices).unwrap_or_else(|error| panic!("{error}"));
    let from =
        SubDevice::from_esi(&selection, Duration::from_millis(1), 1033).unwrap_or_else(|error| panic!("{error}"));
    let mut subdevice = from.subdevice;
    assert_eq!(subdevice.differences_to_esi(device), Vec::<String>::new(), "it was made of it");
    subdevice.revision = Some(0x0012_0000);
    subdevice.mailbox.as_mut().expect("it has one").read.length = 64;
    let pdo = |subdevice: &mut SubDevice, index: u16, change: fn(&mut Vec<ringcat_config::network::model::Entry>)| {
        let mut pdos = subdevice.sync_manager.iter_mut().flat_map(|sm| &mut sm.pdo);
        let found = pdos.find(|pdo| pdo.index == index).expect("it is assigned");
        change(found.entries.as_mut().expect("they are declared"));
    };
    pdo(&mut subdevice, 0x1A00, |entries| entries[2].bits = 32);
    pdo(&mut subdevice, 0x1A02, |entries| drop(entries.pop()));
    let expected = [
        "revision 0x00120000, the description is of 0x00110000",
        "64 bytes of read mailbox at 0x1080, in the description 128 at 0x1080",
        "PDO 0x1a00: entry 3 is 0x6000:11 with 32 bits, in the description 0x6000:11 with 16 bits",
        "PDO 0x1a02: entry 1 is none, in the description 0x6010:11 with 16 bits",
    ];
    assert_eq!(subdevice.differences_to_esi(device), expected);
}
