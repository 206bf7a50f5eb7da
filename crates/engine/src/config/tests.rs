use core::time::Duration;
use std::string::ToString;
use std::vec;
use std::vec::Vec;

use ringcat_wire::address::Position;
use ringcat_wire::al::AlState;
use ringcat_wire::sii::Identity;

use super::*;
use crate::declared::SubDeviceId;

fn infos(products: &[u32]) -> Vec<SubDeviceInfo> {
    let info = |(position, product_code): (u16, &u32)| SubDeviceInfo {
        position: Position(position),
        identity: Identity { vendor_id: 2, product_code: *product_code, revision: 3, serial: 4 },
        ..SubDeviceInfo::default()
    };
    (0..).zip(products).map(info).collect()
}

fn config(position: u16, product: u32) -> SubDeviceConfig {
    SubDeviceConfig::at_position(position).expect_product(2, product)
}

fn found(config: usize, info: usize) -> Resolution {
    Resolution::Found { config, info }
}

/// The error for a position beyond the segment, with the number of SubDevices.
fn absent(config: usize, position: u16, present: usize) -> Resolution {
    let error = ConfigError::Missing { address: ConfigAddress::Position(position), present };
    Resolution::Absent { config, error }
}

// covers: declaration
#[test]
fn declarations_are_resolved_by_position_in_any_order() {
    let configs = [config(1, 11), config(0, 10), SubDeviceConfig::at_position(2)];
    assert_eq!(resolve(&configs, &infos(&[10, 11, 12])), [found(0, 1), found(1, 0), found(2, 2)]);
}

// covers: declaration
#[test]
fn a_wrong_product_is_an_error_with_position_expected_and_got() {
    let resolutions = resolve(&[config(0, 10)], &infos(&[11]));
    let [Resolution::Failed { config: 0, error }, Resolution::Extra { info: 0 }] = resolutions[..] else {
        panic!("{resolutions:?}")
    };
    assert_eq!(error.to_string(), "position 0: expected product code 0x0000000a, got 0x0000000b");
}

#[test]
fn revision_and_serial_number_are_compared_if_declared() {
    let right = config(0, 10).expect_revision(3).expect_serial(4);
    assert_eq!(resolve(&[right], &infos(&[10])), [found(0, 0)]);
    let wrong = config(0, 10).expect_revision(9);
    let error = ConfigError::Mismatch { position: Position(0), field: IdentityField::Revision, expected: 9, got: 3 };
    assert_eq!(resolve(&[wrong], &infos(&[10]))[0], Resolution::Failed { config: 0, error });
}

#[test]
fn a_missing_subdevice_is_an_error_and_an_undeclared_one_is_extra() {
    let missing = ConfigError::Missing { address: ConfigAddress::Position(1), present: 1 };
    let configs = [config(0, 10), config(1, 11)];
    assert_eq!(resolve(&configs, &infos(&[10])), [found(0, 0), Resolution::Failed { config: 1, error: missing }]);
    assert_eq!(resolve(&configs[..1], &infos(&[10, 11])), [found(0, 0), Resolution::Extra { info: 1 }]);
    assert_eq!(missing.to_string(), "no SubDevice at position 1; 1 are present");
}

// covers: declaration
#[test]
fn after_an_absent_optional_subdevice_positions_are_one_lower() {
    let configs = [config(0, 10), config(1, 11).optional(), config(2, 12)];
    assert_eq!(resolve(&configs, &infos(&[10, 12])), [found(0, 0), absent(1, 1, 2), found(2, 1)]);
    assert_eq!(resolve(&configs, &infos(&[10, 11, 12])), [found(0, 0), found(1, 1), found(2, 2)]);
}

#[test]
fn a_single_subdevice_resolves_the_mandatory_declaration_of_its_product() {
    let configs = [config(0, 10).optional(), config(1, 10)];
    assert_eq!(resolve(&configs, &infos(&[10])), [absent(0, 0, 1), found(1, 0)]);
}

// covers: declaration
#[test]
fn an_alias_counts_from_its_subdevice_and_alias_0_from_the_start() {
    let mut infos = infos(&[10, 11, 12]);
    infos[1].alias = 5;
    let configs = [SubDeviceConfig::at_alias(5, 0), SubDeviceConfig::at_alias(5, 1), SubDeviceConfig::at_alias(0, 0)];
    assert_eq!(resolve(&configs, &infos), [found(0, 1), found(1, 2), found(2, 0)]);
    let beyond = ConfigAddress::Alias { alias: 5, offset: 2 };
    let resolutions = resolve(&[SubDeviceConfig::at_alias(5, 2)], &infos);
    let error = ConfigError::Missing { address: beyond, present: 3 };
    assert_eq!(resolutions[0], Resolution::Failed { config: 0, error });
}

