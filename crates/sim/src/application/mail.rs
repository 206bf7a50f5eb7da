//! Mail of the application: passes messages to the servers, sends responses and unsolicited mail (protocol 6).
//!
//! Input: AL events of the mailbox SyncManagers, the time, emergencies and diagnosis messages of the device, faults.
//! Output: mail that the MainDevice reads.

use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::coe::{DiagnosisFlags, DiagnosisMessage, DiagnosisParameter, Emergency};

use super::Application;
use super::coe::emergency_payload;
use super::mailbox::faults::MailFault;
use super::mailbox::record::ServedMail;
use super::servers::ServerContext;
use crate::controller::Controller;
use crate::description::DeviceDescription;
use crate::time::SimTime;

/// Error code of the emergency for a new message in the diagnosis history: device specific.
const NEW_DIAGNOSIS: u16 = 0xFF00;
/// Object 0x1001.
const ERROR_REGISTER: u16 = 0x1001;
/// Maximum number of bytes of a message in the diagnosis history.
const MAX_DIAGNOSIS: usize = 256;

/// Capacity of a record; later requests are not recorded.
const MAX_RECORDED: usize = 1 << 18;

impl Application {
    /// Starts recording served requests; earlier records are dropped. A restart of the device does not end the
    /// recording.
    pub fn record_mail(&mut self) {
        self.record = Some(Vec::new());
    }

    /// Requests served since the start of the recording, oldest first.
    pub fn served_mail(&self) -> &[ServedMail] {
        self.record.as_deref().unwrap_or_default()
    }

    /// Sets a fault of the mail.
    pub fn disturb_mail(&mut self, fault: MailFault, now: SimTime) {
        self.faults.add(fault, now);
    }

    /// Sends an unsolicited message; false without a mailbox in use, or with too many waiting.
    pub fn post(&mut self, protocol: Protocol, payload: Vec<u8>) -> bool {
        let ready = self.last_run;
        self.mailbox.as_mut().is_some_and(|mailbox| mailbox.post(protocol, payload, ready))
    }

    /// Sends an emergency and sets the error register; false if it cannot be sent.
    pub fn emergency(&mut self, emergency: &Emergency) -> bool {
        self.dictionary.set(ERROR_REGISTER, 0, &[emergency.error_register]);
        self.post(Protocol::Coe, emergency_payload(emergency))
    }

    /// Adds a message to the diagnosis history, with the current time and these parameters; an emergency reports it if
    /// the flags request this. False if the message is not stored.
    pub fn diagnose(&mut self, message: &DiagnosisMessage<'_>, parameters: &[DiagnosisParameter<'_>]) -> bool {
        let mut bytes = vec![0; MAX_DIAGNOSIS];
        let mut length = DiagnosisMessage::OVERHEAD;
        for parameter in parameters {
            let Some(more) = parameter.encode(&mut bytes[length..]) else {
                return false;
            };
            length += more;
        }
        let parameter_count = u8::try_from(parameters.len()).unwrap_or(u8::MAX);
        let time_ns = self.last_run.0;
        let head = DiagnosisMessage { parameter_count, parameters: &[], local_time: true, time_ns, ..*message };
        head.encode(&mut bytes);
        bytes.truncate(length);
        if !self.dictionary.diagnose(message.kind, &bytes) {
            return false;
        }
        if self.dictionary.diagnosis_flags().is_some_and(|flags| flags.has(DiagnosisFlags::EMERGENCY)) {
            let [.., low, high] = message.code.to_le_bytes();
            let [text_low, text_high] = message.text.to_le_bytes();
            let data = [low, high, text_low, text_high, message.kind.code()];
            self.emergency(&Emergency { error_code: NEW_DIAGNOSIS, error_register: 0x81, data });
        }
        true
    }

    pub(super) fn run_mailbox(
        &mut self,
        description: &DeviceDescription,
        controller: &mut Controller,
        events: u32,
        now: SimTime,
    ) {
        self.faults.advance(now);
        let (Some(mailbox), Some(declared)) = (&mut self.mailbox, description.mailbox) else {
            return;
        };
        // Sending a response makes room for the waiting message.
        mailbox.send(controller, now);
        let servers = &mut self.servers;
        if let Some(message) = mailbox.take(controller, events, &self.faults, now) {
            self.process_data.advance(now);
            let mut context = ServerContext {
                description,
                declared,
                state: self.machine.state(),
                room: mailbox.room(),
                receive_room: mailbox.receive_room(),
                now,
                dictionary: &mut self.dictionary,
                files: &mut self.files,
                process_data: &self.process_data,
            };
            let ready = now + declared.response_time;
            let (record, state) = (&mut self.record, self.machine.state());
            mailbox.serve(&message, ready, &mut self.faults, |protocol, payload| {
                if let Some(record) = record.as_mut().filter(|record| record.len() < MAX_RECORDED) {
                    record.push(ServedMail { at: now, state, protocol, payload: payload.to_vec() });
                }
                servers.serve(protocol, payload, &mut context)
            });
        }
        servers.work(mailbox.room(), now);
        while mailbox.has_room()
            && let Some((protocol, payload)) = servers.next_message()
        {
            mailbox.post(protocol, payload, now);
            servers.work(mailbox.room(), now);
        }
        self.servers_due = servers.next_deadline(now);
        mailbox.send(controller, now);
    }
}
