//! All protocols in parallel over one mailbox, while frames are lost, late and duplicated, and procedures are dropped.

use alloc::rc::Rc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::RefCell;
use core::time::Duration;

use ringcat_wire::mailbox::Protocol;
use ringcat_wire::mailbox::aoe::{AmsAddress, NetId};
use ringcat_wire::mailbox::coe::Emergency;
use ringcat_wire::mailbox::soe::Idn;

use super::device::pattern;
use super::{Bench, Fate};
use crate::link::LinkSet;
use crate::mail::aoe::AoeRoute;
use crate::mail::coe::{SdoAddress, read, write};
use crate::mail::foe::FoeOptions;
use crate::mail::soe::SoeAddress;
use crate::mail::stream::{Bounded, Bytes};
use crate::mail::voe::Voe;
use crate::mail::{Limits, Mailbox, aoe, foe, soe, voe};

/// Long enough for the recovery of losses.
const LIMITS: Limits = Limits::new(Duration::from_secs(5), Duration::from_secs(5));

/// Random numbers from a seed (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }
}

/// Successful transfers, by kind.
type Done = Rc<RefCell<[u32; 5]>>;

async fn objects(mailbox: Mailbox, done: Done) {
    for round in 0..6u16 {
        let data = pattern(round.into(), [3, 40, 300, 700][usize::from(round) % 4]);
        let object = SdoAddress::new(0x2000 + round, 1);
        write(&mailbox, object, &data, LIMITS).await.unwrap();
        assert_eq!(read(&mailbox, object, LIMITS, 1000).await.unwrap(), data);
    }
    done.borrow_mut()[0] += 1;
}

async fn files(mailbox: Mailbox, done: Done) {
    let options = FoeOptions { limits: LIMITS, ..FoeOptions::default() };
    let data = pattern(77, 900);
    foe::write(&mailbox, "file", options, &mut Bytes::new(&data), |_| ()).await.unwrap();
    let mut sink = Bounded::new(1000);
    foe::read(&mailbox, "file", options, &mut sink, |_| ()).await.unwrap();
    assert_eq!(sink.into_bytes(), data);
    done.borrow_mut()[1] += 1;
}

async fn idns(mailbox: Mailbox, done: Done) {
    for round in 0..5u16 {
        let data = pattern(round.into(), 150);
        let address = SoeAddress::value(1, Idn::standard(0, round));
        soe::write(&mailbox, address, &data, LIMITS).await.unwrap();
        assert_eq!(soe::read(&mailbox, address, LIMITS, 1000).await.unwrap(), data);
    }
    done.borrow_mut()[2] += 1;
}

async fn ads(mailbox: Mailbox, done: Done) {
    let address = |port| AmsAddress { net_id: NetId([1, 2, 3, 4, 5, 6]), port };
    let route = AoeRoute { target: address(1), source: address(2) };
    for round in 0..10u32 {
        let data = pattern(round, 12);
        aoe::write(&mailbox, route, (1, round), &data, LIMITS).await.unwrap();
        assert_eq!(aoe::read(&mailbox, route, (1, round), 12, LIMITS).await.unwrap(), data);
    }
    done.borrow_mut()[3] += 1;
}

async fn vendor(mailbox: Mailbox, done: Done) {
    for round in 0..10u16 {
        let message = Voe { vendor_id: 1, vendor_type: round, data: pattern(round.into(), 20) };
        assert_eq!(voe::exchange(&mailbox, &message, LIMITS).await.unwrap(), message);
    }
    done.borrow_mut()[4] += 1;
}

/// Fate of a frame.
fn fate(random: &mut Random, percent: u64, links: LinkSet) -> Fate {
    if random.below(100) >= percent {
        return Fate::Passes;
    }
    match random.below(4) {
        0 => Fate::LostOut,
        1 => Fate::LostBack,
        2 => Fate::Late(Duration::from_micros(random.below(60_000))),
        _ if links == LinkSet::Ring => Fate::ProcessedTwice,
        _ => Fate::LostBack,
    }
}

