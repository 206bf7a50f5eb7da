//! Subjects of events, and sets of them: what a client of events subscribes to.

use ringcat_wire::address::Position;

use super::Event;

/// Subject of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Subject {
    /// Scans, what they found, the SIIs.
    Scan,
    /// Crossed lines, rings behind junctions, moved SubDevices, errors of cables.
    Cabling,
    /// The ring, its breaks, redundancy.
    Ring,
    /// Links of the host, frames of others, limits of frames.
    Links,
    /// States of SubDevices, lost and returned ones, configurations.
    States,
    /// Emergencies.
    Mail,
    /// Working counters and skipped cycles of domains.
    Domains,
    /// Distributed clocks.
    Clocks,
    /// Single datagrams with wrong working counters: events on request.
    Commands,
    /// Content of acyclic frames: messages of level 2 only, no event.
    Frames,
}

impl Subject {
    /// All of them.
    pub const ALL: [Subject; 10] = [
        Subject::Scan,
        Subject::Cabling,
        Subject::Ring,
        Subject::Links,
        Subject::States,
        Subject::Mail,
        Subject::Domains,
        Subject::Clocks,
        Subject::Commands,
        Subject::Frames,
    ];
}

/// A set of subjects.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Subjects(u16);

impl Subjects {
    /// No subject.
    pub const NONE: Subjects = Subjects(0);
    /// All subjects, also those of later versions.
    pub const ALL: Subjects = Subjects(u16::MAX);

    /// These subjects and a further one.
    #[must_use]
    pub const fn with(self, subject: Subject) -> Subjects {
        Subjects(self.0 | 1 << subject as u16)
    }

    /// These subjects without this one.
    #[must_use]
    pub const fn without(self, subject: Subject) -> Subjects {
        Subjects(self.0 & !(1 << subject as u16))
    }

    /// Whether a subject is in the set.
    pub const fn has(self, subject: Subject) -> bool {
        self.0 & 1 << subject as u16 != 0
    }
}

impl Event {
    /// What it is about.
    pub const fn subject(&self) -> Subject {
        match self {
            Event::Counted { .. }
            | Event::ScanProgress { .. }
            | Event::ScanFinished { .. }
            | Event::ScanFailed { .. }
            | Event::SegmentChanged { .. }
            | Event::Resumed { .. }
            | Event::SiiWarning { .. }
            | Event::DuplicateAlias { .. }
            | Event::Unexpected { .. }
            | Event::Mismatch { .. }
            | Event::Missing { .. } => Subject::Scan,
            Event::LineCrossed { .. }
            | Event::InterfacesSwapped
            | Event::JunctionLearned { .. }
            | Event::JunctionsNotLearned { .. }
            | Event::UnconnectedPort0 { .. }
            | Event::JunctionChanged { .. }
            | Event::JunctionUnknown { .. }
            | Event::JunctionsBlocked { .. }
            | Event::CannotDisconnect { .. }
            | Event::CablingWarning { .. }
            | Event::CableErrors { .. }
            | Event::Moved { .. } => Subject::Cabling,
            Event::RingOpened { .. }
            | Event::BreakLocated { .. }
            | Event::RingClosed { .. }
            | Event::RingUnsteady { .. }
            | Event::RedundancyLost { .. }
            | Event::RedundancyRegained => Subject::Ring,
            Event::LinkDown { .. } | Event::LinkUp { .. } | Event::ForeignFrame { .. } | Event::FrameLimit { .. } => {
                Subject::Links
            }
            #[cfg(feature = "standby")]
            Event::Standby(_) => Subject::Links,
            Event::UndeclaredFailed { .. }
            | Event::UndeclaredState { .. }
            | Event::StateReached { .. }
            | Event::StateError { .. }
            | Event::Lost { .. }
            | Event::Returned { .. }
            | Event::ConfigurationFailed { .. }
            | Event::DeclarationWarning { .. }
            | Event::GroupJoined { .. }
            | Event::GroupLeft { .. } => Subject::States,
            Event::StartupRead { .. } => Subject::States,
            Event::ConversationCut { .. } | Event::Emergency { .. } => Subject::Mail,
            Event::Domain { .. } | Event::Skipped { .. } => Subject::Domains,
            Event::CyclicCommand { .. } | Event::AcyclicCommand { .. } => Subject::Commands,
            Event::ClocksLocked { .. }
            | Event::ReferenceClock { .. }
            | Event::DelaysChanged { .. }
            | Event::DelayUnknown { .. }
            | Event::ClocksFailed { .. }
            | Event::WentOnUnlocked { .. }
            | Event::ApplicationTime { .. }
            | Event::SyncWindow { .. } => Subject::Clocks,
        }
    }
}

impl Event {
    /// Cabling positions that the event names. Positions of the scan are not included: they may differ from those of a
    /// later rescan.
    pub(super) fn positions(&self) -> [Option<Position>; 2] {
        match self {
            Event::BreakLocated { cable }
            | Event::CableErrors { cable, .. }
            | Event::RingClosed { place: Some(cable), .. } => cable.positions(),
            _ => [None; 2],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: jobs
    #[test]
    fn a_set_holds_the_subjects_that_were_put_into_it() {
        for subject in Subject::ALL {
            let one = Subjects::NONE.with(subject);
            assert_eq!(Subject::ALL.map(|other| one.has(other)), Subject::ALL.map(|other| other == subject));
            let others = Subjects::ALL.without(subject);
            assert_eq!(Subject::ALL.map(|other| others.has(other)), Subject::ALL.map(|other| other != subject));
        }
    }
}
