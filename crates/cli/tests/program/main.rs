//! The program `ringcat` as a user calls it: what needs no network interface.

mod demo;
mod exit_codes;
