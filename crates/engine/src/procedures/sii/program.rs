//! Writing an EEPROM: word by word, each read back (protocol 3.8, 4.7); the alias; reloading the configuration.
//!
//! Words that are right already are not written. The configuration area is written last, so that an interrupted write
//! leaves the previous one. Afterwards the EEPROM is assigned as before.

use alloc::vec::Vec;
use core::fmt;
use core::ops::Range;
use core::time::Duration;

use ringcat_wire::address::{StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;
use ringcat_wire::register::{SiiCommand, SiiConfiguration, SiiControl, map};
use ringcat_wire::sii::{CHECKSUM_DISABLED, Sii, SiiError, checksum};

use super::eeprom::Eeprom;
use super::pace::Pace;
use super::{IDENTITY_WORD, MAX_WORDS, SiiReadError, claim};
use crate::supervisor::long_transfers::{TransferKind, UnderWayTransfer};
use crate::supervisor::{Bus, BusError};

/// How long an EEPROM may take for a word.
const WRITE_LIMIT: Duration = Duration::from_millis(100);
/// How long a controller may take to load its configuration.
const LOAD_LIMIT: Duration = Duration::from_millis(500);
/// Attempts to write a word: an EEPROM that is still busy internally does not acknowledge.
const TRIES: u32 = 4;
/// Pause before another try.
const TRY_PAUSE: Duration = Duration::from_millis(5);
/// Words that the controller loads, with their checksum.
const CONFIGURATION: Range<usize> = 0..8;
/// Word of the alias.
const ALIAS_WORD: usize = 4;
/// Word of the checksum.
const CHECKSUM_WORD: usize = 7;
/// Word of the size of the EEPROM in KiBit, less one.
const SIZE_WORD: u32 = 0x3E;
/// Words of a KiBit.
const KIBIT: u32 = 64;

/// Why an EEPROM was not written, or not loaded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SiiProgramError {
    /// The bus failed.
    Bus(BusError),
    /// It cannot be read.
    Read(SiiReadError),
    /// It stayed busy with a word.
    Busy {
        /// Word address.
        word: u32,
    },
    /// The controller repeatedly does not take the command. The PDI may hold the EEPROM.
    Refused {
        /// Word address.
        word: u32,
    },
    /// The EEPROM did not acknowledge a word, or there is no EEPROM.
    Command {
        /// Word address.
        word: u32,
        /// Value of the control register.
        control: SiiControl,
    },
    /// The value read back differs from the written one.
    Mismatch {
        /// Word address.
        word: u32,
        /// Written.
        expected: u16,
        /// Read back.
        got: u16,
    },
    /// The controller refuses the configuration area that it loaded: its checksum is wrong.
    NotLoaded {
        /// Value of the control register.
        control: SiiControl,
    },
    /// These bytes are no SII image.
    Image(SiiError),
    /// The image does not end with an end marker.
    EndMarker,
    /// Not a whole number of words, empty, or more than an EEPROM has.
    Length {
        /// Bytes.
        bytes: usize,
    },
    /// The image is longer than the EEPROM, by the size in word 0x3E of its present content.
    TooLong {
        /// Words of the image.
        words: usize,
        /// Words of the EEPROM.
        there: usize,
    },
    /// The image is that of another product than the device's present content.
    OtherProduct {
        /// Vendor and product of the present content.
        present: [u32; 2],
        /// Those of the image.
        image: [u32; 2],
    },
    /// The image has another type of PDI (word 0, lower byte) than the present content: the device's processor would
    /// no longer reach the controller.
    OtherPdi {
        /// Type in the present content.
        present: u8,
        /// Type in the image.
        image: u8,
    },
    /// The image states another size of the EEPROM (word 0x3E) than the present content.
    OtherSize {
        /// KiBit in the present content.
        present: u32,
        /// KiBit in the image.
        image: u32,
    },
    /// The present configuration area has a wrong checksum.
    Checksum {
        /// The checksum computed from it.
        expected: u8,
        /// Word 7.
        got: u16,
    },
}

