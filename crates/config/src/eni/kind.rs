//! The kind of a file that is not an ENI. Users confuse files with similar roots, so the error names the kind.

use std::fmt;

use roxmltree::Node;

use crate::xml::{is_cipher, is_signature, packed, shown};

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
        packed(bytes).map_or(FileKind::NotXml, FileKind::Encrypted)
    }

    /// The kind by the root element; `None` for an ENI.
    pub(super) fn of(root: Node<'_, '_>) -> Option<FileKind> {
        let name = root.tag_name().name();
        // A part of a file may be encrypted, too.
        if root.descendants().any(|node| is_cipher(node.tag_name().name())) {
            return Some(FileKind::Encrypted("XML encryption"));
        }
        // XML signatures: around the configuration, or in it (protocol ES-153).
        let is_signature = |node: Node<'_, '_>| node.is_element() && is_signature(node.tag_name().name());
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
