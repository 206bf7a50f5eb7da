//! Process data as an application reads and writes it within a cycle.

use std::ops::Range;
use std::time::Duration;

use ringcat_engine::domain::{DomainId, DomainStatus, Freshness};
use ringcat_engine::exchange::{Entry, Exchange};
use ringcat_engine::info::Direction;
use ringcat_engine::main_device::{Directory, SubDeviceId};
use ringcat_engine::time::Instant;

use crate::mapped::{DoesNotFit, Mapped, ObjectOf, Output, OutputBits, WriteError, signed, unsigned};
use crate::no_domain::NoDomain;
use crate::value::Number;

/// When a domain is due, and its state at the last evaluation.
#[derive(Debug)]
pub(crate) struct Rate {
    due: Due,
    pub status: DomainStatus,
}

/// In which cycles a domain is due.
#[derive(Clone, Copy, Debug)]
enum Due {
    /// In each cycle.
    Always,
    /// In every n-th cycle.
    Every(u64),
    /// In the first cycle that begins at or after each multiple of its period; both in nanoseconds.
    Between { cycle_ns: u64, period_ns: u64 },
}

impl Rate {
    /// Rate of a domain with this period, in cycles of this length. A domain without a period is due in each cycle.
    pub fn new(period: Duration, cycle: Duration) -> Rate {
        let [period_ns, cycle_ns] =
            [period, cycle].map(|time| u64::try_from(time.as_nanos()).unwrap_or(u64::MAX).max(1));
        let due = match period_ns / cycle_ns {
            _ if period_ns <= cycle_ns => Due::Always,
            cycles if period_ns.is_multiple_of(cycle_ns) => Due::Every(cycles),
            _ => Due::Between { cycle_ns, period_ns },
        };
        Rate { due, status: DomainStatus::default() }
    }

    /// Whether the domain is due in a cycle. The usual rate, each cycle, needs no division.
    #[inline(always)]
    pub fn is_due(&self, cycle: u64) -> bool {
        matches!(self.due, Due::Always) || self.is_due_now(cycle)
    }

    #[inline(never)]
    fn is_due_now(&self, cycle: u64) -> bool {
        match self.due {
            Due::Always => true,
            Due::Every(cycles) => cycle.is_multiple_of(cycles),
            Due::Between { cycle_ns, period_ns } => {
                u128::from(cycle) * u128::from(cycle_ns) % u128::from(period_ns) < u128::from(cycle_ns)
            }
        }
    }

    /// Largest number of cycles from one exchange of the domain to the next.
    pub fn cycles(&self) -> u64 {
        match self.due {
            Due::Always => 1,
            Due::Every(cycles) => cycles,
            Due::Between { cycle_ns, period_ns } => period_ns.div_ceil(cycle_ns),
        }
    }
}

/// The images of all domains, and the states of domains and inputs.
#[derive(Debug)]
pub struct ProcessData<'a> {
    pub(crate) exchange: &'a mut Exchange,
    pub(crate) directory: &'a Directory,
    pub(crate) rates: &'a [Rate],
    pub(crate) cycle: u64,
    pub(crate) now: Instant,
}

