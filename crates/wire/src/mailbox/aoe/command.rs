//! The data of ADS commands (protocol 6.7; layout of the public ADS specification).

use super::{AdsCommand, AdsErrorCode, FieldWriter, PayloadError, split};

/// An ADS request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdsRequest<'a> {
    /// Reads name and version.
    ReadDeviceInfo,
    /// Reads.
    Read {
        /// Index group.
        group: u32,
        /// Index offset.
        offset: u32,
        /// Bytes to read.
        length: u32,
    },
    /// Writes.
    Write {
        /// Index group.
        group: u32,
        /// Index offset.
        offset: u32,
        /// The data to write.
        data: &'a [u8],
    },
    /// Reads the states.
    ReadState,
    /// Changes the states.
    WriteControl {
        /// New state of ADS.
        ads_state: u16,
        /// New state of the device.
        device_state: u16,
        /// Data for the device.
        data: &'a [u8],
    },
    /// Writes, then reads.
    ReadWrite {
        /// Index group.
        group: u32,
        /// Index offset.
        offset: u32,
        /// Bytes to read.
        read_length: u32,
        /// The data to write.
        data: &'a [u8],
    },
}

impl<'a> AdsRequest<'a> {
    /// The command in the header.
    pub const fn command(&self) -> AdsCommand {
        match self {
            AdsRequest::ReadDeviceInfo => AdsCommand::ReadDeviceInfo,
            AdsRequest::Read { .. } => AdsCommand::Read,
            AdsRequest::Write { .. } => AdsCommand::Write,
            AdsRequest::ReadState => AdsCommand::ReadState,
            AdsRequest::WriteControl { .. } => AdsCommand::WriteControl,
            AdsRequest::ReadWrite { .. } => AdsCommand::ReadWrite,
        }
    }

    /// Decodes the data of a command. Notifications and unknown commands are an error that contains the command code.
    pub fn decode(command: AdsCommand, data: &'a [u8]) -> Result<AdsRequest<'a>, PayloadError> {
        let mut fields = Fields(data);
        Ok(match command {
            AdsCommand::ReadDeviceInfo => AdsRequest::ReadDeviceInfo,
            AdsCommand::Read => {
                AdsRequest::Read { group: fields.long()?, offset: fields.long()?, length: fields.long()? }
            }
            AdsCommand::Write => {
                AdsRequest::Write { group: fields.long()?, offset: fields.long()?, data: fields.counted()? }
            }
            AdsCommand::ReadState => AdsRequest::ReadState,
            AdsCommand::WriteControl => AdsRequest::WriteControl {
                ads_state: fields.word()?,
                device_state: fields.word()?,
                data: fields.counted()?,
            },
            AdsCommand::ReadWrite => AdsRequest::ReadWrite {
                group: fields.long()?,
                offset: fields.long()?,
                read_length: fields.long()?,
                data: fields.counted()?,
            },
            AdsCommand::AddNotification
            | AdsCommand::DeleteNotification
            | AdsCommand::Notification
            | AdsCommand::Other(_) => return Err(unknown(command)),
        })
    }

    /// Encodes the data of the command and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        match *self {
            AdsRequest::ReadDeviceInfo | AdsRequest::ReadState => {}
            AdsRequest::Read { group, offset, length } => {
                for field in [group, offset, length] {
                    writer.put_u32(field)?;
                }
            }
            AdsRequest::Write { group, offset, data } => {
                writer.put_u32(group)?;
                writer.put_u32(offset)?;
                put_counted(&mut writer, data)?;
            }
            AdsRequest::WriteControl { ads_state, device_state, data } => {
                writer.put_u16(ads_state)?;
                writer.put_u16(device_state)?;
                put_counted(&mut writer, data)?;
            }
            AdsRequest::ReadWrite { group, offset, read_length, data } => {
                for field in [group, offset, read_length] {
                    writer.put_u32(field)?;
                }
                put_counted(&mut writer, data)?;
            }
        }
        Some(writer.length())
    }
}

