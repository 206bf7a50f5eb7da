//! Mailboxes: CoE through the router of each SubDevice, undisturbed and with all kinds of losses.

use std::time::Duration;

use ringcat_engine::mail::coe::{SdoAddress, SdoError, SdoFailure, read, write};
use ringcat_engine::mail::{Limits, Mailbox, MailboxError};
use ringcat_sim::cable::{CableId, DeviceIndex};
use ringcat_wire::mailbox::sdo::AbortCode;
use scenarios::loss::Loss;
use scenarios::segments::ring_of_16;
use scenarios::world::World;

const FAST: Duration = Duration::from_micros(10);
const LIMITS: Limits = Limits::new(Duration::from_millis(100), Duration::from_secs(1));
/// An analogue terminal: settings that can be written in any state.
const TERMINAL: usize = 3;
const NUMBER: SdoAddress = SdoAddress::new(0x8000, 1);
const TEXT: SdoAddress = SdoAddress::new(0x8000, 3);
/// Mailboxes of the devices in the catalogue.
const RECEIVE: u16 = 0x1000;
const SEND: u16 = 0x1080;

fn world(seed: u64) -> World {
    World::in_op(seed, ring_of_16(FAST))
}

fn number(world: &World, device: usize) -> u16 {
    let dictionary = world.network().device(DeviceIndex(device)).application.dictionary();
    u16::from_le_bytes(dictionary.read(0x8000, 1).unwrap().try_into().unwrap())
}

/// Writes and reads back a few numbers and texts.
async fn write_and_read(mailbox: Mailbox, rounds: u16) -> Result<(), SdoError> {
    for round in 0..rounds {
        write(&mailbox, NUMBER, &round.to_le_bytes(), LIMITS).await?;
        assert_eq!(read(&mailbox, NUMBER, LIMITS, 2).await?, round.to_le_bytes());
        let text = format!("text number {round:04}");
        write(&mailbox, TEXT, text.as_bytes(), LIMITS).await?;
        assert_eq!(read(&mailbox, TEXT, LIMITS, 16).await?, text.as_bytes());
    }
    Ok(())
}

// covers: 6.1, mailbox
#[test]
fn a_lost_write_is_repeated_with_its_counter_and_executed_once() {
    for lost in [Loss::of_write(0x1004, RECEIVE), Loss::of_write(0x1004, RECEIVE).on_the_way_back()] {
        for skip in 0..6 {
            let mut world = world(1);
            let mailbox = world.mailbox(TERMINAL);
            // Both copies.
            world.lose(lost.times(2, 2 * skip));
            assert_eq!(world.run(write_and_read(mailbox.clone(), 3)), Ok(()));
            assert_eq!(world.application().links().losses_left(), 0);
            let counters = mailbox.counters();
            assert_eq!((counters.written, counters.rewritten), (12, 1), "skip {skip}");
            assert_eq!((counters.read, counters.duplicates, counters.unclaimed), (12, 0, 0), "one response each");
        }
    }
}

// covers: 6.2, mailbox
#[test]
fn a_lost_read_is_repeated_with_the_repeat_bit() {
    for lost in [Loss::of_read(0x1004, SEND), Loss::of_read(0x1004, SEND).on_the_way_back()] {
        for skip in 0..12 {
            let mut world = world(2);
            let mailbox = world.mailbox(TERMINAL);
            world.lose(lost.times(2, 2 * skip));
            assert_eq!(world.run(write_and_read(mailbox.clone(), 4)), Ok(()), "skip {skip}");
            assert_eq!(world.application().links().losses_left(), 0);
            let counters = mailbox.counters();
            assert_eq!((counters.written, counters.repeats), (16, 1));
            assert_eq!(counters.unclaimed, 0);
        }
    }
}

// covers: mailbox
#[test]
fn many_consecutive_losses_are_recovered() {
    let mut world = world(3);
    let mailbox = world.mailbox(TERMINAL);
    for skip in [0, 7, 9, 20, 31] {
        world.lose(Loss::of_write(0x1004, RECEIVE).times(3, skip));
        world.lose(Loss::of_read(0x1004, SEND).times(5, skip));
        world.lose(Loss::of_read(0x1004, SEND).on_the_way_back().times(3, skip + 4));
    }
    assert_eq!(world.run(write_and_read(mailbox.clone(), 10)), Ok(()));
    assert_eq!(world.application().links().losses_left(), 0);
}