// covers: declaration
#[test]
fn alias_0_is_the_exact_position_whatever_else_is_absent() {
    let exact = |position, product| SubDeviceConfig::at_alias(0, position).expect_product(2, product);
    let configs = [config(0, 9).optional(), exact(1, 11), exact(2, 11), exact(9, 12)];
    let resolutions = resolve(&configs, &infos(&[10, 11, 12]));
    assert_eq!(resolutions[1], found(1, 1), "an absent one before it moves nothing");
    assert!(matches!(resolutions[2], Resolution::Failed { error: ConfigError::Mismatch { .. }, .. }));
    assert!(matches!(resolutions[3], Resolution::Failed { error: ConfigError::Missing { .. }, .. }));
}

#[test]
fn two_subdevices_with_the_same_alias_are_an_ambiguous_address() {
    let mut infos = infos(&[10, 11, 12, 13]);
    (infos[0].alias, infos[2].alias, infos[3].alias) = (7, 7, 8);
    let error = ConfigError::Ambiguous {
        address: ConfigAddress::Alias { alias: 7, offset: 1 },
        first: Position(0),
        second: Position(2),
    };
    let failed = Resolution::Failed { config: 0, error };
    assert_eq!(resolve(&[SubDeviceConfig::at_alias(7, 1)], &infos)[0], failed);
    let duplicate = DuplicateAlias { alias: 7, first: Position(0), second: Position(2) };
    assert_eq!(duplicate_aliases(&infos), [duplicate]);
    assert_eq!(duplicate.to_string(), "positions 0 and 2 have the same alias 7");
}

#[test]
fn two_declarations_for_one_subdevice_are_an_error() {
    let error = ConfigError::DeclaredTwice { position: Position(0), first: SubDeviceId(0) };
    let resolutions = resolve(&[config(0, 10), SubDeviceConfig::at_alias(0, 0)], &infos(&[10]));
    assert_eq!(resolutions, [found(0, 0), Resolution::Failed { config: 1, error }]);
}

#[test]
fn a_later_declaration_of_a_sync_manager_replaces_the_earlier() {
    let config = SubDeviceConfig::default()
        .sync_manager(2, Direction::Inputs, Watchdog::Off)
        .sync_manager(2, Direction::Outputs, Watchdog::On)
        .assign(2, Direction::Inputs, vec![])
        .assign(2, Direction::Outputs, vec![PdoMapping::from_sii(0x1600)]);
    let declared = SyncManagerOverride { index: 2, direction: Direction::Outputs, watchdog: Watchdog::On };
    assert_eq!(config.sync_managers, [declared]);
    let pdos = config.pdos.unwrap();
    assert_eq!((pdos.len(), pdos[0].pdos[0].index), (1, 0x1600));
}

// covers: 5.4
#[test]
fn default_time_limits_are_those_of_the_esi_schema() {
    let timeouts = Timeouts::default();
    let limit = |from, to| timeouts.transition(from, to);
    assert_eq!(limit(AlState::Init, AlState::PreOp), Duration::from_secs(3));
    assert_eq!(limit(AlState::Init, AlState::Boot), Duration::from_secs(3));
    assert_eq!(limit(AlState::PreOp, AlState::SafeOp), Duration::from_secs(10));
    assert_eq!(limit(AlState::SafeOp, AlState::Op), Duration::from_secs(10));
    assert_eq!(limit(AlState::Op, AlState::Init), Duration::from_secs(5));
    assert_eq!(limit(AlState::Op, AlState::SafeOp), Duration::from_millis(200));
}

#[test]
fn a_declaration_from_a_scan_is_resolved_to_the_same_subdevice() {
    let infos = infos(&[10, 11]);
    let configs: Vec<_> = infos.iter().map(SubDeviceConfig::from_info).collect();
    assert_eq!(resolve(&configs, &infos), [found(0, 0), found(1, 1)]);
}

#[test]
fn a_lowest_revision_and_an_identification_are_compared_if_declared() {
    let mut infos = infos(&[10]);
    assert_eq!(resolve(&[config(0, 10).expect_revision_from(3)], &infos), [found(0, 0)]);
    let Resolution::Failed { error, .. } = resolve(&[config(0, 10).expect_revision_from(4)], &infos)[0] else {
        panic!()
    };
    assert_eq!(error.to_string(), "position 0: expected a revision not below 0x00000004, got 0x00000003");
    let identified = config(0, 10).expect_identification(7);
    let error =
        ConfigError::Mismatch { position: Position(0), field: IdentityField::Identification, expected: 7, got: 0 };
    assert_eq!(resolve(core::slice::from_ref(&identified), &infos)[0], Resolution::Failed { config: 0, error });
    infos[0].identification = Some(7);
    assert_eq!(resolve(&[identified], &infos), [found(0, 0)]);
}

