//! The option `--junction`: what becomes of rings behind junctions.

use ringcat::{JunctionConnection, JunctionMode};

/// How the option is explained.
pub const HELP: &str = "Rings behind junctions: disabled, automatic (those that are there at the scan are learned), or \
    strict=HEAD:PORT-TAIL:PORT[,...] with the positions of the junction and of the last SubDevice of its ring, and the \
    ports of the cable between them (head: port 1)";

/// A mode, and the connections that strict needs.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Junctions {
    /// The mode.
    pub mode: JunctionMode,
    /// The connections, SubDevices by position.
    pub connections: Vec<JunctionConnection>,
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

fn connection(text: &str) -> Result<JunctionConnection, String> {
    let parts = text.split_once('-').and_then(|(head, tail)| Some((end(head)?, end(tail)?)));
    let Some(((head, head_port), (tail, tail_port))) = parts else {
        return Err(format!("expected HEAD:PORT-TAIL:PORT, as in 1:1-4:1, got \"{text}\""));
    };
    let connection = JunctionConnection { head, head_port, tail, tail_port };
    // How many SubDevices there are is not known yet.
    connection.check(&[], usize::MAX).map_err(|error| error.to_string())?;
    Ok(connection)
}

fn end(text: &str) -> Option<(usize, u8)> {
    let (position, port) = text.split_once(':')?;
    Some((position.parse().ok()?, port.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_option_names_a_mode_and_the_ports_of_closing_cables() {
        let strict = |list: &[(usize, u8, usize, u8)]| Junctions {
            mode: JunctionMode::Strict,
            connections: list
                .iter()
                .map(|&(head, head_port, tail, tail_port)| JunctionConnection { head, head_port, tail, tail_port })
                .collect(),
        };
        assert_eq!(junctions("automatic").map(|it| it.mode), Ok(JunctionMode::Automatic));
        assert_eq!(junctions("disabled"), Ok(Junctions::default()));
        assert_eq!(junctions("strict=1:1-4:1"), Ok(strict(&[(1, 1, 4, 1)])));
        assert_eq!(junctions("strict=0:1-2:1,3:1-5:3"), Ok(strict(&[(0, 1, 2, 1), (3, 1, 5, 3)])));
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
