//! Words in the memory of SubDevices by which declarations find the SubDevices; the SII need not name these words
//! (protocol 4.3).

use alloc::vec::Vec;

use ringcat_wire::address::{RegisterAddress, StationAddress};

use super::shared_segment::SharedSegment;
use crate::config::data_words;
use crate::info::{DataWord, SubDeviceInfo};
use crate::segment::{More, Observation};
use crate::supervisor::{Bus, BusError};

/// Attempts to read a word: without an answer a frame may be lost, or the memory does not exist.
const ATTEMPTS: u32 = 3;

/// Reads these words of each SubDevice of the scan. A SubDevice without such memory has no words. False if frames were
/// lost: then the words that were read before are kept.
pub(crate) async fn read_of_scan(bus: &Bus, segment: &SharedSegment, words: &[RegisterAddress]) -> bool {
    if words.is_empty() {
        return true;
    }
    let keys: Vec<_> = {
        let view = segment.view();
        let stations = view.found().map(|found| found.stations()).unwrap_or_default();
        stations.into_iter().filter_map(|station| Some(view.subdevices().at(station)?.key)).collect()
    };
    let read = bus.gather(keys, |bus, key| {
        let words = words.to_vec();
        async move { (key, read(&bus, key.station, &words).await) }
    });
    let mut are_all_read = true;
    for (key, words) in read.await {
        match words {
            Ok(words) => segment.observe(Observation::MoreRead { key, more: More::DataWords(words) }),
            Err(_) => are_all_read = false,
        }
    }
    are_all_read
}

/// What is known of the SubDevices of the scan.
pub(crate) fn scanned(segment: &SharedSegment) -> Vec<SubDeviceInfo> {
    segment.view().found().map(|found| found.scan().subdevices).unwrap_or_default()
}

/// Reads the words that declared SubDevices are found by.
pub(super) async fn read_declared(
    bus: &Bus,
    segment: &SharedSegment,
    station: StationAddress,
) -> Result<Vec<DataWord>, BusError> {
    let words = data_words(segment.view().members().map(|member| &*member.member.config));
    read(bus, station, &words).await
}

async fn read(bus: &Bus, station: StationAddress, words: &[RegisterAddress]) -> Result<Vec<DataWord>, BusError> {
    let mut all = Vec::new();
    for register in words {
        for _ in 0..ATTEMPTS {
            match bus.fprd_array(station, *register).await {
                Ok(bytes) => {
                    all.push(DataWord::new(*register, u16::from_le_bytes(bytes)));
                    break;
                }
                Err(BusError::Wkc { .. }) => {}
                Err(error) => return Err(error),
            }
        }
    }
    Ok(all)
}
