//! The SoE server of a device: drives with IDNs, elements in fragments, procedure commands (protocol 6.6).
//!
//! Input: the payload of a SoE message, the state, virtual time. Output: the answer, and notifications when a procedure
//! command has ended. [`idn`] defines an IDN.

pub mod idn;

use std::collections::VecDeque;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::ErrorReply;
use ringcat_wire::mailbox::soe::{Idn, SoeElements, SoeErrorCode, SoeMessage, SoeOperation};

use super::answer::Answer;
use crate::description::SoeDescription;
use crate::time::SimTime;
use idn::IdnObject;

/// Maximum number of bytes of an element written in fragments.
const MAX_ELEMENT: usize = 1 << 16;
/// Maximum number of notifications waiting for the mailbox; further ones are dropped.
const MAX_NOTIFICATIONS: usize = 64;
/// IDN of the list of all IDNs, and IDN of the list of all procedure commands.
const ALL_IDNS: Idn = Idn::standard(0, 17);
const ALL_COMMANDS: Idn = Idn::standard(0, 25);

/// The server with its state between messages.
#[derive(Clone, Debug)]
pub struct SoeServer {
    drives: Vec<Vec<IdnObject>>,
    /// Fragments of an element during a write.
    written: Option<Fragments>,
    notifications: VecDeque<Vec<u8>>,
}

#[derive(Clone, Debug)]
struct Fragments {
    drive: u8,
    elements: SoeElements,
    data: Vec<u8>,
    /// Number of following fragments.
    left: u16,
}

impl SoeServer {
    /// The server of a device when its mailbox is opened.
    pub fn new(description: &SoeDescription) -> SoeServer {
        let mut drives = description.drives.clone();
        for drive in &mut drives {
            add_lists(drive);
        }
        SoeServer { drives, written: None, notifications: VecDeque::new() }
    }

    /// An IDN of a drive.
    pub fn idn(&self, drive: u8, idn: Idn) -> Option<&IdnObject> {
        self.drives.get(usize::from(drive))?.iter().find(|object| object.idn == idn)
    }

    /// Serves one message. `room` is the largest length of each message to the MainDevice after the mailbox header.
    pub fn serve(&mut self, payload: &[u8], room: usize, state: AlState, now: SimTime) -> Answer {
        let Ok(message) = SoeMessage::decode(payload) else {
            return Answer::Error(ErrorReply::SIZE_TOO_SHORT);
        };
        match message.operation {
            SoeOperation::ReadRequest => self.read(&message, room, now),
            SoeOperation::WriteRequest => self.write(&message, room, state, now),
            SoeOperation::ReadResponse
            | SoeOperation::WriteResponse
            | SoeOperation::Notification
            | SoeOperation::Emergency => Answer::Silence,
            SoeOperation::Other(_) => Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED),
        }
    }

    fn read(&mut self, message: &SoeMessage<'_>, room: usize, now: SimTime) -> Answer {
        let SoeMessage { drive, elements, .. } = *message;
        let idn = Idn(message.number);
        let data = self.find(drive, idn).and_then(|object| {
            if elements == SoeElements::default() {
                return Err(SoeErrorCode::NO_ELEMENT);
            }
            let mut data = Vec::new();
            for element in elements.iter() {
                data.extend(object.read(element, now)?);
            }
            Ok(data)
        });
        match data {
            Ok(data) => fragments(SoeOperation::ReadResponse, drive, elements, idn, &data, room),
            Err(code) => failure(SoeOperation::ReadResponse, drive, elements, idn, code),
        }
    }

    fn write(&mut self, message: &SoeMessage<'_>, room: usize, state: AlState, now: SimTime) -> Answer {
        let SoeMessage { drive, elements, data, .. } = *message;
        let left = if message.incomplete { message.number } else { 0 };
        // Only fragments of one element may follow each other, with a decreasing count.
        let begun = self.written.take().filter(|begun| begun.drive == drive && begun.elements == elements);
        let mut whole = match begun {
            Some(begun) if begun.left.checked_sub(1) == Some(left) => begun.data,
            _ => Vec::new(),
        };
        if whole.len() + data.len() > MAX_ELEMENT {
            return failure(
                SoeOperation::WriteResponse,
                drive,
                elements,
                Idn(message.number),
                SoeErrorCode::VALUE_TOO_LONG,
            );
        }
        whole.extend_from_slice(data);
        let Some(idn) = message.idn() else {
            self.written = Some(Fragments { drive, elements, data: whole, left });
            return Answer::Silence;
        };
        let result = self.find(drive, idn).and_then(|object| object.write(elements, &whole, state, now));
        match result {
            Ok(()) => fragments(SoeOperation::WriteResponse, drive, elements, idn, &[], room),
            Err(code) => failure(SoeOperation::WriteResponse, drive, elements, idn, code),
        }
    }

    fn find(&mut self, drive: u8, idn: Idn) -> Result<&mut IdnObject, SoeErrorCode> {
        let drive = self.drives.get_mut(usize::from(drive)).ok_or(SoeErrorCode::INVALID_DRIVE)?;
        drive.iter_mut().find(|object| object.idn == idn).ok_or(SoeErrorCode::NO_IDN)
    }

    /// Ends the due procedure commands; each causes a notification.
    pub fn end_due_commands(&mut self, now: SimTime) {
        for (number, drive) in (0u8..).zip(&mut self.drives) {
            for object in drive {
                if object.ends(now) && self.notifications.len() < MAX_NOTIFICATIONS {
                    let message =
                        SoeMessage::whole(SoeOperation::Notification, number, SoeElements::VALUE, object.idn, &[]);
                    self.notifications.push_back(encode(&message));
                }
            }
        }
    }

    /// Time at which the next procedure command ends.
    pub fn next_deadline(&self) -> Option<SimTime> {
        self.drives.iter().flatten().filter_map(IdnObject::running_until).min()
    }

    /// A message of the device that waits for the mailbox.
    pub fn next_message(&mut self) -> Option<Vec<u8>> {
        self.notifications.pop_front()
    }
}

