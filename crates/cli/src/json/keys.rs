//! The documentation of all keys, made from the types: `docs/json.md` has to agree with them.
//!
//! A key that the page lacks, or a key of the page that no type has, fails the test. `RINGCAT_WRITE_JSON_KEYS=1` writes
//! the tables of the page.

use std::path::Path;

use json_keys::{Table, check_keys, check_page, keys};

use super::{
    bench, capture, clocks, demo, demo_standby, doctor, eni, esi, line, network, remote, ring, run, scan, sii, sim,
    standby,
};

/// The line before the tables.
const BEGIN: &str =
    "<!-- Written from crates/cli/src/json: RINGCAT_WRITE_JSON_KEYS=1 cargo test -p ringcat-cli keys -->\n";

/// All lines: a heading, and the keys.
fn all() -> Vec<Table> {
    vec![
        ("Every result", keys::<line::ResultLine>()),
        ("Event", keys::<line::EventLine>()),
        ("Answer", keys::<line::AnswerLine>()),
        ("`scan`", keys::<scan::Scan>()),
        ("`init`", keys::<network::Init>()),
        ("`compare`", keys::<network::Compare>()),
        ("`run`", keys::<run::Run>()),
        ("`ring`", keys::<ring::Ring>()),
        ("`clocks`", keys::<clocks::Clocks>()),
        ("`doctor`", keys::<doctor::Doctor>()),
        ("`capture`", keys::<capture::Capture>()),
        ("`standby`", keys::<standby::Standby>()),
        ("`remote`", keys::<remote::Remote>()),
        ("`sim`", keys::<sim::Sim>()),
        ("`eni`", keys::<eni::EniFile>()),
        ("`eni export`", keys::<eni::EniExport>()),
        ("`esi list`", keys::<esi::EsiList>()),
        ("`esi show`", keys::<esi::EsiShow>()),
        ("`esi declare`", keys::<esi::EsiDeclared>()),
        ("`sii build`", keys::<sii::SiiBuilt>()),
        ("`sii compare`", keys::<sii::SiiCompared>()),
        ("`sii skeleton`", keys::<sii::SiiSkeleton>()),
        ("`demo`", keys::<demo::Demo>()),
        ("`demo --standby`", keys::<demo_standby::DemoStandby>()),
        ("`bench echo`", keys::<bench::Echo>()),
        ("`bench round-trip`", keys::<bench::RoundTrip>()),
        ("`bench cycles`", keys::<bench::Cycles>()),
        ("`bench rate`", keys::<bench::Rate>()),
    ]
}

// covers: json
#[test]
fn the_page_of_all_keys_agrees_with_the_types() {
    // A package has no pages: there it is skipped.
    check_page(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/json.md")), BEGIN, &all());
}

// covers: json
#[test]
fn every_key_has_a_type_a_meaning_and_a_unit() {
    check_keys(&all());
}
