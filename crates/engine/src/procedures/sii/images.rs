//! Whole EEPROMs as they were read, for the next request.
//!
//! An image is used again only if the EEPROM is proved to be unchanged. Each read or write of an EEPROM, from either
//! side of the controller, changes the address register of its SII interface, and a start clears it. After each read
//! the registers of address and data therefore get a number that no other image has, the mark. While the mark is there
//! the interface has had no command since. Vendor, product, revision, serial number and the words that the controller
//! loads are read anew all the same.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::{Cell, RefCell};

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{SiiConfiguration, SiiControl, SiiPdiAccess, map};

use super::cache::SiiCache;
use super::eeprom::Eeprom;
use super::pace::Pace;
use super::program::{Access, SiiProgramError};
use super::{IDENTITY_WORD, MAX_WORDS, bytes_before};
use crate::supervisor::long_transfers::TransferKind;
use crate::supervisor::{Bus, BusError};

/// Most bytes of all images: above it the image whose last request is oldest is dropped.
const MOST_BYTES: usize = 4 << 20;
/// Words that are read between two updates of the progress.
const PART: u32 = 32;
/// Registers from SII_CONFIGURATION to the first two bytes of SII_DATA.
const REGISTERS: usize = 10;
/// Bytes from SII_ADDRESS on that hold a mark.
const MARK_BYTES: usize = 6;
/// Words that are compared with the image: the identity, and before it those that the controller loads.
const COMPARED: [(u32, u32); 2] = [(IDENTITY_WORD, 8), (0, IDENTITY_WORD)];

/// A number in the registers of address and data. The address is behind the largest EEPROM that is read. Of the data
/// registers, only the first two bytes can be written by any controller.
type Mark = [u8; MARK_BYTES];

#[derive(Debug)]
struct Image {
    station: StationAddress,
    mark: Mark,
    bytes: Rc<[u8]>,
}

/// Images by station address, in the order of their last request.
#[derive(Clone, Debug, Default)]
pub struct SiiImages {
    images: Rc<RefCell<Vec<Image>>>,
    marks: Rc<Cell<u32>>,
}

impl SiiImages {
    /// Drops the image of a SubDevice: its EEPROM is written.
    pub fn forget(&self, station: StationAddress) {
        self.keep_those(|kept| kept != station);
    }

    /// Keeps only the images of stations for which `is_kept` is true.
    pub fn keep_those(&self, is_kept: impl Fn(StationAddress) -> bool) {
        self.images.borrow_mut().retain(|image| is_kept(image.station));
    }

    fn of(&self, station: StationAddress) -> Option<(Mark, Rc<[u8]>)> {
        let images = self.images.borrow();
        images.iter().find(|image| image.station == station).map(|image| (image.mark, image.bytes.clone()))
    }

    fn keep(&self, station: StationAddress, mark: Mark, bytes: Rc<[u8]>) {
        self.forget(station);
        let mut images = self.images.borrow_mut();
        images.push(Image { station, mark, bytes });
        let sum = |images: &[Image]| images.iter().map(|image| image.bytes.len()).sum::<usize>();
        while sum(&images) > MOST_BYTES {
            images.remove(0);
        }
    }

    /// A mark that no image had. The first one of a MainDevice comes from its clock.
    fn next_mark(&self, bus: &Bus) -> Mark {
        let last = self.marks.get();
        let next = if last == 0 { bus.now().0 as u32 | 1 } else { last.wrapping_add(1) };
        self.marks.set(next);
        let address = MAX_WORDS | next & (MAX_WORDS - 1);
        let ([a, b, c, d], [low, high]) = (address.to_le_bytes(), ((next >> 15) as u16).to_le_bytes());
        [a, b, c, d, low, high]
    }
}

/// The EEPROM of a SubDevice: its image, if it is unchanged since.
pub async fn read(
    bus: &Bus,
    station: StationAddress,
    images: &SiiImages,
    cache: &SiiCache,
) -> Result<Vec<u8>, SiiProgramError> {
    if let Some((mark, bytes)) = images.of(station) {
        images.forget(station);
        // An error is no proof, and the read that follows reports it.
        if let Ok(Some(mark)) = prove(bus, station, images, cache, (&mark, &bytes)).await {
            images.keep(station, mark, bytes.clone());
            return Ok(bytes.to_vec());
        }
    }
    read_anew(bus, station, images).await
}

/// The whole EEPROM of a SubDevice, read word by word; the SII contains its size.
pub async fn read_anew(bus: &Bus, station: StationAddress, images: &SiiImages) -> Result<Vec<u8>, SiiProgramError> {
    images.forget(station);
    let access = Access::begin(bus, station).await?;
    let work = async {
        let words = access.size().await?;
        let bytes = read_words(bus, station, words.min(MAX_WORDS)).await?;
        // What was read is right without a mark, too.
        if let Ok(Some(mark)) = mark(bus, station, images).await {
            images.keep(station, mark, bytes.as_slice().into());
        }
        Ok(bytes)
    };
    let bytes = work.await;
    access.end().await?;
    bytes
}

/// Writes a mark; `None` if the controller does not hold it, or emulates its EEPROM, whose content may change without a
/// command.
async fn mark(bus: &Bus, station: StationAddress, images: &SiiImages) -> Result<Option<Mark>, BusError> {
    let mark = images.next_mark(bus);
    bus.fpwr(station, map::SII_ADDRESS, &mark).await?;
    let registers = bus.fprd_array(station, map::SII_CONFIGURATION).await?;
    Ok((is_marked(&registers, &mark) && !control_of(&registers).emulated).then_some(mark))
}