impl fmt::Display for SiiProgramError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SiiProgramError::Bus(error) => error.fmt(f),
            SiiProgramError::Read(error) => error.fmt(f),
            SiiProgramError::Busy { word } => {
                write!(f, "EEPROM still busy with word {word:#06x} after {} ms", WRITE_LIMIT.as_millis())
            }
            SiiProgramError::Refused { word } => write!(
                f,
                "the controller does not take the command for EEPROM word {word:#06x}: does the PDI hold the EEPROM?"
            ),
            SiiProgramError::Command { word, control } => {
                write!(f, "EEPROM error at word {word:#06x}: control register 0x0502 is {:#06x}", control.bits())
            }
            SiiProgramError::Mismatch { word, expected, got } => {
                write!(f, "EEPROM word {word:#06x}: expected {expected:#06x} as written, read back {got:#06x}")
            }
            SiiProgramError::NotLoaded { control } => write!(
                f,
                "the controller refuses its configuration area, checksum error: control register 0x0502 is {:#06x}",
                control.bits()
            ),
            SiiProgramError::Image(error) => error.fmt(f),
            SiiProgramError::EndMarker => f.write_str("SII: the categories do not end with an end marker"),
            SiiProgramError::Length { bytes } => {
                write!(f, "SII: expected whole words, at least one and at most 64 KiB, got {bytes} bytes")
            }
            SiiProgramError::TooLong { words, there } => {
                write!(
                    f,
                    "SII: the image has {words} words, the EEPROM says in word {SIZE_WORD:#04x} that it has {there}"
                )
            }
            SiiProgramError::OtherProduct { present: [vendor, product], image: [other_vendor, other_product] } => {
                write!(
                    f,
                    "SII: the image is of vendor {other_vendor:#010x}, product {other_product:#010x}, the device of \
                 {vendor:#010x}, {product:#010x}"
                )
            }
            SiiProgramError::OtherPdi { present, image } => {
                write!(f, "SII: the image has PDI type {image:#04x} in word 0, the device has {present:#04x}")
            }
            SiiProgramError::OtherSize { present, image } => {
                write!(f, "SII: the image states an EEPROM of {image} KiBit in word 0x3e, the device one of {present}")
            }
            SiiProgramError::Checksum { expected, got } => {
                write!(f, "the EEPROM has a wrong checksum: expected {expected:#04x}, word 7 is {got:#06x}")
            }
        }
    }
}

impl core::error::Error for SiiProgramError {
    fn source(&self) -> Option<&(dyn core::error::Error + 'static)> {
        match self {
            SiiProgramError::Bus(error) => Some(error),
            SiiProgramError::Read(error) => Some(error),
            SiiProgramError::Image(error) => Some(error),
            _ => None,
        }
    }
}

impl From<BusError> for SiiProgramError {
    fn from(error: BusError) -> SiiProgramError {
        SiiProgramError::Bus(error)
    }
}

impl From<SiiReadError> for SiiProgramError {
    fn from(error: SiiReadError) -> SiiProgramError {
        SiiProgramError::Read(error)
    }
}

/// What a write did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct SiiWritten {
    /// Words that were written and read back.
    pub written: usize,
    /// Words that were right already.
    pub unchanged: usize,
}

impl SiiWritten {
    /// Numbers of words that were written and that were right already.
    pub const fn new(written: usize, unchanged: usize) -> SiiWritten {
        SiiWritten { written, unchanged }
    }
}

/// Checks whether bytes may be written as an SII: an image with checksum, categories and end marker; with `force` any
/// words.
pub fn check(image: &[u8], force: bool) -> Result<(), SiiProgramError> {
    let bytes = image.len();
    if bytes == 0 || !bytes.is_multiple_of(2) || bytes / 2 > MAX_WORDS as usize {
        return Err(SiiProgramError::Length { bytes });
    }
    if force {
        return Ok(());
    }
    let sii = Sii::parse(image).map_err(SiiProgramError::Image)?;
    if sii.end_marker { Ok(()) } else { Err(SiiProgramError::EndMarker) }
}

/// Writes an image; see [`check`]. One that is longer than the EEPROM states as its size needs `force`: what fits would
/// be written, and the rest would fail. So does the image of another device, if the present content is sound.
pub async fn write(
    bus: &Bus,
    station: StationAddress,
    image: &[u8],
    force: bool,
) -> Result<SiiWritten, SiiProgramError> {
    check(image, force)?;
    let words: Vec<u16> = image.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
    let under_way = bus.begin_transfer(station, TransferKind::EepromWrite, Some(image.len() as u64));
    let access = Access::begin(bus, station).await?;
    let work = async {
        if !force {
            let present = access.read(0, SIZE_WORD + 1).await?;
            let present: Vec<u16> = present.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
            fits(&words, &present)?;
        }
        access.write_words(&words, &under_way).await
    };
    let written = work.await;
    access.end().await?;
    written
}

