//! The kind of a file that is not an ENI. Users confuse files with similar roots, so the error names the kind.

use std::fmt;

use roxmltree::Node;

use crate::xml::shown;

/// The kind of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FileKind {
    /// Root `EtherCATInfo` or `EtherCATInfoList` with devices.
    DeviceDescription,
    /// Output of `ethercat xml` of the IgH stack: `EtherCATInfo` with one vendor and one device per SubDevice.
    EthercatXml,
    /// Root `EtherCATConfig` of a Beremiz project.
    BeremizProject,
    /// A TwinCAT project or system manager file.
    TwinCatProject,
    /// A configuration of the LinuxCNC driver.
    LinuxCnc,
    /// An encrypted file, with the evidence.
    Encrypted(&'static str),
    /// A signed file; the parameter says where the signature is.
    Signed(&'static str),
    /// Not XML: no `<` at the beginning.
    NotXml,
    /// Another XML file, with the name of its root.
    OtherXml(String),
}

impl FileKind {
    /// The kind of a file that is not XML.
    pub(super) fn of_bytes(bytes: &[u8]) -> FileKind {
        let known: [(&[u8], &'static str); 5] = [
            (b"Salted__", "encrypted with a password (OpenSSL)"),
            (b"-----BEGIN", "a PEM container"),
            (&[0x30, 0x82], "a PKCS container"),
            (b"PK\x03\x04", "a ZIP archive"),
            (&[0x1F, 0x8B], "compressed with gzip"),
        ];
        let found = known.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, what)| *what);
        match found {
            Some(what) => FileKind::Encrypted(what),
            None if is_random(bytes) => FileKind::Encrypted("random bytes"),
            None => FileKind::NotXml,
        }
    }

    /// The kind by the root element; `None` for an ENI.
    pub(super) fn of(root: Node<'_, '_>) -> Option<FileKind> {
        let name = root.tag_name().name();
        let is_cipher = |node: &Node<'_, '_>| matches!(node.tag_name().name(), "EncryptedData" | "CipherData");
        // A part of a file may be encrypted, too.
        if root.descendants().any(|node| is_cipher(&node)) {
            return Some(FileKind::Encrypted("XML encryption"));
        }
        // XML signatures: around the configuration, or in it (protocol ES-153).
        let is_signature =
            |node: Node<'_, '_>| node.is_element() && matches!(node.tag_name().name(), "Signature" | "SignedInfo");
        if is_signature(root) {
            return Some(FileKind::Signed("around the configuration"));
        }
        let config = root.children().filter(|node| node.tag_name().name() == "Config");
        if root.children().chain(config.flat_map(|config| config.children())).any(is_signature) {
            return Some(FileKind::Signed("in the configuration"));
        }
        match name {
            "EtherCATConfig" if is_beremiz(root) => Some(FileKind::BeremizProject),
            "EtherCATConfig" => None,
            "EtherCATInfo" | "EtherCATInfoList" if is_ethercat_xml(root) => Some(FileKind::EthercatXml),
            "EtherCATInfo" | "EtherCATInfoList" => Some(FileKind::DeviceDescription),
            "TcSmProject" | "TcSmItem" | "TcSmBoxes" | "TcBlackBox" => Some(FileKind::TwinCatProject),
            "masters" => Some(FileKind::LinuxCnc),
            other => Some(FileKind::OtherXml(other.to_owned())),
        }
    }
}

/// Whether the bytes have the entropy of random data, which text and tables do not reach.
fn is_random(bytes: &[u8]) -> bool {
    /// Number of bytes that are evaluated; fewer bytes are not significant.
    const LOOKED_AT: std::ops::RangeInclusive<usize> = 256..=4096;
    let bytes = &bytes[..bytes.len().min(*LOOKED_AT.end())];
    let mut counts = [0_u32; 256];
    bytes.iter().for_each(|byte| counts[usize::from(*byte)] += 1);
    let total = bytes.len() as u64;
    let all = counts.iter().map(|count| u64::from(*count)).filter(|count| *count > 0);
    let bits = all.map(|count| count * log2(total, count)).sum::<u64>() as f64 / (total.max(1) << FRACTION) as f64;
    // 256 random bytes have 7.2 bits each, text has less than 6.
    LOOKED_AT.contains(&bytes.len()) && bits > 6.8
}

/// Fractional bits of [`log2`].
const FRACTION: u32 = 16;

/// The logarithm of a ratio of at least 1, by squaring: libm would have to be linked into programs in C for this alone.
fn log2(total: u64, count: u64) -> u64 {
    let ratio = (total << 32) / count;
    let whole = ratio.ilog2();
    // Between 1 and 2, with 31 fractional bits.
    let mut mantissa = (ratio << (63 - whole)) >> 32;
    let mut log = u64::from(whole.saturating_sub(32));
    for _ in 0..FRACTION {
        mantissa = (mantissa * mantissa) >> 31;
        let is_two = mantissa >> 32;
        mantissa >>= is_two;
        log = log << 1 | is_two;
    }
    log
}

/// Whether a root `EtherCATConfig` names the schema of device descriptions.
fn is_beremiz(root: Node<'_, '_>) -> bool {
    root.attributes().any(|attribute| {
        attribute.name() == "noNamespaceSchemaLocation" && attribute.value().trim().ends_with("EtherCATInfo.xsd")
    })
}

/// Whether there are comments `Slave 0`, `Slave 1` before vendor and description.
fn is_ethercat_xml(root: Node<'_, '_>) -> bool {
    let comments = root.descendants().take(64).filter(Node::is_comment).filter_map(|node| node.text());
    comments.map(str::trim).any(|text| text.strip_prefix("Slave ").is_some_and(|number| number.parse::<u16>().is_ok()))
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let eni = "An ENI has the root EtherCATConfig; the configuration tool exports it (TwinCAT: EtherCAT device, \
                   \"Export Configuration File\"; EC-Engineer: \"Export ENI\").";
        match self {
            FileKind::DeviceDescription => write!(
                f,
                "a device description (ESI, root EtherCATInfo), not an ENI: it describes what devices can do, not how \
                 a network is configured. {eni}"
            ),
            FileKind::EthercatXml => {
                write!(f, "what `ethercat xml` prints (a device description made of an SII), not an ENI. {eni}")
            }
            FileKind::BeremizProject => write!(
                f,
                "the EtherCATConfig of a Beremiz project, not an ENI: it has neither commands for the transitions nor \
                 cyclic ones. {eni}"
            ),
            FileKind::TwinCatProject => write!(f, "a TwinCAT project, not an ENI. {eni}"),
            FileKind::LinuxCnc => write!(f, "a configuration of LinuxCNC's EtherCAT driver, not an ENI. {eni}"),
            FileKind::Encrypted(what) => write!(
                f,
                "an encrypted or packed file ({what}), perhaps an encrypted ENI as EC-Engineer of acontis exports it \
                 for MainDevices that have its key. RingCAT reads plain ENIs only: export it without encryption. {eni}"
            ),
            FileKind::Signed(place) => write!(
                f,
                "a signed file (an XML signature {place}). RingCAT cannot check the signature, and follows no file \
                 whose signature it has not checked: export it without one. {eni}"
            ),
            FileKind::NotXml => write!(f, "no XML file. {eni}"),
            FileKind::OtherXml(root) => write!(f, "an XML file with the root {}, not an ENI. {eni}", shown(root)),
        }
    }
}