/// The first words of an EEPROM, with its progress.
async fn read_words(bus: &Bus, station: StationAddress, words: u32) -> Result<Vec<u8>, SiiProgramError> {
    let length = bytes_before(words);
    let under_way = bus.begin_transfer(station, TransferKind::EepromRead, Some(length as u64));
    let mut eeprom = Eeprom::open(bus, station, Pace::default()).await?;
    let mut bytes = Vec::with_capacity(length);
    for first in (0..words).step_by(PART as usize) {
        let next = words.min(first + PART);
        bytes.extend(eeprom.bytes(first, next - first, (next < words).then_some(next)).await?);
        under_way.done(bytes.len() as u64);
    }
    Ok(bytes)
}

/// The next mark, if the registers have the mark of an image and the first words are those of the image.
async fn prove(
    bus: &Bus,
    station: StationAddress,
    images: &SiiImages,
    cache: &SiiCache,
    (mark, image): (&Mark, &[u8]),
) -> Result<Option<Mark>, SiiProgramError> {
    let registers = bus.fprd_array(station, map::SII_CONFIGURATION).await?;
    if !is_marked(&registers, mark) {
        return Ok(None);
    }
    let is_offered = SiiConfiguration::from_bits(registers[0]).offer_pdi;
    if !is_offered {
        return compare(bus, station, images, cache, (&registers, image)).await;
    }
    let access = Access::begin(bus, station).await?;
    let work = async {
        // The PDI may have had the EEPROM since.
        let registers = bus.fprd_array(station, map::SII_CONFIGURATION).await?;
        match is_marked(&registers, mark) {
            true => compare(bus, station, images, cache, (&registers, image)).await,
            false => Ok(None),
        }
    };
    let compared = work.await;
    access.end().await?;
    compared
}

/// Reads the first words, and sets the next mark if they are those of an image.
async fn compare(
    bus: &Bus,
    station: StationAddress,
    images: &SiiImages,
    cache: &SiiCache,
    (registers, image): (&[u8; REGISTERS], &[u8]),
) -> Result<Option<Mark>, SiiProgramError> {
    let control = control_of(registers);
    let mut eeprom = Eeprom::ready(bus, station, Pace::guess(cache.pace()), control);
    for (at, (first, count)) in COMPARED.into_iter().enumerate() {
        let then = COMPARED.get(at + 1).map(|(next, _)| *next);
        let read = eeprom.bytes(first, count, then).await?;
        let range = bytes_before(first)..bytes_before(first + count);
        if image.get(range) != Some(&read[..]) {
            return Ok(None);
        }
    }
    let mark = images.next_mark(bus);
    bus.fpwr(station, map::SII_ADDRESS, &mark).await?;
    Ok(Some(mark))
}

fn control_of(registers: &[u8; REGISTERS]) -> SiiControl {
    SiiControl::decode(&[registers[2], registers[3]])
}

/// Whether the registers from SII_CONFIGURATION on have a mark, no command runs, and the PDI does not use the EEPROM.
fn is_marked(registers: &[u8; REGISTERS], mark: &Mark) -> bool {
    let control = control_of(registers);
    registers[REGISTERS - MARK_BYTES..] == *mark
        && !control.busy
        && !control.command_error
        && !SiiPdiAccess::from_bits(registers[1]).pdi_access
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(length: usize) -> Rc<[u8]> {
        alloc::vec![0; length].into()
    }

    // covers: daemon
    #[test]
    fn images_are_bounded_and_the_least_recently_requested_is_dropped() {
        let images = SiiImages::default();
        let mark = [0; MARK_BYTES];
        for number in 0..16 {
            images.keep(StationAddress(number), mark, image(MOST_BYTES / 16));
        }
        assert!((0..16).all(|number| images.of(StationAddress(number)).is_some()));
        // It was requested again.
        images.keep(StationAddress(0), mark, image(MOST_BYTES / 16));
        images.keep(StationAddress(16), mark, image(2));
        let there: Vec<u16> = (0..17).filter(|number| images.of(StationAddress(*number)).is_some()).collect();
        assert!(there.len() == 16 && !there.contains(&1), "{there:?}");
        images.keep_those(|station| station.0 < 3);
        assert!(images.of(StationAddress(0)).is_some() && images.of(StationAddress(16)).is_none());
        images.forget(StationAddress(0));
        assert!(images.of(StationAddress(0)).is_none() && images.of(StationAddress(2)).is_some());
    }

    // covers: daemon, 3.8
    #[test]
    fn registers_prove_an_image_only_with_its_mark_at_rest_and_without_the_pdi() {
        let mark = [0x34, 0x92, 0, 0, 7, 8];
        let with = |at: usize, bits: u8| {
            let mut registers = [0, 0, 0x40, 0, 0x34, 0x92, 0, 0, 7, 8];
            registers[at] ^= bits;
            is_marked(&registers, &mark)
        };
        assert!(with(0, 0) && with(0, 1), "the offer alone moves nothing");
        for (at, bits) in [(1, 1), (3, 0x80), (3, 0x20), (4, 1), (5, 0x80), (7, 1), (8, 1), (9, 1)] {
            assert!(!with(at, bits), "byte {at}, bits {bits:#x}");
        }
    }
}
