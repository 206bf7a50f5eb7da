//! Reads error counters of SubDevices, periodically and on request; clears them (protocol 2.5).

use alloc::vec::Vec;

use ringcat_wire::address::StationAddress;
use ringcat_wire::register::{ErrorCounters, map};

pub use crate::procedures::error_statistics::{PortErrors, Statistics};

use super::ServiceError;
use crate::declared::SubDeviceId;
use crate::procedures::error_statistics::{ErrorStatistics, WATCHDOGS};
use crate::procedures::shared_segment::SharedSegment;
use crate::supervisor::Bus;

/// A counter with this value is cleared.
const NEARLY_FULL: u8 = 0xC0;

/// Runs until the MainDevice stops: reads all counters in turns, once per period.
pub(crate) async fn collect(bus: Bus, segment: SharedSegment) {
    loop {
        let kept = &segment.statistics;
        let begin = bus.now();
        let period = kept.period();
        if period.is_some() {
            let stations: Vec<_> = segment.view().members().map(|member| member.station).enumerate().collect();
            let own = kept.clone();
            let read_one = move |bus: Bus, (subdevice, station)| {
                let kept = own.clone();
                async move {
                    // The supervision handles a SubDevice that does not answer.
                    let _ = read(&bus, &kept, subdevice, station).await;
                }
            };
            bus.gather_in_turns(stations, read_one).await;
        }
        let changed = kept.until_period(period);
        match period {
            Some(period) => {
                let left = period.saturating_sub(bus.now().since(begin));
                let _ = bus.within(left, changed).await;
            }
            None => changed.await,
        }
    }
}

/// Reads the counters of one SubDevice.
pub(crate) async fn read(
    bus: &Bus,
    kept: &ErrorStatistics,
    subdevice: usize,
    station: StationAddress,
) -> Result<Statistics, ServiceError> {
    let counters = bus.fprd_array::<{ ErrorCounters::LEN }>(station, map::RX_ERROR_COUNTER);
    let watchdogs = bus.fprd_array::<WATCHDOGS>(station, map::WATCHDOG_COUNTER_PROCESS_DATA);
    let (counters, watchdogs) = bus.both(counters, watchdogs).await;
    let (bytes, watchdogs) = (counters?, watchdogs?);
    kept.with(subdevice, |statistics| statistics.take(bus.now(), ErrorCounters::decode(&bytes), watchdogs));
    if bytes.iter().chain(&watchdogs).any(|counter| *counter >= NEARLY_FULL) {
        clear_registers(bus, kept, subdevice, station).await?;
    }
    kept.find(subdevice).ok_or(ServiceError::NoSubDevice { subdevice: SubDeviceId(subdevice).into() })
}

/// Clears the counters of one SubDevice, and their totals.
pub(crate) async fn clear(
    bus: &Bus,
    kept: &ErrorStatistics,
    subdevice: usize,
    station: StationAddress,
) -> Result<(), ServiceError> {
    clear_registers(bus, kept, subdevice, station).await?;
    kept.with(subdevice, |statistics| *statistics = Statistics::default());
    Ok(())
}

/// Errors between the read and the write are not counted.
async fn clear_registers(
    bus: &Bus,
    kept: &ErrorStatistics,
    subdevice: usize,
    station: StationAddress,
) -> Result<(), ServiceError> {
    let counters = bus.fpwr(station, map::RX_ERROR_COUNTER, &[0; ErrorCounters::LEN]);
    let watchdogs = bus.fpwr(station, map::WATCHDOG_COUNTER_PROCESS_DATA, &[0; WATCHDOGS]);
    let (counters, watchdogs) = bus.both(counters, watchdogs).await;
    counters?;
    watchdogs?;
    kept.with(subdevice, |statistics| {
        (statistics.registers, statistics.watchdog_registers) = (ErrorCounters::default(), [0; WATCHDOGS]);
    });
    Ok(())
}
