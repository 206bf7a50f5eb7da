//! Mail that comes twice (facts 6.1, 6.2).
//!
//! A repeat brings a mail with its old counter, and so does a frame that comes back late; some SubDevices send an answer
//! twice. A mail is a double when its counter is not zero and counter and content are those of a mail of late. Content
//! is compared because there are SubDevices whose counter stands still.

/// How many mails back a double may lie after a disturbance: a repeat brings the last or the one before, and a late copy
/// may come behind that.
const DEPTH: usize = 3;
const FNV_OFFSET: u64 = 0xCBF2_9CE4_8422_2325;
const FNV_PRIME: u64 = 0x0000_0100_0000_01B3;

/// The mails that were accepted last.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Recent {
    /// Newest first: counter and a hash of the content.
    mails: [Option<(u8, u64)>; DEPTH],
}

impl Recent {
    /// Whether a mail was there before; one that was not is noted. After a disturbance older mails are compared too.
    pub(super) fn is_double(&mut self, counter: u8, content: &[u8], disturbed: bool) -> bool {
        if counter == 0 {
            return false;
        }
        let mail = Some((counter, hash(content)));
        let depth = if disturbed { DEPTH } else { 1 };
        if self.mails[..depth].contains(&mail) {
            return true;
        }
        self.mails.rotate_right(1);
        self.mails[0] = mail;
        false
    }
}

/// FNV-1a.
fn hash(bytes: &[u8]) -> u64 {
    bytes.iter().fold(FNV_OFFSET, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(FNV_PRIME))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_counter_with_the_same_content_is_a_double() {
        let mut recent = Recent::default();
        assert!(!recent.is_double(1, b"a", false));
        assert!(recent.is_double(1, b"a", false));
        assert!(!recent.is_double(1, b"b", false), "a counter that stands still");
        assert!(!recent.is_double(0, b"b", false) && !recent.is_double(0, b"b", false), "0 is no counter");
    }

    #[test]
    fn after_a_disturbance_older_mails_are_doubles_too() {
        let mut recent = Recent::default();
        for counter in 1..=3 {
            assert!(!recent.is_double(counter, b"x", false));
        }
        assert!(recent.is_double(1, b"x", true));
        assert!(!recent.is_double(4, b"x", true));
        assert!(!recent.is_double(1, b"x", true), "a full turn of the counter later it is another one");
    }
}
