//! The documentation of all keys, made from the types: `docs/ethercat-json.md` has to agree with them.

use std::borrow::Cow;
use std::path::Path;

use json_keys::{Table, check_keys, check_page, keys};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};

use super::values::{Bits, Hex, List};
use super::{config, domains, master, pdos, reads, ring, sdos, slaves, texts};
use crate::commands::ALL;
use crate::data_types::Scalar;
use crate::shape::Output;

/// The line before the tables.
const BEGIN: &str =
    "<!-- Written from crates/ethercat/src/json: RINGCAT_WRITE_JSON_KEYS=1 cargo test -p ringcat-ethercat keys -->\n";

/// What [`super::print`] begins every line with.
#[derive(JsonSchema)]
#[allow(dead_code)]
struct Head {
    /// Version of the keys on this page
    schema_version: u32,
    /// The command that prints the line
    command: &'static str,
}

impl<S, C, R: JsonSchema> JsonSchema for List<'_, S, C, R> {
    fn schema_name() -> Cow<'static, str> {
        Vec::<R>::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Vec::<R>::json_schema(generator)
    }
}

impl JsonSchema for Bits {
    fn schema_name() -> Cow<'static, str> {
        "Bits".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        Vec::<&str>::json_schema(generator)
    }
}

impl JsonSchema for Hex<'_> {
    fn schema_name() -> Cow<'static, str> {
        "Hex".into()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        <&str>::json_schema(generator)
    }
}

impl JsonSchema for Scalar {
    fn schema_name() -> Cow<'static, str> {
        "Scalar".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": ["integer", "number", "string", "null"] })
    }
}

/// All tables: a heading, and the keys.
fn all() -> Vec<Table> {
    vec![
        ("Every line", keys::<Head>()),
        ("`clocks`", keys::<ring::Clocks>()),
        ("`config`", keys::<config::Config<'_>>()),
        ("`crc`", keys::<slaves::Crc<'_>>()),
        ("`cstruct`", keys::<texts::Text<'_>>()),
        ("`data`", keys::<domains::Data>()),
        ("`domains`", keys::<domains::Domains>()),
        ("`eoe`", keys::<texts::Ethernet<'_>>()),
        ("`events`", keys::<ring::Event<'_>>()),
        ("`foe_read`", keys::<reads::File<'_>>()),
        ("`graph`", keys::<texts::Text<'_>>()),
        ("`master`", keys::<master::Master<'_>>()),
        ("`pdos`", keys::<pdos::Pdos<'_>>()),
        ("`record`", keys::<ring::Record<'_>>()),
        ("`reg_read`", keys::<reads::Registers>()),
        ("`ring`", keys::<ring::Ring>()),
        ("`sdos`", keys::<sdos::Sdos<'_>>()),
        ("`sii_read`", keys::<reads::Sii>()),
        ("`slaves`", keys::<slaves::Slaves<'_>>()),
        ("`soe_read`", keys::<reads::Idn>()),
        ("`upload`", keys::<reads::Upload>()),
        ("`version`", keys::<texts::Version>()),
        ("`xml`", keys::<texts::Text<'_>>()),
    ]
}

// covers: daemon, json
#[test]
fn the_page_of_all_keys_agrees_with_the_types() {
    // A package has no pages: there it is skipped.
    check_page(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/ethercat-json.md")), BEGIN, &all());
}

// covers: daemon, json
#[test]
fn every_key_has_a_type_a_meaning_and_a_unit() {
    check_keys(&all());
}

// covers: daemon, json
#[test]
fn every_command_that_prints_data_has_a_table_of_keys() {
    let tables: Vec<String> = all().iter().skip(1).map(|(heading, _)| heading.trim_matches('`').to_owned()).collect();
    let commands = ALL.into_iter().filter(|command| command.output == Output::Data);
    assert_eq!(tables, commands.map(|command| command.name).collect::<Vec<_>>());
}
