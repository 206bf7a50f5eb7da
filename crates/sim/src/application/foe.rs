//! The FoE server of a device: files to be read and written, a boot loader for its firmware (protocol 6.4).
//!
//! Input: the payload of a FoE message, the state, virtual time. Output: the response. [`files`] keeps written files
//! over power cycles, [`firmware`] defines images. In BOOT only the firmware is served; it can be written only there.
//! Erasing the old firmware takes time, during which the response is BUSY. An incomplete firmware leaves the device
//! without firmware.

pub mod files;
pub mod firmware;

use ringcat_wire::mailbox::foe::{FoeErrorCode, FoeMessage};
use ringcat_wire::mailbox::{ErrorReply, PayloadError};

use super::answer::Answer;
use crate::description::FoeDescription;
use crate::time::SimTime;
use files::FileStore;

/// Maximum length of an error text.
const MAX_TEXT: usize = 64;
/// Total of the BUSY progress.
const BUSY_ENTIRE: u16 = 100;

/// Context of a transfer.
#[derive(Debug)]
pub struct Files<'a> {
    /// Settings of the server.
    pub description: &'a FoeDescription,
    /// Non-volatile files.
    pub store: &'a mut FileStore,
    /// Whether the device is in BOOT.
    pub boot: bool,
    /// Data bytes of each packet to the device except the last.
    pub receive_data: usize,
    /// Data bytes of each packet from the device except the last.
    pub send_data: usize,
    /// Current time.
    pub now: SimTime,
}

/// The server with its state between messages.
#[derive(Clone, Debug, Default)]
pub struct FoeServer {
    transfer: Option<Transfer>,
}

#[derive(Clone, Debug)]
enum Transfer {
    /// The MainDevice reads.
    Read { data: Vec<u8>, packet: u32 },
    /// The MainDevice writes.
    Write { name: Vec<u8>, data: Vec<u8>, packet: u32, erased_at: Option<SimTime> },
}

/// The reason for which a message ends the transfer.
struct Failure(FoeErrorCode, &'static str);

impl FoeServer {
    /// Serves one message.
    pub fn serve(&mut self, payload: &[u8], files: &mut Files<'_>) -> Answer {
        let message = match FoeMessage::decode(payload) {
            Ok(message) => message,
            Err(PayloadError::Short { .. }) => return Answer::Error(ErrorReply::SIZE_TOO_SHORT),
            Err(PayloadError::Code { .. } | PayloadError::Service { .. }) => {
                return Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED);
            }
        };
        let result = match message {
            FoeMessage::Read { password, name } => self.read(password, name, files),
            FoeMessage::Write { password, name } => self.write(password, name, files),
            FoeMessage::Data { packet, data } => self.take(packet, data, files),
            FoeMessage::Acknowledge { packet } => self.next_packet(packet, files),
            FoeMessage::Busy { .. } => self.current_packet(files),
            FoeMessage::Error { .. } => {
                self.transfer = None;
                return Answer::Silence;
            }
        };
        result.unwrap_or_else(|Failure(code, text)| {
            self.transfer = None;
            encode(&FoeMessage::Error { code, text: &text.as_bytes()[..text.len().min(MAX_TEXT)] })
        })
    }

    fn read(&mut self, password: u32, name: &[u8], files: &Files<'_>) -> Result<Answer, Failure> {
        self.transfer = None;
        check(password, name, files)?;
        let data = files.store.file(name).ok_or(Failure(FoeErrorCode::NOT_FOUND, "no such file"))?.to_vec();
        self.transfer = Some(Transfer::Read { data, packet: 1 });
        self.current_packet(files)
    }

    fn write(&mut self, password: u32, name: &[u8], files: &Files<'_>) -> Result<Answer, Failure> {
        self.transfer = None;
        check(password, name, files)?;
        if !files.boot && files.is_firmware(name) {
            return Err(Failure(FoeErrorCode::BOOTSTRAP_ONLY, "firmware is written in BOOT"));
        }
        self.transfer = Some(Transfer::Write { name: name.into(), data: Vec::new(), packet: 0, erased_at: None });
        Ok(encode(&FoeMessage::Acknowledge { packet: 0 }))
    }

    /// The current packet of a read, for the first time or repeated.
    fn current_packet(&self, files: &Files<'_>) -> Result<Answer, Failure> {
        let Some(Transfer::Read { data, packet }) = &self.transfer else {
            return Err(Failure(FoeErrorCode::ILLEGAL, "nothing is being read"));
        };
        let start = files.send_data.saturating_mul(*packet as usize - 1).min(data.len());
        let piece = &data[start..data.len().min(start + files.send_data)];
        Ok(encode(&FoeMessage::Data { packet: *packet, data: piece }))
    }

    fn next_packet(&mut self, acknowledged: u32, files: &Files<'_>) -> Result<Answer, Failure> {
        let Some(Transfer::Read { data, packet }) = &mut self.transfer else {
            return Err(Failure(FoeErrorCode::ILLEGAL, "nothing is being read"));
        };
        if acknowledged != *packet {
            return Err(Failure(FoeErrorCode::PACKET_NUMBER_WRONG, "acknowledged another packet"));
        }
        // A packet shorter than the others was the last one.
        if files.send_data.saturating_mul(*packet as usize) > data.len() {
            self.transfer = None;
            return Ok(Answer::Silence);
        }
        *packet += 1;
        self.current_packet(files)
    }

    fn take(&mut self, number: u32, piece: &[u8], files: &mut Files<'_>) -> Result<Answer, Failure> {
        let Some(Transfer::Write { name, data, packet, erased_at }) = &mut self.transfer else {
            return Err(Failure(FoeErrorCode::ILLEGAL, "nothing is being written"));
        };
        if number != *packet + 1 {
            return Err(Failure(FoeErrorCode::PACKET_NUMBER_WRONG, "expected another packet"));
        }
        let firmware = files.is_firmware(name);
        if firmware {
            let until = *erased_at.get_or_insert_with(|| {
                files.store.erase_firmware();
                files.now + files.description.erase_time
            });
            if until > files.now {
                return Ok(busy(until, files));
            }
        }
        if data.len() + piece.len() > files.store.room_for(name) {
            return Err(Failure(FoeErrorCode::DISK_FULL, "no room"));
        }
        data.extend_from_slice(piece);
        *packet = number;
        if piece.len() < files.receive_data {
            let (name, data) = (core::mem::take(name), core::mem::take(data));
            self.transfer = None;
            if firmware {
                let version = firmware::check(&data).map_err(|(code, text)| Failure(code, text))?;
                files.store.set_firmware(version);
            }
            if !files.store.keep(&name, data) {
                return Err(Failure(FoeErrorCode::DISK_FULL, "too many files"));
            }
        }
        Ok(encode(&FoeMessage::Acknowledge { packet: number }))
    }
}

