//! `sii_write`: writes an SII.

use ringcat_control::client::ClientError;
use ringcat_control::message::Query;
use ringcat_control::tool::{ToolQuery, TransferWork};

use crate::failure::Failure;
use crate::inputs;
use crate::progress::Transfer;
use crate::session::Session;
use crate::shape::{Command, Output};
use crate::sii_image::{FEWEST_WORDS, HEAD_WORDS, categories, wrong_checksum};

/// Most bytes of an image.
const MOST: usize = 64 << 10;

/// The command.
pub const COMMAND: Command = Command {
    name: "sii_write",
    summary: "Write SII contents to a slave.",
    forms: &["<FILENAME>"],
    help: "One slave must be selected. FILENAME is a file with the whole SII, '-' the
standard input. It is checked: size, checksum, categories up to their end;
vendor, product, type of the PDI and size of the EEPROM against its present
contents. --force writes anyway what may make the slave unusable. The slave
uses the new contents from its next start on.
",
    options: super::reg_read::SINGLE,
    output: Output::Nothing,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let [file] = session.words() else { return Err(Failure::usage("'sii_write' takes one argument: the file!")) };
    let image = inputs::read(file, MOST)?;
    let force = session.arguments.force;
    if image.is_empty() || !image.len().is_multiple_of(2) {
        return Err(Failure::failed(format!("Invalid data size {}! It must be even and not 0.", image.len())));
    }
    if !force {
        check(&image)?;
    }
    let (master, position) = session.single_slave()?;
    let transfer = Transfer { master, position, work: TransferWork::SiiWrite };
    let written = session.ask_with_bar(transfer, Query::Tool(ToolQuery::SiiWrite { position, force }), image);
    written.map_err(|failure| if force { failure } else { or_force(failure) })?;
    session.say_if_verbose("SII writing finished.");
    Ok(())
}

/// What speaks against an image does not prevent that it is written anyway.
fn or_force(failure: Failure) -> Failure {
    match failure {
        Failure::Asked(error @ ClientError::Refused(_)) if error.to_string().contains("SII") => {
            Failure::failed(format!("{error}. Use --force to write anyway."))
        }
        other => other,
    }
}

fn check(image: &[u8]) -> Result<(), Failure> {
    let words = image.len() / 2;
    if words < FEWEST_WORDS {
        // The word is misspelt in the messages that scripts know.
        let text = format!("SII data too short ({words} words)! Mimimum is {FEWEST_WORDS} words.");
        return Err(Failure::failed(text + " Use --force to write anyway."));
    }
    if let Some(wanted) = wrong_checksum(image) {
        return Err(Failure::failed(format!("CRC incorrect. Must be 0x{wanted:02x}. Use --force to write anyway.")));
    }
    if words > HEAD_WORDS && categories(image).is_none() {
        let text = "The categories do not end within the data. Use --force to write anyway.";
        return Err(Failure::failed(text));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use ringcat_wire::sii::checksum;

    // covers: daemon
    #[test]
    fn what_would_brick_a_device_is_refused() {
        let mut image = vec![0; 132];
        image[128..130].fill(0xFF);
        image[14] = checksum(image.first_chunk().expect("it is long"));
        assert!(check(&image).is_ok());
        let refused = |image: &[u8]| check(image).expect_err("it is wrong").text();
        assert!(refused(&image[..78]).starts_with("SII data too short (39 words)! Mimimum is 40 words."));
        image[128..132].copy_from_slice(&[0x0A, 0, 9, 0]);
        assert!(refused(&image).starts_with("The categories do not end"));
        image[14] ^= 1;
        assert!(refused(&image).starts_with("CRC incorrect. Must be 0x"));
    }
}