/// Whether an image is for the device with this present content, the words up to that of the size. An EEPROM that was
/// never written, or has another checksum, says nothing about the device.
fn fits(image: &[u16], present: &[u16]) -> Result<(), SiiProgramError> {
    let size = |words: &[u16]| words.get(SIZE_WORD as usize).map_or(0, |word| u32::from(*word) + 1);
    let there = (size(present) * KIBIT) as usize;
    if image.len() > there {
        return Err(SiiProgramError::TooLong { words: image.len(), there });
    }
    let is_sound = [u16::from(checksum_of(present)), CHECKSUM_DISABLED].contains(&present[CHECKSUM_WORD]);
    let product_of = |words: &[u16]| {
        let at = |word: usize| words.get(word).copied().unwrap_or_default();
        [0, 2].map(|field| {
            let first = IDENTITY_WORD as usize + field;
            u32::from(at(first)) | u32::from(at(first + 1)) << 16
        })
    };
    let product = product_of(present);
    if !is_sound || product[0] == 0 || product[0] == u32::MAX {
        return Ok(());
    }
    let (pdi, image_pdi) = (present[0] as u8, image[0] as u8);
    if product_of(image) != product {
        return Err(SiiProgramError::OtherProduct { present: product, image: product_of(image) });
    }
    if image_pdi != pdi {
        return Err(SiiProgramError::OtherPdi { present: pdi, image: image_pdi });
    }
    if size(image) != size(present) {
        return Err(SiiProgramError::OtherSize { present: size(present), image: size(image) });
    }
    Ok(())
}

/// Writes the alias and the new checksum of the configuration area. A checksum that is wrong before is corrected only
/// with `force`. The controller takes over an alias when it starts, not when it reloads (protocol 4.7).
pub async fn write_alias(
    bus: &Bus,
    station: StationAddress,
    alias: u16,
    force: bool,
) -> Result<SiiWritten, SiiProgramError> {
    let under_way = bus.begin_transfer(station, TransferKind::EepromWrite, None);
    let access = Access::begin(bus, station).await?;
    let work = async {
        let bytes = access.read(0, CONFIGURATION.len() as u32).await?;
        let mut words: Vec<u16> = bytes.as_chunks::<2>().0.iter().map(|pair| u16::from_le_bytes(*pair)).collect();
        let (expected, got) = (checksum_of(&words), words[CHECKSUM_WORD]);
        let disabled = got == CHECKSUM_DISABLED;
        if !force && !disabled && got as u8 != expected {
            return Err(SiiProgramError::Checksum { expected, got });
        }
        words[ALIAS_WORD] = alias;
        if !disabled {
            words[CHECKSUM_WORD] = checksum_of(&words).into();
        }
        access.write_words(&words, &under_way).await
    };
    let written = work.await;
    access.end().await?;
    written
}

/// Makes the controller reload its configuration from the EEPROM (command 0x0400).
pub async fn reload(bus: &Bus, station: StationAddress) -> Result<(), SiiProgramError> {
    let access = Access::begin(bus, station).await?;
    let loaded = access.reload().await;
    access.end().await?;
    loaded
}

fn checksum_of(words: &[u16]) -> u8 {
    let mut bytes = [0; 14];
    for (pair, word) in bytes.as_chunks_mut::<2>().0.iter_mut().zip(words) {
        *pair = word.to_le_bytes();
    }
    checksum(&bytes)
}

/// The EEPROM while it is assigned to EtherCAT.
pub(super) struct Access<'a> {
    bus: &'a Bus,
    station: StationAddress,
    /// It was assigned to the PDI before.
    offered: bool,
}

