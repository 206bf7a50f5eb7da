//! Signals that request the end of a program, received by a waiting thread.
//!
//! A signal handler runs in a thread that the kernel chooses, usually the first thread of the process. That thread may
//! never run while another thread spins with a real-time priority. Therefore all threads block the signals, and one
//! thread with a priority above all others waits for them.

use std::fmt;
use std::mem::zeroed;
use std::time::Duration;

use crate::monotonic::timespec;

/// A signal that requests the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// The terminal or session has closed.
    Hangup,
    /// Ctrl-C.
    Interrupt,
    /// Sent by the system or by `kill`.
    Terminate,
}

impl Signal {
    /// All signals.
    pub const ALL: [Signal; 3] = [Signal::Hangup, Signal::Interrupt, Signal::Terminate];

    /// Signal number.
    pub const fn number(self) -> i32 {
        match self {
            Signal::Hangup => libc::SIGHUP,
            Signal::Interrupt => libc::SIGINT,
            Signal::Terminate => libc::SIGTERM,
        }
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Signal::Hangup => "SIGHUP",
            Signal::Interrupt => "SIGINT",
            Signal::Terminate => "SIGTERM",
        })
    }
}

/// The blocked signals.
#[derive(Clone, Copy)]
pub struct HeldSignals(libc::sigset_t);

impl HeldSignals {
    /// Blocks the signals in the calling thread and in the threads that it starts from now on. SIGHUP is left unchanged
    /// if it is ignored, as under `nohup`.
    pub fn hold() -> HeldSignals {
        // SAFETY: all bytes zero is a valid set and a valid action; the pointers are to live values.
        unsafe {
            let mut set: libc::sigset_t = zeroed();
            libc::sigemptyset(&mut set);
            for signal in Signal::ALL {
                let mut action: libc::sigaction = zeroed();
                libc::sigaction(signal.number(), std::ptr::null(), &mut action);
                if signal != Signal::Hangup || action.sa_sigaction != libc::SIG_IGN {
                    libc::sigaddset(&mut set, signal.number());
                }
            }
            libc::pthread_sigmask(libc::SIG_BLOCK, &set, std::ptr::null_mut());
            HeldSignals(set)
        }
    }

    /// Waits for one of the signals, up to a time limit.
    pub fn wait(&self, limit: Duration) -> Option<Signal> {
        let limit = timespec(u64::try_from(limit.as_nanos()).unwrap_or(u64::MAX));
        // SAFETY: the pointers refer to a live set and a live time; a null pointer for the signal information is
        // allowed.
        let number = unsafe { libc::sigtimedwait(&self.0, std::ptr::null_mut(), &limit) };
        Signal::ALL.into_iter().find(|signal| signal.number() == number)
    }
}

/// Lets the signals end this process again: a program inherits what the one that has started it blocked. To be called
/// before there are further threads.
pub fn unblock() {
    // SAFETY: all bytes zero is a valid set; the pointers are to live values, and no old mask is asked for.
    unsafe {
        let mut set: libc::sigset_t = zeroed();
        libc::sigemptyset(&mut set);
        for signal in Signal::ALL {
            libc::sigaddset(&mut set, signal.number());
        }
        libc::pthread_sigmask(libc::SIG_UNBLOCK, &set, std::ptr::null_mut());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: signals
    #[test]
    fn signals_that_a_thread_has_blocked_are_unblocked_again() {
        let blocked = || {
            let text = std::fs::read_to_string("/proc/thread-self/status").expect("it is there");
            let mask = text.lines().find_map(|line| line.strip_prefix("SigBlk:")).expect("it has the key");
            u64::from_str_radix(mask.trim(), 16).expect("a number")
        };
        let masks = std::thread::spawn(move || {
            unblock();
            let before = blocked();
            HeldSignals::hold();
            let held = blocked();
            unblock();
            (before, held, blocked())
        });
        let (before, held, after) = masks.join().expect("no panic");
        assert!(before != held && before == after, "{before:x} {held:x} {after:x}");
    }

    // covers: signals
    #[test]
    fn a_blocked_signal_waits_for_the_thread_that_receives_it() {
        // In a separate thread: the signal mask of the others stays unchanged.
        let seen = std::thread::spawn(|| {
            let held = HeldSignals::hold();
            assert_eq!(held.wait(Duration::ZERO), None);
            // SAFETY: this thread blocks the signal and is its target.
            unsafe { libc::pthread_kill(libc::pthread_self(), libc::SIGTERM) };
            (held.wait(Duration::from_secs(5)), held.wait(Duration::ZERO))
        });
        assert_eq!(seen.join().expect("no panic"), (Some(Signal::Terminate), None));
    }

    #[test]
    fn signals_have_the_names_of_the_manual() {
        assert_eq!(Signal::ALL.map(|signal| signal.to_string()), ["SIGHUP", "SIGINT", "SIGTERM"]);
    }
}
