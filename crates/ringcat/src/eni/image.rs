//! The process image of an ENI at run time, in the layout of the file (protocol 8.1).
//!
//! The engine has its own layout on the wire; this module copies between both. The list of copies is built after
//! activation. In a cycle the module neither allocates nor waits.

use std::fmt;

use ringcat_config::{Configuration, ImageArea, ImageCopy, ProcessImage};
use ringcat_engine::domain::{DomainId, Freshness};
use ringcat_engine::exchange::{CopyRule, Entry, Exchange};
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::{Directory, SubDeviceId};

use super::value::{Value, VariableType};
use crate::process_data::ProcessData;

/// Maximum bits of a piece that is not aligned to bytes on both sides.
const WORD_BITS: u32 = 64;
/// Bits of one copy from input to output.
const COPY_BITS: u32 = 0x8000;

/// The images of an ENI.
#[derive(Clone, Debug)]
pub struct EniImage {
    inputs: Box<[u8]>,
    outputs: Box<[u8]>,
    input_pieces: Box<[Piece]>,
    output_pieces: Box<[Piece]>,
    variables: Box<[EniVariable]>,
    /// Numbers of the variables by name.
    by_name: Box<[usize]>,
    copies: Vec<CopyRule>,
    unplaced: Vec<SubDeviceId>,
}

/// A variable of the image.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct EniVariable {
    /// Its name.
    pub name: String,
    /// Its type.
    pub data_type: VariableType,
    /// Its image.
    pub direction: Direction,
    /// First bit in that image.
    pub bit: u32,
    /// Bits.
    pub bits: u32,
    /// Index in the declaration of the SubDevice whose process data it is.
    pub subdevice: Option<SubDeviceId>,
    /// The domain that exchanges it; `None` where no domain does.
    pub domain: Option<DomainId>,
}

/// Why an ENI's image does not fit the process data of the network.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ImageError {
    /// A part of a SubDevice lies beyond the image.
    Outside {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// Its image.
        direction: Direction,
        /// First bit behind the part.
        end: u64,
        /// Bits of the image.
        image: u64,
    },
    /// The SubDevice has less process data than the file has places for.
    TooShort {
        /// Index in the declaration.
        subdevice: SubDeviceId,
        /// In which direction.
        direction: Direction,
        /// Bits of the file.
        expected: u64,
        /// Bits of the SubDevice.
        got: u64,
    },
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ImageError::Outside { subdevice, direction, end, image } => write!(
                f,
                "SubDevice {subdevice}: its {direction} end at bit {end} of the process image, which has {image}"
            ),
            ImageError::TooShort { subdevice, direction, expected, got } => write!(
                f,
                "SubDevice {subdevice}: the file has places for {expected} bits of {direction}, the SubDevice has {got}"
            ),
        }
    }
}

impl std::error::Error for ImageError {}

/// Bits that are copied as they are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Piece {
    domain: DomainId,
    /// First bit in the image of the file.
    file: u32,
    /// First bit in the image of the domain.
    wire: u32,
    bits: u32,
}

impl Piece {
    /// Whole bytes on both sides.
    const fn is_aligned(&self) -> bool {
        self.file.is_multiple_of(8) && self.wire.is_multiple_of(8) && self.bits.is_multiple_of(8)
    }

    fn copy(&self, source: &[u8], source_bit: u32, target: &mut [u8], target_bit: u32) {
        if !self.is_aligned() {
            let entry = |bit_offset| Entry { domain: self.domain, bit_offset, bit_length: self.bits as u16 };
            entry(target_bit).write(target, entry(source_bit).read(source));
            return;
        }
        let range = |bit: u32| (bit / 8) as usize..((bit + self.bits) / 8) as usize;
        if let (Some(source), Some(target)) = (source.get(range(source_bit)), target.get_mut(range(target_bit))) {
            target.copy_from_slice(source);
        }
    }
}

impl EniImage {
    /// The images of a file over the process data of a network that was activated with its declaration.
    ///
    /// # Errors
    /// [`ImageError`]: a SubDevice has less process data than the file has places for.
    pub fn new(configuration: &Configuration, directory: &Directory) -> Result<EniImage, ImageError> {
        let image = &configuration.image;
        let mut builder = Builder { image, directory, inputs: Vec::new(), outputs: Vec::new(), unplaced: Vec::new() };
        for area in &image.areas {
            builder.area(area)?;
        }
        let variables: Box<[EniVariable]> = image.variables.iter().map(|variable| builder.variable(variable)).collect();
        let mut by_name: Vec<usize> = (0..variables.len()).collect();
        by_name.sort_by(|a, b| variables[*a].name.cmp(&variables[*b].name));
        let copies = image.copies.iter().flat_map(|copy| builder.copies(copy)).collect();
        let Builder { inputs, outputs, unplaced, .. } = builder;
        Ok(EniImage {
            inputs: vec![0; image.inputs_len].into(),
            outputs: vec![0; image.outputs_len].into(),
            input_pieces: in_words(&inputs),
            output_pieces: in_words(&outputs),
            variables,
            by_name: by_name.into(),
            copies,
            unplaced,
        })
    }

