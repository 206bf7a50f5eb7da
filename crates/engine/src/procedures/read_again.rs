//! Reading a member's SII once more: after a boot loader, or where one that could not be followed may have been mended.

use alloc::string::ToString;

use super::scan::read_one;
use super::shared_segment::SharedSegment;
use super::sii::{self, SiiCache};
use crate::event::Event;
use crate::segment::Observation;
use crate::supervisor::Bus;

/// Reads it. One that cannot be read leaves everything as it was.
pub(super) async fn read_again(bus: &Bus, segment: &SharedSegment, index: usize) {
    let Some(known) = segment.view().members.get(index).and_then(|member| member.info.clone()) else { return };
    let read = async {
        sii::claim(bus, known.station).await?;
        // What was read before says nothing about what is there now.
        read_one(bus, known.position, known.station, &SiiCache::new(false)).await
    };
    match read.await {
        // The reason was reported.
        Ok(info) if info.is_blank() => {}
        Ok(mut info) => {
            info.keep_read_online(&known);
            segment.observe(Observation::ReadAgain { index, info: &info });
        }
        Err(error) => bus.report(Event::ScanFailed { reason: error.to_string() }),
    }
}
