//! Signals of job control for a program that changes the settings of its terminal: they are received between two of its
//! steps, so that it can give the terminal back before it stops.

use std::mem::zeroed;

use crate::signals::HeldSignals;

/// A signal of the terminal or of a shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JobSignal {
    /// Ctrl-\: the program ends.
    Quit,
    /// Ctrl-Z: the program stops.
    Stop,
    /// The program was stopped, and goes on.
    Continue,
}

impl JobSignal {
    /// All signals.
    pub const ALL: [JobSignal; 3] = [JobSignal::Quit, JobSignal::Stop, JobSignal::Continue];

    /// Signal number.
    pub const fn number(self) -> i32 {
        match self {
            JobSignal::Quit => libc::SIGQUIT,
            JobSignal::Stop => libc::SIGTSTP,
            JobSignal::Continue => libc::SIGCONT,
        }
    }
}

/// The blocked signals. The calling thread receives them in the usual way again when this is dropped.
#[derive(Debug)]
pub struct HeldJobSignals(());

impl HeldJobSignals {
    /// Blocks the signals in the calling thread, which has to be the only one that does not block them: see
    /// [`leave_to_others`].
    pub fn hold() -> HeldJobSignals {
        change(libc::SIG_BLOCK, &JobSignal::ALL);
        HeldJobSignals(())
    }

    /// A signal that has come.
    pub fn next(&self) -> Option<JobSignal> {
        let now = libc::timespec { tv_sec: 0, tv_nsec: 0 };
        let set = set_of(&JobSignal::ALL);
        // SAFETY: the pointers refer to a live set and a live time; a null pointer for the signal information is
        // allowed.
        let number = unsafe { libc::sigtimedwait(&set, std::ptr::null_mut(), &now) };
        JobSignal::ALL.into_iter().find(|signal| signal.number() == number)
    }

    /// Stops this process, until SIGCONT. It goes on at once where no shell could continue it: in an orphaned
    /// process group.
    pub fn stop(&self) {
        // SAFETY: no pointers are passed. The identifier is that of this process.
        self.stop_by(unsafe { libc::getpid() });
    }

    /// As [`HeldJobSignals::stop`], with all other processes of its group: as the terminal does for Ctrl-Z.
    pub fn stop_group(&self) {
        self.stop_by(0);
    }

    fn stop_by(&self, target: libc::pid_t) {
        // SAFETY: no pointers are passed. The target is this process, or its group.
        unsafe { libc::kill(target, libc::SIGTSTP) };
        change(libc::SIG_UNBLOCK, &[JobSignal::Stop]);
        change(libc::SIG_BLOCK, &[JobSignal::Stop]);
    }
}

/// Blocks these signals and those that request an end in the calling thread: another thread of the program receives
/// them.
pub fn leave_to_others() {
    HeldSignals::hold();
    change(libc::SIG_BLOCK, &JobSignal::ALL);
}

impl Drop for HeldJobSignals {
    fn drop(&mut self) {
        change(libc::SIG_UNBLOCK, &JobSignal::ALL);
    }
}

fn set_of(signals: &[JobSignal]) -> libc::sigset_t {
    // SAFETY: all bytes zero is a valid set, and the pointers are to a live one.
    unsafe {
        let mut set: libc::sigset_t = zeroed();
        libc::sigemptyset(&mut set);
        signals.iter().for_each(|signal| {
            libc::sigaddset(&mut set, signal.number());
        });
        set
    }
}

fn change(how: i32, signals: &[JobSignal]) {
    // SAFETY: the pointer is to a live set, and no old mask is requested.
    unsafe { libc::pthread_sigmask(how, &set_of(signals), std::ptr::null_mut()) };
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: signals
    #[test]
    fn signals_of_job_control_wait_until_they_are_received() {
        // In a separate thread: the signal mask of the others stays unchanged.
        let seen = std::thread::spawn(|| {
            let held = HeldJobSignals::hold();
            assert_eq!(held.next(), None);
            for signal in [JobSignal::Quit, JobSignal::Stop] {
                // SAFETY: this thread blocks the signal and is its target.
                unsafe { libc::pthread_kill(libc::pthread_self(), signal.number()) };
                assert_eq!(held.next(), Some(signal));
            }
            held.next()
        });
        assert_eq!(seen.join().expect("no panic"), None);
    }
}
