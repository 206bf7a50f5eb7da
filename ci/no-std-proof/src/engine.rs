//! Both halves of the engine at work, against a single SubDevice that is played by a few lines here.

use alloc::rc::Rc;
use alloc::sync::Arc;
use alloc::vec;
use alloc::vec::Vec;
use core::cell::Cell;
use core::hint::black_box;
use core::time::Duration;

use ringcat_engine::Board;
use ringcat_engine::Identity;
use ringcat_engine::Supervisor;
use ringcat_engine::direction::Direction;
use ringcat_engine::domain::{DomainId, DomainState};
use ringcat_engine::exchange::Exchange;
use ringcat_engine::layout::{AreaSpec, DomainSpec, ImageOrder, Layout};
use ringcat_engine::link::{Link, LinkSet};
use ringcat_engine::queue;
use ringcat_engine::time::Instant;
use ringcat_wire::address::{RegisterAddress, Wkc};
use ringcat_wire::datagram::{HEADER_LEN, MORE, OVERHEAD};
use ringcat_wire::frame::{ETHERCAT_HEADER_LEN, ETHERNET_HEADER_LEN, MacAddress};
use ringcat_wire::source_address::MacCodec;

const NOW: Instant = Instant(1_000_000);
/// What the SubDevice puts into everything that is read from it.
const INPUT: u8 = 0x5A;

/// Whether a procedure gets its answer and a cycle is complete.
pub fn works() -> Option<()> {
    let identity = black_box(Identity::new(MacCodec::FlagsFirst, MacAddress([2, 0, 0, 0, 0, 1]), None));
    procedure_works(identity)?;
    cycle_works(identity)
}

fn procedure_works(identity: Identity) -> Option<()> {
    let mut supervisor = Supervisor::new(identity, LinkSet::Single, NOW);
    let (bus, seen) = (supervisor.bus(), Rc::new(Cell::new(Wkc(0))));
    let result = seen.clone();
    supervisor.spawn(async move {
        if let Ok(reply) = bus.brd(RegisterAddress(0x0130), 2).await {
            result.set(reply.wkc());
        }
    });
    supervisor.poll(NOW);
    let mut sent = Vec::new();
    supervisor.transmit(NOW, 1514, &mut |_, bytes| sent.push(bytes.to_vec()));
    for mut frame in sent {
        answer(&mut frame)?;
        supervisor.receive(Link::Main, &frame, NOW);
    }
    supervisor.poll(NOW);
    (seen.get() == Wkc(1)).then_some(())
}

fn cycle_works(identity: Identity) -> Option<()> {
    let area = |sync_manager, flow| AreaSpec { subdevice: 0, sync_manager, direction: flow, length: 2 };
    let areas = vec![area(2, Direction::Outputs), area(3, Direction::Inputs)];
    let spec =
        DomainSpec { period: Duration::from_millis(1), under_way: 1, lrw: false, areas, image: ImageOrder::Packed };
    let layout = Layout::new(&[spec], LinkSet::Single, true).ok()?;
    let (_, inputs) = layout.area(0, 3)?;
    let board = Arc::new(Board::new(1));
    board.set_taking_part(0, true);
    let (events, _events) = queue(16);
    let mut exchange = Exchange::new(identity, LinkSet::Single, &layout, board, events);
    let domain = DomainId(0);
    let queued = exchange.queue(domain, NOW);
    let mut sent = Vec::new();
    exchange.send(NOW, &mut |_, bytes| sent.push(bytes.to_vec()));
    for mut frame in sent {
        answer(&mut frame)?;
        exchange.receive(Link::Main, &frame, NOW);
    }
    let complete = exchange.process(domain, NOW).state == DomainState::Complete;
    let input = exchange.image(domain).get(inputs.image_offset as usize).copied();
    (queued && complete && input == Some(INPUT)).then_some(())
}

/// Works on every datagram as one SubDevice would that answers reads and counts once.
fn answer(frame: &mut [u8]) -> Option<()> {
    let mut at = ETHERNET_HEADER_LEN + ETHERCAT_HEADER_LEN;
    loop {
        let length_field = u16::from_le_bytes([*frame.get(at + 6)?, *frame.get(at + 7)?]);
        let end = at + HEADER_LEN + usize::from(length_field & 0x07FF);
        frame.get_mut(at + HEADER_LEN..end)?.fill(INPUT);
        frame.get_mut(end..end + 2)?.copy_from_slice(&1u16.to_le_bytes());
        if length_field & MORE == 0 {
            return Some(());
        }
        at = end + OVERHEAD - HEADER_LEN;
    }
}
