//! Combines two copies of a datagram (protocol 9.3). The command and the working counters decide, never a comparison of
//! data. Working counters are always added.

use ringcat_wire::address::Wkc;
use ringcat_wire::command::Command;

use crate::link::Link;

/// How to combine the data of two copies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MergeRule {
    /// The command reads nothing: the data is unchanged.
    AsSent,
    /// Broadcast and logical reads, sent as zeros: one SubDevice sets each bit, or the bit is an OR of all.
    Or,
    /// One SubDevice answers: the copy whose working counter is not zero. An LRW on two links addresses one SubDevice
    /// (protocol 9.2.2).
    Answered,
    /// The copy that was sent on this link, where the addressed SubDevice is reached. For ARMW and FRMW the working
    /// counter does not show it, because every other SubDevice increments the counter too.
    SentOn(Link),
}

impl MergeRule {
    /// The rule for a command. `visible` counts for ARMW and FRMW: the link on which the addressed SubDevice is
    /// reached.
    pub const fn of(command: Command, visible: Link) -> MergeRule {
        match command {
            Command::Nop | Command::Apwr | Command::Fpwr | Command::Bwr | Command::Lwr | Command::Reserved(_) => {
                MergeRule::AsSent
            }
            Command::Brd | Command::Brw | Command::Lrd => MergeRule::Or,
            Command::Aprd | Command::Fprd | Command::Aprw | Command::Fprw | Command::Lrw => MergeRule::Answered,
            Command::Armw | Command::Frmw => MergeRule::SentOn(visible),
        }
    }

    /// Merges the second copy into the first. Both have the same length.
    pub(crate) fn merge(self, first: &mut [u8], first_wkc: Wkc, second: &[u8], second_wkc: Wkc, second_sent_on: Link) {
        match self {
            MergeRule::AsSent => {}
            MergeRule::Or => or_into(first, second),
            MergeRule::Answered => {
                if first_wkc.0 == 0 && second_wkc.0 != 0 {
                    first.copy_from_slice(second);
                }
            }
            MergeRule::SentOn(link) => {
                if link == second_sent_on {
                    first.copy_from_slice(second);
                }
            }
        }
    }
}

/// ORs `source` into `target`, over the length of the shorter one.
pub(crate) fn or_into(target: &mut [u8], source: &[u8]) {
    for (to, from) in target.iter_mut().zip(source) {
        *to |= from;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn merged(command: Command, main: (&[u8; 2], u16), redundant: (&[u8; 2], u16)) -> [u8; 2] {
        let rule = MergeRule::of(command, Link::Redundant);
        let mut forward = *main.0;
        rule.merge(&mut forward, Wkc(main.1), redundant.0, Wkc(redundant.1), Link::Redundant);
        let mut backward = *redundant.0;
        rule.merge(&mut backward, Wkc(redundant.1), main.0, Wkc(main.1), Link::Main);
        assert_eq!(forward, backward, "{command}: the order of arrival must not matter");
        forward
    }

    // covers: CR-05, 9.3, ring-merge
    #[test]
    fn reads_of_one_subdevice_come_from_the_copy_it_processed() {
        for command in [Command::Aprd, Command::Fprd, Command::Fprw, Command::Aprw, Command::Lrw] {
            assert_eq!(merged(command, (&[0, 0], 0), (&[1, 2], 1)), [1, 2]);
            assert_eq!(merged(command, (&[1, 2], 1), (&[0, 0], 0)), [1, 2]);
        }
    }

    // covers: ring-merge
    #[test]
    fn broadcast_and_logical_reads_are_ored() {
        for command in [Command::Brd, Command::Lrd] {
            assert_eq!(merged(command, (&[1, 0x20], 3), (&[4, 2], 1)), [5, 0x22]);
        }
    }

    // covers: ring-merge
    #[test]
    fn a_distributed_time_comes_from_the_link_of_the_reference_clock() {
        assert_eq!(merged(Command::Frmw, (&[9, 9], 5), (&[1, 2], 7)), [1, 2]);
    }

    // covers: ring-merge
    #[test]
    fn writes_stay_as_sent() {
        for command in [Command::Fpwr, Command::Lwr, Command::Bwr, Command::Apwr, Command::Nop] {
            assert_eq!(merged(command, (&[7, 7], 1), (&[7, 7], 0)), [7, 7]);
        }
    }
}