    /// Copies the inputs of the last cycle into the image. To be called first in a cycle. Inputs of a SubDevice that
    /// did not answer keep their values ([`EniImage::freshness`]).
    pub fn take_inputs(&mut self, data: &ProcessData<'_>) {
        self.take_inputs_of(data.exchange);
    }

    /// Copies the outputs into the process data that is sent next. To be called last in a cycle.
    pub fn give_outputs(&self, data: &mut ProcessData<'_>) {
        self.give_outputs_to(data.exchange);
    }

    /// As [`EniImage::take_inputs`], for an application with its own loop.
    pub fn take_inputs_of(&mut self, exchange: &Exchange) {
        for piece in &self.input_pieces {
            piece.copy(exchange.image(piece.domain), piece.wire, &mut self.inputs, piece.file);
        }
    }

    /// As [`EniImage::give_outputs`], for an application with its own loop.
    pub fn give_outputs_to(&self, exchange: &mut Exchange) {
        for piece in &self.output_pieces {
            piece.copy(&self.outputs, piece.file, exchange.image_mut(piece.domain), piece.wire);
        }
    }

    /// The input image.
    pub fn inputs(&self) -> &[u8] {
        &self.inputs
    }

    /// The output image.
    pub fn outputs(&self) -> &[u8] {
        &self.outputs
    }

    /// The output image, to write.
    pub fn outputs_mut(&mut self) -> &mut [u8] {
        &mut self.outputs
    }

    /// All variables in document order.
    pub fn variables(&self) -> &[EniVariable] {
        &self.variables
    }

    /// The variable with this name; the first one of the file if the name is not unique.
    pub fn variable(&self, name: &str) -> Option<&EniVariable> {
        let first = self.by_name.partition_point(|number| self.variables[*number].name.as_str() < name);
        self.by_name.get(first).and_then(|number| self.variables.get(*number)).filter(|found| found.name == name)
    }

    /// The first 64 bits of a variable, zero-extended.
    pub fn read(&self, variable: &EniVariable) -> u64 {
        variable.entry().read(self.side(variable.direction))
    }

    /// A variable of up to 64 bits, sign-extended.
    pub fn read_signed(&self, variable: &EniVariable) -> i64 {
        variable.entry().read_signed(self.side(variable.direction))
    }

    /// A variable's value by its type; `None` for one of more than 64 bits.
    pub fn value(&self, variable: &EniVariable) -> Option<Value> {
        let bits = u16::try_from(variable.bits).ok().filter(|bits| u32::from(*bits) <= WORD_BITS)?;
        Some(variable.data_type.value(self.read(variable), bits))
    }

    /// Sets the first 64 bits of an output variable; false for inputs, which cannot be set.
    pub fn write(&mut self, variable: &EniVariable, value: u64) -> bool {
        if variable.direction == Direction::Outputs {
            variable.entry().write(&mut self.outputs, value);
        }
        variable.direction == Direction::Outputs
    }

    /// Age of an input variable: that of its SubDevice's inputs.
    pub fn freshness(&self, variable: &EniVariable, data: &ProcessData<'_>) -> Freshness {
        match (variable.domain, variable.subdevice) {
            (Some(domain), Some(subdevice)) => data.freshness(domain, subdevice),
            _ => Freshness::Never,
        }
    }

    /// The copies from inputs to outputs in every cycle that the file declares, for
    /// [`Application::set_copies`](crate::Application::set_copies).
    pub fn copies(&self) -> &[CopyRule] {
        &self.copies
    }

    /// SubDevices with places in the file but without process data, in a domain or at all.
    pub fn unplaced(&self) -> &[SubDeviceId] {
        &self.unplaced
    }

    fn side(&self, direction: Direction) -> &[u8] {
        match direction {
            Direction::Inputs => &self.inputs,
            Direction::Outputs => &self.outputs,
        }
    }
}

impl EniVariable {
    /// Its place in its image, for the engine's typed access.
    const fn entry(&self) -> Entry {
        let bit_length = if self.bits > WORD_BITS { WORD_BITS } else { self.bits };
        Entry { domain: DomainId(0), bit_offset: self.bit, bit_length: bit_length as u16 }
    }
}

/// Finds the places of a file's bits on the wire.
struct Builder<'a> {
    image: &'a ProcessImage,
    directory: &'a Directory,
    inputs: Vec<Piece>,
    outputs: Vec<Piece>,
    unplaced: Vec<SubDeviceId>,
}