/// An ADS response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdsResponse<'a> {
    /// Name and version.
    DeviceInfo {
        /// Result.
        result: AdsErrorCode,
        /// Major version.
        major: u8,
        /// Minor version.
        minor: u8,
        /// Build number.
        build: u16,
        /// Name, padded with NUL.
        name: [u8; 16],
    },
    /// Response to [`AdsCommand::Read`] and [`AdsCommand::ReadWrite`].
    Data {
        /// Result.
        result: AdsErrorCode,
        /// The data.
        data: &'a [u8],
    },
    /// Response to [`AdsCommand::ReadState`].
    State {
        /// Result.
        result: AdsErrorCode,
        /// State of ADS.
        ads_state: u16,
        /// State of the device.
        device_state: u16,
    },
    /// Response to [`AdsCommand::Write`] and [`AdsCommand::WriteControl`].
    Done {
        /// Result.
        result: AdsErrorCode,
    },
}

impl<'a> AdsResponse<'a> {
    /// The result of the request.
    pub const fn result(&self) -> AdsErrorCode {
        match self {
            AdsResponse::DeviceInfo { result, .. }
            | AdsResponse::Data { result, .. }
            | AdsResponse::State { result, .. }
            | AdsResponse::Done { result } => *result,
        }
    }

    /// Decodes the data of a response to a command. The response to a failed request may contain only the result.
    pub fn decode(command: AdsCommand, data: &'a [u8]) -> Result<AdsResponse<'a>, PayloadError> {
        let mut fields = Fields(data);
        let result = AdsErrorCode(fields.long()?);
        let alone = fields.0.is_empty() && result != AdsErrorCode::NO_ERROR;
        Ok(match command {
            AdsCommand::Write | AdsCommand::WriteControl => AdsResponse::Done { result },
            AdsCommand::ReadDeviceInfo | AdsCommand::Read | AdsCommand::ReadState | AdsCommand::ReadWrite if alone => {
                AdsResponse::Done { result }
            }
            AdsCommand::ReadDeviceInfo => {
                let (&[major, minor, low, high], rest) = split(fields.0, "ADS device info")?;
                let (name, _) = split(rest, "ADS device name")?;
                AdsResponse::DeviceInfo { result, major, minor, build: u16::from_le_bytes([low, high]), name: *name }
            }
            AdsCommand::Read | AdsCommand::ReadWrite => AdsResponse::Data { result, data: fields.counted()? },
            AdsCommand::ReadState => {
                AdsResponse::State { result, ads_state: fields.word()?, device_state: fields.word()? }
            }
            AdsCommand::AddNotification
            | AdsCommand::DeleteNotification
            | AdsCommand::Notification
            | AdsCommand::Other(_) => return Err(unknown(command)),
        })
    }

    /// Encodes the data of the response and returns its length; `None` if it does not fit `out`.
    pub fn encode(&self, out: &mut [u8]) -> Option<usize> {
        let mut writer = FieldWriter::new(out);
        writer.put_u32(self.result().0)?;
        match *self {
            AdsResponse::DeviceInfo { major, minor, build, name, .. } => {
                writer.put(&[major, minor])?;
                writer.put_u16(build)?;
                writer.put(&name)?;
            }
            AdsResponse::Data { data, .. } => put_counted(&mut writer, data)?,
            AdsResponse::State { ads_state, device_state, .. } => {
                writer.put_u16(ads_state)?;
                writer.put_u16(device_state)?;
            }
            AdsResponse::Done { .. } => {}
        }
        Some(writer.length())
    }
}

fn unknown(command: AdsCommand) -> PayloadError {
    PayloadError::Code { what: "ADS command", got: command.code() }
}

fn put_counted(writer: &mut FieldWriter<'_>, data: &[u8]) -> Option<()> {
    writer.put_u32(u32::try_from(data.len()).ok()?)?;
    writer.put(data)
}

/// Reads the fields one after the other.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn word(&mut self) -> Result<u16, PayloadError> {
        let (field, rest) = split(self.0, "ADS field")?;
        self.0 = rest;
        Ok(u16::from_le_bytes(*field))
    }

    fn long(&mut self) -> Result<u32, PayloadError> {
        let (field, rest) = split(self.0, "ADS field")?;
        self.0 = rest;
        Ok(u32::from_le_bytes(*field))
    }

    /// A length and this number of bytes.
    fn counted(&mut self) -> Result<&'a [u8], PayloadError> {
        let length = usize::try_from(self.long()?).unwrap_or(usize::MAX);
        self.0.get(..length).ok_or(PayloadError::Short { what: "ADS data", expected: length, got: self.0.len() })
    }
}
