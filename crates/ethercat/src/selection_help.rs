//! Help for options that several commands have.

/// Options that select SubDevices.
pub const SELECTION: &str = "  --alias    -a <alias>  Aliases of slaves.
  --position -p <pos>    Their positions: in the ring, or with --alias
                         behind it. See the help of 'slaves'.
";
