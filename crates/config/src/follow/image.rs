//! The process image: maps bits of the image to bits of SyncManagers.
//!
//! FMMUs assign logical addresses to process data, cyclic commands assign image positions to logical addresses, and
//! `Send` and `Recv` state image positions directly; all three must agree. Offsets of commands count either from the
//! datagram's data (EC-Engineer) or from its header, ten bytes earlier (TwinCAT, whose image is the frame). The reader
//! detects the variant from the file.

use std::collections::BTreeSet;

use ringcat_engine::info::Direction;

use super::areas::Piece;
use super::cyclic::Cover;
use super::messages::{contradiction, label};
use super::notices::Notices;
use super::registers::is_complete;
use crate::configuration::{ImageArea, ImageCopy, ProcessImage, Variable};
use crate::eni::{BitRange, Eni, EniError, ImageSide, Problem, SubDevice};

/// Maximum number of bytes of an image.
const MAX_IMAGE: usize = 16 << 20;

/// Bits from a command's offset to its data.
const HEADERS: [u64; 2] = [0, 80];
/// Names of variables shown in a notice.
const NAMES: usize = 3;
/// Maximum number of copies after splitting at the borders of areas.
const MAX_COPIES: usize = 8_192;

/// Creates the image.
pub(super) fn follow(
    eni: &Eni,
    mappings: &[Vec<Piece>],
    covers: &[Vec<Option<Cover>>],
    notices: &mut Notices,
) -> Result<ProcessImage, EniError> {
    let mut areas = Vec::new();
    let header = header(eni, mappings, covers);
    for index in 0..eni.subdevices.len() {
        for direction in [Direction::Outputs, Direction::Inputs] {
            of_subdevice(eni, index, direction, &mappings[index], &covers[index], header, &mut areas, notices)?;
        }
    }
    let exchanged = exchanged(mappings, covers);
    areas.retain(|area| area.sync_manager.is_none_or(|sm| exchanged[area.subdevice].contains(&sm)));
    areas.sort_by_key(|area| (area.direction == Direction::Inputs, area.image_bit));
    check_overlaps(eni, &areas)?;
    let end =
        |direction| areas.iter().filter(|a| a.direction == direction).map(|a| a.image_bit + a.bits).max().unwrap_or(0);
    let (inputs_end, outputs_end) = (end(Direction::Inputs), end(Direction::Outputs));
    let mut image = ProcessImage {
        inputs_len: length(&eni.image.inputs, inputs_end)?,
        outputs_len: length(&eni.image.outputs, outputs_end)?,
        areas,
        ..ProcessImage::default()
    };
    for area in &image.areas {
        let room = if area.direction == Direction::Inputs { image.inputs_len } else { image.outputs_len };
        if u64::from(area.image_bit) + u64::from(area.bits) > room as u64 * 8 {
            let place = range_of(&eni.subdevices[area.subdevice], area.direction)
                .first()
                .map_or_else(Default::default, |r| r.place);
            let (what, expected) =
                (format!("{} in the image", side(area.direction)), format!("an end within {room} bytes"));
            let got = format!("{} bits from bit {}", area.bits, area.image_bit);
            return Err(contradiction(eni, area.subdevice, place, what, expected, got, "ByteSize is too small"));
        }
    }
    variables(eni, &mut image, notices);
    copies(eni, &mut image, notices)?;
    Ok(image)
}

/// SyncManagers that cyclic commands exchange, by SubDevice; all SyncManagers if no command addresses a SubDevice.
fn exchanged(mappings: &[Vec<Piece>], covers: &[Vec<Option<Cover>>]) -> Vec<BTreeSet<u8>> {
    let any = covers.iter().flatten().any(Option::is_some);
    let of_subdevice = |(pieces, covers): (&Vec<Piece>, &Vec<Option<Cover>>)| {
        let covered = pieces.iter().zip(covers).filter(|(_, cover)| !any || cover.is_some());
        covered.map(|(piece, _)| piece.sync_manager).collect()
    };
    mappings.iter().zip(covers).map(of_subdevice).collect()
}

const fn side(direction: Direction) -> &'static str {
    match direction {
        Direction::Outputs => "ProcessData/Send",
        Direction::Inputs => "ProcessData/Recv",
    }
}

fn range_of(subdevice: &SubDevice, direction: Direction) -> &[BitRange] {
    let Some(process_data) = &subdevice.process_data else { return &[] };
    match direction {
        Direction::Outputs => &process_data.send,
        Direction::Inputs => &process_data.receive,
    }
}

/// Bits from a command's offset to its data, if one of the variants puts all process data at the positions of `Send`
/// and `Recv`.
fn header(eni: &Eni, mappings: &[Vec<Piece>], covers: &[Vec<Option<Cover>>]) -> Option<u64> {
    let fits = |header: u64| {
        eni.subdevices.iter().zip(mappings).zip(covers).all(|((subdevice, pieces), covers)| {
            pieces.iter().zip(covers).all(|(piece, cover)| {
                let Some(bit) = cover.and_then(|cover| cover.image_bit) else { return true };
                let ranges = range_of(subdevice, piece.direction);
                ranges.is_empty() || ranges.iter().any(|range| within(range, bit + header, piece.bits))
            })
        })
    };
    HEADERS.into_iter().find(|header| fits(*header))
}