impl Builder<'_> {
    fn area(&mut self, area: &ImageArea) -> Result<(), ImageError> {
        let ImageArea { subdevice, direction, image_bit, bits, .. } = *area;
        let length = match direction {
            Direction::Inputs => self.image.inputs_len,
            Direction::Outputs => self.image.outputs_len,
        };
        let (end, image) = (u64::from(image_bit) + u64::from(bits), 8 * length as u64);
        if end > image {
            return Err(ImageError::Outside { subdevice: SubDeviceId(subdevice), direction, end, image });
        }
        let pieces = self.pieces(area, 0, bits);
        let placed: u64 = pieces.iter().map(|piece| u64::from(piece.bits)).sum();
        if placed == 0 && bits > 0 && self.process_data(area).next().is_none() {
            let subdevice = SubDeviceId(subdevice);
            if !self.unplaced.contains(&subdevice) {
                self.unplaced.push(subdevice);
            }
            return Ok(());
        }
        if placed < u64::from(bits) {
            let from = u64::from(area.bit_offset);
            let (expected, got) = (from + u64::from(bits), from + placed);
            return Err(ImageError::TooShort { subdevice: SubDeviceId(subdevice), direction, expected, got });
        }
        match direction {
            Direction::Inputs => self.inputs.extend(pieces),
            Direction::Outputs => self.outputs.extend(pieces),
        }
        Ok(())
    }

    /// Domain, first bit in its image and bits of the process data in which an area lies, as one row.
    fn process_data(&self, area: &ImageArea) -> impl Iterator<Item = (DomainId, u32, u32)> {
        let ImageArea { direction, sync_manager, .. } = *area;
        let areas = self.directory.areas(SubDeviceId(area.subdevice)).iter().filter(move |found| {
            let number = found.placed.area.sync_manager;
            found.direction == direction && sync_manager.is_none_or(|wanted| wanted == number)
        });
        areas.map(|found| (found.domain, 8 * found.placed.image_offset, 8 * u32::from(found.placed.area.length)))
    }

    /// Bits of an area on the wire; fewer than requested if the SubDevice has fewer.
    fn pieces(&self, area: &ImageArea, first: u32, bits: u32) -> Vec<Piece> {
        let mut pieces = Vec::new();
        // Behind the first bit of the row.
        let mut skip = u64::from(area.bit_offset) + u64::from(first);
        let (mut file, mut left) = (area.image_bit.saturating_add(first), bits);
        for (domain, start, length) in self.process_data(area) {
            if skip >= u64::from(length) {
                skip -= u64::from(length);
                continue;
            }
            let offset = skip as u32;
            let bits = left.min(length - offset);
            if bits > 0 {
                pieces.push(Piece { domain, file, wire: start + offset, bits });
            }
            (file, left, skip) = (file + bits, left - bits, 0);
        }
        pieces
    }

    fn variable(&self, variable: &ringcat_config::Variable) -> EniVariable {
        let pieces = match variable.direction {
            Direction::Inputs => &self.inputs,
            Direction::Outputs => &self.outputs,
        };
        let holds = |piece: &&Piece| (piece.file..piece.file + piece.bits).contains(&variable.image_bit);
        EniVariable {
            name: variable.name.clone(),
            data_type: VariableType::named(&variable.data_type),
            direction: variable.direction,
            bit: variable.image_bit,
            bits: variable.bits,
            subdevice: variable.subdevice.map(SubDeviceId),
            domain: pieces.iter().find(holds).map(|piece| piece.domain),
        }
    }

    /// A copy as rules over the domains' images: cut where either side is cut.
    fn copies(&self, copy: &ImageCopy) -> Vec<CopyRule> {
        let (Some(from), Some(to)) = (self.image.areas.get(copy.source_area), self.image.areas.get(copy.target_area))
        else {
            return Vec::new();
        };
        let mut sources = self.pieces(from, copy.source_bit, copy.bits).into_iter();
        let mut targets = self.pieces(to, copy.target_bit, copy.bits).into_iter();
        let (mut source, mut target) = (sources.next(), targets.next());
        let mut rules = Vec::new();
        while let (Some(a), Some(b)) = (&mut source, &mut target) {
            let bits = a.bits.min(b.bits).min(COPY_BITS);
            let entry = |piece: &Piece| Entry { domain: piece.domain, bit_offset: piece.wire, bit_length: bits as u16 };
            rules.push(CopyRule::new(entry(a), entry(b)));
            for piece in [&mut *a, &mut *b] {
                piece.wire += bits;
                piece.bits -= bits;
            }
            if a.bits == 0 {
                source = sources.next();
            }
            if b.bits == 0 {
                target = targets.next();
            }
        }
        rules
    }
}

/// Bits that are no whole bytes are copied word by word.
fn in_words(pieces: &[Piece]) -> Box<[Piece]> {
    let mut words = Vec::new();
    for piece in pieces {
        if piece.is_aligned() {
            words.push(*piece);
            continue;
        }
        for first in (0..piece.bits).step_by(WORD_BITS as usize) {
            let bits = WORD_BITS.min(piece.bits - first);
            words.push(Piece { file: piece.file + first, wire: piece.wire + first, bits, ..*piece });
        }
    }
    words.into()
}
