use std::path::Path;

use super::*;
use crate::segment::Segment;

fn refused(text: &str) -> String {
    Segment::from_toml(text, Path::new("nowhere")).unwrap_err().to_string()
}

/// The tables of a file, and their keys.
const TABLES: [(&str, Keys); 4] =
    [("[segment]", SEGMENT), ("[[device]]", DEVICE), ("[[cable]]", CABLE), ("[[fault]]", FAULT)];

/// Mistakes in a file, and the whole message of each.
const MISTAKES: &[(&str, &str)] = &[
    // Tables.
    (
        "[devices]\ntype = \"servo\"",
        "line 1: unknown table or key \"devices\": expected [segment], [[device]], [[cable]] or [[fault]]",
    ),
    ("ring = true", "line 1: unknown table or key \"ring\": expected [segment], [[device]], [[cable]] or [[fault]]"),
    ("[[segment]]\nring = true", "line 1: segment: expected one table [segment], got an array"),
    ("segment = 3", "line 1: segment: expected one table [segment], got 3"),
    ("\n[device]\ntype = \"servo\"", "line 2: device: expected tables [[device]], got a table"),
    ("[cable]\nfrom = \"main\"", "line 1: cable: expected tables [[cable]], got a table"),
    ("device = [\"servo\"]", "line 1: device: expected tables [[device]], got the text \"servo\" among them"),
    // Unknown keys.
    (
        "[segment]\nspeed = 3",
        "line 2: unknown key \"speed\" in [segment]: expected one of name, seed, ring, cable_ns, link_down_delay_us, \
         link_up_delay_us, hop_ns, processing_ns, forwarding_ns, max_datagrams, more_datagrams",
    ),
    (
        "[[cable]]\nfrom = \"main\"\nto = \"redundant\"\nlength = 5",
        "line 4: unknown key \"length\" in [[cable]]: expected one of from, to, delay_ns",
    ),
    // Missing keys.
    ("\n[[cable]]\nfrom = \"main\"", "line 2: [[cable]] has no key to: expected from and to"),
    ("[[cable]]\ndelay_ns = 5", "line 1: [[cable]] has no key from: expected from and to"),
    ("[[fault]]\ncut = 5", "line 1: [[fault]] has no key at_ms: expected at_ms and a fault"),
    ("[[fault]]\nat_ms = 5", "line 1: [[fault]]: expected one of cut, heal, power_off and power_on"),
    ("[[fault]]\nat_ms = 5\ncut = 0\nheal = 0", "line 1: [[fault]]: expected one of cut, heal, power_off and power_on"),
    ("[[fault]]\nat_ms = 5\ncut = 0", "line 3: cut: expected the number of a cable, got 0, and there is none"),
    (
        "[[device]]\ntype = \"servo\"\n[[fault]]\nat_ms = 5\nheal = 1",
        "line 5: heal: expected the number of a cable, 0 to 0, got 1",
    ),
    (
        "[[device]]\ntype = \"servo\"\n[[fault]]\nat_ms = 5\npower_off = \"coupler\"",
        "line 5: power_off: expected the name of a device, got \"coupler\"",
    ),
    (
        "[[fault]]\nat_ms = 1e12\ncut = 0",
        "line 2: at_ms: expected at most 31536000000, which is a year, got 1000000000000",
    ),
    ("[[fault]]\nat_ms = -5\ncut = 0", "line 2: at_ms: expected a time, not negative, got -5"),
    // Other types.
    ("[segment]\nname = 7", "line 2: name: expected a text in quotation marks, got 7"),
    ("[segment]\nring = 7", "line 2: ring: expected true, false or \"device.port\", got 7"),
    ("[segment]\nseed = \"7\"", "line 2: seed: expected a whole number, not negative, got the text \"7\""),
    ("[segment]\nhop_ns = 1.5", "line 2: hop_ns: expected a whole number, not negative, got 1.5"),
    ("[segment]\nlink_up_delay_us = true", "line 2: link_up_delay_us: expected a number, got true"),
    (
        "[[device]]\ntype = \"coupler\"\ncount = \"two\"",
        "line 3: device \"coupler\": count: expected a whole number, not negative, got the text \"two\"",
    ),
    (
        "[[device]]\ntype = \"servo\"\neight_byte_sii = 1",
        "line 3: device \"servo\": eight_byte_sii: expected true or false, got 1",
    ),
    (
        "[[device]]\ntype = \"servo\"\nfiles = \"a.bin\"",
        "line 3: device \"servo\": files: expected an array of texts, got the text \"a.bin\"",
    ),
    (
        "[[device]]\ntype = \"servo\"\nfiles = [\n  \"a.bin\",\n  7,\n]",
        "line 5: device \"servo\": files: expected an array of texts, got 7",
    ),
    (
        "[[device]]\ntype = [\"servo\"]\nname = \"x\"",
        "line 2: device \"x\": type: expected a text in quotation marks, got an array",
    ),
    (
        "[[device]]\nname = \"x\"\nattach = { to = \"y\" }",
        "line 3: device \"x\": attach: expected a text in quotation marks, got a table",
    ),
    (
        "[[device]]\nname = \"x\"\nserial = 2026-11-22",
        "line 3: device \"x\": serial: expected a whole number from 0 to 4294967295, got the time 2026-11-22",
    ),
    // Values out of range.
    (
        "[[device]]\ntype = \"servo\"\n[[device]]\nalias = 70000",
        "line 4: device \"number 2\": alias: expected a whole number from 0 to 65535, got 70000",
    ),
    (
        "[[device]]\ntype = \"servo\"\nalias = 0x1_0000",
        "line 3: device \"servo\": alias: expected a whole number from 0 to 65535, got 0x10000",
    ),
    (
        "[[device]]\ntype = \"servo\"\nserial = -1",
        "line 3: device \"servo\": serial: expected a whole number from 0 to 4294967295, got -1",
    ),
    (
        "[[device]]\ntype = \"servo\"\nclock_bits = 300",
        "line 3: device \"servo\": clock_bits: expected a whole number from 0 to 255, got 300",
    ),
    (
        "[segment]\nseed = 9223372036854775808",
        "line 2: seed: expected a whole number, not negative, got 9223372036854775808",
    ),
    ("[segment]\nhop_ns = -1", "line 2: hop_ns: expected a whole number, not negative, got -1"),
    ("[segment]\nmax_datagrams = 65536", "line 2: max_datagrams: expected a whole number from 0 to 65535, got 65536"),
    (
        "[[device]]\ntype = \"servo\"\nport = -1",
        "line 3: device \"servo\": port: expected a whole number, not negative, got -1",
    ),
    // Given twice.
    ("[segment]\nseed = 1\nname = \"x\"\nseed = 2", "line 4: key seed is given twice in one table"),
    ("[segment]\nseed = 1\n[segment]\nname = \"x\"", "line 3: key segment is given twice in one table"),
    (
        "[[device]]\ntype = \"servo\"\nname = \"a\"\n[[device]]\ntype = \"servo\"\nname = \"a\"",
        "line 6: device \"a\": name: \"a\" is that of device 0 already",
    ),
    // Wrong words.
    (
        "[segment]\nmax_datagrams = 3\nmore_datagrams = \"lost\"",
        "line 3: more_datagrams: expected \"unprocessed\" or \"dropped\", got \"lost\"",
    ),
    (
        "[[device]]\ntype = \"servo\"\nclock_bits = 16",
        "line 3: device \"servo-1\": clock_bits: expected 0, 32 or 64, got 16",
    ),
    (
        "[[device]]\ntype = \"ethernet-terminal\"\nethernet = \"hub\"",
        "line 3: device \"ethernet-terminal-1\": ethernet: expected stack, loop or nothing, got \"hub\"",
    ),
];

