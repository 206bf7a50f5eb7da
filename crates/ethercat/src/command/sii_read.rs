//! `sii_read`: reads an SII.

use ringcat_control::client::ClientError;
use ringcat_control::message::{Answer, Query};
use ringcat_control::tool::{MAX_IMAGES, SiiLine, ToolAnswer, ToolQuery, TransferWork};

use crate::append::append;
use crate::failure::{Failure, unexpected};
use crate::hex;
use crate::json;
use crate::json::reads::Sii;
use crate::progress::Transfer;
use crate::session::Session;
use crate::shape::{Command, Output};
use crate::sii_image::{HEAD_WORDS, categories, category_name};

/// The command.
pub const COMMAND: Command = Command {
    name: "sii_read",
    summary: "Output a slave's SII contents.",
    forms: &[""],
    help: "One slave must be selected, with --json one or more. Its SII goes to the
standard output as it is; with --verbose as text, category by category. An
SII that was read before is shown again if it has not changed since.
",
    options: super::reg_read::SINGLE,
    output: Output::Data,
    run,
};

fn run(session: &mut Session<'_>) -> Result<(), Failure> {
    if session.arguments.json {
        return print_json(session);
    }
    let (master, position) = session.single_slave()?;
    let image = match read(session, master, &[position])?.pop() {
        Some((_, image)) => image?,
        None => return Err(unexpected()),
    };
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

fn corrupted() -> Failure {
    Failure::failed("SII data seem to be corrupted!")
}

/// A line for each selected SubDevice. Those that cannot be read or decoded do not prevent the output of the others.
fn print_json(session: &mut Session<'_>) -> Result<(), Failure> {
    let (master, positions) = session.some_slaves()?;
    let mut failure = None;
    for positions in positions.chunks(MAX_IMAGES) {
        for (position, image) in read(session, master, positions)? {
            match image {
                Ok(image) => {
                    let found = categories(&image);
                    json::print(session, &Sii::new(master, position, &image, found.as_deref()))?;
                    let is_refused = session.arguments.verbose && found.is_none();
                    failure = failure.or(is_refused.then(corrupted));
                }
                Err(refused) => failure = failure.or(Some(refused)),
            }
        }
    }
    failure.map_or(Ok(()), Err)
}

/// The SIIs of SubDevices, by position.
type Images = Vec<(u16, Result<Vec<u8>, Failure>)>;

fn read(session: &mut Session<'_>, master: u32, positions: &[u16]) -> Result<Images, Failure> {
    let ask = Query::Tool(ToolQuery::SiiImages { positions: positions.to_vec() });
    // Where a bar is shown, there is one position.
    let position = positions.last().copied().unwrap_or(0);
    let transfer = Transfer { master, position, work: TransferWork::SiiRead };
    let (answer, images) = session.ask_with_bar(transfer, ask, Vec::new())?;
    let Answer::Tool(ToolAnswer::SiiImages(lines)) = answer else { return Err(unexpected()) };
    let mut rest = &images[..];
    let image = |SiiLine { position, bytes }| {
        let image = bytes.map_err(|refusal| Failure::Asked(ClientError::Refused(refusal))).map(|bytes| {
            let (image, behind) = rest.split_at((bytes as usize).min(rest.len()));
            rest = behind;
            image.to_vec()
        });
        (position, image)
    };
    Ok(lines.into_iter().map(image).collect())
}