impl<'a> Access<'a> {
    pub(super) async fn begin(bus: &'a Bus, station: StationAddress) -> Result<Access<'a>, BusError> {
        let before = SiiConfiguration::from_bits(bus.fprd_array::<1>(station, map::SII_CONFIGURATION).await?[0]);
        claim(bus, station).await?;
        Ok(Access { bus, station, offered: before.offer_pdi })
    }

    pub(super) async fn end(self) -> Result<(), BusError> {
        if self.offered {
            self.bus.fpwr(self.station, map::SII_CONFIGURATION, &[1]).await?;
        }
        Ok(())
    }

    pub(super) async fn read(&self, first: u32, count: u32) -> Result<Vec<u8>, SiiProgramError> {
        let mut eeprom = Eeprom::open(self.bus, self.station, Pace::default()).await?;
        Ok(eeprom.bytes(first, count, None).await?)
    }

    /// Words of the EEPROM, as its present content states.
    pub(super) async fn size(&self) -> Result<u32, SiiProgramError> {
        let size = self.read(SIZE_WORD, 1).await?;
        Ok((u32::from(u16::from_le_bytes([size[0], size[1]])) + 1) * KIBIT)
    }

    async fn write_words(&self, words: &[u16], under_way: &UnderWayTransfer) -> Result<SiiWritten, SiiProgramError> {
        let mut done = SiiWritten::default();
        let area = CONFIGURATION.end.min(words.len());
        for at in (area..words.len()).chain(0..area) {
            let (word, value) = (at as u32, words[at]);
            if self.word(word).await? == value {
                done.unchanged += 1;
            } else {
                self.write_word(word, value).await?;
                done.written += 1;
            }
            under_way.done(2 * (done.written + done.unchanged) as u64);
        }
        Ok(done)
    }

    async fn word(&self, word: u32) -> Result<u16, SiiProgramError> {
        let bytes = self.read(word, 1).await?;
        Ok(u16::from_le_bytes([bytes[0], bytes[1]]))
    }

    /// Writes a word until it reads back as it was written.
    async fn write_word(&self, word: u32, value: u16) -> Result<(), SiiProgramError> {
        let mut tries = 0;
        loop {
            tries += 1;
            let error = match self.try_word(word, value).await {
                Err(error @ (SiiProgramError::Command { .. } | SiiProgramError::Refused { .. })) => error,
                Err(error) => return Err(error),
                Ok(()) => {
                    let got = self.word(word).await?;
                    if got == value {
                        return Ok(());
                    }
                    SiiProgramError::Mismatch { word, expected: value, got }
                }
            };
            if tries >= TRIES {
                return Err(error);
            }
            self.bus.sleep(TRY_PAUSE).await;
        }
    }

    async fn try_word(&self, word: u32, value: u16) -> Result<(), SiiProgramError> {
        self.wait(WRITE_LIMIT, word).await?;
        let [low, high] = SiiControl::request(SiiCommand::Write).encode();
        let [a, b, c, d] = word.to_le_bytes();
        let [first, second] = value.to_le_bytes();
        self.command(word, alloc::vec![low, high, a, b, c, d, first, second]).await?;
        let control = self.wait(WRITE_LIMIT, word).await?;
        if control.command_error || control.write_enable_error {
            return Err(SiiProgramError::Command { word, control });
        }
        Ok(())
    }

    async fn reload(&self) -> Result<(), SiiProgramError> {
        self.wait(LOAD_LIMIT, 0).await?;
        self.command(0, SiiControl::request(SiiCommand::Reload).encode().to_vec()).await?;
        let control = self.wait(LOAD_LIMIT, 0).await?;
        let failed = control.checksum_error || control.device_info_not_loaded;
        if failed { Err(SiiProgramError::NotLoaded { control }) } else { Ok(()) }
    }

    /// Writes from SII_CONTROL on. If the answer is lost the command is sent twice: the controller is then busy, or
    /// repeats the same operation.
    async fn command(&self, word: u32, data: Vec<u8>) -> Result<(), SiiProgramError> {
        let target = Target::Station(self.station, map::SII_CONTROL);
        let reply = self.bus.transfer(Command::Fpwr, target, data, Some(Wkc(1))).await?;
        if reply.wkc() == Wkc(1) {
            return Ok(());
        }
        let control = SiiControl::decode(&self.bus.fprd_array(self.station, map::SII_CONTROL).await?);
        if control.busy { Ok(()) } else { Err(SiiProgramError::Refused { word }) }
    }

    /// Waits until no command is under way.
    async fn wait(&self, limit: Duration, word: u32) -> Result<SiiControl, SiiProgramError> {
        let begin = self.bus.now();
        loop {
            let control = SiiControl::decode(&self.bus.fprd_array(self.station, map::SII_CONTROL).await?);
            if !control.busy {
                return Ok(control);
            }
            let elapsed = self.bus.now().since(begin);
            if elapsed >= limit {
                return Err(SiiProgramError::Busy { word });
            }
            self.bus.sleep(Pace::next(elapsed)).await;
        }
    }
}
