//! Reading a pcapng file: little-endian, Ethernet, any resolution that is a power of ten.
//!
//! Bytes go in; interfaces, packets and statistics come out. Blocks of other types are skipped; a file that ends within
//! a block, or with wrong lengths, is an error.

/// Later times, from the year 2116 on, are considered an error.
const LATEST: u64 = 1 << 62;

/// An interface of the capture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Interface {
    /// Its name.
    pub name: String,
    /// Nanoseconds per unit of time.
    unit_ns: u64,
    /// Frames lost by the recorder, if its statistics are in the file.
    pub dropped: Option<u64>,
}

/// A captured frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Index of its interface.
    pub interface: usize,
    /// Whether this host sent it.
    pub sent: bool,
    /// Nanoseconds since 1970.
    pub time_ns: u64,
    /// The frame without FCS.
    pub bytes: Vec<u8>,
}

/// A file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Capture {
    /// Its interfaces.
    pub interfaces: Vec<Interface>,
    /// Its frames, in the order of the file.
    pub packets: Vec<Packet>,
}

fn u16_at(bytes: &[u8], at: usize) -> Result<u16, String> {
    let bytes = bytes.get(at..at + 2).ok_or("a block is too short")?;
    Ok(u16::from_le_bytes([bytes[0], bytes[1]]))
}

fn u32_at(bytes: &[u8], at: usize) -> Result<u32, String> {
    Ok(u32::from(u16_at(bytes, at)?) | u32::from(u16_at(bytes, at + 2)?) << 16)
}

/// Code and value of each option from an offset in a block's body.
fn options(body: &[u8], mut at: usize) -> Result<Vec<(u16, &[u8])>, String> {
    let mut found = Vec::new();
    while at < body.len() {
        let (code, length) = (u16_at(body, at)?, usize::from(u16_at(body, at + 2)?));
        if code == 0 {
            break;
        }
        found.push((code, body.get(at + 4..at + 4 + length).ok_or("an option is longer than its block")?));
        at += 4 + length.next_multiple_of(4);
    }
    Ok(found)
}

impl Capture {
    /// Reads a file.
    pub fn parse(mut rest: &[u8]) -> Result<Capture, String> {
        if u32_at(rest, 0)? != 0x0A0D_0D0A || u32_at(rest, 8)? != 0x1A2B_3C4D {
            return Err("no little-endian pcapng file".to_owned());
        }
        let mut capture = Capture::default();
        while !rest.is_empty() {
            let (kind, length) = (u32_at(rest, 0)?, u32_at(rest, 4)? as usize);
            let block = rest.get(..length).filter(|block| block.len() >= 12 && block.len().is_multiple_of(4));
            let block = block.ok_or("the file ends within a block")?;
            if u32_at(block, length - 4)? as usize != length {
                return Err("the two lengths of a block differ".to_owned());
            }
            let body = &block[8..length - 4];
            match kind {
                1 => capture.interfaces.push(interface(body)?),
                5 => capture.statistics(body)?,
                6 => capture.packet(body)?,
                _ => {}
            }
            rest = &rest[length..];
        }
        Ok(capture)
    }

    fn statistics(&mut self, body: &[u8]) -> Result<(), String> {
        let interface = self.interfaces.get_mut(u32_at(body, 0)? as usize).ok_or("statistics of no interface")?;
        for (code, value) in options(body, 12)? {
            if let (5, Ok(value)) = (code, value.try_into()) {
                interface.dropped = Some(u64::from_le_bytes(value));
            }
        }
        Ok(())
    }

    fn packet(&mut self, body: &[u8]) -> Result<(), String> {
        let interface = u32_at(body, 0)? as usize;
        let unit_ns = self.interfaces.get(interface).ok_or("a frame of no interface")?.unit_ns;
        let time = u64::from(u32_at(body, 4)?) << 32 | u64::from(u32_at(body, 8)?);
        let (captured, length) = (u32_at(body, 12)? as usize, u32_at(body, 16)? as usize);
        if captured != length {
            return Err("only a part of a frame was captured".to_owned());
        }
        let bytes = body.get(20..20 + captured).ok_or("a frame is longer than its block")?.to_vec();
        let flags = options(body, 20 + captured.next_multiple_of(4))?.into_iter().find(|(code, _)| *code == 2);
        let direction = flags.and_then(|(_, flags)| flags.first()).map_or(0, |flags| flags & 3);
        let sent = match direction {
            1 => false,
            2 => true,
            _ => return Err("a frame without direction".to_owned()),
        };
        let time_ns = time.checked_mul(unit_ns).filter(|time| *time < LATEST).ok_or("a time after the year 2116")?;
        self.packets.push(Packet { interface, sent, time_ns, bytes });
        Ok(())
    }
}

fn interface(body: &[u8]) -> Result<Interface, String> {
    if u16_at(body, 0)? != 1 {
        return Err("an interface that is not Ethernet".to_owned());
    }
    // The default is microseconds.
    let mut interface = Interface { unit_ns: 1000, ..Interface::default() };
    for (code, value) in options(body, 8)? {
        match (code, value) {
            (2, name) => interface.name = String::from_utf8_lossy(name).into_owned(),
            (9, [digits @ 0..=9]) => interface.unit_ns = 10u64.pow(9 - u32::from(*digits)),
            (9, _) => return Err("a resolution of time that is no power of ten, or below nanoseconds".to_owned()),
            _ => {}
        }
    }
    Ok(interface)
}
