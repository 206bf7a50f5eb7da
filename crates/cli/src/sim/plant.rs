//! A segment with the cables that an order has cut and the interfaces that have lost their carrier.
//!
//! Both break a host cable: it works when it is not cut and its interface has a carrier.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use ringcat::sim::cable::{CableId, HostLink};
use ringcat::sim::fault::Fault;
use ringcat::sim::network::Network;
use ringcat::sim::network::statistics::LossCause;

use super::gaps::Gaps;
use super::names::describe_cable;

/// A segment under orders.
#[derive(Debug)]
pub struct Plant {
    network: Network,
    /// Cables that an order has cut.
    cut: BTreeSet<usize>,
    /// Whether each interface has carrier.
    carrier: [bool; 2],
    /// Times between outputs, since they were asked for first.
    gaps: Option<Gaps>,
}

impl Plant {
    /// A segment whose interfaces all have carrier.
    pub fn new(network: Network) -> Plant {
        Plant { network, cut: BTreeSet::new(), carrier: [true; 2], gaps: None }
    }

    /// The segment.
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// The segment.
    pub fn network_mut(&mut self) -> &mut Network {
        &mut self.network
    }

    /// Cuts a cable.
    pub fn cut(&mut self, cable: CableId) {
        self.cut.insert(cable.0);
        self.network.apply(Fault::Cut(cable));
    }

    /// Heals a cable; a host cable without a carrier stays dead until the carrier is back.
    pub fn heal(&mut self, cable: CableId) {
        self.cut.remove(&cable.0);
        let dark =
            HostLink::ALL.into_iter().any(|link| self.is_dark(link) && self.network.host_cable(link) == Some(cable));
        if !dark {
            self.network.apply(Fault::Heal(cable));
        }
    }

    /// Heals everything that was cut; says what.
    pub fn heal_all(&mut self) -> String {
        let cables: Vec<CableId> = self.cut.iter().copied().map(CableId).collect();
        for cable in &cables {
            self.heal(*cable);
        }
        let lines: Vec<String> =
            cables.iter().map(|cable| format!("healed: {}", describe_cable(*cable, &self.network))).collect();
        lines.join("\n")
    }

    fn is_dark(&self, link: HostLink) -> bool {
        !self.carrier[link as usize]
    }

    /// The carrier of an interface is up or down. Whether that has changed.
    pub fn set_carrier(&mut self, link: HostLink, up: bool) -> bool {
        let changed = self.carrier[link as usize] != up;
        self.carrier[link as usize] = up;
        if let (true, Some(cable)) = (changed, self.network.host_cable(link)) {
            if up && !self.cut.contains(&cable.0) {
                self.network.apply(Fault::Heal(cable));
            } else if !up {
                self.network.apply(Fault::Cut(cable));
            }
        }
        changed
    }

    /// Notes the outputs that SubDevices have taken, if times between them were asked for.
    pub fn note_outputs(&mut self) {
        if let Some(gaps) = &mut self.gaps {
            gaps.note(&self.network);
        }
    }

    /// Times between outputs since the last call; the first one begins to note them.
    pub fn gaps(&mut self) -> String {
        let gaps = self.gaps.get_or_insert_with(|| Gaps::begin(&mut self.network));
        gaps.note(&self.network);
        gaps.lines(&self.network)
    }

    /// Devices, cut cables and counters.
    pub fn status(&self) -> String {
        let mut text = String::new();
        // Writing into a String cannot fail.
        for (number, device) in self.network.devices().enumerate() {
            let state = if device.controller.is_powered() { device.al_status().to_string() } else { "no power".into() };
            let _ = writeln!(text, "{number} \"{}\": {state}", device.name());
        }
        for cable in &self.cut {
            let _ = writeln!(text, "cut: {}", describe_cable(CableId(*cable), &self.network));
        }
        for link in HostLink::ALL.into_iter().filter(|link| self.network.host_cable(*link).is_some()) {
            let counters = self.network.statistics().link(link);
            let carrier = if self.is_dark(link) { "no carrier, " } else { "" };
            let (sent, received) = (counters.frames_sent, counters.frames_received);
            let _ = writeln!(text, "{link}: {carrier}{sent} frames into the segment, {received} out of it");
        }
        for cause in LossCause::ALL {
            let lost = self.network.statistics().lost(cause);
            if lost > 0 {
                let _ = writeln!(text, "lost, {cause}: {lost}");
            }
        }
        text.truncate(text.trim_end().len());
        text
    }
}
