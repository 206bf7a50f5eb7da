//! SYNC signals of a file that a SubDevice refuses: those that none of its operation modes has, and a SYNC0 without a
//! cycle (protocol 7.3, ES-60). The SubDevice refuses SAFEOP (AL status codes 0x0030, 0x0035).

use ringcat_engine::config::SubDeviceConfig;
use ringcat_engine::info::SubDeviceInfo;
use ringcat_wire::al::AlState;

/// The bits of AssignActivate that are register 0x0981: unit, SYNC0, SYNC1.
const ACTIVATION: u16 = 0x0700;
/// The bits of the two signals: with the bit of the unit alone only latch units are active, which need no cycle.
const SIGNALS: u16 = 0x0600;
/// Most operation modes that a message lists.
const LISTED: usize = 8;

/// The differences, and whether each prevents OP; none if the SII has no operation modes, or if they were not read. If
/// none of the modes in the SII has signals, the ESI may have further modes: then the difference does not prevent OP.
pub(super) fn differences(declared: &SubDeviceConfig, info: &SubDeviceInfo) -> Vec<(bool, String)> {
    let Some(sync) = declared.sync.filter(|sync| sync.assign_activate & ACTIVATION != 0) else { return Vec::new() };
    let is_checked = info.controller.features.dc && !info.device_emulation && !info.dc_modes.is_empty();
    if !is_checked || !matches!(declared.target, AlState::SafeOp | AlState::Op) {
        return Vec::new();
    }
    let signals = |word: u16| word & ACTIVATION;
    let modes: Vec<u16> = info.dc_modes.iter().map(|mode| mode.assign_activate).collect();
    let mut texts = Vec::new();
    if !modes.iter().any(|mode| signals(*mode) == signals(sync.assign_activate)) {
        let listed: Vec<String> = modes.iter().take(LISTED).map(|mode| format!("{mode:#06x}")).collect();
        let more = if modes.len() > LISTED { ", ..." } else { "" };
        let (own, listed) = (sync.assign_activate, listed.join(", "));
        let text = format!("AssignActivate {own:#06x} activates SYNC signals of none of its modes ({listed}{more})");
        texts.push((modes.iter().any(|mode| mode & SIGNALS != 0), text));
    } else if sync.assign_activate & SIGNALS != 0 && sync.sync0_cycle_ns == 0 {
        texts.push((true, "its SYNC signals need a cycle of SYNC0, the file has 0".to_owned()));
    }
    texts
}
