//! Present SubDevices that do not fit their configuration: each fails alone, as with IgH, and keeps no other one from
//! OP.

use ringcat::{DomainState, PdoMapping};
use ringcat_engine::config::PdoEntry;
use ringcat_sim::cable::DeviceIndex;
use ringcat_sim::fault::Fault;
use scenarios::calls::configure::SyncInfo;

use super::*;

/// What does not fit at a position of [`KINDS`].
#[derive(Clone, Copy, Debug)]
enum Misfit {
    /// An SDO for a SubDevice without CoE.
    Sdo,
    /// Other PDOs than those of a SubDevice whose PDOs are fixed.
    Pdos,
    /// SYNC signals of a SubDevice without a clock.
    Signals,
}

/// Configures a SubDevice that is there so that it does not fit.
fn misfit(ecrt: &mut Ecrt, position: usize, what: Misfit, domain: DomainId) -> SubDeviceId {
    let config = ecrt.slave_config(0, position as u16, identity(KINDS[position])).expect("it is new");
    if let Misfit::Pdos = what {
        let entries = vec![PdoEntry::new(0x7FF0, 1, 32)];
        let pdos = vec![PdoMapping::of(0x16FF, entries)];
        ecrt.pdos(config, &[SyncInfo { index: 0, direction: ringcat::Direction::Outputs, pdos }]);
    } else {
        let entry = ecrt.default_entries(config)[0];
        ecrt.reg_pdo_entry(config, entry, domain, Some(&mut 0)).expect("it is mapped");
    }
    match what {
        Misfit::Sdo => ecrt.config_sdo(config, 0x8000, 1, &[1]),
        Misfit::Signals => ecrt.dc(config, 0x0300, 1_000_000, 0),
        Misfit::Pdos => {}
    }
    config
}

/// All but one are operational, and the data is incomplete because of this one.
fn assert_alone(ecrt: &mut Ecrt, others: &[SubDeviceId], failed: SubDeviceId, text: &str) {
    for other in others {
        let status = ecrt.slave_config_state(*other);
        assert!(status.is_some_and(|status| status.operational), "{text}: {other}: {status:?}");
    }
    let status = ecrt.slave_config_state(failed).expect("it is configured");
    assert!(status.online && !status.operational, "{text}: {status:?}");
}

// covers: api, declaration, mandatory
#[test]
fn a_present_subdevice_that_does_not_fit_fails_alone_and_the_others_reach_op() {
    for what in [Misfit::Sdo, Misfit::Pdos, Misfit::Signals] {
        for (count, mut ecrt) in requested().filter(|(count, _)| *count > 1) {
            let text = format!("{what:?}, {count}");
            let (domain, others) = configure(&mut ecrt, (0..count).filter(|at| *at != 1));
            let failed = misfit(&mut ecrt, 1, what, domain);
            if let Misfit::Signals = what {
                ecrt.with_clocks();
            }
            ecrt.activate().unwrap_or_else(|error| panic!("{text}: {error:?}"));
            ecrt.cycles(4_000);
            assert_alone(&mut ecrt, &others, failed, &text);
            let expected = if let Misfit::Pdos = what { DomainState::Complete } else { DomainState::Incomplete };
            assert_eq!(ecrt.process(domain).expect("active").state, expected, "{text}");
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, &text);
            // It fits now.
            let (_, configs) = configure(&mut ecrt, 0..count);
            assert_eq!(configs.len(), count);
            ecrt.activate().expect("it fits");
            ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{text}: {error}"));
        }
    }
}

/// The places in the image are those of its PDOs before.
// covers: api, declaration
#[test]
fn a_subdevice_with_other_pdos_than_those_of_its_place_fails_alone() {
    for (count, mut ecrt) in requested().filter(|(count, _)| *count > 1) {
        let (domain, mut configs) = configure(&mut ecrt, 0..count);
        let other = configs.remove(0);
        let pdos = vec![PdoMapping::of(0x1600, vec![PdoEntry::new(0x6040, 0, 16)])];
        ecrt.pdos(other, &[SyncInfo { index: 2, direction: ringcat::Direction::Outputs, pdos }]);
        ecrt.activate().expect("it fails alone");
        ecrt.cycles(2_000);
        assert_alone(&mut ecrt, &configs, other, &format!("{count}"));
        assert_eq!(ecrt.process(domain).expect("active").state, DomainState::Incomplete);
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "deactivated");
    }
}

// covers: api, declaration, domains
#[test]
fn configurations_without_a_domain_are_activated() {
    for (count, mut ecrt) in requested() {
        for position in 0..count {
            let _ = ecrt.slave_config(0, position as u16, identity(KINDS[position])).expect("it is new");
        }
        ecrt.activate().expect("no domain is no error");
        ecrt.cycles(500);
        assert_eq!(usize::from(ecrt.master_state().responding), count);
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "deactivated");
    }
}

// covers: api, declaration, dc-sync
#[test]
fn signals_of_absent_subdevices_are_no_obstacle_without_any_clock() {
    for (count, mut ecrt) in requested().filter(|(count, _)| *count > 1) {
        ecrt.network().apply(Fault::PowerOff(DeviceIndex(0)));
        ecrt.pause(std::time::Duration::from_millis(500));
        let domain = ecrt.create_domain().expect("it is requested");
        let config = configure_named(&mut ecrt, 0, KINDS[0], domain);
        ecrt.dc(config, 0x0300, 1_000_000, 0);
        ecrt.activate().expect("it is absent");
        ecrt.cycles(300);
        ecrt.network().apply(Fault::PowerOn(DeviceIndex(0)));
        ecrt.cycle_until_op(std::time::Duration::from_secs(15)).unwrap_or_else(|error| panic!("{count}: {error}"));
    }
}
