//! The program `ringcat` as a user calls it: what needs no network interface.

mod compared;
mod daemon;
mod demo;
#[cfg(feature = "standby")]
mod demo_standby;
mod doctor;
mod documented;
mod exit_codes;
mod files;
mod json;
mod out_files;
mod pages;
mod paired;
#[cfg(feature = "standby")]
mod service;
mod terminal;
