//! Contradictions are refused with line, SubDevice, expected and actual value.

use crate::refused;

fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "{part:?} in {text:?}");
    }
}

// covers: eni-image
#[test]
fn the_written_station_address_must_be_phys_addr() {
    let text = refused(&[("<Data>e903</Data>", "<Data>ea03</Data>")]);
    has(
        &text,
        &["line ", "Slave 1 \"Coupler <1>\" (PhysAddr 1001)", "expected 1001, got 1002", "export the file again"],
    );
}

#[test]
fn the_compared_vendor_must_be_the_vendor_of_info() {
    has(&refused(&[("<Data>02000000</Data>", "<Data>03000000</Data>")]), &["vendor id", "expected 0x2, got 0x3"]);
}

#[test]
fn a_sync_manager_must_have_the_direction_of_its_type() {
    let text = refused(&[("<Data>000f010044000100</Data>", "<Data>000f010040000100</Data>")]);
    has(&text, &["Slave 2 \"Left\"", "direction of SyncManager 0", "Write", "Read"]);
}

// covers: eni-image
#[test]
fn mailbox_and_sync_manager_must_be_the_same_memory() {
    let text = refused(&[(
        "<Send><Start>4096</Start><Length>128</Length></Send>",
        "<Send><Start>4096</Start><Length>64</Length></Send>",
    )]);
    has(&text, &["Slave 4 \"Drive\"", "Mailbox/Send", "64 bytes at 0x1000", "128 bytes at 0x1000"]);
}

// covers: 3.10, eni-image
#[test]
fn an_fmmu_must_not_extend_beyond_its_sync_manager() {
    let text =
        refused(&[("<Data>00000010060000070011000201000000</Data>", "<Data>00000010080000070011000201000000</Data>")]);
    has(&text, &["FMMU 0", "SyncManager 2 (6 bytes)", "64 bits"]);
}

// covers: eni-image
#[test]
fn send_must_have_as_many_bits_as_the_fmmus_map() {
    let text = refused(&[(
        "<BitStart>32</BitStart><BitLength>48</BitLength>",
        "<BitStart>32</BitStart><BitLength>40</BitLength>",
    )]);
    has(&text, &["ProcessData/Send", "expected 48 bits", "got 40 bits"]);
}

// covers: eni-image
#[test]
fn two_subdevices_cannot_have_the_same_bits_address_or_position() {
    let bits = ("<BitStart>20</BitStart>", "<BitStart>18</BitStart>");
    has(
        &refused(&[bits, ("00000001010004070 00f", "00000001010002050 00f")]),
        &["Slave 3 \"Right\"", "bits that no other SubDevice has", "Left"],
    );
    let text = refused(&[("<PhysAddr>1003</PhysAddr><AutoIncAddr>", "<PhysAddr>1002</PhysAddr><AutoIncAddr>")]);
    has(&text, &["PhysAddr", "1002", "which Slave 2 \"Left\""]);
    let text = refused(&[("<AutoIncAddr>65534</AutoIncAddr>", "<AutoIncAddr>65535</AutoIncAddr>")]);
    has(&text, &["AutoIncAddr", "position 1, which Slave 2"]);
}

#[test]
fn al_control_must_request_the_state_of_its_transition() {
    has(&refused(&[("<Data>1200</Data>", "<Data>1800</Data>")]), &["AL control at the transition IP", "got 0x08"]);
}

// covers: eni-image
#[test]
fn previous_ports_must_exist_and_form_paths_to_the_first_subdevice() {
    let to = "<Port>C</Port><PhysAddr>1001</PhysAddr>";
    has(&refused(&[(to, "<Port>C</Port><PhysAddr>7</PhysAddr>")]), &["PreviousPort", "got 7"]);
    has(&refused(&[(to, "<Port>C</Port><PhysAddr>1004</PhysAddr>")]), &["PreviousPort", "a loop"]);
}

// covers: eni-read
#[test]
fn an_image_that_is_too_small_or_too_large_is_refused() {
    has(
        &refused(&[("<ByteSize>10</ByteSize>", "<ByteSize>9</ByteSize>")]),
        &["Slave 4", "9 bytes", "ByteSize is too small"],
    );
    has(
        &refused(&[("<ByteSize>10</ByteSize>", "<ByteSize>500000000</ByteSize>")]),
        &["16777216 bytes of a process image"],
    );
}

#[test]
fn a_download_needs_data() {
    let text = refused(&[("<SubIndex>0</SubIndex><Data>01000016</Data>", "<SubIndex>0</SubIndex>")]);
    has(&text, &["0x1c12:00", "Data to download"]);
}
