//! Errors and notices about a SubDevice of a file: names of SubDevices, elements and commands.

use ringcat_wire::command::Command;

use crate::eni::{Contradiction, Eni, EniError, Place, Problem, quoted};

/// An error about a SubDevice or a part of it.
pub(super) fn contradiction(
    eni: &Eni,
    subdevice: usize,
    place: Place,
    what: impl Into<String>,
    expected: impl Into<String>,
    got: impl Into<String>,
    hint: &str,
) -> EniError {
    let contradiction =
        Contradiction { what: what.into(), expected: expected.into(), got: got.into(), hint: hint.to_owned() };
    let problem = Problem::Contradiction(Box::new(contradiction));
    EniError { place: Some(place), element: label(eni, subdevice), problem }
}

/// A SubDevice in messages: `Slave 2 "EL2008" (PhysAddr 1002)`.
pub(super) fn label(eni: &Eni, subdevice: usize) -> String {
    let number = subdevice + 1;
    let Some(found) = eni.subdevices.get(subdevice) else { return format!("Slave {number}") };
    let station = found.station.map(|station| format!(" (PhysAddr {station})")).unwrap_or_default();
    format!("Slave {number} {}{station}", quoted(&found.name))
}

/// An element with its comment, for messages.
pub(super) fn named(element: &str, comment: &str) -> String {
    if comment.is_empty() { element.to_owned() } else { format!("{element} {}", quoted(comment)) }
}

/// A command's name, as in the specification.
pub(super) fn command_name(command: Command) -> String {
    command.to_string()
}
