//! Requests to a device with all mailbox protocols; each response identifies its request.
//!
//! A [`Requester`] writes a unique value, reads it back, and keeps the possible values: the last written one, and after
//! failed writes their possible remains. Any other value is the response to another or an older request, and panics.

use std::net::Ipv4Addr;

use ringcat::Limits;
use ringcat_engine::mail::aoe::{self, AoeRoute};
use ringcat_engine::mail::coe::{self, SdoAddress, information};
use ringcat_engine::mail::eoe::{self, IpSettings};
use ringcat_engine::mail::foe::{self, FoeOptions};
use ringcat_engine::mail::soe::{self, SoeAddress};
use ringcat_engine::mail::stream::{Bounded, Bytes};
use ringcat_engine::mail::voe::{self, Voe};
use ringcat_engine::mail::{Lane, Mailbox};
use ringcat_sim::application::aoe::MEMORY;
use ringcat_wire::mailbox::aoe::{AmsAddress, NetId};
use ringcat_wire::mailbox::coe::ValueInfo;
use ringcat_wire::mailbox::soe::Idn;

/// Kinds of requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// CoE: an object, expedited.
    Object,
    /// CoE: an object in segments.
    LargeObject,
    /// CoE: the description of an object's entry.
    Description,
    /// FoE: a file of several packets.
    File,
    /// SoE: a number.
    Idn,
    /// SoE: a list in fragments.
    IdnList,
    /// AoE: memory.
    Memory,
    /// VoE: an echo.
    Vendor,
    /// EoE: an IP address.
    Address,
}

/// All kinds.
pub const KINDS: [Kind; 9] = [
    Kind::Object,
    Kind::LargeObject,
    Kind::Description,
    Kind::File,
    Kind::Idn,
    Kind::IdnList,
    Kind::Memory,
    Kind::Vendor,
    Kind::Address,
];

impl Kind {
    /// The lane of the request.
    pub const fn lane(self) -> Lane {
        match self {
            Kind::Object | Kind::LargeObject | Kind::Description => Lane::Coe,
            Kind::File => Lane::Foe,
            Kind::Idn | Kind::IdnList => Lane::Soe,
            Kind::Memory => Lane::Aoe,
            Kind::Vendor => Lane::Voe,
            Kind::Address => Lane::Eoe,
        }
    }

    /// Bytes of a value.
    const fn length(self) -> usize {
        match self {
            Kind::Object => 2,
            Kind::Idn | Kind::Address => 4,
            Kind::LargeObject => 2500,
            Kind::File | Kind::IdnList => 3000,
            Kind::Description => 1,
            Kind::Memory => 300,
            Kind::Vendor => 200,
        }
    }
}

/// Sends one kind of request, with unique values.
#[derive(Debug)]
pub struct Requester {
    kind: Kind,
    mailbox: Mailbox,
    limits: Limits,
    /// The initial value, after it was read.
    initial: Option<Vec<u8>>,
    /// Possible values, the last written at the end.
    known: Vec<Vec<u8>>,
    /// The device may lose its power, and with it the written value.
    forgets: bool,
}

/// Bytes of a list before its check sum.
const fn length_without_sum(value: &[u8]) -> usize {
    value.len().saturating_sub(4)
}

/// FNV-1a of the bytes of a list, to detect mixed lists.
fn check_sum(bytes: &[u8]) -> [u8; 4] {
    let hash = bytes.iter().fold(0x811C_9DC5u32, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193));
    hash.to_le_bytes()
}

/// Whether a sequence of bytes is contained in another.
fn contains(all: &[u8], part: &[u8]) -> bool {
    all.windows(part.len().max(1)).any(|window| window == part)
}

/// Text of an error.
fn said(error: impl std::fmt::Display) -> String {
    error.to_string()
}

impl Requester {
    /// A requester; only one of each kind may use a device at a time.
    pub fn new(kind: Kind, mailbox: Mailbox, limits: Limits, forgets: bool) -> Requester {
        Requester { kind, mailbox, limits, initial: None, known: Vec::new(), forgets }
    }

    /// Writes a value of this number and reads it back.
    ///
    /// # Errors
    /// The error of the service.
    ///
    /// # Panics
    /// When a response belongs to another request.
    pub async fn ask(&mut self, number: u32) -> Result<(), String> {
        match self.kind {
            Kind::Description => return self.describe(number).await,
            Kind::Vendor => return self.echo(number).await,
            _ => {}
        }
        if self.initial.is_none() && self.kind != Kind::File {
            self.initial = Some(self.read().await?);
        }
        let value = self.value(number);
        self.known.push(value.clone());
        self.write(&value).await?;
        let initial = self.initial.clone().filter(|_| self.forgets);
        self.known = vec![value];
        self.known.extend(initial);
        let found = self.read().await?;
        let own = self.known.iter().position(|value| *value == found);
        assert!(own.is_some(), "{:?} {number}: {} bytes {:02x?}", self.kind, found.len(), &found[..found.len().min(8)]);
        Ok(())
    }

