//! Codes with which SubDevices refuse, in the words of the standards, and the failures that commands report.

use ringcat_control::refusal::ServiceFault;

use crate::failure::Failure;

/// Abort codes of SDO transfers (ETG.1000.6, CiA 301).
const SDO: [(u32, &str); 35] = [
    (0x0503_0000, "Toggle bit not changed"),
    (0x0504_0000, "SDO protocol timeout"),
    (0x0504_0001, "Client/Server command specifier not valid or unknown"),
    (0x0504_0002, "Invalid block size"),
    (0x0504_0003, "Invalid sequence number"),
    (0x0504_0004, "CRC error"),
    (0x0504_0005, "Out of memory"),
    (0x0601_0000, "Unsupported access to an object"),
    (0x0601_0001, "Attempt to read a write-only object"),
    (0x0601_0002, "Attempt to write a read-only object"),
    (0x0601_0003, "Subindex cannot be written, subindex 0 must be 0 for write access"),
    (0x0601_0004, "Complete access not supported for this object"),
    (0x0601_0005, "Object length exceeds the mailbox size"),
    (0x0601_0006, "Object mapped to an RxPDO, download blocked"),
    (0x0602_0000, "This object does not exist in the object directory"),
    (0x0604_0041, "The object cannot be mapped into the PDO"),
    (0x0604_0042, "The number and length of the objects to be mapped would exceed the PDO length"),
    (0x0604_0043, "General parameter incompatibility reason"),
    (0x0604_0047, "General internal incompatibility in the device"),
    (0x0606_0000, "Access failure due to a hardware error"),
    (0x0607_0010, "Data type does not match, length of service parameter does not match"),
    (0x0607_0012, "Data type does not match, length of service parameter too high"),
    (0x0607_0013, "Data type does not match, length of service parameter too low"),
    (0x0609_0011, "Subindex does not exist"),
    (0x0609_0030, "Value range of parameter exceeded"),
    (0x0609_0031, "Value of parameter written too high"),
    (0x0609_0032, "Value of parameter written too low"),
    (0x0609_0036, "Maximum value is less than minimum value"),
    (0x060A_0023, "Resource not available"),
    (0x0800_0000, "General error"),
    (0x0800_0020, "Data cannot be transferred or stored to the application"),
    (0x0800_0021, "Data cannot be transferred or stored to the application because of local control"),
    (0x0800_0022, "Data cannot be transferred or stored to the application because of the present device state"),
    (0x0800_0023, "Object dictionary dynamic generation fails or no object dictionary is present"),
    (0x0800_0024, "No data available"),
];

/// Error codes of FoE.
const FOE: [(u32, &str); 11] = [
    (0x8001, "Not found."),
    (0x8002, "Access denied."),
    (0x8003, "Disk full."),
    (0x8004, "Illegal."),
    (0x8005, "Packet number wrong."),
    (0x8006, "Already exists."),
    (0x8007, "No user."),
    (0x8008, "Bootstrap only."),
    (0x8009, "Not Bootstrap."),
    (0x800A, "No rights."),
    (0x800B, "Program Error."),
];

fn named(table: &[(u32, &'static str)], code: u32, unknown: &'static str) -> &'static str {
    table.iter().find(|(own, _)| *own == code).map_or(unknown, |(_, text)| *text)
}

/// The failure of an SDO transfer.
pub fn of_sdo(failure: Failure) -> Failure {
    match failure.aborted() {
        Some(code) => {
            let text = named(&SDO, code, "Unknown abort code");
            Failure::failed(format!("SDO transfer aborted with code 0x{code:08x}: {text}"))
        }
        None => failure,
    }
}

/// The failure of a file transfer; `what` is `read` or `write`.
pub fn of_foe(failure: Failure, what: &str) -> Failure {
    match failure.aborted() {
        Some(code) => {
            let text = named(&FOE, code, "Unknown error code.");
            Failure::failed(format!("FoE {what} aborted with error code 0x{code:08x}: {text}"))
        }
        None => failure,
    }
}

/// The failure of an access to an IDN; `what` is `read` or `write`.
pub fn of_soe(failure: Failure, what: &str) -> Failure {
    match (failure.fault(), failure.aborted()) {
        (Some(ServiceFault::Aborted(_)), Some(code)) => {
            let known = u16::try_from(code).ok().and_then(|code| ringcat_wire::mailbox::soe::SoeErrorCode(code).name());
            let text = known.unwrap_or("Unknown error code");
            Failure::failed(format!("SoE {what} command failed with code 0x{code:04x}: {text}."))
        }
        _ => failure,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn codes_are_named_and_ascend() {
        assert!(SDO.is_sorted_by(|a, b| a.0 < b.0) && FOE.is_sorted_by(|a, b| a.0 < b.0));
        assert_eq!(named(&SDO, 0x0602_0000, ""), "This object does not exist in the object directory");
        assert_eq!(named(&FOE, 0x800C, "Unknown error code."), "Unknown error code.");
    }
}
