//! The configuration that results from an ENI (protocol 8): one file, `files/small.xml`, and variants of it.

mod commands;
mod contradictions;
mod images;
mod other_commands;
mod reading;
mod real_files;
mod segments;

use ringcat_config::eni::{self, Eni};
use ringcat_config::{Configuration, follow};

/// A coupler, two terminals whose outputs share a byte, a drive with mailbox and clock.
pub const SMALL: &str = include_str!("../files/small.xml");

/// The file with some texts replaced; each text must occur exactly once.
pub fn with(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(SMALL.to_owned(), |text, (from, to)| {
        assert_eq!(text.matches(from).count(), 1, "{from} is there once");
        text.replace(from, to)
    })
}

/// The model of a readable file.
pub fn model(text: &str) -> Eni {
    eni::read(text.as_bytes()).unwrap_or_else(|error| panic!("{error}"))
}

/// The configuration of a valid file.
pub fn configured(text: &str) -> Configuration {
    follow(&model(text)).unwrap_or_else(|error| panic!("{error}"))
}

/// The configuration of the file with some texts replaced.
pub fn changed(changes: &[(&str, &str)]) -> Configuration {
    configured(&with(changes))
}

/// The error of a file that cannot be read or followed.
pub fn refusal(text: &str) -> String {
    match eni::read(text.as_bytes()).and_then(|model| follow(&model)) {
        Ok(_) => panic!("it is followed"),
        Err(error) => error.to_string(),
    }
}

/// The error of the file with some texts replaced.
pub fn refused(changes: &[(&str, &str)]) -> String {
    refusal(&with(changes))
}

/// Notices as text.
pub fn notices(configuration: &Configuration) -> Vec<String> {
    configuration.notices.iter().map(ToString::to_string).collect()
}

/// Whether one notice has all these parts.
pub fn has_notice(configuration: &Configuration, parts: &[&str]) -> bool {
    notices(configuration).iter().any(|notice| parts.iter().all(|part| notice.contains(part)))
}
