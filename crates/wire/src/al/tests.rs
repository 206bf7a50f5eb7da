//! Tests of [`super`].

use super::*;
use proptest::prelude::*;
use std::string::ToString;
use std::vec::Vec;

#[test]
fn states_have_the_codes_and_names_of_the_standard() {
    let table: Vec<_> = AlState::ALL.iter().map(|s| (s.code(), s.to_string())).collect();
    let expected = [(1, "INIT"), (2, "PREOP"), (3, "BOOT"), (4, "SAFEOP"), (8, "OP")];
    assert_eq!(table, expected.map(|(code, name)| (code, name.to_string())));
}

#[test]
fn a_nibble_that_is_no_state_decodes_to_none() {
    for code in (0..=255u8).filter(|c| ![1, 2, 3, 4, 8].contains(c)) {
        assert_eq!(AlState::from_code(code), None);
    }
}

// covers: 5.1, codec-registers
#[test]
fn the_transition_table_is_complete() {
    use AlState::*;
    //         to: Init  PreOp  Boot   SafeOp Op
    let table = [
        (Init, [true, true, true, false, false]),
        (PreOp, [true, true, false, true, false]),
        (Boot, [true, false, true, false, false]),
        (SafeOp, [true, true, false, true, true]),
        (Op, [true, true, false, true, true]),
    ];
    for (from, row) in table {
        for (to, allowed) in AlState::ALL.into_iter().zip(row) {
            assert_eq!(transition_allowed(from, to), allowed, "{from} -> {to}");
        }
    }
}

// covers: codec-registers
#[test]
fn al_control_vectors() {
    assert_eq!(AlControl::new(AlState::Op).encode(), [0x08, 0x00]);
    // protocol 5.6: INIT with acknowledge.
    assert_eq!(AlControl::with_acknowledge(AlState::Init).encode(), [0x11, 0x00]);
    let identification = AlControl { identification: true, ..AlControl::new(AlState::PreOp) };
    assert_eq!(identification.encode(), [0x22, 0x00]);
    assert_eq!(AlControl::decode(&[0x22, 0x00]), identification);
}

// covers: codec-registers
#[test]
fn al_status_vectors() {
    assert_eq!(AlStatus::decode(&[0x14, 0x00]), AlStatus::with_error(AlState::SafeOp));
    assert_eq!(AlStatus::new(AlState::Op).encode(), [0x08, 0x00]);
    assert_eq!(AlStatus::from_bits(0x0014).to_string(), "SAFEOP+ERROR");
    // protocol 5.3: a broadcast read ORs SAFEOP and OP.
    assert_eq!(AlStatus::from_bits(0x000C).al_state(), None);
    assert_eq!(AlStatus::from_bits(0x000C).to_string(), "state 0xc");
}

// covers: 5.5, codec-registers
#[test]
fn al_status_codes_have_their_numbers() {
    let numbers: Vec<u16> = AlStatusCode::ALL.iter().map(|c| c.0).collect();
    let expected = [
        0x0000, 0x0001, 0x0002, 0x0003, 0x0004, 0x0006, 0x0007, 0x000E, 0x0011, 0x0012, 0x0013, 0x0014, 0x0015, 0x0016,
        0x0017, 0x0018, 0x0019, 0x001A, 0x001B, 0x001C, 0x001D, 0x001E, 0x001F, 0x0020, 0x0021, 0x0022, 0x0023, 0x0024,
        0x0025, 0x0026, 0x0027, 0x0028, 0x0029, 0x002A, 0x002B, 0x002C, 0x002D, 0x002E, 0x0030, 0x0031, 0x0032, 0x0033,
        0x0034, 0x0035, 0x0036, 0x0037, 0x0041, 0x0042, 0x0043, 0x0044, 0x0045, 0x004F, 0x0050, 0x0051, 0x0052, 0x0060,
        0x0061, 0x0070, 0x0080, 0x0081, 0x0082, 0x0083, 0x00F0,
    ];
    assert_eq!(numbers, expected);
    assert!(AlStatusCode::ALL.iter().all(|code| code.name().is_some()));
}

#[test]
fn an_al_status_code_is_displayed_with_number_and_name() {
    assert_eq!(AlStatusCode::SYNC_MANAGER_WATCHDOG.to_string(), "0x001b SM watchdog");
    assert_eq!(AlStatusCode(0x8001).to_string(), "0x8001 vendor specific");
    assert_eq!(AlStatusCode(0x0005).to_string(), "0x0005 unknown code");
    assert_eq!(AlStatusCode::decode(&[0x1B, 0x00]), AlStatusCode::SYNC_MANAGER_WATCHDOG);
}

proptest! {
    #[test]
    fn any_bits_round_trip(bytes in any::<[u8; 2]>()) {
        prop_assert_eq!(AlControl::decode(&bytes).encode(), bytes);
        prop_assert_eq!(AlStatus::decode(&bytes).encode(), bytes);
        prop_assert_eq!(AlStatusCode::decode(&bytes).encode(), bytes);
        prop_assert!(!AlStatusCode::decode(&bytes).to_string().is_empty());
    }
}
