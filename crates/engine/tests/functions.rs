//! The table of functions and roles against the protocol sheet.

use ringcat_engine::main_device::{Denial, Function, MainDevicePhase, MainDeviceRole, Permission};

/// The sheet with the groups of functions, of the repository.
fn sheet() -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/protocol/09-standby.md");
    std::fs::read_to_string(path).expect("the sheet")
}

/// Each group of the sheet that is blocked at INACTIVE, with its functions here.
const BLOCKED: [(&str, &[Function]); 9] = [
    ("CoE", &[Function::SdoTransfer, Function::ObjectDictionary, Function::PdoByMailbox]),
    ("FoE", &[Function::FileTransfer]),
    ("SoE", &[Function::SoeAccess]),
    ("AoE", &[Function::AoeAccess]),
    ("VoE", &[Function::VendorMessage, Function::RawMailbox, Function::Ethernet, Function::DebugMessage]),
    (
        "state",
        &[
            Function::SubDeviceState,
            Function::StateOfAll,
            Function::ForcedState,
            Function::Activate,
            Function::Deactivate,
            Function::Stop,
        ],
    ),
    ("raw commands", &[Function::RawDatagrams]),
    ("registers", &[Function::Registers, Function::Eeprom, Function::EepromOwner, Function::SiiCompletion]),
    (
        "topology",
        &[
            Function::Scan,
            Function::Rescan,
            Function::ForceTopologyChange,
            Function::PortState,
            Function::BlockedPorts,
            Function::ControllerReset,
            Function::PortReport,
        ],
    ),
];
/// Two further groups: of information, and of controls.
const INFORMATION: [(&str, &[Function]); 2] =
    [("info", &[Function::SubDeviceInfo, Function::Statistics]), ("IO controls", &[Function::Statistics])];
/// Independent of the role, or with another behaviour.
const FREE: [Function; 4] = [Function::Status, Function::OwnObjects, Function::Events, Function::Settings];

/// For an INACTIVE alone: it sends nothing.
const OF_INACTIVE: Function = Function::Follow;

/// Names of the groups in the sheet, in its order.
fn groups() -> Vec<String> {
    let begin = sheet().find("Blocked at INACTIVE (groups").expect("the list of the sheet");
    let rest = &sheet()[begin..];
    let end = rest.find("Enabled with different behaviour").expect("the end of the list");
    let items = rest[..end].lines().filter_map(|line| line.strip_prefix("* "));
    items.filter_map(|item| item.split_once(':').map(|(name, _)| String::from(name))).collect()
}

// covers: 9.11
#[test]
fn each_group_of_the_sheet_has_its_functions_and_each_function_its_group() {
    let named: Vec<&str> = BLOCKED.iter().chain(&INFORMATION).map(|(name, _)| *name).collect();
    assert_eq!(groups(), named, "the sheet and this table have the same groups");
    for (group, functions) in BLOCKED.iter().chain(&INFORMATION) {
        assert!(functions.iter().all(|function| function.needs_the_bus()), "{group}");
    }
    for function in Function::ALL {
        let is_blocked = BLOCKED.iter().chain(&INFORMATION).any(|(_, functions)| functions.contains(function));
        assert_eq!(is_blocked, function.needs_the_bus(), "{function:?}");
        assert_eq!(!is_blocked, FREE.contains(function) || *function == OF_INACTIVE, "{function:?}");
    }
}

// covers: 9.11
#[test]
fn functions_without_the_bus_are_never_refused() {
    for phase in [MainDevicePhase::Orphaned, MainDevicePhase::Idle, MainDevicePhase::Operation] {
        let refused = FREE
            .iter()
            .filter(|function| function.permission(MainDeviceRole::Active, phase) == Permission::Refused)
            .count();
        assert_eq!(refused, 0, "{phase:?}");
    }
}

// covers: 9.11
#[test]
fn role_inactive_refuses_what_needs_the_bus_and_names_function_role_and_reason() {
    for function in Function::ALL.iter().copied().filter(|function| *function != OF_INACTIVE) {
        for phase in [MainDevicePhase::Orphaned, MainDevicePhase::Idle, MainDevicePhase::Operation] {
            let is_refused = function.permission(MainDeviceRole::Inactive, phase) == Permission::Refused;
            let is_refused_if_active = function.permission(MainDeviceRole::Active, phase) == Permission::Refused;
            assert_eq!(is_refused, function.needs_the_bus() || is_refused_if_active, "{function:?}");
            for role in [MainDeviceRole::Active, MainDeviceRole::Inactive] {
                let result = function.check(role, phase);
                assert_eq!(result.is_err(), function.permission(role, phase) == Permission::Refused);
                let Err(denied) = result else { continue };
                assert_eq!((denied.function, denied.role), (function, role));
                assert_eq!(denied.denial == Denial::NeedsTheBus, role == MainDeviceRole::Inactive);
                let text = denied.to_string();
                assert!(text.contains(&format!("{function:?}")) && text.contains(&role.to_string()), "{text}");
            }
        }
    }
}

// covers: 9.11, standby
#[test]
fn only_an_inactive_without_an_application_may_follow() {
    for phase in [MainDevicePhase::Orphaned, MainDevicePhase::Idle, MainDevicePhase::Operation] {
        let denied = OF_INACTIVE.check(MainDeviceRole::Active, phase).unwrap_err();
        assert_eq!(denied.denial, Denial::NothingToFollow, "{phase:?}");
        assert_eq!(OF_INACTIVE.permission(MainDeviceRole::Active, phase), Permission::Refused);
    }
    assert_eq!(OF_INACTIVE.check(MainDeviceRole::Inactive, MainDevicePhase::Idle), Ok(()));
    let denied = OF_INACTIVE.check(MainDeviceRole::Inactive, MainDevicePhase::Operation).unwrap_err();
    assert_eq!(denied.denial, Denial::InOperation);
}
