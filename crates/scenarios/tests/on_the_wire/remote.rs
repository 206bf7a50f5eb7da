//! Two controllers that hand their role over on a schedule; their state is read and their roles are switched over TCP.

use std::fs;
use std::os::unix::fs::OpenOptionsExt;
use std::path::PathBuf;

use serde_json::Value;

use crate::bench::{finish, program};
use crate::documented::Page;
use crate::takeover::{Pair, READY, await_that, await_words, end};
use crate::{bench::await_op, said};

/// The file with the token.
struct Token(PathBuf);

impl Token {
    fn new() -> Token {
        let path = std::env::temp_dir().join(format!("ringcat-remote-token-{}", std::process::id()));
        let file = fs::OpenOptions::new().write(true).create(true).truncate(true).mode(0o600).open(&path);
        std::io::Write::write_all(&mut file.expect("it can be made"), b"a-token-of-the-wire\n").expect("it fits");
        Token(path)
    }

    fn path(&self) -> &str {
        self.0.to_str().expect("it is UTF-8")
    }
}

impl Drop for Token {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

const SERVER: &str = "127.0.0.1:7300";

// covers: standby, json, AC-08, REQ037, REQ015, MR-07
#[test]
fn controllers_switch_roles_on_schedule_and_over_tcp() {
    let Some(pair) = Pair::new() else { return };
    let token = Token::new();
    pair.bench.ip_main("link set lo up");
    let remote = ["--remote", SERVER, "--remote-token", token.path(), "--switch-every", "1s", "--master-out", "16"];
    let first = pair.first(&remote);
    await_op(&pair.bench, 10);
    let second = pair.second(&["--switch-every", "1s", "--master-out", "16"]);
    await_words(&first, READY);
    let ask = |more: &[&str]| {
        let arguments = [&["remote", SERVER, "--token", token.path(), "--json"], more].concat();
        finish(pair.bench.start(&program("ringcat"), &arguments))
    };
    let state = |more: &[&str]| {
        let output = ask(more);
        let (text, errors) = said(&output);
        assert!(output.status.success(), "{more:?}: {text}{errors}");
        Page::read().check("remote", &text)
    };
    // Alone it has no other one to hand its role over to, which it reports.
    await_words(&second, "switchover on schedule: handed over within ");
    let handed_back = "switchover on schedule: handed over within ";
    await_that("it was handed over by both", &[&first, &second], || first.said().so_far().contains(handed_back));
    let seen = state(&[]);
    assert_eq!(seen["subdevices"], Value::from(vec!["OP"; 10]), "{seen}");
    assert!(seen["role_changes"].as_u64() >= Some(2), "{seen}");
    assert_eq!(seen["has_application"], true);
    // Permanent standby: INACTIVE, and the schedule of the other one is refused.
    let held = state(&["permanent-standby"]);
    assert_eq!([&held["role"], &held["is_permanent_standby"]], [&Value::from("inactive"), &Value::from(true)]);
    await_words(&second, "switchover on schedule REFUSED: not ready: held INACTIVE");
    let released = state(&["hot-standby"]);
    assert_eq!(released["is_permanent_standby"], false);
    pair.all_are_in("OP");
    // Without the right token nothing.
    let other = Token(std::env::temp_dir().join(format!("ringcat-no-token-{}", std::process::id())));
    fs::copy(&token.0, &other.0).expect("it is there");
    fs::write(&other.0, "a-token-of-others").expect("it is ours");
    let refused = finish(pair.bench.start(&program("ringcat"), &["remote", SERVER, "--token", other.path()]));
    assert_eq!(refused.status.code(), Some(2), "{:?}", said(&refused));
    assert!(said(&refused).1.contains("another token") || said(&refused).0.contains("another token"));
    end(second, &["switchovers on schedule that were refused: "]);
    end(first, &["switchover on schedule: handed over within "]);
}
