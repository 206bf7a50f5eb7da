//! ENI files and any bytes (protocol 8): every file gives a consistent configuration or an error.
//!
//! [`mutate`] makes typical changes of a file: other numbers, half a datagram, elements that are removed, duplicated or
//! moved. Random bytes would seldom be valid XML.

use ringcat::SubDeviceId;
use ringcat::eni::EniFile;
use ringcat_config::eni;
use ringcat_config::{Configuration, follow};
use ringcat_engine::info::Direction;

use crate::dice::Dice;

/// An own file with all elements.
pub const WHOLE: &str = include_str!("../../../config/tests/files/small.xml");
/// A hot connect group, commands without many of their parts, values at edges.
pub const GROUP: &str = include_str!("../../../config/tests/files/group.xml");
/// Groups by data words and a switch, commands of each protocol, at each transition and for the whole bus.
pub const COMMANDS: &str = include_str!("../../../config/tests/files/commands.xml");

/// Reads and follows a file; the result must be consistent, and building a segment from it must not panic.
pub fn target(bytes: &[u8]) {
    let _ = is_followed(bytes);
}

/// The same; returns whether the file could be followed.
pub fn is_followed(bytes: &[u8]) -> bool {
    let configuration = match eni::read(bytes).and_then(|model| follow(&model)) {
        Ok(configuration) => configuration,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            return false;
        }
    };
    holds_together(&configuration);
    let file = EniFile::from_bytes(bytes).expect("what is followed can be loaded");
    let _ = file.simulated(false).map(|_| ());
    true
}

/// Every index in a configuration refers to an existing element.
fn holds_together(configuration: &Configuration) {
    let (declaration, image) = (&configuration.declaration, &configuration.image);
    let count = declaration.subdevices.len();
    assert_eq!(configuration.subdevices.len(), count);
    let members = declaration.domains.iter().flat_map(|domain| &domain.members).map(|member| member.subdevice);
    let by_lrw = declaration.explicit_lrw.iter().flat_map(|lrw| lrw.subdevices.iter().copied());
    let plugged =
        configuration.subdevices.iter().filter_map(|facts| facts.plugged_into).map(|(other, _)| SubDeviceId(other));
    assert!(members.chain(by_lrw).chain(plugged).all(|subdevice| subdevice.0 < count));
    for area in &image.areas {
        let room = if area.direction == Direction::Inputs { image.inputs_len } else { image.outputs_len };
        assert!(area.subdevice < count && u64::from(area.image_bit) + u64::from(area.bits) <= room as u64 * 8);
        assert!(area.bits > 0, "{area:?}");
        let declared = declaration.subdevices[area.subdevice].declared.iter().flatten();
        if let Some(sm) = declared.into_iter().find(|sm| Some(sm.index) == area.sync_manager) {
            assert!(area.bit_offset + area.bits <= u32::from(sm.register.length) * 8, "{area:?}");
        }
    }
    for copy in &image.copies {
        let (source, target) = (&image.areas[copy.source_area], &image.areas[copy.target_area]);
        assert_eq!((source.direction, target.direction), (Direction::Inputs, Direction::Outputs));
        assert!(
            copy.bits > 0 && copy.source_bit + copy.bits <= source.bits && copy.target_bit + copy.bits <= target.bits
        );
    }
    assert!(image.variables.iter().filter_map(|variable| variable.subdevice).all(|subdevice| subdevice < count));
    for notice in &configuration.notices {
        assert!(notice.times > 0 && !notice.to_string().is_empty());
        assert!(notice.subdevices.iter().all(|subdevice| *subdevice < count));
    }
}

/// Boundary values of readers.
const VALUES: [&str; 20] = [
    "0",
    "1",
    "2",
    "7",
    "15",
    "255",
    "256",
    "1001",
    "1002",
    "65535",
    "65536",
    "4294967295",
    "4294967296",
    "-1",
    "0xff",
    "#x",
    "",
    "00",
    "ffffffff",
    "true",
];

/// Changes a file in one to three places.
pub fn mutate(text: &str, dice: &mut Dice) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=dice.below(3) {
        let at = dice.below(lines.len() as u64) as usize;
        match dice.below(8) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[dice.below(lines.len() as u64) as usize].clone()),
            2 => {
                let other = dice.below(lines.len() as u64) as usize;
                lines.swap(at, other);
            }
            3 => lines[at] = with_other_digit(&lines[at], dice),
            _ => lines[at] = with_other_value(&lines[at], dice),
        }
        if lines.is_empty() {
            break;
        }
    }
    lines.join("\n")
}

/// One of the values of a line becomes another one.
fn with_other_value(line: &str, dice: &mut Dice) -> String {
    let begins: Vec<usize> = line.match_indices('>').map(|(at, _)| at + 1).filter(|at| *at < line.len()).collect();
    if begins.is_empty() {
        return line.to_owned();
    }
    let begin = *dice.pick(&begins);
    let end = line[begin..].find('<').map_or(line.len(), |end| begin + end);
    format!("{}{}{}", &line[..begin], dice.pick(&VALUES), &line[end..])
}

/// A hexadecimal digit becomes another one.
fn with_other_digit(line: &str, dice: &mut Dice) -> String {
    let digits: Vec<usize> = line.match_indices(|c: char| c.is_ascii_hexdigit()).map(|(at, _)| at).collect();
    if digits.is_empty() {
        return line.to_owned();
    }
    let at = *dice.pick(&digits);
    format!("{}{:x}{}", &line[..at], dice.below(16), &line[at + 1..])
}
