//! The EoE server of a device: frames in fragments, an IP stack or a loop, IP parameters (protocol 6.5).
//!
//! Input: the payload of an EoE message, virtual time. Output: the response, and frames of the device. [`reassembly`]
//! joins fragments, [`stack`] is an IP stack that answers ping and serves TCP. Time stamps are in virtual time.

mod addresses;
pub mod frames;
pub mod reassembly;
pub mod stack;

use std::collections::VecDeque;

use core::net::Ipv4Addr;

use ringcat_wire::mailbox::eoe::{AddressFilter, BLOCK, EoeBody, EoeFragment, EoeMessage, EoeResult, IpParameters};
use ringcat_wire::mailbox::{ErrorReply, PayloadError};

use super::answer::Answer;
use crate::description::{EoeDescription, EoeEnd};
use crate::time::SimTime;
use reassembly::Reassembly;
use stack::Stack;

pub use addresses::Addresses;

/// Messages of the device that wait for room in the mailbox.
const MAX_WAITING: usize = 64;
/// Size of messages without a frame: the address filter is the longest.
const MAX_OTHER: usize = 128;

/// The server with its state between messages.
#[derive(Clone, Debug)]
pub struct EoeServer {
    ip_support: bool,
    filter_support: bool,
    addresses: Addresses,
    filter: AddressFilter,
    reassembly: Reassembly,
    end: End,
    frame: u8,
    waiting: VecDeque<Vec<u8>>,
}

/// Receiver of the frames.
#[derive(Clone, Debug)]
enum End {
    Stack(Box<Stack>),
    Loop,
    Nothing,
}

impl EoeServer {
    /// The server of a device when its mailbox is opened.
    pub fn new(description: &EoeDescription) -> EoeServer {
        let unset = Ipv4Addr::UNSPECIFIED;
        let addresses = Addresses {
            mac: description.mac,
            address: description.address.unwrap_or(unset),
            mask: description.mask.unwrap_or(unset),
            gateway: description.gateway.unwrap_or(unset),
            dns: unset,
            name: Vec::new(),
        };
        let end = match description.end {
            EoeEnd::Stack => End::Stack(Box::new(Stack::new(&addresses))),
            EoeEnd::Loop => End::Loop,
            EoeEnd::Nothing => End::Nothing,
        };
        EoeServer {
            ip_support: description.ip_support,
            filter_support: description.filter_support,
            addresses,
            filter: AddressFilter::default(),
            reassembly: Reassembly::default(),
            end,
            frame: 0,
            waiting: VecDeque::new(),
        }
    }

    /// The current addresses.
    pub const fn addresses(&self) -> &Addresses {
        &self.addresses
    }

    /// The current address filter.
    pub const fn filter(&self) -> &AddressFilter {
        &self.filter
    }

    /// Serves one message. `room` is the largest length of each message to the MainDevice after the mailbox header.
    pub fn serve(&mut self, payload: &[u8], room: usize, now: SimTime) -> Answer {
        let message = match EoeMessage::decode(payload) {
            Ok(message) => message,
            Err(PayloadError::Short { .. }) => return Answer::Error(ErrorReply::SIZE_TOO_SHORT),
            Err(PayloadError::Code { .. } | PayloadError::Service { .. }) => {
                return Answer::Error(ErrorReply::SERVICE_NOT_SUPPORTED);
            }
        };
        let port = message.port;
        let body = match message.body {
            EoeBody::Fragment(fragment) => return self.fragment(port, &fragment, room, now),
            EoeBody::SetIp(parameters) => EoeBody::SetIpDone(self.set_ip(&parameters)),
            EoeBody::GetIp if self.ip_support => EoeBody::Ip(EoeResult::OK, self.ip()),
            EoeBody::GetIp => EoeBody::Ip(EoeResult::NO_IP_SUPPORT, IpParameters::default()),
            EoeBody::SetFilter(filter) if self.filter_support => {
                self.filter = filter;
                EoeBody::SetFilterDone(EoeResult::OK)
            }
            EoeBody::SetFilter(_) => EoeBody::SetFilterDone(EoeResult::NO_FILTER_SUPPORT),
            EoeBody::GetFilter if self.filter_support => EoeBody::Filter(EoeResult::OK, self.filter),
            EoeBody::GetFilter => EoeBody::Filter(EoeResult::NO_FILTER_SUPPORT, AddressFilter::default()),
            EoeBody::TimeStamp { .. }
            | EoeBody::SetIpDone(_)
            | EoeBody::SetFilterDone(_)
            | EoeBody::Ip(..)
            | EoeBody::Filter(..) => return Answer::Silence,
        };
        Answer::payload(encode(&EoeMessage { port, body }, MAX_OTHER))
    }

