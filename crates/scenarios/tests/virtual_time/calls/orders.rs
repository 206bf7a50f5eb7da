//! The life of a program: request, configure, activate, deactivate, release, in every order.

use std::time::Duration;

use ringcat::{DomainState, LastOutputs};
use ringcat_sim::cable::CableId;
use ringcat_sim::fault::Fault;
use scenarios::calls::errno::Errno;
use scenarios::calls::master::Ecrt;
use scenarios::calls::witness::is_idle;

use super::{
    KINDS, LIMIT, POSITION, SIZES, assert_idle, configure, configure_named, identity, masters, networks, requested,
    run_all,
};

// covers: api, states, layout
#[test]
fn configure_activate_loop_brings_all_to_op_with_complete_data() {
    for (count, mut ecrt) in requested() {
        assert_eq!(ecrt.request(), Err(Errno::Busy));
        let (domain, configs) = configure(&mut ecrt, 0..count);
        let size = ecrt.domain_size(domain);
        assert!(ecrt.data(domain).is_none(), "no data before activation");
        assert_eq!(ecrt.process(domain), None);
        assert_eq!(ecrt.deactivate(), Err(Errno::Inval));
        ecrt.activate().expect("it fits");
        ecrt.activate().expect("a second one is a warning");
        assert_eq!(ecrt.data(domain).map(|image| image.to_vec()), Some(vec![0; size]), "{count}");
        let state = ecrt.process(domain).expect("active").state;
        assert_eq!(state, DomainState::Zero, "nothing has left");
        let time = ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}: {error}"));
        ecrt.cycles(50);
        let all = ecrt.master_state();
        assert_eq!((usize::from(all.responding), all.al_states, all.is_up), (count, 8, true));
        for config in &configs {
            let status = ecrt.slave_config_state(*config).expect("it is configured");
            assert!(status.online && status.operational && !status.has_error, "{config}: {status:?}");
        }
        println!("{count}: OP after {time:?}, {} changes of outputs compared", ecrt.witness.compared);
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "deactivated");
        let all = ecrt.master_state();
        assert_eq!((usize::from(all.responding), all.is_up), (count, true), "{count}: {all:?}");
        ecrt.pause(Duration::from_millis(40));
        let all = ecrt.master_state();
        assert_eq!((usize::from(all.responding), all.al_states, all.is_up), (count, 2, true));
        assert_eq!(ecrt.deactivate(), Err(Errno::Inval), "it is not active any more");
        assert!(count < 2 || ecrt.witness.compared > 40, "{}", ecrt.witness.compared);
    }
}

// covers: api, states
#[test]
fn calls_without_a_reservation_or_an_activation_change_nothing() {
    for (count, mut ecrt) in masters() {
        assert_eq!(ecrt.create_domain(), Err(Errno::Inval));
        assert_eq!(ecrt.activate(), Err(Errno::NoDev));
        assert_eq!(ecrt.deactivate(), Err(Errno::Inval));
        ecrt.request().expect("it is free");
        let (domain, _) = configure(&mut ecrt, 0..count);
        for _ in 0..50 {
            ecrt.receive();
            assert_eq!(ecrt.process(domain), None);
            assert!(!ecrt.queue(domain));
            ecrt.send();
            ecrt.pause(Duration::from_millis(1));
        }
        assert_eq!(ecrt.sync_slave_clocks(), Err(Errno::NxIo));
        assert_idle(&mut ecrt, "configured, not activated");
        ecrt.activate().expect("the configuration is as it was");
        ecrt.cycle_until_op(LIMIT).expect("all are there");
    }
}

// covers: api, recovery
#[test]
fn activation_before_the_link_is_up_reaches_op_when_it_comes() {
    for count in SIZES {
        for (is_ring, mut network) in networks(count).into_iter().enumerate().map(|(at, it)| (at == 1, it)) {
            let cables: Vec<CableId> = if is_ring { vec![CableId(0), CableId(count)] } else { vec![CableId(0)] };
            cables.iter().for_each(|cable| network.apply(Fault::Cut(*cable)));
            network.advance_by(Duration::from_millis(50));
            let mut ecrt = Ecrt::new(network);
            ecrt.request().expect("it is free");
            let domain = ecrt.create_domain().expect("reserved");
            let bare = ecrt.slave_config(0, 0, identity(KINDS[0])).expect("new");
            assert_eq!(
                ecrt.reg_pdo_entry(bare, POSITION, domain, None),
                Err(Errno::NoEnt),
                "nothing is inherited from an absent SubDevice"
            );
            ecrt.release();
            ecrt.request().expect("it is free");
            let domain = ecrt.create_domain().expect("reserved");
            for (position, kind) in (0..).zip(&KINDS[..count]) {
                configure_named(&mut ecrt, position, kind, domain);
            }
            ecrt.activate().expect("absent SubDevices are no error");
            ecrt.cycles(200);
            let state = ecrt.master_state();
            assert_eq!((state.responding, state.al_states, state.is_up), (0, 0, false), "{count}");
            cables.iter().for_each(|cable| ecrt.network().apply(Fault::Heal(*cable)));
            let time = ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}, ring {is_ring}: {error}"));
            println!("{count}, ring {is_ring}: OP {time:?} after the link");
            ecrt.deactivate().expect("all follow");
            assert_idle(&mut ecrt, "deactivated");
        }
    }
}

