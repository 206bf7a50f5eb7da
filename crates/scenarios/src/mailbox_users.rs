//! Users of the devices' mailboxes besides procedures: for each device a request of the cyclic thread and a client of
//! the gateway. Both read elements of an array with values that identify the element; a wrong value panics.

use std::collections::BTreeMap;

use ringcat::{RequestState, SdoRequest, SubDeviceId};
use ringcat_wire::mailbox::sdo::{SdoRequest as Request, SdoResponse};
use ringcat_wire::mailbox::{Header, Message, Protocol, gateway};

use crate::world::World;

/// The array, and its elements that are never written: each has its subindex as value.
const ARRAY: u16 = 0x2001;
const FIRST: u8 = 20;
const LAST: u8 = 200;
/// Cycles after which a client repeats a request without a response.
const PATIENCE: u32 = 40;

/// A device and its users.
#[derive(Debug)]
struct Users {
    station: u16,
    request: SdoRequest,
    /// Element of the request.
    asked: u8,
    client: u64,
    counter: u8,
    /// Element and counter of the client's request.
    sent: BTreeMap<u8, u8>,
    /// Cycles for which it has waited.
    waited: Option<u32>,
}

/// The users of some devices, and their results.
#[derive(Debug)]
pub struct MailboxUsers {
    users: Vec<Users>,
    stopped: bool,
    next: u8,
    /// Number of right values.
    pub answered: u32,
    /// Number of failed requests.
    pub failed: u32,
}

impl MailboxUsers {
    /// Users of these devices, which are declared with the same indices.
    pub fn new(world: &mut World, devices: &[usize]) -> MailboxUsers {
        let users = devices.iter().map(|device| Users {
            station: world.station_of(*device),
            request: world.application_mut().engine_mut().create_sdo_request(SubDeviceId(*device), 8),
            asked: FIRST,
            client: 100 + *device as u64,
            counter: 0,
            sent: BTreeMap::new(),
            waited: None,
        });
        let users = users.collect();
        MailboxUsers { users, stopped: false, next: FIRST, answered: 0, failed: 0 }
    }

    /// Runs this many cycles and checks all users after each.
    pub fn run_cycles(&mut self, world: &mut World, cycles: u64) {
        for _ in 0..cycles {
            world.cycle();
            self.look(world);
        }
    }

    /// Starts no new requests. True when all requests have a value or have failed.
    pub fn stop(&mut self, world: &mut World) -> bool {
        self.stopped = true;
        for users in &mut self.users {
            world.application_mut().engine_mut().forget_client(users.client);
            users.sent.clear();
        }
        self.users.iter().all(|users| users.request.state() != RequestState::Busy)
    }

    fn element(&mut self) -> u8 {
        self.next = if self.next == LAST { FIRST } else { self.next + 1 };
        self.next
    }

    fn look(&mut self, world: &mut World) {
        self.take_answers(world);
        for at in 0..self.users.len() {
            self.look_at_request(at);
            let waited = &mut self.users[at].waited;
            *waited = waited.map(|waited| waited + 1).filter(|waited| *waited < PATIENCE);
            if waited.is_none() && !self.stopped {
                self.ask(world, at);
            }
        }
    }

    fn look_at_request(&mut self, at: usize) {
        let users = &self.users[at];
        match users.request.state() {
            RequestState::Busy => return,
            RequestState::Success => {
                let mut data = [0; 8];
                let length = users.request.data(&mut data);
                assert_eq!(data[..length], [users.asked, 0], "a request of the cyclic thread, device {at}");
                self.answered += 1;
            }
            RequestState::Error => self.failed += 1,
            RequestState::Unused => {}
        }
        if self.stopped {
            return;
        }
        let element = self.element();
        let users = &mut self.users[at];
        users.asked = element;
        users.request.set_object(ARRAY, element, false).expect("it is not busy");
        users.request.read().expect("it is not busy");
    }

    fn ask(&mut self, world: &mut World, at: usize) {
        let element = self.element();
        let users = &mut self.users[at];
        users.counter = users.counter % 7 + 1;
        users.sent.insert(users.counter, element);
        users.waited = Some(0);
        let request = Request::Upload { index: ARRAY, sub_index: element, complete_access: false };
        let mut payload = [0; 16];
        let length = request.encode(&mut payload).expect("it fits");
        let header = Header { address: users.station, ..Header::new(Protocol::Coe, users.counter, length as u16) };
        let mut bytes = [0; 32];
        let message = Message { header, payload: &payload[..length] };
        let length = gateway::encode(&message, &mut bytes).expect("it fits");
        world.application_mut().engine_mut().relay(users.client, &bytes[..length]);
    }

    fn take_answers(&mut self, world: &mut World) {
        while let Some(relayed) = world.application_mut().engine_mut().pop_relayed() {
            let users = self.users.iter_mut().find(|users| users.client == relayed.client).expect("a client of ours");
            let Message { header, payload } = gateway::decode(&relayed.bytes).expect("a message");
            let asked = users.sent.get(&header.counter).copied();
            assert!(header.address == users.station && asked.is_some(), "response without a request: {header:?}");
            users.waited = None;
            if header.protocol != Protocol::Coe {
                self.failed += 1;
                continue;
            }
            match SdoResponse::decode(payload).expect("an SDO") {
                SdoResponse::UploadExpedited { index, sub_index, data, .. } => {
                    assert_eq!((index, Some(sub_index), data.first()), (ARRAY, asked, asked.as_ref()), "a client");
                    self.answered += 1;
                }
                SdoResponse::Abort { .. } => self.failed += 1,
                other => panic!("to a client that uploads: {other:?}"),
            }
        }
    }
}