// covers: mailbox
#[test]
fn cutting_and_healing_cables_during_transfers_loses_no_request_and_no_answer() {
    let mut world = world(4);
    let mailboxes = [3, 4, 7, 14, 15].map(|subdevice| world.mailbox(subdevice));
    let terminals = [mailboxes[0].clone(), mailboxes[2].clone(), mailboxes[3].clone()];
    let works = terminals.map(|mailbox| world.start(write_and_read(mailbox, 100)));
    for cable in [4, 3, 8, 15, 14, 0, 16] {
        world.run_cycles(7);
        world.cut(CableId(cable));
        world.run_cycles(13);
        world.heal(CableId(cable));
        world.run_cycles(5);
    }
    for work in works {
        assert_eq!(world.finish(Duration::from_secs(10), work), Ok(()));
    }
    for mailbox in &mailboxes {
        assert_eq!(mailbox.counters().unclaimed, 0);
    }
}

// covers: mailbox
#[test]
fn a_late_response_is_not_assigned_to_the_next_request() {
    let mut world = world(5);
    let mailbox = world.mailbox(TERMINAL);
    assert_eq!(world.run(write_and_read(mailbox.clone(), 2)), Ok(()));
    world.hang(DeviceIndex(TERMINAL), true);
    let limits = Limits::new(LIMITS.request, Duration::from_millis(20));
    let own = mailbox.clone();
    let error = world.run(async move { read(&own, NUMBER, limits, 2).await }).expect_err("it hangs");
    assert_eq!(error.cause, SdoFailure::Mailbox(MailboxError::NoAnswer { limit: limits.answer }));
    // Another request is dropped while it is under way.
    let own = mailbox.clone();
    let dropped = world.start(async move { read(&own, NUMBER, LIMITS, 2).await });
    world.run_cycles(5);
    drop(dropped);
    world.run_cycles(5);
    let own = mailbox.clone();
    let work = world.start(async move {
        write(&own, NUMBER, &7u16.to_le_bytes(), LIMITS).await?;
        read(&own, NUMBER, LIMITS, 2).await
    });
    world.hang(DeviceIndex(TERMINAL), false);
    assert_eq!(world.finish(Duration::from_secs(3), work), Ok(vec![7, 0]));
    assert_eq!(number(&world, TERMINAL), 7);
}

// covers: mailbox
#[test]
fn the_mailbox_of_an_absent_subdevice_is_closed_until_its_return() {
    let mut world = world(6);
    let mailbox = world.mailbox(TERMINAL);
    let work = world.start(write_and_read(mailbox.clone(), 1000));
    world.run_cycles(20);
    world.power_off(DeviceIndex(TERMINAL));
    let error = world.finish(Duration::from_secs(1), work).expect_err("it has no power");
    assert_eq!(error.cause, SdoFailure::Mailbox(MailboxError::Closed));
    let own = mailbox.clone();
    let error = world.run(async move { read(&own, NUMBER, LIMITS, 2).await }).expect_err("it has no power");
    assert_eq!(error.cause, SdoFailure::Mailbox(MailboxError::Closed));
    world.power_on(DeviceIndex(TERMINAL));
    world.settle();
    assert_eq!(world.run(write_and_read(mailbox, 5)), Ok(()));
}

// covers: mailbox
#[test]
fn several_tasks_share_a_mailbox_and_each_gets_its_responses() {
    let mut world = world(7);
    let mailbox = world.mailbox(TERMINAL);
    let channel = |mailbox: Mailbox, channel: u16| async move {
        for round in 0..20u16 {
            let object = SdoAddress::new(0x8000 + 0x10 * channel, 1);
            let value = (channel << 8 | round).to_le_bytes();
            write(&mailbox, object, &value, LIMITS).await?;
            assert_eq!(read(&mailbox, object, LIMITS, 2).await?, value);
        }
        Ok::<(), SdoError>(())
    };
    let works = [0, 1, 2, 3].map(|number| world.start(channel(mailbox.clone(), number)));
    let absent = SdoAddress::new(0x7777, 0);
    let own = mailbox.clone();
    let error = world.run(async move { read(&own, absent, LIMITS, 2).await }).expect_err("there is no such object");
    assert_eq!(error.cause, SdoFailure::Aborted(AbortCode::OBJECT_DOES_NOT_EXIST));
    for work in works {
        assert_eq!(world.finish(Duration::from_secs(2), work), Ok(()));
    }
    assert_eq!(mailbox.counters().unclaimed, 0);
}

// covers: mailbox
#[test]
fn an_idle_mailbox_costs_one_byte_per_poll() {
    let mut world = world(8);
    let mailbox = world.mailbox(TERMINAL);
    let before = mailbox.counters();
    world.run_cycles(100);
    assert_eq!(mailbox.counters(), before, "the router itself does not access the mailbox");
    assert_eq!(world.run(write_and_read(mailbox.clone(), 50)), Ok(()));
    let counters = mailbox.counters();
    println!("{} answers, {} empty reads, {} looks", counters.read, counters.empty_reads, counters.polls);
    assert_eq!(counters.read, 200);
    assert!(counters.empty_reads < 100, "{} empty reads", counters.empty_reads);
}
