//! What follows if a SubDevice refuses the assignment or mapping of its PDOs.

/// What follows if a SubDevice refuses the assignment or mapping of its PDOs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum RefusedPdos {
    /// Its configuration fails.
    #[default]
    Fail,
    /// It is reported, and the SubDevice goes on with what it holds: its application decides about SAFEOP. Programs for
    /// IgH's interface expect this.
    Warn,
}