impl ProcessData<'_> {
    /// Number of the cycle, from 0.
    pub fn cycle(&self) -> u64 {
        self.cycle
    }

    /// Time at which the cycle began.
    pub fn now(&self) -> Instant {
        self.now
    }

    /// State of a domain when its frames were last evaluated.
    ///
    /// # Errors
    /// The declaration has no such domain.
    pub fn status(&self, domain: DomainId) -> Result<DomainStatus, NoDomain> {
        let rate = self.rates.get(domain.0).map(|rate| rate.status);
        rate.ok_or(NoDomain { domain, declared: self.rates.len() })
    }

    /// Whether a domain is due in this cycle.
    pub fn is_due(&self, domain: DomainId) -> bool {
        self.rates.get(domain.0).is_some_and(|rate| rate.is_due(self.cycle))
    }

    /// Value of an entry, zero-extended; [`ProcessData::get`] returns a typed value.
    pub fn read(&self, entry: &Entry) -> u64 {
        self.exchange.read(entry)
    }

    /// Value of an entry, sign-extended from its width.
    pub fn read_signed(&self, entry: &Entry) -> i64 {
        entry.read_signed(self.exchange.image(entry.domain))
    }

    /// Sets an output to an unsigned value; [`ProcessData::set`] takes a typed value and cannot fail.
    ///
    /// # Errors
    /// The entry is an input or not in the image, or the value has more bits. Nothing is changed then.
    ///
    /// ```
    /// use ringcat::{Entry, ProcessData, WriteError};
    ///
    /// fn start(data: &mut ProcessData<'_>, motor: &Entry, sensor: &Entry) -> Result<(), WriteError> {
    ///     data.write(motor, 1)?;
    ///     assert!(matches!(data.write(sensor, 1), Err(WriteError::NotAnOutput { .. })));
    ///     Ok(())
    /// }
    /// ```
    pub fn write(&mut self, entry: &Entry, value: u64) -> Result<(), WriteError> {
        self.check(entry)?;
        let bits = unsigned(value, entry.bit_length).map_err(|error| error.of(self.object_at(entry)))?;
        self.exchange.write(entry, bits);
        Ok(())
    }

    /// Sets an output to a signed value.
    ///
    /// # Errors
    /// As [`ProcessData::write`].
    pub fn write_signed(&mut self, entry: &Entry, value: i64) -> Result<(), WriteError> {
        self.check(entry)?;
        let bits = signed(value, entry.bit_length).map_err(|error| error.of(self.object_at(entry)))?;
        self.exchange.write(entry, bits);
        Ok(())
    }

    /// Checks that an entry can be written by value.
    fn check(&self, entry: &Entry) -> Result<(), WriteError> {
        let start = u64::from(entry.bit_offset);
        let bits = start..start + u64::from(entry.bit_length);
        let image_bits = self.exchange.image(entry.domain).len() as u64 * 8;
        match entry.bit_length {
            _ if bits.end > image_bits => Err(WriteError::Outside { domain: entry.domain, end: bits.end, image_bits }),
            1..=64 if self.directory.are_outputs(entry.domain, bits.clone()) => Ok(()),
            1..=64 => Err(self.not_an_output(entry.domain, start)),
            length => Err(WriteError::Length { bits: length }),
        }
    }

    #[cold]
    fn not_an_output(&self, domain: DomainId, start: u64) -> WriteError {
        WriteError::NotAnOutput { domain, start, object: self.directory.object_at(domain, start) }
    }

    #[cold]
    fn object_at(&self, entry: &Entry) -> Option<ObjectOf> {
        self.directory.object_at(entry.domain, entry.bit_offset.into())
    }

    /// Value of an input, or the value of an output that the next frame sends.
    ///
    /// ```
    /// use ringcat::{Input, Output, ProcessData};
    ///
    /// /// Follows the axis where it is.
    /// fn hold(data: &mut ProcessData<'_>, actual: Input<i32>, target: Output<i32>) {
    ///     data.set(target, data.get(actual));
    /// }
    /// ```
    ///
    /// An input cannot be set:
    ///
    /// ```compile_fail
    /// # use ringcat::{Input, ProcessData};
    /// fn wrong(data: &mut ProcessData<'_>, actual: Input<i32>) {
    ///     data.set(actual, 0);
    /// }
    /// ```
    pub fn get<M: Mapped>(&self, place: M) -> M::Number {
        M::Number::from_bits(self.exchange.read(&place.entry()))
    }

    /// Sets an output.
    pub fn set<T: Number>(&mut self, output: Output<T>, value: T) {
        self.exchange.write(&output.entry(), value.to_bits());
    }

    /// Sets an output of any number of bits.
    ///
    /// # Errors
    /// The value has more bits; nothing is changed then.
    pub fn set_bits(&mut self, output: OutputBits, value: u64) -> Result<(), DoesNotFit> {
        let bits = output.unsigned(value)?;
        self.exchange.write(&output.entry(), bits);
        Ok(())
    }

    /// Sets an output of any number of bits to a signed value.
    ///
    /// # Errors
    /// The value has more bits; nothing is changed then.
    pub fn set_signed_bits(&mut self, output: OutputBits, value: i64) -> Result<(), DoesNotFit> {
        let bits = output.signed(value)?;
        self.exchange.write(&output.entry(), bits);
        Ok(())
    }

    /// The process data of one SyncManager of a SubDevice; `None` where none of it is in a domain.
    pub fn area(&self, subdevice: SubDeviceId, sync_manager: u8) -> Option<&[u8]> {
        let (domain, range, _) = self.place_of(subdevice, sync_manager)?;
        self.exchange.image(domain).get(range)
    }

    /// The outputs of one SyncManager of a SubDevice; `None` where none are in a domain, or they are inputs.
    pub fn area_mut(&mut self, subdevice: SubDeviceId, sync_manager: u8) -> Option<&mut [u8]> {
        let (domain, range, direction) = self.place_of(subdevice, sync_manager)?;
        if direction == Direction::Inputs {
            return None;
        }
        self.exchange.image_mut(domain).get_mut(range)
    }

    fn place_of(&self, subdevice: SubDeviceId, sync_manager: u8) -> Option<(DomainId, Range<usize>, Direction)> {
        let areas = self.directory.areas(subdevice);
        let area = areas.iter().find(|area| area.placed.area.sync_manager == sync_manager)?;
        let start = area.placed.image_offset as usize;
        let end = start + usize::from(area.placed.area.length);
        Some((area.domain, start..end, area.direction))
    }

    /// A domain's whole image, inputs and outputs.
    pub fn image(&self, domain: DomainId) -> &[u8] {
        self.exchange.image(domain)
    }

    /// Bytes of a domain's image, to write outputs.
    ///
    /// # Errors
    /// The bytes are not all outputs, or not in the image.
    #[inline]
    pub fn outputs_mut(&mut self, domain: DomainId, bytes: Range<usize>) -> Result<&mut [u8], WriteError> {
        let [start, end] = [bytes.start, bytes.end].map(|at| (at as u64).saturating_mul(8));
        let image_bits = self.exchange.image(domain).len() as u64 * 8;
        if end > image_bits {
            return Err(WriteError::Outside { domain, end, image_bits });
        }
        if !self.directory.are_outputs(domain, start..end) {
            return Err(self.not_an_output(domain, start));
        }
        let image = self.exchange.image_mut(domain).get_mut(bytes);
        image.ok_or(WriteError::Outside { domain, end, image_bits })
    }

    /// Sets all outputs of all domains to zero.
    pub fn zero_outputs(&mut self) {
        self.fill_outputs(0);
    }

    /// Sets each byte of all outputs of all domains to a value.
    pub fn fill_outputs(&mut self, byte: u8) {
        for subdevice in (0..self.directory.subdevice_count()).map(SubDeviceId) {
            for area in self.directory.areas(subdevice).iter().filter(|area| area.direction == Direction::Outputs) {
                let start = area.placed.image_offset as usize;
                let end = start + usize::from(area.placed.area.length);
                self.exchange.image_mut(area.domain)[start..end].fill(byte);
            }
        }
    }

    /// Age of a SubDevice's inputs in a domain.
    pub fn freshness(&self, domain: DomainId, subdevice: SubDeviceId) -> Freshness {
        self.exchange.freshness(domain, subdevice)
    }

    /// The places of all process data.
    pub fn directory(&self) -> &Directory {
        self.directory
    }
}
