//! Datagrams of the application's own.
//!
//! On two links positions are those of the last scan (CR-09). Increments would follow the way of the frames, which a
//! break, a crossed SubDevice or a branch behind the way on makes another one; and at an edge, while a frame is out,
//! it is not known which. So the SubDevice that the scan found at a position is addressed by its station address since.

use alloc::vec::Vec;

use ringcat_wire::address::{LogicalAddress, Position, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use super::MainDevice;
use super::pending::Pending;
use crate::declared::SubDeviceId;
use crate::layout::Layout;
use crate::link::LinkSet;
use crate::procedures::junction::{UnderWay, ordering};
use crate::procedures::services::ServiceError;
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::{Bus, BusError, Reply};

/// Datagrams of the application that are taken at once.
pub const MAX_DATAGRAMS: usize = 1024;

/// A datagram of the application's own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawDatagram {
    /// The command.
    pub command: Command,
    /// The address, as the command wants it. With two links a position is that of the last scan, or of a rescan
    /// since then of which the cabling was taken over, wherever a break is and whichever SubDevice is missing or came
    /// in between: it leaves with the station address of the SubDevice that was found there. A SubDevice that lost its
    /// power answers to it again when it was given its address back, one that is not declared only after another look
    /// of this kind. Other positions, and all with one link, count SubDevices as frames meet them.
    pub target: Target,
    /// What is sent; for reads, zeros.
    pub data: Vec<u8>,
    /// Whether it may be sent again when its frame is lost.
    pub resend: bool,
}

impl MainDevice {
    /// Starts to send datagrams of the application's own, at once, in one frame where they fit. Each brings its answer,
    /// whatever its working counter. An LRW over process data of several SubDevices is refused with two links, and all
    /// others with it.
    pub fn start_datagrams(
        &mut self,
        datagrams: Vec<RawDatagram>,
    ) -> Pending<Result<Vec<Result<Reply, BusError>>, ServiceError>> {
        let bus = self.bus();
        let addressed = self.addressed(datagrams);
        let segment = self.segment.clone();
        self.start(async move {
            let addressed = addressed?;
            let _orders: Vec<_> = addressed.iter().flat_map(|(it, _)| orders(segment.as_ref(), it)).collect();
            Ok(bus.gather(addressed, send).await)
        })
    }

    /// How each of them leaves, and its original address.
    fn addressed(&self, datagrams: Vec<RawDatagram>) -> Result<Vec<(RawDatagram, Target)>, ServiceError> {
        if datagrams.len() > MAX_DATAGRAMS {
            return Err(ServiceError::TooMany { got: datagrams.len(), limit: MAX_DATAGRAMS });
        }
        let stations = if self.options.links() == LinkSet::Ring { self.stations_by_position() } else { Vec::new() };
        let by_station = |datagram: RawDatagram| {
            let asked = datagram.target;
            let Target::Position(Position(position), register) = asked else { return (datagram, asked) };
            match (with_station(datagram.command), stations.get(usize::from(position))) {
                (Some(command), Some(station)) => {
                    (RawDatagram { command, target: Target::Station(*station, register), ..datagram }, asked)
                }
                _ => (datagram, asked),
            }
        };
        datagrams.iter().try_for_each(|datagram| self.check_lrw_of(datagram))?;
        Ok(datagrams.into_iter().map(by_station).collect())
    }

    /// The station addresses of those that the last scan found, or the rescan of which the cabling was taken over, by
    /// position.
    fn stations_by_position(&self) -> Vec<StationAddress> {
        match (&self.segment, &*self.scan.borrow()) {
            (Some(segment), _) => segment.view().cabling.stations.clone(),
            (None, Some(Ok(scan))) => scan.subdevices.iter().map(|info| info.station).collect(),
            (None, Some(Err(_)) | None) => Vec::new(),
        }
    }

    fn check_lrw_of(&self, datagram: &RawDatagram) -> Result<(), ServiceError> {
        let (Command::Lrw, Target::Logical(logical)) = (datagram.command, datagram.target) else { return Ok(()) };
        let Some(segment) = self.segment.as_ref().filter(|_| self.options.links() == LinkSet::Ring) else {
            return Ok(());
        };
        match covered(&segment.view().layout, logical, datagram.data.len()) {
            Some(subdevices) => Err(ServiceError::LrwOnTwoLinks {
                logical,
                length: datagram.data.len(),
                subdevices: subdevices.map(SubDeviceId),
            }),
            None => Ok(()),
        }
    }
}

/// Notes what a datagram tells junctions to do about their ports.
fn orders(segment: Option<&SharedSegment>, datagram: &RawDatagram) -> Vec<UnderWay> {
    use Command::{Aprw, Apwr, Brw, Bwr, Fprw, Fpwr};
    let Some(known) = segment.filter(|_| matches!(datagram.command, Aprw | Apwr | Brw | Bwr | Fprw | Fpwr)) else {
        return Vec::new();
    };
    let at = |place: usize| known.view().cabling.stations.get(place).copied();
    let (stations, register) = match datagram.target {
        Target::Station(station, register) => (Vec::from([station]), register),
        Target::Position(Position(place), register) => (at(place.into()).into_iter().collect(), register),
        Target::Broadcast(register) => (known.view().cabling.stations.clone(), register),
        Target::Logical(_) | Target::None => return Vec::new(),
    };
    stations.into_iter().filter_map(|station| ordering(segment, station, register, &datagram.data)).collect()
}

/// Two SubDevices of which process data lies in a range of logical addresses, if there are as many.
fn covered(layout: &Layout, logical: LogicalAddress, length: usize) -> Option<[usize; 2]> {
    let (begin, end) = (u64::from(logical.0), u64::from(logical.0) + length as u64);
    let areas = layout.domains.iter().flat_map(|domain| &domain.areas).filter(|placed| {
        let first = u64::from(placed.logical.0);
        first < end && begin < first + u64::from(placed.area.length)
    });
    let mut subdevices = areas.map(|placed| placed.area.subdevice);
    let one = subdevices.next()?;
    subdevices.find(|other| *other != one).map(|other| [one, other])
}

/// The command that does the same by station address.
const fn with_station(command: Command) -> Option<Command> {
    match command {
        Command::Aprd => Some(Command::Fprd),
        Command::Apwr => Some(Command::Fpwr),
        Command::Aprw => Some(Command::Fprw),
        Command::Armw => Some(Command::Frmw),
        _ => None,
    }
}

async fn send(bus: Bus, (datagram, asked): (RawDatagram, Target)) -> Result<Reply, BusError> {
    let RawDatagram { command, target, data, resend } = datagram;
    let reply = bus.datagram(command, target, data, resend).await.map_err(|error| error.with_target(asked))?;
    // FMMUs that the application wrote itself are not known here.
    let is_split = command == Command::Lrw && reply.main != Wkc(0) && reply.redundant != Wkc(0);
    if is_split { Err(BusError::Split { target: asked }) } else { Ok(reply) }
}