fn within(range: &BitRange, bit: u64, bits: u32) -> bool {
    bit >= range.start.into() && bit + u64::from(bits) <= u64::from(range.start) + u64::from(range.length)
}

#[allow(clippy::too_many_arguments)]
fn of_subdevice(
    eni: &Eni,
    index: usize,
    direction: Direction,
    pieces: &[Piece],
    covers: &[Option<Cover>],
    header: Option<u64>,
    areas: &mut Vec<ImageArea>,
    notices: &mut Notices,
) -> Result<(), EniError> {
    let ranges = range_of(&eni.subdevices[index], direction);
    let pieces: Vec<(&Piece, Option<Cover>)> =
        pieces.iter().zip(covers.iter().copied()).filter(|(piece, _)| piece.direction == direction).collect();
    if pieces.is_empty() {
        return unmapped(eni, index, direction, ranges, areas, notices);
    }
    let said: u64 = ranges.iter().map(|range| u64::from(range.length)).sum();
    let mapped: u64 = pieces.iter().map(|(piece, _)| u64::from(piece.bits)).sum();
    if !ranges.is_empty() && said != mapped {
        let hint = "Send and Recv must have as many bits as the FMMUs map: export the file again";
        let expected = format!("{mapped} bits, which the FMMUs map");
        return Err(contradiction(
            eni,
            index,
            ranges[0].place,
            side(direction),
            expected,
            format!("{said} bits"),
            hint,
        ));
    }
    let by_offset: Option<Vec<u64>> = header.and_then(|header| {
        pieces.iter().map(|(_, cover)| cover.and_then(|cover| cover.image_bit).map(|bit| bit + header)).collect()
    });
    match by_offset {
        Some(bits) => {
            for ((piece, _), bit) in pieces.iter().zip(bits) {
                areas.push(area(eni, index, piece, 0, bit, piece.bits)?);
            }
        }
        None if ranges.is_empty() => {
            let reason =
                "neither Send or Recv nor a cyclic command gives an image position: exchanged, but not in the image";
            notices.add(Some(pieces[0].0.place), Some(index), "process data", reason);
        }
        None => {
            if pieces.iter().any(|(_, cover)| cover.is_some_and(|cover| cover.image_bit.is_some())) {
                let reason = "the offsets of the cyclic commands differ: Send and Recv take precedence";
                notices.add(Some(ranges[0].place), Some(index), side(direction), reason);
            }
            in_order(eni, index, ranges, &pieces, areas)?;
        }
    }
    Ok(())
}

/// Process data without an FMMU: in a file that leaves FMMUs to the SII, the ranges follow one another.
fn unmapped(
    eni: &Eni,
    index: usize,
    direction: Direction,
    ranges: &[BitRange],
    areas: &mut Vec<ImageArea>,
    notices: &mut Notices,
) -> Result<(), EniError> {
    if is_complete(&eni.subdevices[index].init_commands) {
        if let Some(range) = ranges.iter().find(|range| range.length > 0) {
            let reason = "no FMMU maps process data there: the bits stay zero";
            notices.add(Some(range.place), Some(index), side(direction), reason);
        }
        return Ok(());
    }
    let mut bit_offset: u32 = 0;
    for range in ranges.iter().filter(|range| range.length > 0) {
        let (image_bit, bits) = (range.start, range.length);
        areas.push(ImageArea { subdevice: index, direction, sync_manager: None, bit_offset, image_bit, bits });
        let what = side(direction);
        bit_offset = bit_offset.checked_add(bits).ok_or_else(|| {
            contradiction(eni, index, range.place, what, "fewer than 2^32 bits", "more in all ranges", "")
        })?;
    }
    Ok(())
}

fn area(eni: &Eni, subdevice: usize, piece: &Piece, from: u32, bit: u64, bits: u32) -> Result<ImageArea, EniError> {
    let image_bit = u32::try_from(bit).ok().filter(|bit| bit.checked_add(bits).is_some());
    let image_bit = image_bit.ok_or_else(|| {
        let got = format!("bit {bit}");
        contradiction(eni, subdevice, piece.place, "place in the image", "an end below 2^32 bits", got, "")
    })?;
    let (direction, sync_manager, bit_offset) = (piece.direction, Some(piece.sync_manager), piece.bit_offset + from);
    Ok(ImageArea { subdevice, direction, sync_manager, bit_offset, image_bit, bits })
}

/// Fills the ranges in document order with the pieces in the order of SyncManagers.
fn in_order(
    eni: &Eni,
    index: usize,
    ranges: &[BitRange],
    pieces: &[(&Piece, Option<Cover>)],
    areas: &mut Vec<ImageArea>,
) -> Result<(), EniError> {
    let mut ranges = ranges.iter().map(|range| (range.start, range.length)).filter(|(_, length)| *length > 0);
    let mut room = ranges.next();
    for (piece, _) in pieces {
        let mut done = 0;
        while let Some((start, left)) = room.filter(|_| done < piece.bits) {
            let bits = left.min(piece.bits - done);
            areas.push(area(eni, index, piece, done, start.into(), bits)?);
            done += bits;
            room = if bits == left { ranges.next() } else { Some((start + bits, left - bits)) };
        }
    }
    Ok(())
}