    fn fragment(&mut self, port: u8, fragment: &EoeFragment<'_>, room: usize, now: SimTime) -> Answer {
        let wants_time = fragment.time_requested && fragment.last;
        let frame = self.reassembly.take(fragment);
        let mut payloads = Vec::new();
        if let Some(frame) = frame {
            match &mut self.end {
                End::Stack(stack) => {
                    stack.receive(frame);
                    self.run_stack(room, now);
                }
                End::Loop => payloads = self.cut(port, &frame, room),
                End::Nothing => {}
            }
        }
        if wants_time {
            let body = EoeBody::TimeStamp { frame: fragment.frame, time_ns: now.0 as u32 };
            payloads.push(encode(&EoeMessage { port, body }, MAX_OTHER));
        }
        if payloads.is_empty() { Answer::Silence } else { Answer::Payloads(payloads) }
    }

    /// Runs the due work of the stack; its frames wait for the mailbox.
    pub fn run_stack(&mut self, room: usize, now: SimTime) {
        // A stack with a full output queue pauses.
        while self.waiting.len() < MAX_WAITING {
            let End::Stack(stack) = &mut self.end else {
                return;
            };
            let Some(frame) = stack.work(now) else {
                return;
            };
            let messages = self.cut(0, &frame, room);
            self.waiting.extend(messages);
        }
    }

    /// Next time at which the stack has work without input.
    pub fn next_deadline(&mut self, now: SimTime) -> Option<SimTime> {
        match &mut self.end {
            // While frames wait for the mailbox, the mailbox determines the next step.
            End::Stack(stack) if self.waiting.is_empty() => stack.next_deadline(now),
            End::Stack(_) | End::Loop | End::Nothing => None,
        }
    }

    /// A message of the device that waits for the mailbox.
    pub fn next_message(&mut self) -> Option<Vec<u8>> {
        self.waiting.pop_front()
    }

    /// A frame in fragments.
    fn cut(&mut self, port: u8, frame: &[u8], room: usize) -> Vec<Vec<u8>> {
        let most = room.saturating_sub(EoeMessage::OVERHEAD) / BLOCK * BLOCK;
        if most == 0 {
            return Vec::new();
        }
        self.frame = (self.frame + 1) & 0x0F;
        let count = frame.len().div_ceil(most);
        let blocks = |bytes: usize| u8::try_from(bytes.div_ceil(BLOCK)).unwrap_or(u8::MAX);
        let messages = frame.chunks(most).enumerate().map(|(number, data)| {
            let fragment = EoeFragment {
                frame: self.frame,
                number: u8::try_from(number).unwrap_or(u8::MAX),
                blocks: if number == 0 { blocks(frame.len()) } else { blocks(number * most) },
                last: number + 1 == count,
                time_requested: false,
                time_ns: None,
                data,
            };
            encode(&EoeMessage { port, body: EoeBody::Fragment(fragment) }, EoeMessage::OVERHEAD + data.len())
        });
        messages.collect()
    }

    fn set_ip(&mut self, parameters: &IpParameters<'_>) -> EoeResult {
        if !self.ip_support {
            return EoeResult::NO_IP_SUPPORT;
        }
        let mut new = self.addresses.clone();
        new.mac = parameters.mac.unwrap_or(new.mac);
        new.address = parameters.address.unwrap_or(new.address);
        new.mask = parameters.mask.unwrap_or(new.mask);
        new.gateway = parameters.gateway.unwrap_or(new.gateway);
        new.dns = parameters.dns.unwrap_or(new.dns);
        new.name = parameters.name.map_or(new.name, <[u8]>::to_vec);
        if !new.are_valid() {
            return EoeResult::UNSPECIFIED;
        }
        if let End::Stack(stack) = &mut self.end {
            stack.set_addresses(&new);
        }
        self.addresses = new;
        EoeResult::OK
    }

    fn ip(&self) -> IpParameters<'_> {
        let Addresses { mac, address, mask, gateway, dns, name } = &self.addresses;
        IpParameters {
            mac: Some(*mac),
            address: Some(*address),
            mask: Some(*mask),
            gateway: Some(*gateway),
            dns: Some(*dns),
            name: Some(name),
        }
    }
}

fn encode(message: &EoeMessage<'_>, most: usize) -> Vec<u8> {
    let mut bytes = vec![0; most];
    let length = message.encode(&mut bytes).unwrap_or(0);
    bytes.truncate(length);
    bytes
}
