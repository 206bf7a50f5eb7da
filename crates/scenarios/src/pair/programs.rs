//! The programs of both MainDevices.

use std::ops::Range;
use std::time::Duration;

use ringcat::simulated::two_hosts::HostLinks;
use ringcat::standby::StoreAndForward;
use ringcat::{
    AlState, Application, Direction, DomainId, DomainState, Error, Event, LastOutputs, Links, MainDevice, Options,
    SubDeviceId, automatic,
};

use super::board::{Board, Phase};

/// Cycle time of both MainDevices.
pub const CYCLE: Duration = Duration::from_millis(1);
/// An INACTIVE checks for requests at this interval while no frames come.
const LOOK: Duration = Duration::from_millis(1);
/// Limit of an orderly stop.
const STOP_LIMIT: Duration = Duration::from_secs(2);

/// Forwards until it is asked to stop, but no frames that are older than two cycles. Its links are up only meanwhile.
pub(super) fn standby(links: HostLinks, board: &Board) {
    forward(links, board, 2 * CYCLE);
}

/// Forwards frames of any age.
pub(super) fn standby_without_limit(links: HostLinks, board: &Board) {
    forward(links, board, Duration::MAX);
}

fn forward(mut links: HostLinks, board: &Board, max_age: Duration) {
    let mut forwarder = StoreAndForward::new(links.addresses()).expect("there are two links").with_max_age(max_age);
    links.switch(true);
    while !board.is_asked_to_stop() {
        links.wait(links.now() + LOOK);
        forwarder.forward(&mut links);
        board.note(|seen| seen.forwarded = forwarder.counters());
    }
    links.switch(false);
    board.note(|seen| seen.phase = Phase::Ended);
}

/// Brings all SubDevices to OP, writes the number of the cycle to all outputs, and stops in order when asked to.
pub(super) fn active(mut links: HostLinks, board: &Board) {
    links.switch(true);
    let failure = exchange(links, board).err();
    board.note(|seen| {
        seen.phase = Phase::Ended;
        seen.failure = failure.map(|error| error.to_string());
    });
}

fn exchange(links: HostLinks, board: &Board) -> Result<(), Error> {
    let mut main_device = MainDevice::request(links, &Options::default());
    let scan = main_device.scan()?;
    let mut application = main_device.activate(automatic(&scan.subdevices, CYCLE))?;
    let outputs = outputs_of(&application, scan.subdevices.len());
    let mut is_running = false;
    while !board.is_asked_to_stop() {
        let status = application.cycle(|data| {
            let number = (data.now().0 / CYCLE.as_nanos() as u64) as u16;
            for area in outputs.iter().cloned() {
                let bytes = data.outputs_mut(DomainId(0), area).expect("they are outputs");
                let pattern = number.to_le_bytes().into_iter().cycle();
                bytes.iter_mut().zip(pattern).for_each(|(byte, value)| *byte = value);
            }
            data.status(DomainId(0)).expect("it is declared")
        });
        let is_complete = status.state == DomainState::Complete && status.wkc == status.expected;
        is_running |= application.all_settled() && is_complete;
        let mut foreign = 0;
        while let Some(event) = application.pop_event() {
            foreign += u64::from(matches!(event.event, Event::ForeignFrame { .. }));
        }
        board.note(|seen| {
            if is_running {
                seen.phase = Phase::Active;
                seen.cycles += 1;
                seen.incomplete += u64::from(!is_complete);
            }
            seen.is_last_complete = is_complete;
            seen.ring = application.ring();
            seen.foreign += foreign;
        });
    }
    board.note(|seen| seen.phase = Phase::Starting);
    let main_device = application.stop(LastOutputs::Zero, AlState::Init, STOP_LIMIT)?;
    main_device.into_links().switch(false);
    Ok(())
}

/// The outputs of all SubDevices in the image.
pub(super) fn outputs_of(application: &Application<HostLinks>, subdevices: usize) -> Vec<Range<usize>> {
    let areas = (0..subdevices).flat_map(|subdevice| application.directory().areas(SubDeviceId(subdevice)));
    let outputs = areas.filter(|area| area.direction == Direction::Outputs);
    outputs
        .map(|area| {
            let start = area.placed.image_offset as usize;
            start..start + usize::from(area.placed.area.length)
        })
        .collect()
}