// covers: sim-files
#[test]
fn errors_are_in_terms_of_toml_with_key_line_and_what_is_allowed() {
    for (text, expected) in MISTAKES {
        assert_eq!(refused(text), *expected, "{text}");
    }
}

// covers: sim-files
#[test]
fn text_that_is_no_toml_is_refused_with_its_line_and_without_rust_types() {
    for (text, place) in [
        ("[segment]\nring true", "line 2: "),
        ("[segment]\nname = \"x", "line 2: "),
        ("[[device]\ntype = \"servo\"", "line 1: "),
        ("[segment]\nname = x", "line 2: "),
        ("[segment]\nring = True", "line 2: "),
        ("[segment]\nseed = 01", "line 2: "),
        ("\u{0}", "line 1: "),
    ] {
        let message = refused(text);
        assert!(message.starts_with(place), "{text}: {message}");
        let rust = ["u8", "u16", "u32", "u64", "usize", "i64", "f64", "struct", "enum", "sequence", "Spanned", "field"];
        let words: Vec<&str> = message.split(|c: char| !c.is_ascii_alphanumeric()).collect();
        assert!(rust.iter().all(|word| !words.contains(word)), "{text}: {message}");
        assert!(!message.contains('\n'), "{text}: {message}");
    }
}

/// The reader refuses an unknown key with its own keys: they are those of the tables here.
#[test]
fn the_keys_are_those_of_the_reader() {
    for (before, keys) in TABLES {
        let message = crate::segment::format::File::parse(&format!("{before}\nno_such_key = 1")).unwrap_err().message;
        let known: Vec<&str> = message.split('`').skip(3).step_by(2).collect();
        assert_eq!(known, keys.iter().map(|(key, _)| *key).collect::<Vec<_>>(), "{before}: {message}");
    }
}