// covers: api, recovery
#[test]
fn a_lost_link_shows_in_all_states_and_op_returns_by_itself() {
    for (count, mut ecrt) in requested() {
        let (domain, configs) = run_all(&mut ecrt, count);
        let links = ecrt.network().cables().len() - count + 1;
        let cables: Vec<CableId> = if links == 2 { vec![CableId(0), CableId(count)] } else { vec![CableId(0)] };
        cables.iter().for_each(|cable| ecrt.network().apply(Fault::Cut(*cable)));
        ecrt.cycles(300);
        let state = ecrt.master_state();
        assert_eq!((state.responding, state.al_states, state.is_up), (0, 0, false), "{count}");
        assert_eq!(ecrt.process(domain).expect("active").state, DomainState::Zero);
        for config in &configs {
            let status = ecrt.slave_config_state(*config).expect("it is configured");
            assert!(!status.online && !status.operational && status.al_state.is_none(), "{status:?}");
        }
        cables.iter().for_each(|cable| ecrt.network().apply(Fault::Heal(*cable)));
        ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}: {error}"));
    }
}

// covers: api, stop
#[test]
fn deactivation_and_another_configuration_follow_each_other_at_any_moment() {
    for (count, mut ecrt) in requested() {
        for (round, ran) in [0, 1, 2, 3, 5, 8, 13, 40, 100].into_iter().enumerate() {
            let chosen: Vec<usize> = (0..count).filter(|at| (at + round) % 3 != 0).collect();
            let (domain, _) = configure(&mut ecrt, chosen.clone());
            ecrt.activate().expect("it fits");
            ecrt.cycles(ran);
            let outputs = if round % 2 == 0 { LastOutputs::Zero } else { LastOutputs::Held };
            ecrt.deactivate_with(outputs).expect("all follow");
            assert!(ecrt.data(domain).is_none(), "data pointers die");
            assert_idle(&mut ecrt, &format!("{count}: {chosen:?} after {ran} cycles"));
        }
        run_all(&mut ecrt, count);
    }
}

// covers: api, stop
#[test]
fn release_without_deactivation_ends_the_application() {
    for (count, mut ecrt) in requested() {
        for ran in [0, 4, 100] {
            configure(&mut ecrt, 0..count);
            ecrt.activate().expect("it fits");
            ecrt.cycles(ran);
            ecrt.release();
            assert_idle(&mut ecrt, "released");
            assert_eq!(ecrt.create_domain(), Err(Errno::Inval));
            ecrt.pause(Duration::from_millis(200));
            ecrt.request().expect("it is free again");
        }
        run_all(&mut ecrt, count);
    }
}

// covers: api, stop, scan
#[test]
fn a_program_that_was_killed_leaves_a_segment_that_the_next_one_brings_to_op() {
    for (count, mut ecrt) in requested() {
        for ran in [0, 5, 15, 300] {
            configure(&mut ecrt, 0..count);
            ecrt.activate().expect("it fits");
            ecrt.cycles(ran);
            ecrt.killed();
            ecrt.request().expect("it is free");
            assert_idle(&mut ecrt, &format!("{count}: killed after {ran} cycles"));
        }
        run_all(&mut ecrt, count);
    }
}

// covers: api, declaration, mandatory
#[test]
fn absent_and_wrong_subdevices_are_no_error_and_keep_no_other_one_from_op() {
    for (count, mut ecrt) in requested().filter(|(count, _)| *count > 1) {
        let (domain, mut configs) = configure(&mut ecrt, [0]);
        let absent = configure_named(&mut ecrt, 99, "digital-output-8", domain);
        let wrong = ecrt.slave_config(0, 1, identity("digital-input-8")).expect("it is not compared here");
        assert_eq!(ecrt.slave_config(0, 1, identity("digital-output-8")), Err(Errno::NoEnt), "another identity");
        assert_eq!(ecrt.slave_config(0, 1, identity("digital-input-8")), Ok(wrong), "the same configuration");
        ecrt.activate().expect("both are no error");
        ecrt.cycles(1_000);
        let first = configs.remove(0);
        assert!(ecrt.slave_config_state(first).is_some_and(|status| status.operational), "{count}");
        for other in [absent, wrong] {
            let status = ecrt.slave_config_state(other).expect("it is configured");
            assert!(!status.online && !status.operational, "{count}: {other}: {status:?}");
        }
        assert_eq!(ecrt.process(domain).expect("active").state, DomainState::Incomplete, "{count}");
        // Unconfigured SubDevices stay in PREOP.
        assert_eq!(ecrt.master_state().al_states, if count > 1 { 10 } else { 8 });
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "deactivated");
    }
}

