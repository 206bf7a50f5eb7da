//! Distributed clocks (protocol ES-60 to ES-62).

use crate::esi::element::Element;
use crate::esi::error::EsiError;
use crate::esi::model::{ClockSettings, OpMode, OpModeSyncManager, ScaledTime};

pub(super) fn clock(element: Element<'_>) -> Result<ClockSettings, EsiError> {
    Ok(ClockSettings {
        line: element.line(),
        potential_reference: element.is("PotentialReferenceClock")?,
        external_reference: element.is("ExternalRefClock")?,
        time_loop_only: element.is("TimeLoopControlOnly")?,
        is_32_bit: element.is("Unknown64Bit")?,
        modes: element.children("OpMode").map(mode).collect::<Result<_, _>>()?,
    })
}

fn mode(element: Element<'_>) -> Result<OpMode, EsiError> {
    let time = |name: &str| -> Result<ScaledTime, EsiError> {
        let Some(child) = element.child(name) else { return Ok(ScaledTime::default()) };
        // Negative times are also written as unsigned numbers.
        let ns: i64 = element.number_of(name)?.unwrap_or(0);
        Ok(ScaledTime { ns: ns as i32, factor: child.number_in("Factor")? })
    };
    let shift = element.child("ShiftTimeSync0");
    Ok(OpMode {
        line: element.line(),
        name: element.text_of("Name"),
        description: element.text_of("Desc"),
        assign_activate: element.number_of("AssignActivate")?.unwrap_or(0),
        cycle_0: time("CycleTimeSync0")?,
        shift_0: time("ShiftTimeSync0")?,
        shift_0_for_inputs: shift.map(|shift| shift.is("Input")).transpose()?.unwrap_or_default(),
        cycle_1: time("CycleTimeSync1")?,
        shift_1: time("ShiftTimeSync1")?,
        sync_managers: element.children("Sm").map(sync_manager).collect::<Result<_, _>>()?,
    })
}

fn sync_manager(element: Element<'_>) -> Result<OpModeSyncManager, EsiError> {
    let pdo = |pdo: Element<'_>| Ok((pdo.number()?, pdo.number_in("OSFac")?));
    let pdos = element.children("Pdo").map(pdo).collect::<Result<_, EsiError>>()?;
    Ok(OpModeSyncManager { number: element.number_in("No")?.unwrap_or(0), pdos })
}
