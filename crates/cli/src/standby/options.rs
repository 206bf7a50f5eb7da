//! The options of `ringcat standby`.

use std::time::Duration;

use clap::Args;
use ringcat::standby::{MasterSizes, Policy};

use super::ethernet::EthernetArguments;
use super::guarding;
use super::remote::ServerArguments;
use super::schedule;
use crate::interfaces::LinkNames;
use crate::numbers::number;
use crate::run::declared::DeclarationArguments;
use crate::thread::ThreadArguments;
use crate::times::time;

/// From the limit of a guard to the takeover at least: it detects the end, and switches two interfaces off.
const GUARD_ACTS: Duration = Duration::from_millis(2);

/// What it is for, and what it is not.
const ABOUT_STANDBY: &str = "\
The ring leads through both MainDevices: from the main link of the ACTIVE
through the SubDevices into --redundant here, and from --main here to the
redundant link of the ACTIVE. Each frame is sent on at the other interface, or
back if that one is down.

Both interfaces are switched on when it forwards, and off at its end: then the
ACTIVE has a line. Leave them off before: an interface that is up and does not
forward takes the whole bus from the ACTIVE. Switching needs cap_net_admin.
Another process guards that: it switches both off when this one is killed,
hangs, or is stopped for longer than --guard.

Without a declaration it never sends on its own. With --eni, --network or
--automatic it is one of two controllers with the same declaration: INACTIVE
if frames of an ACTIVE arrive, otherwise ACTIVE. As INACTIVE it takes over when
no process data has arrived for --timeout cycles. At its end an ACTIVE hands the
role over if the other one is ready; otherwise it stops the bus as `ringcat run`
does. Exit status 1 if a check failed; the last line reports which.

With --tap on both sides, Ethernet passes between them in acyclic frames:
  ringcat standby ... --tap rc0
  ip addr add 192.168.7.1/24 dev rc0; ip link set rc0 up

See docs/standby.md, which begins with a note on patents.";

/// Options of `ringcat standby`.
#[derive(Args, Debug)]
#[command(after_long_help = ABOUT_STANDBY)]
pub struct StandbyArguments {
    #[command(flatten)]
    pub links: LinkNames,
    #[command(flatten)]
    pub thread: ThreadArguments,
    #[command(flatten)]
    pub declared: DeclarationArguments,
    /// Take over with the SubDevices found as their SIIs say
    #[arg(long, conflicts_with = "file", group = "declaration", help_heading = "Segment")]
    pub automatic: bool,
    #[command(flatten)]
    pub policy: PolicyArguments,
    #[command(flatten)]
    pub ethernet: EthernetArguments,
    #[command(flatten)]
    pub remote: ServerArguments,
    #[command(flatten)]
    pub sizes: SizeArguments,
    /// Age from which frames are not forwarded
    ///
    /// Frames wait where this computer is too busy, or where this program was stopped. They would bring SubDevices back
    /// to earlier outputs; the ACTIVE has given them up.
    #[arg(
        long,
        value_name = "TIME",
        value_parser = time,
        default_value = "5ms",
        conflicts_with = "declaration",
        help_heading = "Run"
    )]
    pub max_age: Duration,
    /// Time after which both interfaces are switched off if this program hangs
    ///
    /// Another process does that, and at once when this program is killed. The ACTIVE then has a line instead of no
    /// bus. A time below the pauses that this computer makes switches them off without need: this program then ends.
    #[arg(long, value_name = "TIME", value_parser = guarding::limit, default_value = "20ms", help_heading = "Run")]
    pub guard: Duration,
    /// Use no such process
    #[arg(long, conflicts_with = "guard", help_heading = "Run")]
    pub no_guard: bool,
    /// How long, such as 10s or 5min; until Ctrl-C by default
    #[arg(long = "for", value_name = "TIME", value_parser = time, help_heading = "Run")]
    pub lasts: Option<Duration>,
    /// Go on although another program on this host uses an interface
    #[arg(long, help_heading = "Run")]
    pub force: bool,
}

/// When the role changes.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Role")]
pub struct PolicyArguments {
    /// Cycles without process data of the ACTIVE after which this one takes over
    ///
    /// But not before 15 ms, and not before --guard and 2 ms: the guard of an ACTIVE that hangs has to have acted.
    #[arg(
        long,
        value_name = "CYCLES",
        default_value = "3",
        value_parser = number(3_u32..=1000, 10),
        requires = "declaration"
    )]
    timeout: u32,
    /// How long this one listens at its start; a random pause up to this time follows
    ///
    /// If no frame of an ACTIVE arrives, it becomes ACTIVE then.
    #[arg(long, value_name = "TIME", value_parser = time, default_value = "2s", requires = "declaration")]
    listen: Duration,
    /// Stay INACTIVE: neither take over, nor be handed the role over
    #[arg(long, requires = "declaration")]
    permanent_standby: bool,
    /// Hand the role over each time this one has been ACTIVE for this time
    ///
    /// As proof that the other one can take over; with this option there as well, it hands the role back. A switchover
    /// is refused and reported when not ready, and the exit status is then 1. At least 1 s.
    #[arg(long, value_name = "TIME", value_parser = schedule::every, requires = "declaration")]
    #[arg(conflicts_with = "permanent_standby")]
    pub switch_every: Option<Duration>,
    /// End if the watchdog of a SubDevice is too short for a takeover
    ///
    /// During a takeover, outputs may be missing for --timeout and two cycles: such a SubDevice then leaves OP. Without
    /// this option it is only reported.
    #[arg(long, requires = "declaration", conflicts_with = "permanent_standby")]
    pub strict: bool,
}

/// Sizes of master frames, the same on both controllers.
#[derive(Args, Clone, Copy, Debug)]
#[command(next_help_heading = "Master frames")]
pub struct SizeArguments {
    /// Bytes of process data of the ACTIVE for the INACTIVE
    ///
    /// Programs of the library use them; this one sends zeros.
    #[arg(long, value_name = "BYTES", default_value = "0", requires = "declaration")]
    master_out: u16,
    /// Bytes of process data of the INACTIVE for the ACTIVE
    #[arg(long, value_name = "BYTES", default_value = "0", requires = "declaration")]
    master_in: u16,
    /// Do not send the inputs of the SubDevices to the INACTIVE
    ///
    /// Its inputs are zero then until it takes over. Outputs need no room: it takes them from the process data.
    #[arg(long, requires = "declaration")]
    no_update_in: bool,
    /// Bytes of knowledge of the segment per cycle
    ///
    /// The INACTIVE follows when it has all of it; fewer bytes make the master frames shorter.
    #[arg(long, value_name = "BYTES", default_value = "512", value_parser = number(8_u16..=1472, 512))]
    #[arg(requires = "declaration")]
    knowledge: u16,
}

impl SizeArguments {
    /// The sizes.
    pub fn sizes(self) -> MasterSizes {
        let mut sizes = MasterSizes::default();
        (sizes.to_inactive, sizes.to_active) = (self.master_out, self.master_in);
        (sizes.inputs, sizes.knowledge) = (!self.no_update_in, self.knowledge);
        sizes
    }
}

impl PolicyArguments {
    /// The policy, where both controllers have a guard with this limit.
    pub fn policy(self, guard: Duration) -> Policy {
        let policy = if self.permanent_standby { Policy::permanent_standby() } else { Policy::default() };
        let least = policy.least_time_out.max(guard + GUARD_ACTS);
        policy.with_time_out(self.timeout, least).with_listen(self.listen)
    }
}