/// Adds the lists that every drive has: all IDNs, all procedure commands.
fn add_lists(drive: &mut Vec<IdnObject>) {
    let mut all: Vec<Idn> = drive.iter().map(|object| object.idn).chain([ALL_IDNS, ALL_COMMANDS]).collect();
    all.sort_unstable();
    all.dedup();
    let commands: Vec<Idn> =
        drive.iter().filter(|object| object.attribute.is_command()).map(|object| object.idn).collect();
    drive.retain(|object| object.idn != ALL_IDNS && object.idn != ALL_COMMANDS);
    for (idn, name, members) in [(ALL_IDNS, "List of all IDNs", all), (ALL_COMMANDS, "List of all commands", commands)]
    {
        let data: Vec<u8> = members.into_iter().flat_map(|member| member.0.to_le_bytes()).collect();
        drive.push(IdnObject::list(idn, name, 2, &data, data.len()).read_only());
    }
}

/// Data in the required number of messages.
fn fragments(operation: SoeOperation, drive: u8, elements: SoeElements, idn: Idn, data: &[u8], room: usize) -> Answer {
    let most = room.saturating_sub(SoeMessage::OVERHEAD).max(1);
    let pieces: Vec<&[u8]> = if data.is_empty() { vec![data] } else { data.chunks(most).collect() };
    let count = pieces.len();
    let messages = pieces.into_iter().enumerate().map(|(place, piece)| {
        let left = u16::try_from(count - 1 - place).unwrap_or(u16::MAX);
        let incomplete = left > 0;
        let number = if incomplete { left } else { idn.0 };
        encode(&SoeMessage { operation, incomplete, error: false, drive, elements, number, data: piece })
    });
    Answer::Payloads(messages.collect())
}

fn failure(operation: SoeOperation, drive: u8, elements: SoeElements, idn: Idn, code: SoeErrorCode) -> Answer {
    let data = code.0.to_le_bytes();
    let message = SoeMessage::whole(operation, drive, elements, idn, &data);
    Answer::payload(encode(&SoeMessage { error: true, ..message }))
}

fn encode(message: &SoeMessage<'_>) -> Vec<u8> {
    let mut bytes = vec![0; SoeMessage::OVERHEAD + message.data.len()];
    let length = message.encode(&mut bytes).unwrap_or(0);
    bytes.truncate(length);
    bytes
}
