//! The configuration file: the variables of the IgH manual (7.4), and those of RingCAT.
//!
//! In: a file. Out: what the daemon is to do, and what each variable was understood as; or all mistakes with their
//! lines. [`syntax`]: assignments as `sh` has them; [`variables`]: their meaning; [`place`]: which file is used.

mod model;
pub mod place;
pub mod syntax;
pub mod variables;

use std::fs::File;
use std::io::Read;
use std::path::Path;

pub use model::{Conf, ConfError, Mistake, Own, Understood};

use crate::segment_process::load;
use crate::source::{MasterOption, Source};

/// Longest file that is read.
const LONGEST: u64 = 64 * 1024;

impl Conf {
    /// Reads a file.
    ///
    /// # Errors
    /// It cannot be read, or all that is wrong in it.
    pub fn read(path: &Path) -> Result<Conf, ConfError> {
        let failed = |mistakes| ConfError { path: path.to_owned(), mistakes };
        let whole = |text: String| failed(vec![Mistake { line: None, text }]);
        let bytes = bytes(path).map_err(whole)?;
        Conf::from_bytes(&bytes).map_err(failed)
    }

    /// Reads a file, and the files of simulated segments that it names.
    ///
    /// # Errors
    /// As for [`Conf::read`], and segments that cannot be simulated.
    pub fn read_with_segments(path: &Path) -> Result<Conf, ConfError> {
        let conf = Conf::read(path)?;
        let mistakes: Vec<Mistake> = conf.masters.iter().filter_map(|option| conf.mistake_of_segment(option)).collect();
        if mistakes.is_empty() { Ok(conf) } else { Err(ConfError { path: path.to_owned(), mistakes }) }
    }

    fn mistake_of_segment(&self, option: &MasterOption) -> Option<Mistake> {
        let Source::Simulated(file) = &option.source else { return None };
        let error = load(file).err()?;
        let name = format!("RINGCAT_MASTER{}_SIM", option.master);
        let line = self.understood.iter().rev().find(|it| it.name == name).map(|it| it.line);
        Some(Mistake { line, text: format!("{name}: {error}") })
    }

    /// The same from the bytes of a file.
    ///
    /// # Errors
    /// All that is wrong in it, in the order of the lines.
    pub fn from_bytes(bytes: &[u8]) -> Result<Conf, Vec<Mistake>> {
        let (assignments, mut mistakes) = syntax::assignments(bytes);
        let conf = variables::understand(assignments, &mut mistakes);
        if mistakes.is_empty() {
            return Ok(conf);
        }
        mistakes.sort_by_key(|mistake| mistake.line.unwrap_or(usize::MAX));
        Err(mistakes)
    }
}

fn bytes(path: &Path) -> Result<Vec<u8>, String> {
    let is_file = std::fs::metadata(path).map_err(|error| error.to_string())?.is_file();
    if !is_file {
        return Err("expected a file".to_owned());
    }
    let mut bytes = Vec::new();
    let file = File::open(path).map_err(|error| error.to_string())?;
    file.take(LONGEST + 1).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    match bytes.len() as u64 > LONGEST {
        true => Err(format!("expected a file of at most {} KiB", LONGEST / 1024)),
        false => Ok(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: daemon
    #[test]
    fn a_mistake_is_named_with_file_and_line_and_several_are_all_listed() {
        let text = "MASTER0_DEVICE=\"eth0 eth1\"\nRINGCAT_MODE=$MODE\n\nMASTER0_BACKUP=ff:ff:ff:ff:ff:ff\n";
        let path = std::env::temp_dir().join(format!("ringcatd-conf-{}", std::process::id()));
        std::fs::write(&path, text).expect("it can be written");
        let shown = Conf::read(&path).expect_err("it is wrong").to_string();
        let lines: Vec<&str> =
            shown.lines().map(|line| line.strip_prefix(path.to_str().expect("text")).expect(line)).collect();
        assert_eq!(lines.len(), 3, "{shown}");
        assert!(
            lines[0].starts_with(":1: MASTER0_DEVICE: expected the address or the name of one interface"),
            "{shown}"
        );
        assert!(lines[1].starts_with(":2: RINGCAT_MODE: '$' is not expanded"), "{shown}");
        assert!(lines[2].starts_with(":4: MASTER0_BACKUP: ff:ff:ff:ff:ff:ff stands for"), "{shown}");
        std::fs::write(&path, "#".repeat(LONGEST as usize + 1)).expect("it can be written");
        assert!(Conf::read(&path).expect_err("too long").to_string().ends_with(": expected a file of at most 64 KiB"));
        std::fs::write(&path, "\nRINGCAT_MASTER0_SIM=/no/such.toml\n").expect("it can be written");
        assert!(Conf::read(&path).is_ok());
        let shown = Conf::read_with_segments(&path).expect_err("no segment").to_string();
        assert!(shown.starts_with(&format!("{}:2: RINGCAT_MASTER0_SIM: /no/such.toml: ", path.display())), "{shown}");
        assert_eq!(shown.matches("/no/such.toml").count(), 1, "{shown}");
        std::fs::remove_file(&path).expect("it is there");
        assert!(Conf::read(&path).expect_err("it is gone").to_string().contains("No such file"));
        for endless in ["/dev/zero", "/"] {
            assert!(Conf::read(endless.as_ref()).expect_err("no file").to_string().ends_with(": expected a file"));
        }
    }
}
