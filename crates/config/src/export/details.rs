//! Parts of an ENI that a declaration does not have: names, and values that other MainDevices read.

use crate::eni::{Eni, Pdo};

/// Names and identities of a network.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct ExportDetails {
    /// Name of the network.
    pub name: String,
    /// Details of the SubDevices, by index in the declaration.
    pub subdevices: Vec<SubDeviceDetails>,
    /// Names of the domains.
    pub tasks: Vec<String>,
}

/// Names and identity of a SubDevice.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct SubDeviceDetails {
    /// `Info/VendorId`, also where it is not compared.
    pub vendor_id: Option<u32>,
    /// `Info/ProductCode`, also where it is not compared.
    pub product_code: Option<u32>,
    /// `Info/RevisionNo`, also where it is not compared.
    pub revision: Option<u32>,
    /// `Info/SerialNo`.
    pub serial: Option<u32>,
    /// `Info/Physics`: a letter per port.
    pub physics: String,
    /// `Mailbox/Protocol`.
    pub protocols: Vec<String>,
    /// Names of PDOs and entries.
    pub pdos: Vec<Pdo>,
}

impl ExportDetails {
    /// The details of an ENI.
    pub fn of(eni: &Eni) -> ExportDetails {
        let subdevices = eni.subdevices.iter().map(|of| SubDeviceDetails {
            vendor_id: of.vendor_id,
            product_code: of.product_code,
            revision: of.revision,
            serial: of.serial,
            physics: of.physics.clone(),
            protocols: of.mailbox.iter().flat_map(|mailbox| mailbox.protocols.clone()).collect(),
            pdos: of.process_data.iter().flat_map(|data| data.pdos.clone()).collect(),
        });
        ExportDetails {
            name: eni.main_device.name.clone(),
            subdevices: subdevices.collect(),
            tasks: eni.tasks.iter().map(|task| task.comment.clone()).collect(),
        }
    }
}
