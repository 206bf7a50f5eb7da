//! Remote access to `ringcat standby` (`--remote`), and the client `ringcat remote`.

use std::net::{SocketAddr, TcpListener};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum};
use ringcat::SupervisorThread;
use ringcat::standby::remote::{
    RemoteClient, RemoteError, RemoteOptions, RemoteRole, RemoteServer, RemoteState, RemoteToken,
};

use crate::failure::Failure;
use crate::json::data::Data;
use crate::json::remote::Remote;
use crate::output::say;
use crate::times::{in_words, time};
use crate::verdict::{Report, Verdict};

/// A requested role has this long to take effect.
const EFFECT: Duration = Duration::from_secs(2);
/// Interval at which that is checked.
const LOOK: Duration = Duration::from_millis(20);

/// Periods at which clients may be answered.
const CYCLES: RangeInclusive<Duration> = Duration::from_millis(1)..=Duration::from_secs(1);

fn cycle(text: &str) -> Result<Duration, String> {
    let cycle = time(text)?;
    let (least, most) = (in_words(*CYCLES.start()), in_words(*CYCLES.end()));
    if CYCLES.contains(&cycle) { Ok(cycle) } else { Err(format!("expected {least} to {most}")) }
}

/// Options of the server.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Remote access")]
pub struct ServerArguments {
    /// Answer `ringcat remote` on this address
    ///
    /// State, readiness and requests for a role. Not encrypted: use an address of the host itself and SSH, or one of
    /// --tap. Off without this option.
    #[arg(long, value_name = "ADDR:PORT", requires = "remote_token", requires = "declaration")]
    remote: Option<SocketAddr>,
    /// File with the token that clients need, readable by its owner only
    #[arg(long, value_name = "FILE", requires = "remote")]
    remote_token: Option<PathBuf>,
    /// Period at which clients are answered, 1 ms to 1 s
    #[arg(long, value_name = "TIME", value_parser = cycle, default_value = "10ms", requires = "remote")]
    remote_cycle: Duration,
}

impl ServerArguments {
    /// Starts the server.
    pub fn start(&self, supervisor: &SupervisorThread) -> Result<Option<RemoteServer>, Failure> {
        let (Some(address), Some(token)) = (&self.remote, &self.remote_token) else { return Ok(None) };
        let token = read_token(token)?;
        let refused = |error: &dyn std::fmt::Display| Failure::new(format!("--remote {address}: {error}"));
        let listener = TcpListener::bind(address).map_err(|error| refused(&error))?;
        let options = RemoteOptions::default().with_cycle(self.remote_cycle);
        let server = RemoteServer::start(listener, token, options, supervisor.clone());
        let server = server.map_err(|error| refused(&error))?;
        say!("remote access on {}", server.address());
        Ok(Some(server))
    }
}

fn read_token(path: &std::path::Path) -> Result<RemoteToken, Failure> {
    RemoteToken::from_file(path).map_err(|error| Failure::new(format!("{}: {error}", path.display())))
}

/// Options of the client.
#[derive(Args, Debug)]
pub struct ClientArguments {
    /// Address and port of --remote there
    #[arg(value_name = "ADDR:PORT")]
    address: String,
    /// What to do
    #[arg(value_enum, default_value = "state")]
    order: Order,
    /// File with the token
    #[arg(long, value_name = "FILE", help_heading = "Remote access")]
    token: PathBuf,
    /// Request the role also while a file or an EEPROM is written there
    #[arg(long, help_heading = "Remote access")]
    force: bool,
    /// Longest time for an answer
    #[arg(long, value_name = "TIME", value_parser = time, default_value = "3s", help_heading = "Remote access")]
    limit: Duration,
}

/// A query or a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Order {
    /// Its state
    State,
    /// It becomes ACTIVE
    Active,
    /// It becomes INACTIVE
    Inactive,
    /// It hands its role over to the other one
    HandOver,
    /// It becomes INACTIVE, and takes over on request only
    PermanentStandby,
    /// It takes over again
    HotStandby,
}

