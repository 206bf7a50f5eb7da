//! The calls of a cycle in any order: without the others, twice, with two domains, and not at all for a while.

use std::time::Duration;

use ringcat::{DomainId, DomainState};
use scenarios::calls::errno::Errno;
use scenarios::calls::master::Ecrt;

use super::{LIMIT, POSITION, TARGET, assert_idle, configure, identity, requested, run_all};

/// Time in which frames are back.
const BACK: Duration = Duration::from_micros(600);

/// What is in the outputs of the segment.
fn outputs(ecrt: &mut Ecrt) -> Vec<Vec<u8>> {
    ecrt.network().devices().map(|device| device.outputs().to_vec()).collect()
}

// covers: cycles, domains
#[test]
fn each_call_of_a_cycle_does_its_part_and_no_other() {
    for (count, mut ecrt) in requested() {
        let (domain, _) = run_all(&mut ecrt, count);
        ecrt.pause(BACK);
        ecrt.receive();
        let complete = ecrt.process(domain).expect("active");
        assert_eq!(complete.state, DomainState::Complete);
        assert_eq!(ecrt.process(domain), Some(complete), "processed twice");
        // Queued and not sent: nothing moves, and there is no answer.
        let before = outputs(&mut ecrt);
        ecrt.write();
        assert!(ecrt.queue(domain));
        ecrt.pause(BACK);
        ecrt.receive();
        assert_eq!(outputs(&mut ecrt), before, "{count}: nothing was sent");
        assert_eq!(ecrt.process(domain).expect("active").state, DomainState::Zero);
        // Queued again: the later outputs leave.
        ecrt.write();
        assert!(ecrt.queue(domain));
        ecrt.send();
        ecrt.pause(BACK);
        ecrt.receive();
        assert_eq!(ecrt.process(domain).expect("active").state, DomainState::Complete);
        // Sent without a queue: outputs stay.
        let before = outputs(&mut ecrt);
        ecrt.write();
        for _ in 0..3 {
            ecrt.send();
            ecrt.pause(BACK);
            ecrt.receive();
        }
        assert_eq!(outputs(&mut ecrt), before, "{count}: nothing was queued");
        // Queued without process: cycles go on.
        for _ in 0..20 {
            ecrt.write();
            assert!(ecrt.queue(domain));
            ecrt.send();
            ecrt.pause(Duration::from_millis(1));
            ecrt.receive();
        }
        assert_eq!(ecrt.process(domain).expect("active").state, DomainState::Complete);
        ecrt.cycles(5);
        assert!(ecrt.is_running(), "{count}: {}", ecrt.describe());
    }
}

// covers: cycles, domains, layout
#[test]
fn two_domains_run_at_rates_of_their_own() {
    for (count, mut ecrt) in requested() {
        let (fast, slow) = (ecrt.create_domain().expect("reserved"), ecrt.create_domain().expect("reserved"));
        let drive = ecrt.slave_config(0, 0, identity("servo")).expect("new");
        let list = [(drive, TARGET.0, TARGET.1), (drive, 0, 0), (drive, 0x1234, 0)];
        assert_eq!(ecrt.reg_pdo_entry_list(fast, &list).map(|places| places.len()), Ok(1), "it ends at index 0");
        let place = ecrt.reg_pdo_entry(drive, POSITION, slow, None).expect("mapped");
        assert_eq!(ecrt.reg_pdo_entry(drive, POSITION, slow, None), Ok(place), "registered twice");
        assert_eq!(ecrt.reg_pdo_entry(drive, (0x1234, 5), slow, None), Err(Errno::NoEnt));
        if count > 1 {
            let lamps = ecrt.slave_config(0, 1, identity("digital-output-8")).expect("new");
            assert_eq!(ecrt.reg_pdo_entry(lamps, (0x7010, 1), slow, None), Err(Errno::Fault), "bit 1");
            let mut bit = 0;
            ecrt.reg_pdo_entry(lamps, (0x7010, 1), slow, Some(&mut bit)).expect("mapped");
            assert_eq!(bit, 1);
        }
        ecrt.activate().expect("it fits");
        ecrt.cycle_until_op(LIMIT).expect("all are there");
        let mut seen = [0, 0];
        for cycle in 0..200 {
            ecrt.pause(BACK);
            ecrt.receive();
            for (at, every) in [1, 8].into_iter().enumerate() {
                if cycle % every == 0 {
                    let status = ecrt.process(DomainId(at)).expect("active");
                    seen[at] += usize::from(status.state == DomainState::Complete);
                    ecrt.write();
                    ecrt.queue(DomainId(at));
                }
            }
            ecrt.send();
            ecrt.pause(BACK);
        }
        // The first cycle of each domain may have been out.
        assert!(seen[0] >= 199 && seen[1] >= 24, "{count}: {seen:?}");
        assert!(ecrt.side.application().is_some_and(|it| it.all_settled()));
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "deactivated");
    }
}

// covers: cycles, layout
#[test]
fn more_domains_than_fmmus_are_an_overflow() {
    for (_, mut ecrt) in requested() {
        let drive = ecrt.slave_config(0, 0, identity("servo")).expect("new");
        let mut last = Ok(0);
        for _ in 0..17 {
            let domain = ecrt.create_domain().expect("reserved");
            last = ecrt.reg_pdo_entry(drive, POSITION, domain, None);
        }
        assert_eq!(last, Err(Errno::Overflow));
    }
}

// covers: cycles, recovery, refused-states
#[test]
fn a_program_that_stops_cycling_and_goes_on_returns_to_op() {
    for (count, mut ecrt) in requested() {
        configure(&mut ecrt, 0..count);
        ecrt.activate().expect("it fits");
        // It stops at once after activation, and in OP.
        ecrt.pause(Duration::from_secs(2));
        ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}: {error}"));
        ecrt.pause(Duration::from_secs(2));
        ecrt.cycles(200);
        ecrt.reset();
        ecrt.cycle_until_op(LIMIT).unwrap_or_else(|error| panic!("{count}: {error}"));
        ecrt.pause(Duration::from_secs(2));
        ecrt.deactivate().expect("all follow");
        assert_idle(&mut ecrt, "deactivated after a stop");
    }
}
