//! Reads a member's SII again: after a boot loader, or if an SII that could not be used may have been corrected.

use alloc::string::ToString;

use super::scan::read_one;
use super::shared_segment::SharedSegment;
use super::sii::{self, SiiCache};
use crate::info::PdoSource;
use crate::segment::MemberFinding;
use crate::supervisor::Bus;

/// Reads the SII. If it cannot be read nothing changes.
pub(super) async fn read_again(bus: &Bus, segment: &SharedSegment, (index, attempt): (usize, u32)) {
    let Some(known) = segment.view().member(index).and_then(|member| member.info.cloned()) else { return };
    let alias_source = segment.view().alias_source();
    let read = async {
        let _turn = segment.eeproms.take(known.station).await;
        sii::claim(bus, known.station).await?;
        // Cached contents may be outdated.
        read_one(bus, (known.position, known.station), &SiiCache::new(false), alias_source).await
    };
    match read.await {
        // The reason was reported before.
        Ok(info) if info.is_blank() => {}
        Ok(mut info) => {
            // A boot loader may have brought another dictionary.
            info.pdo_source = PdoSource::Outdated;
            info.keep_dictionary(&known);
            info.data_words.clone_from(&known.data_words);
            segment.observe_member((index, attempt), MemberFinding::ReadAgain(&info));
        }
        Err(error) => segment.observe_member((index, attempt), MemberFinding::NotReadAgain(error.to_string())),
    }
}
