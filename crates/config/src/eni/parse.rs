//! From XML to the model: the root, the MainDevice and the SubDevices; commands, cycles and images have modules of
//! their own. The order of elements does not matter (protocol 8.2).

mod commands;
mod cyclic;
mod mailbox;
mod process_data;

use super::element::{Element, File};
use super::error::{EniError, Problem};
use super::kind::FileKind;
use super::model::{DistributedClock, Eni, HotConnect, MailboxStates, MainDevice, Port, PreviousPort, SubDevice};
use crate::xml::{self, MAX_SUBDEVICES, shown};

/// The model of a file.
pub(super) fn parse(text: &str) -> Result<Eni, EniError> {
    let document = xml::parse(text).map_err(|error| EniError::of_xml(error, text.as_bytes()))?;
    let root = document.root_element();
    let file = File::new(text);
    if let Some(kind) = FileKind::of(root) {
        let element = root.tag_name().name().to_owned();
        let place = Some(file.place(root.range().start));
        return Err(EniError { place, element, problem: Problem::WrongFile { kind } });
    }
    let mut eni = configuration(Element::new(root, &file))?;
    let comments = document.root().children().filter(|node| node.is_comment()).filter_map(|node| node.text());
    let comments = comments.map(|text| text.replace(char::is_control, " "));
    eni.made_by = comments.map(|text| text.trim().to_owned()).find(|text| text.to_lowercase().contains("created"));
    (eni.unknown, eni.more_unknown) = file.into_unknown();
    Ok(eni)
}

fn configuration(root: Element<'_>) -> Result<Eni, EniError> {
    root.expects(&["Config"]);
    let config = root.required("Config")?;
    config.expects(&["Master", "Slave", "Cyclic", "ProcessImage"]);
    let subdevices: Vec<SubDevice> =
        config.children("Slave").take(MAX_SUBDEVICES + 1).map(subdevice).collect::<Result<_, _>>()?;
    if subdevices.len() > MAX_SUBDEVICES {
        return Err(config.error(Problem::TooMuch { what: "SubDevices", limit: MAX_SUBDEVICES }));
    }
    Ok(Eni {
        version: root.attribute("Version").map(str::to_owned),
        main_device: config.child("Master").map(main_device).transpose()?.unwrap_or_default(),
        subdevices,
        tasks: config.children("Cyclic").map(cyclic::task).collect::<Result<_, _>>()?,
        image: config.child("ProcessImage").map(process_data::image).transpose()?.unwrap_or_default(),
        ..Eni::default()
    })
}

fn main_device(element: Element<'_>) -> Result<MainDevice, EniError> {
    element.expects(&["Info", "MailboxStates", "EoE", "InitCmds"]);
    let mut found = MainDevice { eoe: element.child("EoE").is_some(), ..MainDevice::default() };
    if let Some(info) = element.child("Info") {
        info.expects(&["Name", "Destination", "Source", "EtherType"]);
        found.name = info.text_of("Name");
        found.destination = info.hex_of("Destination")?.unwrap_or_default();
        found.source = info.hex_of("Source")?.unwrap_or_default();
    }
    if let Some(states) = element.child("MailboxStates") {
        let start = ringcat_wire::address::LogicalAddress(states.required_number("StartAddr")?);
        let count = states.number_of("Count")?.unwrap_or_default();
        found.mailbox_states = Some(MailboxStates { place: states.place(), start, count });
    }
    found.init_commands = commands::list(element)?;
    Ok(found)
}

fn subdevice(element: Element<'_>) -> Result<SubDevice, EniError> {
    element.expects(&["Info", "ProcessData", "Mailbox", "InitCmds", "PreviousPort", "HotConnect", "DC"]);
    let info = element.required("Info")?;
    info.expects(&[
        "Name",
        "PhysAddr",
        "AutoIncAddr",
        "Physics",
        "VendorId",
        "ProductCode",
        "RevisionNo",
        "SerialNo",
        "ProductRevision",
    ]);
    Ok(SubDevice {
        place: element.place(),
        name: info.text_of("Name"),
        station: info.number_of("PhysAddr")?,
        auto_increment: info.number_of("AutoIncAddr")?,
        physics: info.text_of("Physics"),
        vendor_id: info.id_of("VendorId")?,
        product_code: info.id_of("ProductCode")?,
        revision: info.id_of("RevisionNo")?,
        serial: info.id_of("SerialNo")?,
        process_data: element.child("ProcessData").map(process_data::process_data).transpose()?,
        mailbox: element.child("Mailbox").map(mailbox::mailbox).transpose()?,
        init_commands: commands::list(element)?,
        previous_ports: element.children("PreviousPort").map(previous_port).collect::<Result<_, _>>()?,
        hot_connect: element.child("HotConnect").map(hot_connect).transpose()?,
        clock: element.child("DC").map(clock).transpose()?,
    })
}

fn previous_port(element: Element<'_>) -> Result<PreviousPort, EniError> {
    element.expects(&["DeviceId", "Port", "PhysAddr"]);
    let port = element.required("Port")?;
    let letter = match port.text().as_str() {
        "A" | "a" => Port::A,
        "B" | "b" => Port::B,
        "C" | "c" => Port::C,
        "D" | "d" => Port::D,
        _ => return Err(port.wrong("a port A, B, C or D")),
    };
    Ok(PreviousPort {
        place: element.place(),
        selected: element.flag_in("Selected")?,
        port: letter,
        station: element.number_of("PhysAddr")?,
    })
}

fn hot_connect(element: Element<'_>) -> Result<HotConnect, EniError> {
    element.expects(&["GroupName", "GroupMemberCnt", "IdentifyCmd"]);
    let members: Option<u16> = element.number_of("GroupMemberCnt")?;
    if members == Some(0) {
        let expected = "at least 1, the head itself".to_owned();
        return Err(element.required("GroupMemberCnt")?.error(Problem::Value { expected, got: shown("0") }));
    }
    Ok(HotConnect {
        place: element.place(),
        name: element.text_of("GroupName"),
        members: members.unwrap_or(1),
        identify: element.children("IdentifyCmd").map(commands::command).collect::<Result<_, _>>()?,
    })
}

fn clock(element: Element<'_>) -> Result<DistributedClock, EniError> {
    element.expects(&["PotentialReferenceClock", "ReferenceClock", "CycleTime0", "CycleTime1", "ShiftTime"]);
    Ok(DistributedClock {
        place: element.place(),
        reference: element.flag_of("ReferenceClock")?,
        cycle_0_ns: element.number_of("CycleTime0")?.unwrap_or_default(),
        cycle_1_ns: element.number_of("CycleTime1")?.unwrap_or_default(),
        shift_ns: element.number_of("ShiftTime")?.unwrap_or_default(),
    })
}