/// Each key takes the largest value of its type: the reader has no narrower one.
#[test]
fn the_reader_takes_every_value_that_the_check_lets_pass() {
    for (before, keys) in TABLES {
        for (key, kind) in keys {
            let values = match kind {
                Text => vec!["\"x\"".to_owned()],
                Texts => vec!["[]".to_owned(), "[\"x\"]".to_owned()],
                Flag => vec!["true".to_owned()],
                Whole(most) => vec!["0".to_owned(), most.to_string()],
                Number => vec!["1".to_owned(), "-1.5".to_owned(), "inf".to_owned(), format!("{}", i64::MIN)],
                Ring => vec!["false".to_owned(), "\"x.1\"".to_owned()],
            };
            for value in values {
                let required: &[&str] = match before {
                    "[[cable]]" => &["from = \"x\"\n", "to = \"x\"\n"],
                    "[[fault]]" => &["at_ms = 1\n"],
                    _ => &[],
                };
                let others: String = required.iter().copied().filter(|other| !other.starts_with(*key)).collect();
                let text = format!("{before}\n{others}{key} = {value}\n");
                assert_eq!(check(&text), Ok(()), "{text}");
                assert!(crate::segment::format::File::parse(&text).is_ok(), "{text}");
            }
        }
    }
}

#[test]
fn a_file_in_another_encoding_is_refused_with_its_line() {
    let path = std::env::temp_dir().join(format!("ringcat-latin-1-{}.toml", std::process::id()));
    std::fs::write(&path, b"[segment]\nname = \"Pr\xfcfstand\"\n").unwrap();
    let error = Segment::load(&path).unwrap_err().to_string();
    std::fs::remove_file(&path).unwrap();
    assert_eq!(error, format!("{}:2: expected UTF-8 text", path.display()));
}

/// Values of all types of TOML, at the ends of ranges and beyond.
const VALUES: [&str; 17] = [
    "0",
    "1",
    "-1",
    "70000",
    "4294967296",
    "9223372036854775807",
    "1.5",
    "-1.5",
    "nan",
    "inf",
    "true",
    "\"\"",
    "\"yes\"",
    "[]",
    "[\"yes\"]",
    "[1]",
    "{}",
];

// covers: sim-files
#[test]
fn a_refused_value_of_any_key_is_named_with_line_key_and_what_is_expected() {
    let mut refused = 0;
    for (header, keys) in TABLES {
        for ((key, _), value) in keys.iter().flat_map(|key| VALUES.map(|value| (key, value))) {
            let others: &[&str] = match header {
                "[[cable]]" => &["from = \"b.1\"", "to = \"c.0\""],
                "[[device]]" => &["type = \"servo\"", "name = \"x\""],
                "[[fault]]" if *key == "at_ms" => &["cut = 0"],
                "[[fault]]" => &["at_ms = 1"],
                _ => &[],
            };
            let others: Vec<&str> = others.iter().copied().filter(|line| !line.starts_with(*key)).collect();
            // The cable leads to the second of them.
            let apart = if header == "[[cable]]" { "attach = \"none\"\n" } else { "" };
            let device = |name, more| format!("[[device]]\ntype = \"servo\"\nname = \"{name}\"\n{more}");
            let devices = [device("b", ""), device("c", apart)];
            let before = format!(
                "{}{header}\n{}",
                devices.concat(),
                others.iter().map(|it| format!("{it}\n")).collect::<String>()
            );
            let at = before.lines().count() + 1;
            let text = format!("{before}{key} = {value}\n");
            let Err(error) = Segment::from_toml(&text, Path::new("nowhere")) else { continue };
            let file = error.clone().in_file("plant.toml").to_string();
            assert!(file.starts_with(&format!("plant.toml:{at}: ")), "{text}{file}");
            assert!(error.message.starts_with(&format!("{key}: ")), "{text}{file}");
            let is_of_file = ["cannot be read", "nowhere/"].iter().any(|words| error.message.contains(words));
            assert!(is_of_file || error.message.contains("expected "), "{text}{file}");
            assert!(
                !["invalid type", "u16", "usize", "struct"].iter().any(|rust| error.message.contains(rust)),
                "{file}"
            );
            refused += 1;
        }
    }
    assert!(refused > 500, "{refused}");
}