impl Order {
    /// Whether the state shows that it was carried out.
    fn is_done(self, state: &RemoteState) -> bool {
        match self {
            Order::State => true,
            Order::Active => state.is_active,
            Order::Inactive | Order::HandOver => !state.is_active,
            Order::PermanentStandby => !state.is_active && state.is_held,
            Order::HotStandby => !state.is_held,
        }
    }
}

/// Sends a query or a request to a MainDevice, and waits until a request has taken effect.
pub fn run(arguments: &ClientArguments) -> Result<Report, Failure> {
    let ClientArguments { address, order, token, force, limit } = arguments;
    let token = read_token(token)?;
    let failed = |error: RemoteError| Failure::new(format!("{address}: {error}"));
    let mut client = RemoteClient::connect(address.as_str(), &token, *limit).map_err(failed)?;
    if *order == Order::HandOver && !client.state().map_err(failed)?.is_active {
        return Err(Failure::new(format!("{address}: it is INACTIVE, and only the ACTIVE hands its role over")));
    }
    match order {
        Order::State => Ok(()),
        Order::Active => client.request(RemoteRole::Active, *force),
        Order::Inactive => client.request(RemoteRole::Inactive, *force),
        Order::HandOver => client.request(RemoteRole::HandOver, *force),
        Order::PermanentStandby => client.hold(true, *force),
        Order::HotStandby => client.hold(false, *force),
    }
    .map_err(failed)?;
    let end = Instant::now() + EFFECT;
    let mut state = client.state().map_err(failed)?;
    while !order.is_done(&state) && Instant::now() < end {
        std::thread::sleep(LOOK);
        state = client.state().map_err(failed)?;
    }
    show(&state);
    let role = if state.is_active { "ACTIVE" } else { "INACTIVE" };
    let verdict = match order.is_done(&state) {
        true => Verdict::Held(format!("{role}, {}", readiness(&state))),
        false => Verdict::Failed(format!("it is {role} still after 2 s, {}; see its log", readiness(&state))),
    };
    Ok(Report { verdict, data: Data::Remote(Remote::new(client.program(), &state)) })
}

fn readiness(state: &RemoteState) -> String {
    match state.not_ready.is_empty() {
        true => "ready".to_owned(),
        false => format!("not ready: {}", state.not_ready.join(", ")),
    }
}

/// Prints a state.
fn show(state: &RemoteState) {
    let link = |carrier: Option<bool>| match carrier {
        Some(true) => "up",
        Some(false) => "down",
        None => "unknown",
    };
    let [main, redundant] = state.carriers.map(link);
    say!("role           {}", if state.is_active { "ACTIVE" } else { "INACTIVE" });
    say!("standby        {}", if state.is_held { "permanent: takes over on request only" } else { "hot" });
    say!("readiness      {}", readiness(state));
    say!("application    {}", if state.has_application { "runs" } else { "none yet" });
    say!("ring           {}; main link {main}, redundant link {redundant}", state.ring);
    let in_op = state.subdevices.iter().filter(|state| *state == "OP").count();
    say!("SubDevices     {}, in OP {in_op}", state.subdevices.len());
    for (number, subdevice) in state.subdevices.iter().enumerate().filter(|(_, state)| *state != "OP") {
        say!("  {number:>4}         {subdevice}");
    }
    let counters = |counters: &ringcat::standby::remote::RemoteCounters| {
        format!(
            "{} frames sent, {} lost, {} cycles incomplete, {} frames of others",
            counters.sent, counters.lost, counters.incomplete, counters.foreign
        )
    };
    say!("as ACTIVE      {} cycles in both roles, {}", state.cycles, counters(&state.counters));
    if let Some(of_active) = &state.of_active {
        say!("the ACTIVE     {}", counters(of_active));
    }
    let [main, redundant] = state.forwarded;
    say!(
        "forwarded      {main} on MAIN, {redundant} on RED, of these {} back; {} not forwarded",
        state.sent_back,
        state.not_forwarded
    );
    say!("changes        {} of the role", state.role_changes);
}