    /// A value that is unique for this number.
    fn value(&self, number: u32) -> Vec<u8> {
        let mut value: Vec<u8> = (0..self.kind.length()).map(|at| (at as u32 * 31 + number * 7 % 251) as u8).collect();
        let tag = (number << 8 | self.kind as u32).to_le_bytes();
        let length = value.len().min(4);
        value[..length].copy_from_slice(&tag[4 - length..]);
        if length == 4 {
            value[..4].copy_from_slice(&tag);
        } else {
            value[..2].copy_from_slice(&(number as u16).to_le_bytes());
        }
        if self.kind == Kind::IdnList {
            let end = length_without_sum(&value);
            let sum = check_sum(&value[..end]);
            value[end..].copy_from_slice(&sum);
        }
        value
    }

    fn object(&self) -> SdoAddress {
        if self.kind == Kind::Object { SdoAddress::new(0x2001, 7) } else { SdoAddress::new(0x2002, 0) }
    }

    fn idn(&self) -> SoeAddress {
        if self.kind == Kind::Idn {
            SoeAddress::value(1, Idn::standard(0, 47))
        } else {
            SoeAddress::value(0, Idn::product(0, 1))
        }
    }

    fn route() -> AoeRoute {
        let address = |port| AmsAddress { net_id: NetId([5, 18, 2, 3, 2, 1]), port };
        AoeRoute::new(address(1000), address(0x8000))
    }

    async fn write(&self, value: &[u8]) -> Result<(), String> {
        let (mailbox, limits) = (&self.mailbox, self.limits);
        match self.kind {
            Kind::Object | Kind::LargeObject => coe::write(mailbox, self.object(), value, limits).await.map_err(said),
            Kind::File => {
                let options = FoeOptions::default().with_limits(limits);
                foe::write(mailbox, "question", options, &mut Bytes::new(value), |_| ()).await.map(drop).map_err(said)
            }
            Kind::Idn => soe::write(mailbox, self.idn(), value, limits).await.map_err(said),
            Kind::IdnList => {
                // A list begins with its length and its maximum length.
                let length = (value.len() as u16).to_le_bytes();
                let list = [&length, &20_000u16.to_le_bytes(), value].concat();
                soe::write(mailbox, self.idn(), &list, limits).await.map_err(said)
            }
            Kind::Memory => aoe::write(mailbox, Self::route(), (MEMORY, 16), value, limits).await.map_err(said),
            Kind::Address => {
                let address = <[u8; 4]>::try_from(value).ok().map(Into::into);
                let settings = IpSettings::default().with_address(address).with_mask(Ipv4Addr::new(255, 0, 0, 0));
                eoe::set_ip(mailbox, 0, &settings, limits).await.map_err(said)
            }
            Kind::Description | Kind::Vendor => Ok(()),
        }
    }

    async fn read(&self) -> Result<Vec<u8>, String> {
        let (mailbox, limits, room) = (&self.mailbox, self.limits, 120_000);
        match self.kind {
            Kind::Object | Kind::LargeObject => coe::read(mailbox, self.object(), limits, room).await.map_err(said),
            Kind::File => {
                let options = FoeOptions::default().with_limits(limits);
                let mut sink = Bounded::new(room);
                foe::read(mailbox, "question", options, &mut sink, |_| ()).await.map_err(said)?;
                Ok(sink.into_bytes())
            }
            Kind::Idn => soe::read(mailbox, self.idn(), limits, room).await.map_err(said),
            Kind::IdnList => {
                let list = soe::read(mailbox, self.idn(), limits, room).await.map_err(said)?;
                // Fragments that the device itself discards show only in the list.
                let value = list.get(4..).unwrap_or_default();
                let length = list.first_chunk().map(|length| usize::from(u16::from_le_bytes(*length)));
                let end = length_without_sum(value);
                let sum_fits = value.len() != self.kind.length() || check_sum(&value[..end]) == value[end..];
                // If the first fragments were discarded, the last one alone is accepted as a list, with any contents.
                let is_rest = |known: &Vec<u8>| known.len() > value.len() && contains(known, value);
                let whole = sum_fits && !self.known.iter().any(is_rest);
                if length == Some(value.len()) && whole {
                    Ok(value.to_vec())
                } else {
                    Err("a part of a list".to_owned())
                }
            }
            Kind::Memory => {
                let length = self.kind.length() as u32;
                aoe::read(mailbox, Self::route(), (MEMORY, 16), length, limits).await.map_err(said)
            }
            Kind::Address => {
                let settings = eoe::read_ip(mailbox, 0, limits).await.map_err(said)?;
                Ok(settings.address.map_or(Vec::new(), |address| address.octets().to_vec()))
            }
            Kind::Description | Kind::Vendor => Ok(Vec::new()),
        }
    }

    /// An entry of the array; the response contains its subindex.
    async fn describe(&self, number: u32) -> Result<(), String> {
        let address = (0x2001, (number % 200) as u8 + 1);
        let entry = information::entry(&self.mailbox, address, ValueInfo::ALL, self.limits).await.map_err(said)?;
        assert_eq!((entry.index, entry.sub_index), address);
        Ok(())
    }

    async fn echo(&self, number: u32) -> Result<(), String> {
        let message = Voe { vendor_id: 0x0C47, vendor_type: number as u16, data: self.value(number) };
        let answer = voe::exchange(&self.mailbox, &message, self.limits).await.map_err(said)?;
        // A vendor message may be unsolicited, too; the last request may have a late response.
        assert!(self.known.is_empty() && answer.vendor_type == number as u16 && answer == message, "VoE {number}");
        Ok(())
    }
}
