//! What users may do by the mode of the socket: root, a member of the group, another user, each in a process of its
//! own.

use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::Command;

use ringcat::daemon::{Answer, Client, ClientError, Query, Right};
use ringcat_control::Refusal;
use ringcat_link::process::effective_user;
use ringcatd::rights::Rights;

use crate::bench::{Bench, ask, copy_program};

/// Socket for the process of another user.
const SOCKET: &str = "RINGCAT_TEST_USER";
/// The test that is that process.
const TEST: &str = "users::each_mode_lets_root_members_and_strangers_do_what_its_bits_say";
/// The group of the socket, a user in it and one that is not.
const GROUP: u32 = 65_432;
const MEMBER: u32 = 65_433;
const OTHER_USER: u32 = 65_434;

/// What this user can do at a socket, in one word.
fn tried(socket: &Path) -> &'static str {
    let mut client = match Client::connect(socket, "user") {
        Ok(client) => client,
        Err(ClientError::NotPermitted { .. }) => return "nothing",
        Err(error) => panic!("{error}"),
    };
    assert!(matches!(ask(&mut client, Query::State), Answer::State(_)));
    let register = Query::RegisterWrite { position: 0, address: 0x0400 };
    match client.ask(0, register, vec![0xC2, 0x09]) {
        Ok((Answer::Done, _)) => assert_eq!(client.right(), Right::Change),
        Err(ClientError::Refused(Refusal::ReadOnly)) => {
            assert_eq!(client.right(), Right::Read);
            return "read";
        }
        other => panic!("{other:?}"),
    }
    "change"
}

/// What a process with this user and group can do.
fn tries(bench: &Bench, user: u32, group: u32) -> String {
    let copy = bench.socket.with_file_name("test");
    if !copy.exists() {
        copy_program(std::env::current_exe().expect("it is known"), &copy);
    }
    let mut command = Command::new(&copy);
    command.args(["--exact", TEST, "--nocapture"]).env(SOCKET, &bench.socket).current_dir("/");
    let output = command.uid(user).gid(group).output().expect("it starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    let found = said.lines().find_map(|line| line.split_once("may: ")).expect("it says what it may");
    found.1.to_owned()
}

// covers: daemon
#[test]
fn each_mode_lets_root_members_and_strangers_do_what_its_bits_say() {
    if let Some(socket) = std::env::var_os(SOCKET) {
        println!("\nmay: {}", tried(socket.as_ref()));
        return;
    }
    if effective_user() != 0 {
        println!("skipped: only root starts processes of other users");
        return;
    }
    let cases = [
        (0o660, ["change", "change", "nothing"]),
        (0o664, ["change", "change", "read"]),
        (0o666, ["change", "change", "change"]),
        (0o644, ["change", "read", "read"]),
        (0o600, ["change", "nothing", "nothing"]),
    ];
    for (mode, expected) in cases {
        let bench = Bench::with_rights(2, Rights { group: Some(GROUP), mode });
        let found = [(0, 0), (MEMBER, GROUP), (OTHER_USER, OTHER_USER)].map(|(user, group)| tries(&bench, user, group));
        assert_eq!(found, expected, "{mode:04o}");
    }
    // Without a group the bits of others count for members of the daemon's own group, too.
    let bench = Bench::with_rights(2, Rights { group: None, mode: 0o664 });
    assert_eq!(tries(&bench, OTHER_USER, 0), "read");
}
