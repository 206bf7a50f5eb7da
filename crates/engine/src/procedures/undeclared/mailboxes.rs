//! Mailboxes of SubDevices without a declaration, and the results of their last attempts. Both stay outside of the
//! model: a mailbox has a handle to the bus, a result is for the procedure that waits for it.

use alloc::rc::Rc;
use alloc::vec::Vec;
use core::cell::RefCell;

use ringcat_wire::address::Position;

use crate::knowledge::KnownMailbox;
use crate::mail::{EmergencyRings, Mailbox};
use crate::procedures::configure::ConfigureError;
use crate::segment::SubDeviceKey;
use crate::supervisor::Bus;

type AttemptResult = Result<(), ConfigureError>;

#[derive(Debug)]
struct Entry {
    key: SubDeviceKey,
    position: Position,
    mailbox: Mailbox,
    /// The last attempt that has ended.
    ended: Option<(u32, AttemptResult)>,
}

/// The mailboxes, shared by all procedures. Which SubDevices have one is decided by the model.
#[derive(Clone, Debug)]
pub struct UndeclaredMailboxes {
    all: Rc<RefCell<Vec<Entry>>>,
    rings: Rc<RefCell<EmergencyRings>>,
    bus: Bus,
}

impl UndeclaredMailboxes {
    /// No mailboxes. `rings` has the emergencies of all SubDevices.
    pub(crate) fn new(bus: &Bus, rings: Rc<RefCell<EmergencyRings>>) -> UndeclaredMailboxes {
        UndeclaredMailboxes { all: Rc::default(), rings, bus: bus.clone() }
    }

    /// No mailboxes, for another bus.
    pub(crate) fn renewed(&self, bus: &Bus) -> UndeclaredMailboxes {
        UndeclaredMailboxes::new(bus, self.rings.clone())
    }

    /// The SubDevices with mailboxes from now on. Mailboxes of those that stay do not change, the others are closed:
    /// the result has those with downloads to PDO assignment or mapping that were not fetched. The ring buffer for
    /// emergencies follows a SubDevice to its new position; after a SubDevice has left, for example by a loss of power,
    /// the next SubDevice at its position uses its ring buffer.
    pub(crate) fn follow(&self, now: &[(SubDeviceKey, Position)]) -> Vec<SubDeviceKey> {
        let (mut all, mut rings) = (self.all.borrow_mut(), self.rings.borrow_mut());
        let is_same =
            |(entry, (key, at)): &(&Entry, &(SubDeviceKey, Position))| entry.key == *key && entry.position == *at;
        let unchanged = all.iter().zip(now).take_while(is_same).count();
        let mut before = all.split_off(unchanged);
        let now = now.get(unchanged..).unwrap_or_default();
        for entry in &before {
            match now.iter().any(|(key, _)| *key == entry.key) {
                true => rings.forget(entry.position.into()),
                false => rings.leave(entry.position, entry.mailbox.emergencies()),
            }
        }
        for (key, position) in now {
            let entry = match before.iter().position(|entry| entry.key == *key) {
                Some(at) => {
                    let entry = before.swap_remove(at);
                    entry.mailbox.rename((*position).into());
                    rings.keep((*position).into(), entry.mailbox.emergencies());
                    Entry { position: *position, ..entry }
                }
                None => {
                    let mailbox = Mailbox::new(&self.bus, *position);
                    mailbox.keep_emergencies_in(rings.arrive(*position));
                    Entry { key: *key, position: *position, mailbox, ended: None }
                }
            };
            all.push(entry);
        }
        rings.end_changes();
        before.iter().for_each(|entry| entry.mailbox.close());
        before.iter().filter(|entry| entry.mailbox.has_written_pdos()).map(|entry| entry.key).collect()
    }

    /// The mailbox of a SubDevice.
    pub(crate) fn of(&self, key: SubDeviceKey) -> Option<Mailbox> {
        self.all.borrow().iter().find(|entry| entry.key == key).map(|entry| entry.mailbox.clone())
    }

    /// What another process needs of the mailbox of a SubDevice.
    pub(crate) fn known(&self, key: SubDeviceKey) -> Option<KnownMailbox> {
        self.of(key)?.known()
    }

    /// The mailboxes in use.
    pub(super) fn in_use(&self) -> Vec<Mailbox> {
        let all = self.all.borrow();
        all.iter().filter(|entry| entry.mailbox.is_open()).map(|entry| entry.mailbox.clone()).collect()
    }

    /// SubDevices with downloads to objects of PDO assignment or mapping since the last call.
    pub(crate) fn take_written_pdos(&self) -> Vec<SubDeviceKey> {
        let all = self.all.borrow();
        let written = all.iter().filter(|entry| entry.mailbox.has_written_pdos());
        written.inspect(|entry| entry.mailbox.forget_written_pdos()).map(|entry| entry.key).collect()
    }

    /// An attempt has ended.
    pub(super) fn end(&self, key: SubDeviceKey, attempt: u32, result: AttemptResult) {
        if let Some(entry) = self.all.borrow_mut().iter_mut().find(|entry| entry.key == key) {
            entry.ended = Some((attempt, result));
        }
    }

    /// The result of an attempt, if it is the last one that has ended.
    pub(in crate::procedures) fn result(&self, key: SubDeviceKey, attempt: u32) -> Option<AttemptResult> {
        let all = self.all.borrow();
        let (ended, result) = all.iter().find(|entry| entry.key == key)?.ended.as_ref()?;
        (*ended == attempt).then(|| result.clone())
    }
}