impl Files<'_> {
    fn is_firmware(&self, name: &[u8]) -> bool {
        self.description.firmware.as_ref().is_some_and(|firmware| firmware.as_bytes() == name)
    }
}

/// Common conditions of reading and writing.
fn check(password: u32, name: &[u8], files: &Files<'_>) -> Result<(), Failure> {
    if name.is_empty() {
        return Err(Failure(FoeErrorCode::ILLEGAL, "no name"));
    }
    if files.description.password != 0 && password != files.description.password {
        return Err(Failure(FoeErrorCode::ACCESS_DENIED, "wrong password"));
    }
    if files.boot && !files.is_firmware(name) {
        return Err(Failure(FoeErrorCode::NOT_BOOTSTRAP, "only the firmware in BOOT"));
    }
    Ok(())
}

/// Progress of erasing.
fn busy(until: SimTime, files: &Files<'_>) -> Answer {
    let left = until.since(files.now).as_nanos() * u128::from(BUSY_ENTIRE);
    let left = left.div_ceil(files.description.erase_time.as_nanos().max(1));
    let done = BUSY_ENTIRE.saturating_sub(u16::try_from(left).unwrap_or(BUSY_ENTIRE));
    encode(&FoeMessage::Busy { done, entire: BUSY_ENTIRE, text: b"erasing" })
}

fn encode(message: &FoeMessage<'_>) -> Answer {
    let data = match message {
        FoeMessage::Data { data, .. } => data.len(),
        FoeMessage::Read { .. }
        | FoeMessage::Write { .. }
        | FoeMessage::Acknowledge { .. }
        | FoeMessage::Error { .. }
        | FoeMessage::Busy { .. } => MAX_TEXT,
    };
    let mut bytes = vec![0; FoeMessage::OVERHEAD + data];
    match message.encode(&mut bytes) {
        Some(length) => {
            bytes.truncate(length);
            Answer::payload(bytes)
        }
        None => Answer::Error(ErrorReply::NO_MORE_MEMORY),
    }
}