/// Checks that areas of one image share no bits.
fn check_overlaps(eni: &Eni, areas: &[ImageArea]) -> Result<(), EniError> {
    let Some(pair) = areas.windows(2).find(|pair| {
        pair[0].direction == pair[1].direction
            && u64::from(pair[0].image_bit) + u64::from(pair[0].bits) > pair[1].image_bit.into()
    }) else {
        return Ok(());
    };
    let (first, second) = (pair[0], pair[1]);
    let subdevice = &eni.subdevices[second.subdevice];
    let place = range_of(subdevice, second.direction).first().map_or(subdevice.place, |range| range.place);
    let got = format!("bit {}, which {} also has", second.image_bit, label(eni, first.subdevice));
    Err(contradiction(
        eni,
        second.subdevice,
        place,
        side(second.direction),
        "bits that no other SubDevice has in the image",
        got,
        "",
    ))
}

/// Bytes of an image: the size in the file, otherwise the used size.
fn length(side: &ImageSide, end: u32) -> Result<usize, EniError> {
    let bytes = side.bytes.map_or(end.div_ceil(8), |bytes| bytes) as usize;
    if bytes > MAX_IMAGE {
        return Err(EniError::of_file(Problem::TooMuch { what: "bytes of a process image", limit: MAX_IMAGE }));
    }
    Ok(bytes)
}

/// The area of `areas`, sorted by direction and bit, that contains a bit.
fn area_at(areas: &[ImageArea], direction: Direction, bit: u32) -> Option<usize> {
    let key = |area: &ImageArea| (area.direction == Direction::Inputs, area.image_bit);
    let behind = areas.partition_point(|area| key(area) <= (direction == Direction::Inputs, bit));
    let area = areas[..behind].last()?;
    (area.direction == direction && bit - area.image_bit < area.bits).then(|| behind - 1)
}

fn variables(eni: &Eni, image: &mut ProcessImage, notices: &mut Notices) {
    let sides = [(Direction::Inputs, &eni.image.inputs), (Direction::Outputs, &eni.image.outputs)];
    let mut unassigned: Vec<&crate::eni::Variable> = Vec::new();
    for (direction, side) in sides {
        for variable in &side.variables {
            let subdevice =
                area_at(&image.areas, direction, variable.bit_offset).map(|area| image.areas[area].subdevice);
            if subdevice.is_none() {
                unassigned.push(variable);
            }
            image.variables.push(Variable {
                name: variable.name.clone(),
                data_type: variable.data_type.clone(),
                direction,
                image_bit: variable.bit_offset,
                bits: variable.bits,
                subdevice,
            });
        }
    }
    let Some(first) = unassigned.first() else { return };
    let names: Vec<String> = unassigned.iter().take(NAMES).map(|variable| crate::eni::quoted(&variable.name)).collect();
    let more = if unassigned.len() > NAMES { ", ..." } else { "" };
    let subject = format!("{} variables of no SubDevice ({}{more})", unassigned.len(), names.join(", "));
    let reason = "process data of no SubDevice: not exchanged, inputs stay zero";
    notices.add(Some(first.place), None, subject, reason);
}

/// `CopyInfo`, split at the borders of source and target areas.
fn copies(eni: &Eni, image: &mut ProcessImage, notices: &mut Notices) -> Result<(), EniError> {
    let commands = eni.tasks.iter().flat_map(|task| &task.frames).flat_map(|frame| &frame.commands);
    for copy in commands.flat_map(|command| &command.copies) {
        let mut done = 0;
        while done < copy.bits {
            let bit = |from: u32| from.checked_add(done);
            let source = bit(copy.source).and_then(|bit| Some((bit, area_at(&image.areas, Direction::Inputs, bit)?)));
            let target = bit(copy.target).and_then(|bit| Some((bit, area_at(&image.areas, Direction::Outputs, bit)?)));
            let (Some((from, source_area)), Some((to, target_area))) = (source, target) else {
                let reason = "source or target is process data of no SubDevice: not copied";
                notices.add(Some(copy.place), None, "CopyInfo", reason);
                break;
            };
            let (source, target) = (image.areas[source_area], image.areas[target_area]);
            let (source_bit, target_bit) = (from - source.image_bit, to - target.image_bit);
            let bits = (copy.bits - done).min(source.bits - source_bit).min(target.bits - target_bit);
            if image.copies.len() == MAX_COPIES {
                return Err(EniError::at(copy.place, Problem::TooMuch { what: "copies", limit: MAX_COPIES }));
            }
            image.copies.push(ImageCopy { source_area, source_bit, target_area, target_bit, bits });
            done += bits;
        }
    }
    Ok(())
}
