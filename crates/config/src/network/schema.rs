//! The JSON schema of network files is made from the types: `docs/network-file.schema.json` has to agree with them.
//! `RINGCAT_WRITE_NETWORK_SCHEMA=1` writes the file.

use std::path::PathBuf;

use schemars::generate::SchemaSettings;
use serde_json::Value;

use super::NetworkFile;

/// The schema as text.
fn schema() -> String {
    let settings = SchemaSettings::draft2020_12().for_deserialize();
    let mut schema = settings.into_generator().into_root_schema_for::<NetworkFile>().to_value();
    schema["title"] = Value::from("Network file of RingCAT, version 1");
    let mut text = serde_json::to_string_pretty(&schema).expect("a schema is JSON");
    text.push('\n');
    text
}

// covers: network-file
#[test]
fn the_schema_in_the_documentation_agrees_with_the_types() {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/network-file.schema.json"));
    if !path.with_file_name("FEATURES.md").exists() {
        println!("skipped: a package has no pages, {} is not there", path.display());
        return;
    }
    if std::env::var("RINGCAT_WRITE_NETWORK_SCHEMA").is_ok_and(|value| value == "1") {
        std::fs::write(&path, schema()).expect("the file is writable");
        return;
    }
    let written = std::fs::read_to_string(&path).expect("docs/network-file.schema.json is there");
    assert!(written == schema(), "run RINGCAT_WRITE_NETWORK_SCHEMA=1 cargo test -p ringcat-config schema");
}

/// Names of the keys of all tables.
fn keys_of(schema: &Value, keys: &mut Vec<(String, String)>) {
    if let Some(properties) = schema.get("properties").and_then(Value::as_object) {
        for (name, property) in properties {
            let meaning = property.get("description").and_then(Value::as_str).unwrap_or_default();
            keys.push((name.clone(), meaning.to_owned()));
        }
    }
    for child in schema.get("$defs").and_then(Value::as_object).into_iter().flat_map(|defs| defs.values()) {
        keys_of(child, keys);
    }
}

// covers: network-file
#[test]
fn every_key_has_a_meaning_in_the_schema_and_is_in_the_file_with_all_keys() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/files/whole.network.toml");
    let Ok(whole) = std::fs::read_to_string(path) else {
        println!("skipped: a package has no samples, {path} is not there");
        return;
    };
    let mut keys = Vec::new();
    keys_of(&serde_json::from_str(&schema()).expect("the schema is JSON"), &mut keys);
    assert!(keys.len() > 100, "{}", keys.len());
    for (key, meaning) in keys {
        assert!(!meaning.is_empty(), "{key} has no comment");
        let forms = [format!("{key} = "), format!("[{key}]"), format!(".{key}]"), format!("[{key}.")];
        assert!(forms.iter().any(|form| whole.contains(form)), "the file with all keys lacks {key}");
    }
}
