//! The `ringcat` program.

fn main() {}
