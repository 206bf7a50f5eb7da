//! Counters of frames that were forwarded, in words.

use ringcat::standby::ForwardingCounters;

/// Why this MainDevice and the ACTIVE cannot share a ring.
pub fn same_identity(counters: &ForwardingCounters) -> Option<String> {
    counters.check_identity().err().map(|error| error.to_string())
}

/// The counters in a line.
pub fn in_line(counters: &ForwardingCounters) -> String {
    let ForwardingCounters { on_main, on_redundant, sent_back, again, own, not_ethercat, too_old, no_link, .. } =
        counters;
    format!(
        "forwarded {on_main} on MAIN, {on_redundant} on RED, of these {sent_back} back; not forwarded: {again} again, \
         {own} own, {not_ethercat} not EtherCAT, {too_old} too old, {no_link} without a link"
    )
}
