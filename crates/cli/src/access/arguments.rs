//! The options of a segment: interfaces, or a master of the daemon.

use std::path::PathBuf;

use clap::error::ErrorKind;
use clap::{ArgMatches, Args, Command, Error, FromArgMatches};

use crate::interfaces::{InterfaceArguments, LinkNames, SourceAddress};
use crate::recording::RecordingArguments;
use crate::thread::ThreadArguments;

/// The options.
#[derive(Clone, Debug)]
pub struct AccessArguments {
    /// A master of the daemon in place of interfaces.
    pub master: Option<u32>,
    /// Where the daemon listens.
    pub socket: Option<PathBuf>,
    pub interfaces: InterfaceArguments,
    pub thread: ThreadArguments,
    pub recording: RecordingArguments,
}

/// Options of a master of the daemon.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Links")]
struct MasterArguments {
    /// Get the bus of this master from the daemon ringcatd, in place of --main
    ///
    /// Needs no permission but that of the daemon, which has the bus back at the end.
    #[arg(long, value_name = "NUMBER", conflicts_with_all = ["main", "redundant", "force"])]
    master: Option<u32>,
    /// Where the daemon listens; otherwise RINGCAT_SOCKET, the place of this user, or /run/ringcat/control
    #[arg(long, value_name = "PATH")]
    socket: Option<PathBuf>,
}

/// With `--master` no interface is necessary.
fn with_master(command: Command) -> Command {
    command.mut_arg("main", |main| main.required(false).required_unless_present("master"))
}

impl Args for AccessArguments {
    fn augment_args(command: Command) -> Command {
        let command = with_master(InterfaceArguments::augment_args(command));
        let command = MasterArguments::augment_args(command);
        RecordingArguments::augment_args(ThreadArguments::augment_args(command))
    }

    fn augment_args_for_update(command: Command) -> Command {
        let command = with_master(InterfaceArguments::augment_args_for_update(command));
        let command = MasterArguments::augment_args_for_update(command);
        RecordingArguments::augment_args_for_update(ThreadArguments::augment_args_for_update(command))
    }
}

impl FromArgMatches for AccessArguments {
    fn from_arg_matches(matches: &ArgMatches) -> Result<AccessArguments, Error> {
        let MasterArguments { master, socket } = MasterArguments::from_arg_matches(matches)?;
        if master.is_none() && socket.is_some() {
            // `requires` does not see that, since a master excludes the interfaces.
            let text = "--socket names a daemon: expected --master <NUMBER> too\n";
            return Err(Error::raw(ErrorKind::MissingRequiredArgument, text));
        }
        let interfaces = match master {
            None => InterfaceArguments::from_arg_matches(matches)?,
            Some(_) => InterfaceArguments {
                links: LinkNames { main: String::new(), redundant: None },
                source_address: matches.get_one::<SourceAddress>("source_address").copied().unwrap_or_default(),
                max_datagrams: matches.get_one::<u16>("max_datagrams").copied(),
                force: false,
            },
        };
        Ok(AccessArguments {
            master,
            socket,
            interfaces,
            thread: ThreadArguments::from_arg_matches(matches)?,
            recording: RecordingArguments::from_arg_matches(matches)?,
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = AccessArguments::from_arg_matches(matches)?;
        Ok(())
    }
}
