//! Commands with a datagram: `InitCmd`, `IdentifyCmd` and the common part of a cyclic `Cmd` (protocol 8.2).

use ringcat_wire::address::{LogicalAddress, RegisterAddress};
use ringcat_wire::command::{Addressing, Command};

use crate::eni::element::Element;
use crate::eni::error::{EniError, Problem};
use crate::eni::model::{Datagram, EcatCommand, Requires, Target, Transition, Validate};
use crate::xml::shown;

/// Maximum number of data bytes of a datagram (protocol 1.3).
const MAX_DATA: u16 = 1486;

/// The commands in `InitCmds` of an element, except those that are disabled as mailbox commands can be.
pub(super) fn list(parent: Element<'_>) -> Result<Vec<EcatCommand>, EniError> {
    let Some(commands) = parent.child("InitCmds") else { return Ok(Vec::new()) };
    commands.expects(&["InitCmd"]);
    let mut found = Vec::new();
    for element in commands.children("InitCmd") {
        if !element.flag_of("Disabled")? {
            found.push(command(element)?);
        }
    }
    Ok(found)
}

/// One command.
pub(super) fn command(element: Element<'_>) -> Result<EcatCommand, EniError> {
    element.expects(&[
        "Transition",
        "BeforeSlave",
        "Comment",
        "Requires",
        "Cmd",
        "Adp",
        "Ado",
        "Addr",
        "Data",
        "DataLength",
        "Cnt",
        "Retries",
        "Validate",
        "Timeout",
        "Disabled",
    ]);
    let requires = match element.child("Requires") {
        None => None,
        Some(requires) => match requires.text().to_lowercase().as_str() {
            "frame" => Some(Requires::Frame),
            "cycle" => Some(Requires::Cycle),
            _ => return Err(requires.wrong("frame or cycle")),
        },
    };
    let datagram = datagram(element)?;
    let validate = element.child("Validate").map(validate).transpose()?;
    if let Some(validate) = &validate
        && validate.data.len() > datagram.data.len()
    {
        let expected = format!("at most {} bytes, the length of the read", datagram.data.len());
        let got = shown(&format!("{} bytes", validate.data.len()));
        return Err(element.required("Validate")?.error(Problem::Value { expected, got }));
    }
    Ok(EcatCommand {
        place: element.place(),
        transitions: transitions(element)?,
        before_subdevices: element.flag_of("BeforeSlave")?,
        comment: element.text_of("Comment"),
        requires,
        datagram,
        retries: element.number_of("Retries")?.unwrap_or_default(),
        validate,
        timeout_ms: element.number_of("Timeout")?,
    })
}

/// All `Transition` elements of a command.
pub(super) fn transitions(element: Element<'_>) -> Result<Vec<Transition>, EniError> {
    let one = |element: Element<'_>| {
        let text = element.text().to_uppercase();
        let found = Transition::ALL.into_iter().find(|transition| transition.name() == text);
        found.ok_or_else(|| element.wrong("a transition such as IP, PS or SO"))
    };
    let mut found: Vec<Transition> = element.children("Transition").map(one).collect::<Result<_, _>>()?;
    // A repeated transition has no effect.
    let mut seen = [false; Transition::ALL.len()];
    found.retain(|transition| !std::mem::replace(&mut seen[*transition as usize], true));
    Ok(found)
}

fn validate(element: Element<'_>) -> Result<Validate, EniError> {
    element.expects(&["Data", "DataMask", "Timeout"]);
    let data = element.required("Data")?.hex()?;
    let mask = element.hex_of("DataMask")?;
    if let Some(mask) = &mask
        && mask.len() != data.len()
    {
        let expected = format!("a mask of {} bytes, as long as Data", data.len());
        return Err(element.required("DataMask")?.wrong(expected));
    }
    Ok(Validate { data, mask, timeout_ms: element.number_of("Timeout")?.unwrap_or_default() })
}

/// Command, address, data and working counter.
pub(super) fn datagram(element: Element<'_>) -> Result<Datagram, EniError> {
    let cmd = element.required("Cmd")?;
    let command = match Command::from_code(cmd.number()?) {
        Command::Reserved(_) => return Err(cmd.wrong("a command from 0 (NOP) to 14 (FRMW)")),
        command => command,
    };
    let target = match command.addressing() {
        Addressing::Logical => Target::Logical(LogicalAddress(element.required_number("Addr")?)),
        // The address of a NOP has no meaning.
        Addressing::None => register(element, false)?,
        Addressing::AutoIncrement | Addressing::Station | Addressing::Broadcast => register(element, true)?,
    };
    Ok(Datagram { command, target, data: data(element)?, count: element.number_of("Cnt")? })
}

fn register(element: Element<'_>, required: bool) -> Result<Target, EniError> {
    let of = |name| if required { element.required_number(name) } else { Ok(element.number_of(name)?.unwrap_or(0)) };
    Ok(Target::Register { adp: of("Adp")?, ado: RegisterAddress(of("Ado")?) })
}

fn data(element: Element<'_>) -> Result<Vec<u8>, EniError> {
    let data = match (element.child("Data"), element.child("DataLength")) {
        (Some(data), _) => data.hex()?,
        (None, Some(length)) => match length.number::<u16>()? {
            bytes if bytes <= MAX_DATA => vec![0; usize::from(bytes)],
            _ => return Err(length.wrong(format!("at most {MAX_DATA} bytes, the capacity of a frame"))),
        },
        (None, None) => return Err(element.error(Problem::Missing { element: "Data" })),
    };
    if data.len() > usize::from(MAX_DATA) {
        let expected = format!("at most {MAX_DATA} bytes, the capacity of a frame");
        let got = format!("{} bytes", data.len());
        return Err(element.required("Data")?.error(Problem::Value { expected, got }));
    }
    Ok(data)
}
