//! The modules that start-up commands name (0xF030), compared with those that a SubDevice has detected (0xF050)
//! (protocol ES-69, ES-70). A SubDevice with both lists refuses SAFEOP where they differ.

use std::collections::BTreeMap;

use ringcat_engine::config::{SdoDownload, StartupAction, SubDeviceConfig, Transition};
use ringcat_wire::al::AlState;

/// The list of idents that the MainDevice writes.
const CONFIGURED: u16 = 0xF030;
/// The transitions on the way to OP.
const WAY: [Transition; 3] = [Transition::Ip, Transition::Ps, Transition::So];
/// Bytes of an ident.
const IDENT: usize = 4;

/// The differences by slot, from 1, and whether they prevent OP.
pub(super) fn differences(declared: &SubDeviceConfig, detected: Option<&[u32]>) -> (bool, Vec<String>) {
    let (Some(expected), Some(got)) = (configured(declared), detected) else { return (false, Vec::new()) };
    // A list without idents is not compared by the SubDevice.
    let is_compared =
        expected.iter().any(|ident| *ident != 0) && matches!(declared.target, AlState::SafeOp | AlState::Op);
    let word = |ident: u32| match ident {
        0 => "no module".to_owned(),
        ident => format!("module {ident:#010x}"),
    };
    let at = |list: &[u32], slot: usize| list.get(slot).copied().unwrap_or(0);
    let slots = (0..expected.len().max(got.len())).filter(|slot| at(&expected, *slot) != at(got, *slot));
    let text =
        |slot: usize| format!("slot {}: expected {}, got {}", slot + 1, word(at(&expected, slot)), word(at(got, slot)));
    (is_compared, slots.map(text).collect())
}

/// Whether start-up commands write a list of modules.
pub(super) fn are_declared(declared: &SubDeviceConfig) -> bool {
    writes(declared, None).next().is_some()
}

/// The list that the start-up commands leave in the SubDevice, by slot, 0 for an empty one; `None` without such
/// commands.
fn configured(declared: &SubDeviceConfig) -> Option<Vec<u32>> {
    let (mut slots, mut count) = (BTreeMap::new(), None);
    for of in WAY.into_iter().flat_map(|transition| writes(declared, Some(transition))) {
        match (of.sub_index, of.complete_access) {
            (0, false) => count = of.data.first().copied(),
            (sub_index, false) => drop(slots.insert(sub_index, ident(&of.data))),
            (first, true) => {
                // Subindex 0 has a byte of padding (protocol 6.3).
                let entries = if first == 0 { of.data.get(2..).unwrap_or_default() } else { &of.data[..] };
                if first == 0 {
                    count = of.data.first().copied();
                }
                slots.extend((1..=u8::MAX).zip(entries.chunks(IDENT).map(ident)));
            }
        }
    }
    let last = slots.keys().next_back().copied();
    let count = count.or(last)?;
    Some((1..=count).map(|slot| slots.get(&slot).copied().unwrap_or(0)).collect())
}

/// Downloads to the list, at one transition or at any on the way to OP.
fn writes(declared: &SubDeviceConfig, at: Option<Transition>) -> impl Iterator<Item = &SdoDownload> {
    let is_then = move |transition: Transition| at.map_or(WAY.contains(&transition), |at| at == transition);
    declared.startup.iter().filter(move |command| is_then(command.transition)).filter_map(|command| {
        match &command.action {
            StartupAction::Sdo(download) => Some(download).filter(|it| it.index == CONFIGURED),
            _ => None,
        }
    })
}

fn ident(bytes: &[u8]) -> u32 {
    let mut ident = [0; IDENT];
    let length = bytes.len().min(IDENT);
    ident[..length].copy_from_slice(&bytes[..length]);
    u32::from_le_bytes(ident)
}