/// One run; `percent` of the frames are disturbed.
fn storm(seed: u64, links: LinkSet, percent: u64, drops: bool) {
    let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
    let mut bench = Bench::new(links, 64);
    let done = Done::default();
    let mailbox = || bench.mailbox.clone();
    let own = [mailbox(), mailbox(), mailbox(), mailbox(), mailbox()];
    let [a, b, c, d, e] = own;
    bench.start(objects(a, done.clone()));
    bench.start(files(b, done.clone()));
    bench.start(idns(c, done.clone()));
    bench.start(ads(d, done.clone()));
    bench.start(vendor(e, done.clone()));
    let end = bench.now + Duration::from_secs(60);
    let (mut queued, mut emergencies) = (0u16, Vec::new());
    while *done.borrow() != [1; 5] {
        assert!(bench.now < end, "seed {seed}: not done in 60 s: {:?}, {:?}", done.borrow(), bench.mailbox.counters());
        if random.below(40) == 0 && queued < 200 {
            queued += 1;
            let emergency = Emergency { error_code: queued, error_register: 0, data: [0; 5] };
            let mut mail = vec![0x00, 0x10];
            mail.extend(emergency.encode());
            bench.device.queue_mail(Protocol::Coe, &mail, bench.now);
        }
        if drops && random.below(60) == 0 {
            // A further request that is given up early.
            let (mailbox, bus) = (bench.mailbox.clone(), bench.supervisor.bus());
            let (limit, which) = (Duration::from_micros(random.below(3000)), random.below(3));
            bench.start(async move {
                let object = SdoAddress::new(0x2000, 1);
                let _ = match which {
                    0 => bus.within(limit, read(&mailbox, object, LIMITS, 1000)).await.map(drop),
                    1 => {
                        bus.within(limit, write(&mailbox, SdoAddress::new(0x3000, 1), &[1; 90], LIMITS)).await.map(drop)
                    }
                    _ => bus
                        .within(limit, soe::read(&mailbox, SoeAddress::value(1, Idn(0)), LIMITS, 900))
                        .await
                        .map(drop),
                };
            });
        }
        bench.step(|| fate(&mut random, percent, links));
        emergencies.extend(
            core::iter::from_fn(|| bench.mailbox.pop_emergency()).map(|received| received.emergency.error_code),
        );
    }
    for _ in 0..10 {
        bench.mailbox.mail_available();
        bench.pass(Duration::from_millis(100));
        emergencies.extend(
            core::iter::from_fn(|| bench.mailbox.pop_emergency()).map(|received| received.emergency.error_code),
        );
    }
    emergencies.sort_unstable();
    let counters = bench.mailbox.counters();
    assert_eq!(emergencies, (1..=queued).collect::<Vec<_>>(), "seed {seed}: each emergency once, {counters:?}");
    let steps = bench.device.served.windows(2);
    // The counter of a message that was never accepted is missing; no message is executed twice in a row.
    assert!(steps.clone().all(|pair| pair[0] != pair[1]), "seed {seed}");
}

// covers: mailbox-faults
#[test]
fn all_protocols_run_in_parallel_over_one_mailbox() {
    storm(1, LinkSet::Single, 0, false);
}

// covers: mailbox-faults
#[test]
fn no_mail_is_lost_or_confused_whatever_frames_are_lost_seeds_0_to_99() {
    for seed in 0..100 {
        storm(seed, if seed % 2 == 0 { LinkSet::Ring } else { LinkSet::Single }, 1 + seed % 20, false);
    }
}

/// A mail was read four times in 200 ms, each time by a late frame or after a repeat.
// covers: mailbox-faults
#[test]
fn a_late_mail_long_after_its_acceptance_is_a_duplicate_seed_2468() {
    storm(2468, LinkSet::Ring, 20, false);
}

/// A request was given up after its answer had begun, before the write was confirmed.
// covers: mailbox-faults
#[test]
fn fragments_of_an_abandoned_request_do_not_answer_the_next_request() {
    storm(3580, LinkSet::Ring, 20, true);
}

// covers: mailbox-faults
#[test]
fn dropped_procedures_do_not_disturb_others_seeds_0_to_99() {
    for seed in 0..100 {
        storm(seed, LinkSet::Single, seed % 10, true);
    }
}
