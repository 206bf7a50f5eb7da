//! `sii_read`: reads an SII.

use ringcat_control::message::Query;

use crate::append::append;
use crate::failure::Failure;
use crate::hex;
use crate::json;
use crate::json::reads::Sii;
use crate::session::Session;
use crate::shape::{Command, Output};
use crate::sii_image::{HEAD_WORDS, categories, category_name};

/// The command.
pub const COMMAND: Command = Command {
    name: "sii_read",
    summary: "Output a slave's SII contents.",
    forms: &[""],
    help: "One slave must be selected. Its SII goes to the standard output as it is;
with --verbose as text, category by category.
",
    options: super::reg_read::SINGLE,
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    let (master, position) = session.single_slave()?;
    let (_, image) = session.ask(master, Query::SiiRead { position }, Vec::new())?;
    let corrupted = || Failure::failed("SII data seem to be corrupted!");
    if session.arguments.json {
        let found = categories(&image);
        let is_refused = session.arguments.verbose && found.is_none();
        json::print(session, &Sii::new(master, position, &image, found.as_deref()))?;
        return if is_refused { Err(corrupted()) } else { Ok(()) };
    }
    if !session.arguments.verbose {
        return session.write(&image);
    }
    let head = image.get(..2 * HEAD_WORDS).ok_or_else(corrupted)?;
    let mut text = "SII Area:\n".to_owned() + &hex::trimmed_lines("  ", head);
    let Some(categories) = categories(&image) else {
        session.write_text(&text)?;
        return Err(corrupted());
    };
    for (category, data) in categories {
        append!(text, "SII Category 0x{category:04x} ({}), {} words\n", category_name(category), data.len() / 2);
        text += &hex::trimmed_lines("  ", data);
    }
    session.write_text(&text)
}
