//! Datagrams of the application.
//!
//! With two links positions are those of the last scan (CR-09). Auto-increment addresses would follow the path of the
//! frames, which changes with a break, a crossed SubDevice or a branch; while the ring opens or closes, the path of a
//! frame is unknown. So a position is replaced by the station address of the SubDevice that the scan found there.

use alloc::vec::Vec;

use ringcat_wire::address::{LogicalAddress, Position, StationAddress, Wkc};
use ringcat_wire::command::Command;
use ringcat_wire::datagram::Target;

use crate::declared::SubDeviceId;
use crate::layout::Layout;
use crate::link::LinkSet;
use crate::main_device::MainDevice;
use crate::main_device::pending::Pending;
use crate::procedures::junction::{UnderWay, ordering};
use crate::procedures::services::ServiceError;
use crate::procedures::shared_segment::SharedSegment;
use crate::role::Function;
use crate::supervisor::{Bus, BusError, Reply};

/// Maximum number of the application's datagrams per call.
pub const MAX_DATAGRAMS: usize = 1024;

/// A datagram of the application.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct RawDatagram {
    /// The command.
    pub command: Command,
    /// The address, as the command requires. With two links a position is that of the last scan, or of a later rescan
    /// whose cabling was taken over, regardless of breaks and of SubDevices that are missing or were added: the
    /// datagram is sent with the station address of the SubDevice that was found there. A SubDevice that lost its power
    /// answers again when its address was assigned again, an undeclared one only after another rescan. Other positions,
    /// and all with one link, count SubDevices in the order in which frames pass them.
    pub target: Target,
    /// The data to send; for reads, zeros.
    pub data: Vec<u8>,
    /// Whether it may be sent again if its frame is lost.
    pub resend: bool,
}

impl RawDatagram {
    /// A datagram that is not sent again if its frame is lost.
    pub fn new(command: Command, target: Target, data: impl Into<Vec<u8>>) -> RawDatagram {
        RawDatagram { command, target, data: data.into(), resend: false }
    }

    /// Sets [`RawDatagram::resend`].
    #[must_use]
    pub const fn with_resend(mut self, resend: bool) -> RawDatagram {
        self.resend = resend;
        self
    }
}

impl MainDevice {
    /// Starts to send datagrams of the application together, in one frame if they fit. Each gets its reply, whatever
    /// the working counter. With two links an LRW over process data of several SubDevices is refused, together with all
    /// other datagrams of the call.
    pub fn start_datagrams(
        &mut self,
        datagrams: Vec<RawDatagram>,
    ) -> Pending<Result<Vec<Result<Reply, BusError>>, ServiceError>> {
        let bus = self.bus();
        let addressed = self.permit(Function::RawDatagrams).map_err(ServiceError::NotPermitted);
        let addressed = addressed.and_then(|()| self.addressed(datagrams));
        let segment = self.segment.clone();
        self.start(async move {
            let addressed = addressed?;
            let _orders: Vec<_> = addressed.iter().flat_map(|(it, _)| orders(&segment, it)).collect();
            Ok(bus.gather(addressed, send).await)
        })
    }

    /// The datagrams as sent, and their original addresses.
    fn addressed(&self, datagrams: Vec<RawDatagram>) -> Result<Vec<(RawDatagram, Target)>, ServiceError> {
        if datagrams.len() > MAX_DATAGRAMS {
            return Err(ServiceError::TooMany { got: datagrams.len(), limit: MAX_DATAGRAMS });
        }
        let stations = if self.options.links() == LinkSet::Ring { self.stations_by_position() } else { Vec::new() };
        let by_station = |datagram: RawDatagram| {
            let original = datagram.target;
            let Target::Position(Position(position), register) = original else { return (datagram, original) };
            match (with_station(datagram.command), stations.get(usize::from(position))) {
                (Some(command), Some(station)) => {
                    (RawDatagram { command, target: Target::Station(*station, register), ..datagram }, original)
                }
                _ => (datagram, original),
            }
        };
        datagrams.iter().try_for_each(|datagram| self.check_lrw_of(datagram))?;
        Ok(datagrams.into_iter().map(by_station).collect())
    }

    /// The station addresses of the last scan, or of the rescan whose cabling was taken over, by position.
    fn stations_by_position(&self) -> Vec<StationAddress> {
        self.segment.view().stations_by_position()
    }

    fn check_lrw_of(&self, datagram: &RawDatagram) -> Result<(), ServiceError> {
        let (Command::Lrw, Target::Logical(logical)) = (datagram.command, datagram.target) else { return Ok(()) };
        let Some(segment) = self.active().filter(|_| self.options.links() == LinkSet::Ring) else {
            return Ok(());
        };
        match covered(segment.view().layout(), logical, datagram.data.len()) {
            Some(subdevices) => Err(ServiceError::LrwOnTwoLinks {
                logical,
                length: datagram.data.len(),
                subdevices: subdevices.map(SubDeviceId),
            }),
            None => Ok(()),
        }
    }
}

/// Port commands to junctions in a datagram.
fn orders(segment: &SharedSegment, datagram: &RawDatagram) -> Vec<UnderWay> {
    use Command::{Aprw, Apwr, Brw, Bwr, Fprw, Fpwr};
    if !matches!(datagram.command, Aprw | Apwr | Brw | Bwr | Fprw | Fpwr) {
        return Vec::new();
    }
    let stations = segment.view().stations_by_position();
    let at = |place: usize| stations.get(place).copied();
    let (stations, register) = match datagram.target {
        Target::Station(station, register) => (Vec::from([station]), register),
        Target::Position(Position(place), register) => (at(place.into()).into_iter().collect(), register),
        Target::Broadcast(register) => (stations.clone(), register),
        Target::Logical(_) | Target::None => return Vec::new(),
    };
    stations.into_iter().filter_map(|station| ordering(segment, station, register, &datagram.data)).collect()
}

/// Two SubDevices with process data in a range of logical addresses, if there are two.
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

/// The command with the same effect by station address.
const fn with_station(command: Command) -> Option<Command> {
    match command {
        Command::Aprd => Some(Command::Fprd),
        Command::Apwr => Some(Command::Fpwr),
        Command::Aprw => Some(Command::Fprw),
        Command::Armw => Some(Command::Frmw),
        _ => None,
    }
}

async fn send(bus: Bus, (datagram, original): (RawDatagram, Target)) -> Result<Reply, BusError> {
    let RawDatagram { command, target, data, resend } = datagram;
    let reply = bus.datagram(command, target, data, resend).await.map_err(|error| error.with_target(original))?;
    // FMMUs written by the application are not known here.
    let is_split = command == Command::Lrw && reply.main != Wkc(0) && reply.redundant != Wkc(0);
    if is_split { Err(BusError::Split { target: original }) } else { Ok(reply) }
}
