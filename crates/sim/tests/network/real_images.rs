//! Devices from the EEPROM images of real devices, if `../shared/data` exists beside the repository.

use std::path::{Path, PathBuf};

use ringcat_sim::cable::HostLink::Main;
use ringcat_sim::network::Network;
use ringcat_sim::segment::Segment;
use ringcat_wire::address::Position;
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::frame::Frame;
use ringcat_wire::register::map;
use ringcat_wire::sii::Sii;

use crate::wiring::{SETTLE, command};

/// Bytes of a usual controller's `SII_DATA`.
const READ: usize = 8;

fn images() -> Option<(PathBuf, Vec<String>)> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/sii");
    let Ok(entries) = std::fs::read_dir(&directory) else {
        println!("skipped: {} is not there", directory.display());
        return None;
    };
    let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
    let mut names: Vec<String> = names.filter(|name| name.ends_with(".bin")).collect();
    names.sort();
    Some((directory, names))
}

/// Sends a datagram to the first device and returns its data and working counter.
fn exchange(
    network: &mut Network,
    with: Command,
    register: ringcat_wire::address::RegisterAddress,
    data: &[u8],
) -> (Vec<u8>, u16) {
    network.send(Main, &command(with, Target::Position(Position(0), register), data));
    network.advance_by(SETTLE);
    let received = network.receive(Main).unwrap();
    let frame = Frame::parse(&received.bytes).unwrap();
    let datagram = frame.datagrams().next().unwrap();
    (datagram.data.to_vec(), datagram.wkc.0)
}

/// Reads eight bytes of EEPROM over the wire.
fn read_sii(network: &mut Network, word: u32) -> Vec<u8> {
    let [a, b, c, d] = word.to_le_bytes();
    assert_eq!(exchange(network, Command::Apwr, map::SII_CONTROL, &[0x00, 0x01, a, b, c, d]).1, 1);
    let (control, _) = exchange(network, Command::Aprd, map::SII_CONTROL, &[0; 2]);
    assert_eq!(control[1] & 0xE0, 0, "neither busy nor an error");
    exchange(network, Command::Aprd, map::SII_DATA, &[0; READ]).0
}

// covers: sim-files
#[test]
fn a_device_from_a_real_image_returns_this_image_on_the_wire() {
    let Some((directory, names)) = images() else { return };
    let mut made = 0;
    for name in names {
        let image = std::fs::read(directory.join(&name)).unwrap();
        let text = format!("[[device]]\nsii = \"{name}\"\n");
        let segment = match Segment::from_toml(&text, &directory) {
            Ok(segment) => segment,
            Err(error) => {
                println!("refused: {error}");
                assert!(Sii::parse(&image).is_err(), "{name}: {error}");
                continue;
            }
        };
        let mut network = Network::from_description(segment).unwrap();
        network.advance_by(SETTLE);
        for word in [0, 4, 8, 12, 24, 60] {
            let at = word as usize * 2;
            assert_eq!(read_sii(&mut network, word), image[at..at + READ], "{name}, word {word}");
        }
        made += 1;
    }
    assert!(made >= 30, "{made} devices from real images");
}
