//! `Info` of a device (protocol ES-33).

use crate::esi::element::Element;
use crate::esi::error::EsiError;
use crate::esi::model::{Info, PortKind, PortSettings, StateTimes};

pub(super) fn info(element: Element<'_>) -> Result<Info, EsiError> {
    let mut info = Info {
        identification_al_status: element.flag_of("IdentificationReg134")?.unwrap_or_default(),
        identification_address: element.number_of("IdentificationAdo")?,
        ports: element.children("Port").map(port).collect(),
        ..Info::default()
    };
    if let Some(electrical) = element.child("Electrical") {
        info.ebus_current_ma = electrical.number_of("EBusCurrent")?;
    }
    if let Some(machine) = element.child("StateMachine") {
        if let Some(times) = machine.child("Timeout") {
            info.state_times = StateTimes {
                preop_ms: times.number_of("PreopTimeout")?,
                safeop_op_ms: times.number_of("SafeopOpTimeout")?,
                back_to_init_ms: times.number_of("BackToInitTimeout")?,
                back_to_safeop_ms: times.number_of("BackToSafeopTimeout")?,
            };
        }
        if let Some(behaviour) = machine.child("Behavior") {
            info.safeop_without_sync = behaviour.is("StartToSafeopNoSync")?;
        }
    }
    if let Some(times) = element.child("Mailbox").and_then(|mailbox| mailbox.child("Timeout")) {
        info.request_timeout_ms = times.number_of("RequestTimeout")?;
        info.response_timeout_ms = times.number_of("ResponseTimeout")?;
    }
    if let Some(controller) = element.child("EtherCATController") {
        info.ram_bytes = controller.number_of("DpramSize")?;
        info.sync_manager_count = controller.number_of("SmCount")?;
        info.fmmu_count = controller.number_of("FmmuCount")?;
    }
    Ok(info)
}

fn port(element: Element<'_>) -> PortSettings {
    let kind = match element.text_of("Type").trim() {
        "MII" => PortKind::Mii,
        "EBUS" => PortKind::Ebus,
        _ => PortKind::None,
    };
    PortSettings { kind, label: element.text_of("Label") }
}