// covers: api, refused-states
#[test]
fn a_failed_configuration_waits_for_a_reset() {
    for (count, mut ecrt) in requested().filter(|(count, _)| *count > 1) {
        use ringcat_sim::cable::DeviceIndex;
        use ringcat_wire::al::{AlState, AlStatusCode};
        let (device, code) = (DeviceIndex(0), AlStatusCode(0x8042));
        ecrt.network().apply(Fault::RefuseTransition { device, to: AlState::SafeOp, code, times: 1 });
        let (_, configs) = configure(&mut ecrt, 0..count);
        ecrt.activate().expect("it fits");
        ecrt.cycles(3_000);
        let status = ecrt.slave_config_state(configs[0]).expect("configured");
        assert!(status.online && !status.operational, "{count}: {status:?}");
        assert!(ecrt.slave_config_state(configs[1]).is_some_and(|status| status.operational));
        ecrt.reset();
        ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}: {error}"));
    }
}

// covers: api, declaration
#[test]
fn an_alias_names_the_subdevice_behind_it() {
    for is_ring in [false, true] {
        let mut described = scenarios::segments::descriptions(&super::KINDS[..5]);
        described[1].alias = 7;
        let options = ringcat_sim::network::NetworkOptions::default();
        let network = if is_ring { scenarios::segments::ring } else { scenarios::segments::line };
        let mut ecrt = Ecrt::new(network(described, options));
        ecrt.request().expect("it is free");
        let domain = ecrt.create_domain().expect("reserved");
        let lamps = ecrt.slave_config(7, 0, identity("digital-output-8")).expect("new");
        let inputs = ecrt.slave_config(7, 2, identity("digital-input-8")).expect("new");
        // The same SubDevice by its position: attached once.
        let again = ecrt.slave_config(0, 1, identity("digital-output-8")).expect("new");
        assert_eq!(ecrt.reg_pdo_entry(lamps, (0x7000, 1), domain, None), Ok(0));
        assert_eq!(ecrt.reg_pdo_entry(inputs, (0x6000, 1), domain, None), Ok(1));
        ecrt.activate().expect("it fits");
        ecrt.cycles(500);
        let is_operational = |ecrt: &mut Ecrt, config| ecrt.slave_config_state(config).is_some_and(|it| it.operational);
        assert!(is_operational(&mut ecrt, inputs));
        assert_ne!(is_operational(&mut ecrt, lamps), is_operational(&mut ecrt, again), "one of both is attached");
    }
}

/// It waits for a reset, and loses its station address meanwhile.
// covers: api, states, recovery
#[test]
fn a_failed_subdevice_that_restarts_unseen_is_found_and_brought_to_preop() {
    use ringcat_sim::cable::DeviceIndex;
    use ringcat_wire::al::{AlState, AlStatusCode};
    for (count, mut ecrt) in requested() {
        let (device, code) = (DeviceIndex(0), AlStatusCode(0x8042));
        let refuse = |times| Fault::RefuseTransition { device, to: AlState::PreOp, code, times };
        // It restarts, and refuses PREOP once it is known.
        ecrt.network().apply(refuse(1));
        ecrt.network().apply(Fault::PowerOff(device));
        ecrt.network().apply(Fault::PowerOn(device));
        ecrt.pause(Duration::from_secs(3));
        assert!(is_idle(ecrt.network(), 0).is_err(), "{count}: it refuses PREOP and waits");
        ecrt.network().apply(refuse(0));
        ecrt.network().apply(Fault::PowerOff(device));
        ecrt.network().apply(Fault::PowerOn(device));
        ecrt.pause(Duration::from_secs(2));
        assert_idle(&mut ecrt, "it came back by itself");
    }
}

/// A measurement of delays whose frames are lost requests pauses; the last cycles do not wait for them.
// covers: api, stop, dc-delays
#[test]
fn a_deactivation_keeps_its_limit_while_a_measurement_loses_its_frames() {
    for at in 0..120 {
        for mut ecrt in networks(5).map(Ecrt::new) {
            ecrt.request().expect("it is free");
            let (domain, _) = configure(&mut ecrt, 0..5);
            ecrt.with_clocks();
            ecrt.activate().expect("it fits");
            for _ in 0..at {
                ecrt.receive();
                ecrt.process(domain);
                ecrt.queue(domain);
                ecrt.send();
                ecrt.pause(Duration::from_micros(150));
            }
            ecrt.network().cut(CableId(0));
            // Asserts its limit.
            let _ = ecrt.deactivate();
        }
    }
}
