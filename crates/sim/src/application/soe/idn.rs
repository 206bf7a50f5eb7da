//! One IDN of a simulated drive: elements, write conditions, procedure commands (protocol 6.6; IEC 61491).

use core::time::Duration;

use ringcat_wire::al::AlState;
use ringcat_wire::mailbox::soe::{Idn, IdnAttribute, IdnLength, SoeElements, SoeErrorCode};

use crate::time::SimTime;

/// Display format "signed" of the attribute.
const SIGNED: u8 = 2;
/// Value of a procedure command that is set and enabled.
const COMMAND_START: u16 = 0x0003;
/// Data states of a procedure command: not set, running, done.
const STATE_VALID: u16 = 0x0000;
const STATE_RUNNING: u16 = 0x0007;
const STATE_DONE: u16 = 0x0003;
/// Bytes of the two length fields before a list.
const LIST_HEAD: usize = 4;

/// An IDN with its elements.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct IdnObject {
    /// IDN.
    pub idn: Idn,
    /// Name.
    pub name: String,
    /// Attribute.
    pub attribute: IdnAttribute,
    /// Unit, if there is one.
    pub unit: Option<String>,
    /// Smallest and largest value of a number.
    pub range: Option<(i64, i64)>,
    /// The value; a list without its two length fields.
    pub value: Vec<u8>,
    /// Maximum number of bytes of a list.
    capacity: usize,
    default: Option<Vec<u8>>,
    writable: bool,
    command: Option<Command>,
}

/// State of a procedure command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Command {
    takes: Duration,
    until: Option<SimTime>,
    state: u16,
}

impl IdnObject {
    /// A number of 1, 2, 4 or 8 bytes.
    pub fn number(idn: Idn, name: &str, bytes: u8, value: u64) -> IdnObject {
        let value: Vec<u8> = value.to_le_bytes().into_iter().take(usize::from(bytes)).collect();
        IdnObject {
            idn,
            name: name.into(),
            attribute: IdnAttribute::new(IdnLength::Fixed(bytes)),
            unit: None,
            range: None,
            default: Some(value.clone()),
            capacity: value.len(),
            value,
            writable: true,
            command: None,
        }
    }

    /// A list of elements of 1, 2, 4 or 8 bytes with room for `capacity` bytes.
    pub fn list(idn: Idn, name: &str, bytes: u8, value: &[u8], capacity: usize) -> IdnObject {
        let attribute = IdnAttribute::new(IdnLength::List(bytes));
        let capacity = capacity.max(value.len()).min(usize::from(u16::MAX));
        let number = IdnObject::number(idn, name, 0, 0);
        IdnObject { attribute, value: value.into(), default: None, capacity, ..number }
    }

    /// A procedure command with a duration.
    pub fn command(idn: Idn, name: &str, takes: Duration) -> IdnObject {
        let number = IdnObject::number(idn, name, 2, 0);
        let command = Some(Command { takes, until: None, state: STATE_VALID });
        IdnObject { attribute: number.attribute.command(), default: None, command, ..number }
    }

    /// The same IDN with a unit.
    pub fn unit(self, unit: &str) -> IdnObject {
        IdnObject { unit: Some(unit.into()), ..self }
    }

    /// The same IDN as a number that can only be written within this range.
    pub fn within(self, minimum: i64, maximum: i64) -> IdnObject {
        IdnObject { range: Some((minimum, maximum)), ..self }
    }

    /// The same IDN, not writable.
    pub fn read_only(self) -> IdnObject {
        IdnObject { writable: false, ..self }
    }

    /// The same IDN with bits of the attribute set.
    pub fn with_attribute(self, bits: u32) -> IdnObject {
        IdnObject { attribute: IdnAttribute(self.attribute.0 | bits), ..self }
    }

    /// One element.
    pub(super) fn read(&self, element: SoeElements, now: SimTime) -> Result<Vec<u8>, SoeErrorCode> {
        let number = |value: i64| value.to_le_bytes()[..self.value.len().min(8)].to_vec();
        match element {
            SoeElements::DATA_STATE => Ok(self.data_state(now).to_le_bytes().to_vec()),
            SoeElements::NAME => Ok(counted(self.name.as_bytes(), self.name.len())),
            SoeElements::ATTRIBUTE => Ok(self.attribute.0.to_le_bytes().to_vec()),
            SoeElements::UNIT => {
                let unit = self.unit.as_ref().ok_or(SoeErrorCode::NO_UNIT)?;
                Ok(counted(unit.as_bytes(), unit.len()))
            }
            SoeElements::MINIMUM => Ok(number(self.range.ok_or(SoeErrorCode::NO_MINIMUM)?.0)),
            SoeElements::MAXIMUM => Ok(number(self.range.ok_or(SoeErrorCode::NO_MAXIMUM)?.1)),
            SoeElements::VALUE => Ok(match self.attribute.length() {
                IdnLength::Fixed(_) => self.value.clone(),
                IdnLength::List(_) => counted(&self.value, self.capacity),
            }),
            SoeElements::DEFAULT => self.default.clone().ok_or(SoeErrorCode::NO_DEFAULT),
            SoeElements(_) => Err(SoeErrorCode::NO_ELEMENT),
        }
    }

