//! Transitions between states: the checks before them and the actions at their end (protocol 5.2).
//!
//! Input: AL control, the end times of transitions. Output: AL status; enables and disables mailbox and process data.

use core::time::Duration;

use ringcat_wire::al::{AlState, AlStatusCode};
use ringcat_wire::sii::MailboxLayout;

use super::mailbox::Mailbox;
use super::servers::Servers;
use super::state_machine::{self, Pending, Reaction};
use super::{Application, EVENT_AL_CONTROL, EVENT_SYNC_MANAGER, EVENT_WATCHDOG, settings};
use crate::controller::Controller;
use crate::description::DeviceDescription;
use crate::time::SimTime;

/// Object 0x100A.
const SOFTWARE_VERSION: u16 = 0x100A;

impl Application {
    /// Handles a write to AL control.
    pub(super) fn requested(&mut self, description: &DeviceDescription, controller: &mut Controller, now: SimTime) {
        let control = controller.al_control(now);
        let boot = bootstrap(description).is_some();
        let mut reaction = self.machine.request(control, boot, description.identification);
        if let Reaction::Begin(to) = reaction {
            reaction = match self.prepare(to, description, controller, now) {
                Ok(()) => Reaction::Begin(to),
                Err(code) => self.machine.refuse(code),
            };
        }
        match reaction {
            Reaction::Ignore => {}
            Reaction::Report => self.report(controller, now),
            Reaction::Begin(to) => {
                let from = self.machine.state();
                if from == AlState::Op {
                    self.process_data.make_safe(controller, now);
                }
                let takes = state_machine::duration(&description.transitions, from, to);
                let patience = if to == AlState::Op { description.outputs_timeout } else { Duration::ZERO };
                self.report(controller, now);
                self.machine.begin(to, now, takes, patience);
            }
        }
    }

    /// The checks before a transition.
    fn prepare(
        &mut self,
        to: AlState,
        description: &DeviceDescription,
        controller: &mut Controller,
        now: SimTime,
    ) -> Result<(), AlStatusCode> {
        if let Some(code) = self.take_refusal(to) {
            return Err(code);
        }
        let from = self.machine.state();
        match (from, to) {
            (AlState::Init, AlState::PreOp) if !self.files.has_firmware() => Err(AlStatusCode::NO_VALID_FIRMWARE),
            (AlState::Init, AlState::PreOp) => match standard(description) {
                Some(layout) => self.check_mailbox(
                    &layout,
                    AlStatusCode::INVALID_MAILBOX_CONFIGURATION_PREOP,
                    description,
                    controller,
                    now,
                ),
                None => Ok(()),
            },
            (AlState::Init, AlState::Boot) => {
                let layout = bootstrap(description).ok_or(AlStatusCode::BOOT_NOT_SUPPORTED)?;
                let wrong = AlStatusCode::INVALID_MAILBOX_CONFIGURATION_BOOT;
                self.check_mailbox(&layout, wrong, description, controller, now)
            }
            (AlState::PreOp, AlState::SafeOp) if now < self.preop_since + description.preop_settling => {
                Err(AlStatusCode::EXTERNAL_HARDWARE_NOT_READY)
            }
            (AlState::PreOp, AlState::SafeOp) => {
                let actual = settings::sync_managers(controller, now);
                let ram_kib = controller.config().ram_kib;
                let layout = settings::process_data(description, &self.dictionary, &actual, ram_kib)?;
                let sync0_cycle_ns = settings::timing(description, &layout, controller, now)?;
                self.dictionary.note_sync0(sync0_cycle_ns);
                self.layout = layout;
                Ok(())
            }
            // SyncManagers for OP only have been enabled meanwhile (protocol 4.4).
            (AlState::SafeOp, AlState::Op) => {
                let actual = settings::sync_managers(controller, now);
                let ram_kib = controller.config().ram_kib;
                let layout = settings::process_data(description, &self.dictionary, &actual, ram_kib)?;
                if layout != self.layout {
                    self.layout = layout;
                    self.process_data.start(self.layout.clone(), &self.dictionary, controller, now);
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn check_mailbox(
        &mut self,
        layout: &MailboxLayout,
        wrong: AlStatusCode,
        description: &DeviceDescription,
        controller: &mut Controller,
        now: SimTime,
    ) -> Result<(), AlStatusCode> {
        let actual = settings::sync_managers(controller, now);
        if !settings::mailbox_matches(description, layout, &actual) {
            return Err(wrong);
        }
        let numbers = settings::mailbox_numbers(description, layout);
        self.mailbox = Some(Mailbox::open(*layout, numbers, controller, now));
        self.servers = Servers::new(description);
        if let Some(version) = self.files.version() {
            self.dictionary.replace(SOFTWARE_VERSION, 0, version.as_bytes());
        }
        Ok(())
    }

    fn take_refusal(&mut self, to: AlState) -> Option<AlStatusCode> {
        let place = self.refusals.iter().position(|refusal| refusal.to == to && refusal.times > 0)?;
        let refusal = &mut self.refusals[place];
        let code = refusal.code;
        refusal.times -= 1;
        if refusal.times == 0 {
            self.refusals.remove(place);
        }
        Some(code)
    }

    /// Completes a due transition.
    pub(super) fn finish(
        &mut self,
        pending: Pending,
        description: &DeviceDescription,
        controller: &mut Controller,
        now: SimTime,
    ) {
        let no_sync = controller.awaits_sync0(now);
        if pending.to == AlState::Op && (no_sync || !self.process_data.outputs_seen()) {
            if now >= pending.time_limit {
                self.machine.refuse(if no_sync { AlStatusCode::NO_SYNC } else { AlStatusCode::NO_VALID_OUTPUTS });
                self.report(controller, now);
            } else if controller.al_event() & EVENT_AL_CONTROL != 0 {
                self.machine.abandon();
                self.requested(description, controller, now);
            }
            return;
        }
        let from = self.machine.complete();
        if (from, pending.to) == (AlState::Init, AlState::PreOp) {
            self.preop_since = now;
        }
        if from != AlState::SafeOp && from != AlState::Op || matches!(pending.to, AlState::Init | AlState::PreOp) {
            controller.latch_fmmus(pending.to == AlState::SafeOp);
        }
        match (from, pending.to) {
            (_, AlState::Init) => {
                self.process_data.stop(now);
                self.mailbox = None;
                controller.set_data_word();
                if description.forgets_pdos_in_init {
                    self.dictionary.forget_pdos(description);
                }
            }
            (AlState::SafeOp | AlState::Op, AlState::PreOp) => self.process_data.stop(now),
            (AlState::PreOp, AlState::SafeOp) => {
                self.process_data.start(self.layout.clone(), &self.dictionary, controller, now);
            }
            (_, AlState::Op) => self.process_data.operate(&self.dictionary, controller, now),
            _ => {}
        }
        self.report(controller, now);
        if controller.al_event() & EVENT_SYNC_MANAGER != 0 {
            self.sync_managers_changed(description, controller, now);
        }
        if controller.al_event() & EVENT_AL_CONTROL != 0 {
            self.requested(description, controller, now);
        }
        self.check_watchdog(controller, EVENT_WATCHDOG, now);
    }
}

fn standard(description: &DeviceDescription) -> Option<MailboxLayout> {
    description.mailbox.map(|mailbox| mailbox.standard).filter(|layout| layout.receive_size != 0)
}

fn bootstrap(description: &DeviceDescription) -> Option<MailboxLayout> {
    let mailbox = description.mailbox.filter(|mailbox| mailbox.protocols.foe())?;
    Some(mailbox.bootstrap).filter(|layout| layout.receive_size != 0)
}