// covers: 5.3, mandatory
#[test]
fn an_identification_finds_its_bearer_wherever_it_is() {
    let mut infos = infos(&[10, 11, 12]);
    infos[2].identification = Some(5);
    let configs = [SubDeviceConfig::at_identification(5), config(0, 10), config(1, 11)];
    assert_eq!(resolve(&configs, &infos), [found(0, 2), found(1, 0), found(2, 1)]);
    infos[0].identification = Some(5);
    let address = ConfigAddress::Identification { value: 5, offset: 0 };
    let error = ConfigError::Ambiguous { address, first: Position(0), second: Position(2) };
    assert_eq!(resolve(&configs, &infos)[0], Resolution::Failed { config: 0, error });
    assert_eq!(error.to_string(), "identification 5 belongs to position 0 and to position 2");
}

/// A group of two behind an alias, and two others.
fn with_group() -> Vec<SubDeviceConfig> {
    let head = SubDeviceConfig::at_alias(5, 0).expect_product(2, 20);
    let group = Group::new(head).then(SubDeviceConfig::default().expect_product(2, 21));
    [config(0, 10), config(1, 11)].into_iter().chain(group.into_configs(GroupId(0))).collect()
}

// covers: hot-connect
#[test]
fn a_group_is_found_at_any_place_and_positions_do_not_count_it() {
    for place in 0..3 {
        let mut infos = infos(&[10, 11]);
        for product in [21, 20] {
            let mut member = self::infos(&[product]).remove(0);
            member.alias = if product == 20 { 5 } else { 0 };
            infos.insert(place, member);
        }
        let others: Vec<usize> = (0..4).filter(|at| *at != place && *at != place + 1).collect();
        let expected = [found(0, others[0]), found(1, others[1]), found(2, place), found(3, place + 1)];
        assert_eq!(resolve(&with_group(), &infos), expected, "at {place}");
    }
}

#[test]
fn an_absent_or_incomplete_group_does_not_move_other_positions() {
    let missing = |config, offset, present| {
        let address = ConfigAddress::Alias { alias: 5, offset };
        Resolution::Absent { config, error: ConfigError::Missing { address, present } }
    };
    let expected = [found(0, 0), found(1, 1), missing(2, 0, 2), missing(3, 1, 2)];
    assert_eq!(resolve(&with_group(), &infos(&[10, 11])), expected);
    let mut infos = infos(&[10, 20, 11]);
    infos[1].alias = 5;
    let error =
        ConfigError::Mismatch { position: Position(2), field: IdentityField::ProductCode, expected: 21, got: 11 };
    let expected = [found(0, 0), found(1, 2), found(2, 1), Resolution::Absent { config: 3, error }];
    assert_eq!(resolve(&with_group(), &infos), expected);
}

/// Steps of a resolution of this many SubDevices.
fn steps(number: u16, declare: impl Fn(u16) -> SubDeviceConfig) -> usize {
    let mut infos = infos(&vec![10; number.into()]);
    for (mark, info) in (1..).zip(&mut infos) {
        (info.alias, info.identification) = (mark, Some(mark));
    }
    let configs: Vec<SubDeviceConfig> = (0..number).map(declare).collect();
    let before = super::steps::so_far();
    let resolutions = resolve(&configs, &infos);
    let all_found = (0..number.into()).map(|at| found(at, at));
    assert!(resolutions.into_iter().eq(all_found));
    super::steps::so_far() - before
}

// covers: declaration
#[test]
fn the_work_of_a_resolution_grows_as_the_network_does() {
    type Declare = fn(u16) -> SubDeviceConfig;
    let ways: [(&str, Declare); 4] = [
        ("positions", |at| config(at, 10)),
        ("aliases", |at| SubDeviceConfig::at_alias(at + 1, 0)),
        ("identifications", |at| SubDeviceConfig::at_identification(at + 1)),
        ("more optional ones than combinations are compared", |at| config(at, 10).optional()),
    ];
    for (way, declare) in ways {
        let (few, many) = (steps(5_000, declare), steps(20_000, declare));
        assert!(few <= 20_000 && many <= 4 * few + 100, "{way}: {few} steps, {many} for four times as many");
    }
}

// covers: declaration
#[test]
fn very_many_optional_subdevices_are_absent_where_they_do_not_fit() {
    let products: Vec<u32> = (0..5_000).collect();
    let configs: Vec<SubDeviceConfig> = (0..5_000).map(|at| config(at, at.into()).optional()).collect();
    let without: Vec<u32> = products.iter().copied().filter(|product| *product != 7).collect();
    let resolutions = resolve(&configs, &infos(&without));
    assert_eq!(
        (&resolutions[6], &resolutions[8], &resolutions[4_999]),
        (&found(6, 6), &found(8, 7), &found(4_999, 4_998))
    );
    assert_eq!(resolutions[7], absent(7, 7, 4_999));
}