    /// Writes one element.
    pub(super) fn write(
        &mut self,
        elements: SoeElements,
        data: &[u8],
        state: AlState,
        now: SimTime,
    ) -> Result<(), SoeErrorCode> {
        match elements {
            SoeElements::VALUE => {}
            SoeElements::NAME => return Err(SoeErrorCode::NAME_READ_ONLY),
            SoeElements::ATTRIBUTE => return Err(SoeErrorCode::ATTRIBUTE_READ_ONLY),
            SoeElements::UNIT => return Err(SoeErrorCode::UNIT_READ_ONLY),
            SoeElements::MINIMUM => return Err(SoeErrorCode::MINIMUM_READ_ONLY),
            SoeElements::MAXIMUM => return Err(SoeErrorCode::MAXIMUM_READ_ONLY),
            SoeElements::DEFAULT => return Err(SoeErrorCode::DEFAULT_READ_ONLY),
            SoeElements::DATA_STATE => return Err(SoeErrorCode::INVALID_ACCESS),
            SoeElements(_) => return Err(SoeErrorCode::NO_ELEMENT),
        }
        if !self.writable {
            return Err(SoeErrorCode::VALUE_READ_ONLY);
        }
        let protection = match state {
            AlState::PreOp => IdnAttribute::PROTECTED_PREOP,
            AlState::SafeOp => IdnAttribute::PROTECTED_SAFEOP,
            AlState::Op => IdnAttribute::PROTECTED_OP,
            AlState::Init | AlState::Boot => 0,
        };
        if protection != 0 && self.attribute.has(protection) {
            return Err(SoeErrorCode::VALUE_PROTECTED);
        }
        let value = self.check(data)?;
        if self.command.is_some() {
            self.steer(&value, now)?;
        }
        self.value = value;
        Ok(())
    }

    /// The value in the data, if it is valid.
    fn check(&self, data: &[u8]) -> Result<Vec<u8>, SoeErrorCode> {
        if let IdnLength::List(bytes) = self.attribute.length() {
            let (&[low, high, _, _], list) =
                data.split_first_chunk::<LIST_HEAD>().ok_or(SoeErrorCode::VALUE_TOO_SHORT)?;
            let length = usize::from(u16::from_le_bytes([low, high]));
            if length > self.capacity || list.len() > self.capacity {
                return Err(SoeErrorCode::VALUE_TOO_LONG);
            }
            let list = list.get(..length).ok_or(SoeErrorCode::VALUE_TOO_SHORT)?;
            return if length.is_multiple_of(usize::from(bytes)) {
                Ok(list.to_vec())
            } else {
                Err(SoeErrorCode::INVALID_VALUE)
            };
        }
        if data.len() < self.value.len() {
            return Err(SoeErrorCode::VALUE_TOO_SHORT);
        }
        if data.len() > self.value.len() {
            return Err(SoeErrorCode::VALUE_TOO_LONG);
        }
        if let Some((minimum, maximum)) = self.range {
            let negative =
                self.attribute.display_format() == SIGNED && data.last().is_some_and(|byte| byte & 0x80 != 0);
            let mut bytes = [if negative { 0xFF } else { 0 }; 8];
            let length = data.len().min(8);
            bytes[..length].copy_from_slice(&data[..length]);
            let value = i64::from_le_bytes(bytes);
            if value < minimum {
                return Err(SoeErrorCode::BELOW_MINIMUM);
            }
            if value > maximum {
                return Err(SoeErrorCode::ABOVE_MAXIMUM);
            }
        }
        Ok(data.to_vec())
    }

    /// Sets or cancels a procedure command.
    fn steer(&mut self, value: &[u8], now: SimTime) -> Result<(), SoeErrorCode> {
        let Some(command) = &mut self.command else {
            return Ok(());
        };
        let word = value.first_chunk().map_or(0, |bytes| u16::from_le_bytes(*bytes));
        if word == 0 {
            (command.until, command.state) = (None, STATE_VALID);
            return Ok(());
        }
        if word != COMMAND_START {
            return Err(SoeErrorCode::INVALID_VALUE);
        }
        if command.until.is_some() {
            return Err(SoeErrorCode::COMMAND_ACTIVE);
        }
        (command.until, command.state) = (Some(now + command.takes), STATE_RUNNING);
        Ok(())
    }

    /// Time at which a running procedure command ends.
    pub(super) fn running_until(&self) -> Option<SimTime> {
        self.command.and_then(|command| command.until)
    }

    /// Ends the procedure command if it is due; true if it ended.
    pub(super) fn ends(&mut self, now: SimTime) -> bool {
        let Some(command) = &mut self.command else {
            return false;
        };
        let due = command.until.is_some_and(|until| until <= now);
        if due {
            (command.until, command.state) = (None, STATE_DONE);
        }
        due
    }

    fn data_state(&self, now: SimTime) -> u16 {
        self.command.map_or(STATE_VALID, |command| match command.until {
            Some(until) if until <= now => STATE_DONE,
            _ => command.state,
        })
    }
}

/// Bytes after their number and the maximum number of bytes.
fn counted(bytes: &[u8], capacity: usize) -> Vec<u8> {
    let number = |length: usize| u16::try_from(length).unwrap_or(u16::MAX).to_le_bytes();
    let mut data = number(bytes.len()).to_vec();
    data.extend_from_slice(&number(capacity));
    data.extend_from_slice(bytes);
    data
}
