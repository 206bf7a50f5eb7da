//! A command at work: its arguments, its output, the daemon and its masters.

use std::fmt::{self, Arguments as Formatted};
use std::io::{self, IsTerminal, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use ringcat_control::client::ClientError;
use ringcat_control::message::{Answer, MasterState, Query, Snapshot};
use ringcat_control::socket::to_connect_to;
use ringcat_control::tool::{MOST_SUBDEVICES, Piece, SubDeviceLine, ToolAnswer, ToolQuery};
use ringcat_control::{Client, Refusal, visible};

use crate::arguments::Arguments;
use crate::failure::{Failure, unexpected};
use crate::numbers::List;
use crate::order;
use crate::progress::{self, Bar, Transfer};
use crate::selection::{self, Slave};
use crate::standalone::{Standalone, Started};

/// Called while an answer is waited for, at this interval; may end the wait.
type Meanwhile = (Duration, Box<dyn FnMut() -> ControlFlow<()>>);

/// A command at work.
pub struct Session<'a> {
    /// Name of the command.
    pub name: &'static str,
    /// Its arguments.
    pub arguments: Arguments,
    socket: &'a Path,
    client: Option<Client>,
    /// Second connection, for the progress of a transfer.
    second: Option<Client>,
    meanwhile: Option<Meanwhile>,
    /// Links of a bus without a daemon: no other bus is asked then.
    links: Option<String>,
    _standalone: Option<Standalone>,
    output: &'a mut dyn Write,
    errors: &'a mut dyn Write,
}

/// The socket of the daemon: that of the environment, or the place of this user or of root ([`to_connect_to`]).
pub fn socket() -> PathBuf {
    to_connect_to(|name| std::env::var_os(name))
}

