//! Notifications to the service manager: the daemon is ready, its status, the watchdog, its end.
//!
//! Datagrams of text to the socket that `NOTIFY_SOCKET` names (`sd_notify(3)`). Nothing waits: a datagram that the
//! service manager does not take now is lost, and the next state is sent with the next check.

use std::ffi::OsString;
use std::os::linux::net::SocketAddrExt;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::net::{SocketAddr, UnixDatagram};
use std::time::Duration;

use ringcat_control::visible;

/// Longest text about what the daemon does.
const LONGEST: usize = 512;

/// The service manager, if one has started this process.
#[derive(Debug, Default)]
pub struct ServiceManager {
    socket: Option<(UnixDatagram, SocketAddr)>,
    /// It expects a watchdog notification within this time.
    watchdog: Option<Duration>,
    said: String,
    is_ready: bool,
}

impl ServiceManager {
    /// The one that the variables of the environment name, for the process with this number.
    pub fn new(process: u32, variable: impl Fn(&str) -> Option<OsString>) -> ServiceManager {
        let address = variable("NOTIFY_SOCKET").and_then(|name| address(name.as_bytes()));
        let socket = address.and_then(|address| {
            let socket = UnixDatagram::unbound().ok()?;
            socket.set_nonblocking(true).ok()?;
            Some((socket, address))
        });
        let number = |name: &str| variable(name).and_then(|text| text.to_str()?.parse::<u64>().ok());
        let is_for_this = number("WATCHDOG_PID").is_none_or(|pid| pid == u64::from(process));
        let watchdog = number("WATCHDOG_USEC").filter(|limit| *limit > 0 && is_for_this).map(Duration::from_micros);
        ServiceManager { socket, watchdog, ..ServiceManager::default() }
    }

    /// Whether there is one.
    pub fn is_there(&self) -> bool {
        self.socket.is_some()
    }

    /// Longest pause between watchdog notifications: half of the expected time.
    pub fn interval(&self, most: Duration) -> Duration {
        self.watchdog.filter(|_| self.is_there()).map_or(most, |limit| most.min(limit / 2))
    }

    /// A watchdog notification, if one is expected.
    pub fn live(&self) {
        if self.watchdog.is_some() {
            self.send("WATCHDOG=1");
        }
    }

    /// What the daemon does, when it has changed; with it that it is ready.
    pub fn report(&mut self, status: &str, is_ready: bool) {
        let shown = visible(status).replace(['\n', '\t'], " ");
        let shown = &shown[..shown.floor_char_boundary(LONGEST)];
        let becomes_ready = is_ready && !self.is_ready;
        if shown == self.said && !becomes_ready {
            return;
        }
        let ready = if becomes_ready { "READY=1\n" } else { "" };
        // A lost notification is sent again by the next report.
        if self.send(&format!("{ready}STATUS={shown}")) {
            shown.clone_into(&mut self.said);
            self.is_ready |= is_ready;
        }
    }

    /// The daemon ends.
    pub fn stop(&self) {
        self.send("STOPPING=1\nSTATUS=ends");
    }

    fn send(&self, text: &str) -> bool {
        self.socket.as_ref().is_some_and(|(socket, to)| socket.send_to_addr(text.as_bytes(), to).is_ok())
    }
}

/// A path, or with `@` in front a name without a file.
fn address(name: &[u8]) -> Option<SocketAddr> {
    match name {
        [b'@', name @ ..] => SocketAddr::from_abstract_name(name).ok(),
        [b'/', ..] => SocketAddr::from_pathname(std::ffi::OsStr::from_bytes(name)).ok(),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn received(socket: &UnixDatagram) -> Vec<String> {
        socket.set_nonblocking(true).expect("a socket");
        let mut buffer = [0; 2048];
        std::iter::from_fn(|| {
            let length = socket.recv(&mut buffer).ok()?;
            Some(String::from_utf8_lossy(&buffer[..length]).into_owned())
        })
        .collect()
    }

    fn manager(name: &str, watchdog: &[(&str, &str)]) -> ServiceManager {
        let all = [&[("NOTIFY_SOCKET", name)], watchdog].concat();
        ServiceManager::new(7, |wanted| all.iter().find(|(it, _)| *it == wanted).map(|(_, value)| value.into()))
    }

    // covers: daemon
    #[test]
    fn states_are_sent_once_each_and_again_if_nothing_took_them() {
        let name = format!("ringcatd-notify-{}", std::process::id());
        let mut early = manager(&format!("@{name}"), &[]);
        early.report("scans", true);
        let socket = UnixDatagram::bind_addr(&SocketAddr::from_abstract_name(&name).expect("a name")).expect("free");
        for _ in 0..2 {
            early.report("scans", true);
        }
        early.report("4\nSubDevices", true);
        early.live();
        early.stop();
        let expected = ["READY=1\nSTATUS=scans", "STATUS=4 SubDevices", "STOPPING=1\nSTATUS=ends"];
        assert_eq!(received(&socket), expected);
        // A reader that does not read delays nothing.
        for number in 0..100_000 {
            early.report(&number.to_string(), true);
        }
        assert!(received(&socket).len() < 100_000);
    }

    // covers: daemon
    #[test]
    fn signs_of_life_are_sent_as_often_as_they_are_expected() {
        let path = std::env::temp_dir().join(format!("ringcatd-watchdog-{}", std::process::id()));
        let socket = UnixDatagram::bind(&path).expect("it is free");
        let name = path.to_str().expect("text");
        let second = Duration::from_secs(1);
        let asked = manager(name, &[("WATCHDOG_USEC", "500000"), ("WATCHDOG_PID", "7")]);
        assert_eq!(asked.interval(second), Duration::from_millis(250));
        asked.live();
        assert_eq!(received(&socket), ["WATCHDOG=1"]);
        for other in [&[("WATCHDOG_USEC", "500000"), ("WATCHDOG_PID", "8")][..], &[("WATCHDOG_USEC", "0")], &[]] {
            let manager = manager(name, other);
            assert_eq!(manager.interval(second), second);
            manager.live();
        }
        assert_eq!(received(&socket), [""; 0]);
        std::fs::remove_file(path).expect("it is there");
        for none in ["", "relative", "@"] {
            manager(none, &[]).report("x", true);
        }
        assert!(!ServiceManager::default().is_there());
    }
}
