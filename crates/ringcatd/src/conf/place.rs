//! Which configuration file is used: the rule of the IgH manual (7.4.4).
//!
//! Under systemd `/etc/ethercat.conf` is used and `/etc/sysconfig/ethercat` is ignored; without it, it is the other way
//! round.

use std::fmt;
use std::path::{Path, PathBuf};

/// The file under systemd.
pub const UNDER_SYSTEMD: &str = "etc/ethercat.conf";
/// The file of an init script.
pub const WITHOUT_SYSTEMD: &str = "etc/sysconfig/ethercat";
/// This directory exists under systemd (`sd_booted(3)`).
const SYSTEMD: &str = "run/systemd/system";

/// The file that is used.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub path: PathBuf,
    /// The other one, if it exists.
    pub ignored: Option<PathBuf>,
    is_systemd: bool,
}

impl Place {
    /// The file that is used on this machine.
    pub fn find() -> Place {
        Place::below(Path::new("/"))
    }

    /// Whether systemd runs on this machine.
    pub fn is_systemd(&self) -> bool {
        self.is_systemd
    }

    /// The same below a directory.
    pub fn below(root: &Path) -> Place {
        let is_systemd = root.join(SYSTEMD).is_dir();
        let both = [root.join(UNDER_SYSTEMD), root.join(WITHOUT_SYSTEMD)];
        let [path, other] = if is_systemd {
            both
        } else {
            let [a, b] = both;
            [b, a]
        };
        let ignored = other.exists().then_some(other);
        Place { path, ignored, is_systemd }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs = if self.is_systemd { "systemd runs" } else { "systemd does not run" };
        write!(f, "{} counts, since {runs} on this machine", self.path.display())?;
        match &self.ignored {
            Some(ignored) => write!(f, "; {} is ignored", ignored.display()),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn under_systemd_one_file_counts_and_without_it_the_other() {
        let root = std::env::temp_dir().join(format!("ringcatd-place-{}", std::process::id()));
        let (new, old) = (root.join(UNDER_SYSTEMD), root.join(WITHOUT_SYSTEMD));
        std::fs::create_dir_all(root.join("etc/sysconfig")).expect("it can be made");
        assert_eq!((Place::below(&root).path, Place::below(&root).ignored), (old.clone(), None));
        for file in [&new, &old] {
            std::fs::write(file, "").expect("it can be written");
        }
        let without = Place::below(&root);
        assert_eq!((&without.path, &without.ignored), (&old, &Some(new.clone())));
        std::fs::create_dir_all(root.join(SYSTEMD)).expect("it can be made");
        let under = Place::below(&root);
        assert_eq!((&under.path, &under.ignored), (&new, &Some(old.clone())));
        let shown = under.to_string();
        assert!(shown.contains("systemd runs on this machine; ") && shown.ends_with("sysconfig/ethercat is ignored"));
        std::fs::remove_dir_all(root).expect("it is there");
    }
}