impl<'a> Session<'a> {
    /// A command with these arguments. The daemon at `socket` is called when it is needed.
    pub fn new(
        name: &'static str,
        arguments: Arguments,
        socket: &'a Path,
        output: &'a mut dyn Write,
        errors: &'a mut dyn Write,
    ) -> Session<'a> {
        let (client, second, meanwhile) = (None, None, None);
        Session { name, arguments, socket, client, second, meanwhile, links: None, _standalone: None, output, errors }
    }

    /// On these links instead, which a daemon of this command drives from the first question on.
    #[must_use]
    pub fn with_links(self, links: Option<String>) -> Session<'a> {
        Session { links, ..self }
    }

    /// The arguments behind the command.
    pub fn words(&self) -> &[String] {
        self.arguments.words.get(1..).unwrap_or_default()
    }

    /// Writes data.
    ///
    /// # Errors
    /// The output is closed.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), Failure> {
        Ok(self.output.write_all(bytes)?)
    }

    /// Writes text.
    ///
    /// # Errors
    /// The output is closed.
    pub fn write_text(&mut self, text: &str) -> Result<(), Failure> {
        self.write(visible(text).as_bytes())
    }

    /// Writes text; for `write!`.
    ///
    /// # Errors
    /// The output is closed.
    pub fn write_fmt(&mut self, text: Formatted<'_>) -> Result<(), Failure> {
        self.write_text(&fmt::format(text))
    }

    /// Writes a value of a SubDevice: its bytes to a program, text without zero bytes to a terminal.
    ///
    /// # Errors
    /// The output is closed.
    pub fn write_value(&mut self, value: &[u8]) -> Result<(), Failure> {
        if !io::stdout().is_terminal() {
            return self.write(value);
        }
        self.write_text(&String::from_utf8_lossy(value).replace('\0', ""))
    }

    /// Passes on what was written so far.
    ///
    /// # Errors
    /// The output is closed.
    pub fn flush(&mut self) -> Result<(), Failure> {
        Ok(self.output.flush()?)
    }

    /// Says something on the standard error.
    pub fn say(&mut self, text: &str) {
        // Nothing can be reported where it is closed.
        let _ = writeln!(self.errors, "{}", visible(text));
    }

    /// As [`Session::say`], with `--verbose` only.
    pub fn say_if_verbose(&mut self, text: &str) {
        if self.arguments.verbose {
            self.say(text);
        }
    }

    fn client(&mut self) -> Result<&mut Client, Failure> {
        if self.client.is_none() {
            let client = match &self.links {
                Some(links) => {
                    let Started { standalone, client, second } = Standalone::start(links)?;
                    (self._standalone, self.second) = (Some(standalone), second);
                    client
                }
                None => Client::connect(self.socket, "ethercat")?,
            };
            self.client = Some(client);
        }
        self.client.as_mut().ok_or_else(unexpected)
    }

    /// Whether the daemon ends with this command.
    pub const fn is_standalone(&self) -> bool {
        self.links.is_some()
    }

    /// Sends a query about a master; `bytes` is data to write. Returns data that was read, too.
    ///
    /// # Errors
    /// The daemon refuses, or is not there.
    pub fn ask(&mut self, master: u32, ask: Query, bytes: Vec<u8>) -> Result<(Answer, Vec<u8>), Failure> {
        self.client()?;
        match self {
            Session { client: Some(client), meanwhile: Some((every, check)), .. } => {
                Ok(client.ask_patiently_meanwhile(master, &ask, &bytes, (*every, check.as_mut()))?)
            }
            _ => Ok(self.client()?.ask_patiently(master, &ask, &bytes)?),
        }
    }

    /// From now on this is called while an answer is waited for, and may end the wait.
    pub fn check_meanwhile(&mut self, every: Duration, check: Box<dyn FnMut() -> ControlFlow<()>>) {
        self.meanwhile = Some((every, check));
    }

    /// Nothing more is called while an answer is waited for.
    pub fn end_checks(&mut self) {
        self.meanwhile = None;
    }

    /// As [`Session::ask`], for a transfer that may take seconds: a terminal at the standard error shows a bar.
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn ask_with_bar(&mut self, of: Transfer, ask: Query, bytes: Vec<u8>) -> Result<(Answer, Vec<u8>), Failure> {
        let is_wanted = !self.arguments.json && !self.arguments.quiet;
        self.client()?;
        let Session { name, socket, client: Some(client), second, errors, links, .. } = self else {
            return Err(unexpected());
        };
        if !is_wanted || !progress::is_shown() {
            return Ok(client.ask_patiently(of.master, &ask, &bytes)?);
        }
        // The bus of this command has no other daemon.
        let mut bar = Bar::new(name, of, links.is_none().then_some(*socket), second);
        let mut draw = || {
            bar.draw(errors);
            ControlFlow::Continue(())
        };
        let asked = client.ask_patiently_meanwhile(of.master, &ask, &bytes, (progress::INTERVAL, &mut draw));
        bar.remove(errors);
        Ok(asked?)
    }

    /// The whole state of a master.
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn state(&mut self, master: u32) -> Result<Box<Snapshot>, Failure> {
        match self.ask(master, Query::State, Vec::new())? {
            (Answer::State(state), _) => Ok(state),
            _ => Err(unexpected()),
        }
    }

    /// Sends a query of the tool.
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn tool(&mut self, master: u32, ask: ToolQuery) -> Result<ToolAnswer, Failure> {
        match self.ask(master, Query::Tool(ask), Vec::new())? {
            (Answer::Tool(answer), _) => Ok(answer),
            _ => Err(unexpected()),
        }
    }

    /// Requests an action, or data.
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn done(&mut self, master: u32, ask: ToolQuery, bytes: Vec<u8>) -> Result<Vec<u8>, Failure> {
        Ok(self.ask(master, Query::Tool(ask), bytes)?.1)
    }

    /// All masters.
    ///
    /// # Errors
    /// There is no daemon.
    pub fn all_masters(&mut self) -> Result<Vec<MasterState>, Failure> {
        let explicit = self.list(self.arguments.master.as_deref(), "master")?.single();
        let asked = self.ask(0, Query::Masters, Vec::new());
        let failed = |text: String| match explicit {
            Some(number) => Failure::failed(format!("Failed to open master {number}: {text}")),
            None => Failure::failed(format!("Failed to obtain number of masters: {text}")),
        };
        match asked {
            Ok((Answer::Masters(masters), _)) => Ok(order::by_key(masters, |master| master.master)),
            Ok(_) => Err(unexpected()),
            // It was there before.
            Err(Failure::Asked(error @ ClientError::Connection(_))) => Err(Failure::Asked(error)),
            Err(Failure::Asked(error)) => Err(failed(error.to_string())),
            Err(other) => Err(other),
        }
    }

    /// A list of an option; all without it.
    ///
    /// # Errors
    /// The text is no list.
    pub fn list(&self, text: Option<&str>, what: &str) -> Result<List, Failure> {
        let Some(text) = text else { return Ok(List::all()) };
        List::parse(text).ok_or_else(|| Failure::usage(format!("Invalid {what} list '{text}'!")))
    }

    /// The masters that were selected, by number.
    ///
    /// # Errors
    /// There is no daemon, or no master with a number that was named.
    pub fn masters(&mut self) -> Result<Vec<MasterState>, Failure> {
        let list = self.list(self.arguments.master.as_deref(), "master")?;
        let all = self.all_masters()?;
        if let Some(missing) = list.singles().find(|number| all.iter().all(|master| master.master != *number)) {
            let present = all.iter().map(|master| master.master).collect();
            let refusal = Refusal::NoMaster { master: missing, present };
            return Err(Failure::failed(format!("Failed to open master {missing}: {refusal}")));
        }
        Ok(all.into_iter().filter(|master| list.has(master.master)).collect())
    }

    /// The selected SubDevices of a master in a list of several masters. A master that nothing drives, because it waits
    /// for its interface, has none; the standard error says why.
    ///
    /// # Errors
    /// As [`Session::slaves`].
    pub fn listed_slaves(&mut self, master: u32) -> Result<Vec<Slave>, Failure> {
        let slaves = self.slaves(master);
        Ok(self.if_driven(slaves)?.unwrap_or_default())
    }

    /// What a list of several masters shows of one. A master that nothing drives has nothing to show; the standard
    /// error says why.
    ///
    /// # Errors
    /// Any other failure.
    pub fn if_driven<T>(&mut self, shown: Result<T, Failure>) -> Result<Option<T>, Failure> {
        let refusal = shown.as_ref().err().and_then(Failure::not_driven).map(Refusal::to_string);
        match refusal {
            Some(text) => {
                self.say(&text);
                Ok(None)
            }
            None => shown.map(Some),
        }
    }

    /// The only master of a command that needs one.
    ///
    /// # Errors
    /// None or several are selected.
    pub fn single_master(&mut self) -> Result<u32, Failure> {
        match &self.masters()?[..] {
            [master] => Ok(master.master),
            _ => Err(Failure::usage(format!("{} requires to select a single master!", self.name))),
        }
    }

    /// All SubDevices of a master, with the aliases that they are counted from.
    ///
    /// # Errors
    /// As [`Session::ask`].
    pub fn all_slaves(&mut self, master: u32) -> Result<Vec<Slave>, Failure> {
        let mut lines: Vec<SubDeviceLine> = Vec::new();
        loop {
            let from = u16::try_from(lines.len()).unwrap_or(u16::MAX);
            let answer = self.tool(master, ToolQuery::SubDevices { from })?;
            let ToolAnswer::SubDevices(Piece { total, these }) = answer else { return Err(unexpected()) };
            let is_last = these.len() < MOST_SUBDEVICES;
            lines.extend(these);
            if is_last || lines.len() >= total as usize || from == u16::MAX {
                return Ok(selection::counted(lines));
            }
        }
    }

    /// The selected SubDevices of a master.
    ///
    /// # Errors
    /// As [`Session::ask`]; a list is wrong.
    pub fn slaves(&mut self, master: u32) -> Result<Vec<Slave>, Failure> {
        let aliases = self.arguments.alias.as_deref().map(|text| self.list(Some(text), "alias")).transpose()?;
        let positions = self.arguments.position.as_deref().map(|text| self.list(Some(text), "position"));
        let positions = positions.transpose()?;
        let all = self.all_slaves(master)?;
        Ok(selection::slaves(all, aliases.as_ref(), positions.as_ref()))
    }

    /// Master and position of the only SubDevice of a command that needs one.
    ///
    /// # Errors
    /// None or several are selected.
    pub fn single_slave(&mut self) -> Result<(u32, u16), Failure> {
        let (master, selected) = self.selected()?;
        match selected[..] {
            [position] => Ok((master, position)),
            _ => Err(self.wrong_number("a single slave", selected.len())),
        }
    }

    /// Master and positions of the SubDevices of a command that needs one or more.
    ///
    /// # Errors
    /// None is selected.
    pub fn some_slaves(&mut self) -> Result<(u32, Vec<u16>), Failure> {
        let (master, selected) = self.selected()?;
        if selected.is_empty() { Err(self.wrong_number("one slave or more", 0)) } else { Ok((master, selected)) }
    }

    fn selected(&mut self) -> Result<(u32, Vec<u16>), Failure> {
        let master = self.single_master()?;
        let slaves = self.slaves(master)?;
        Ok((master, slaves.iter().map(|slave| slave.line.position).collect()))
    }

    fn wrong_number(&self, wanted: &str, selected: usize) -> Failure {
        Failure::usage(format!("'{}' requires {wanted} to be selected: {selected} are!", self.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn control_characters_in_text_of_devices_are_escaped() {
        let (mut output, mut errors) = (Vec::new(), Vec::new());
        let arguments = Arguments::parse(&[]).expect("no words");
        let mut session = Session::new("slaves", arguments, Path::new("/"), &mut output, &mut errors);
        writeln!(session, "0  EL\u{1b}[31m\u{200f}\tPREOP").expect("it is open");
        session.write_text("Ger\u{e4}t\u{2028}\n").expect("it is open");
        // Data for a program.
        session.write(b"\x1b\n").expect("it is open");
        session.say("a\u{9b}b");
        assert_eq!(output, "0  EL\\u{1b}[31m\\u{200f}\tPREOP\nGer\u{e4}t\\u{2028}\n\u{1b}\n".as_bytes());
        assert_eq!(errors, b"a\\u{9b}b\n");
    }
}
