//! The option `--junction`: how rings behind junctions are handled.

use ringcat::{JunctionConnection, JunctionMode, StationAddress, SubDeviceId};

/// How the option is explained.
pub const HELP: &str = "Rings behind junctions: disabled, automatic or strict=CONNECTIONS";
pub const LONG_HELP: &str = "Rings behind junctions: disabled, automatic or strict=CONNECTIONS\n\n\
    automatic learns the rings that are closed at the scan. strict takes HEAD:PORT-TAIL:PORT[,...]: the positions of \
    the junction and of the last SubDevice of its ring, and the ports of the cable between them (head: port 1), as in \
    strict=1:1-4:1. With --eni, @ and the station address of the file may take the place of a position, as in \
    @1001:1-@1004:1.";

/// A mode, and the connections that strict needs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Junctions {
    /// The mode.
    pub mode: JunctionMode,
    /// The connections.
    pub connections: Vec<Connection>,
}

/// A connection of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Connection {
    head: (Place, u8),
    tail: (Place, u8),
}

/// A SubDevice of the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    /// `4`: its position.
    Position(usize),
    /// `@1004`: the station address that an ENI gives it.
    Station(u16),
}

impl Connection {
    /// With indices in the declaration; `at_station` finds those of station addresses.
    pub fn resolve(
        &self,
        at_station: impl Fn(StationAddress) -> Option<SubDeviceId>,
    ) -> Result<JunctionConnection, String> {
        let index = |place: Place| match place {
            Place::Position(position) => Ok(SubDeviceId(position)),
            Place::Station(station) => at_station(StationAddress(station)).ok_or_else(|| {
                format!("--junction: no SubDevice has station address {station} in an ENI (--eni FILE)")
            }),
        };
        let ((head, head_port), (tail, tail_port)) = (self.head, self.tail);
        Ok(JunctionConnection::new(index(head)?, head_port, index(tail)?, tail_port))
    }
}

/// Reads `disabled`, `automatic` or `strict=HEAD:PORT-TAIL:PORT[,...]`.
pub fn junctions(text: &str) -> Result<Junctions, String> {
    let plain = |mode| Ok(Junctions { mode, connections: Vec::new() });
    match text.split_once('=') {
        None if text == "disabled" => plain(JunctionMode::Disabled),
        None if text == "automatic" => plain(JunctionMode::Automatic),
        Some(("strict", list)) => {
            let connections = list.split(',').map(connection).collect::<Result<Vec<_>, _>>()?;
            Ok(Junctions { mode: JunctionMode::Strict, connections })
        }
        _ => Err(format!("expected disabled, automatic or strict=HEAD:PORT-TAIL:PORT, got \"{text}\"")),
    }
}

fn connection(text: &str) -> Result<Connection, String> {
    let parts = text.split_once('-').and_then(|(head, tail)| Some((end(head)?, end(tail)?)));
    let Some((head, tail)) = parts else {
        return Err(format!("expected HEAD:PORT-TAIL:PORT, as in 1:1-4:1, got \"{text}\""));
    };
    let connection = Connection { head, tail };
    // Station addresses are not known yet.
    let known = JunctionConnection::new(SubDeviceId(0), head.1, SubDeviceId(1), tail.1);
    let known = connection.resolve(|_| None).unwrap_or(known);
    known.check_ports().map_err(|error| error.to_string())?;
    Ok(connection)
}

fn end(text: &str) -> Option<(Place, u8)> {
    let (place, port) = text.split_once(':')?;
    let place = match place.strip_prefix('@') {
        Some(station) => Place::Station(station.parse().ok()?),
        None => Place::Position(place.parse().ok()?),
    };
    Some((place, port.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: junctions
    #[test]
    fn the_option_names_a_mode_and_the_ports_of_closing_cables() {
        let strict = |list: &[(usize, u8, usize, u8)]| Junctions {
            mode: JunctionMode::Strict,
            connections: list
                .iter()
                .map(|&(head, head_port, tail, tail_port)| Connection {
                    head: (Place::Position(head), head_port),
                    tail: (Place::Position(tail), tail_port),
                })
                .collect(),
        };
        assert_eq!(junctions("automatic").map(|it| it.mode), Ok(JunctionMode::Automatic));
        assert_eq!(junctions("disabled"), Ok(Junctions::default()));
        assert_eq!(junctions("strict=1:1-4:1"), Ok(strict(&[(1, 1, 4, 1)])));
        assert_eq!(junctions("strict=0:1-2:1,3:1-5:3"), Ok(strict(&[(0, 1, 2, 1), (3, 1, 5, 3)])));
        let by_station = junctions("strict=@1002:1-4:1").expect("as a file calls it").connections[0];
        let resolved = JunctionConnection::new(SubDeviceId(1), 1, SubDeviceId(4), 1);
        assert_eq!(by_station.resolve(|station| (station.0 == 1002).then_some(SubDeviceId(1))), Ok(resolved));
        assert!(by_station.resolve(|_| None).is_err_and(|text| text.contains("station address 1002")));
        assert!(junctions("strict=@1002:2-@1004:1").is_err(), "the head's port is 1");
        for wrong in
            ["", "strict", "strict=", "strict=1:1", "strict=1:1-4", "strict=a:1-4:1", "automatic=1", "Strict=1:1-4:1"]
        {
            assert!(junctions(wrong).is_err(), "{wrong}");
        }
        assert_eq!(
            junctions("strict=1:2-4:1"),
            Err("junction connection 1:2-4:1: expected head port 1, got 2".to_owned())
        );
        assert!(junctions("strict=1:1-4:0").is_err_and(|text| text.contains("expected tail port 1, 2 or 3, got 0")));
    }
}
