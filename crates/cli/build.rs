//! A release of the program `ringcat` has no symbols. Other programs of the workspace keep theirs, because benches
//! count calls and instructions by function; a profile of Cargo has one setting for all of them. Functions with the
//! same instructions, mostly those of generic types, are in it once, if the linker is the one that Rust has by default
//! on x86-64 Linux; others may not have the option.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if !env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        return;
    }
    println!("cargo::rustc-link-arg-bins=-Wl,--strip-all");
    let is = |name: &str, expected: &str| env::var(name).is_ok_and(|value| value == expected);
    let has_flags = env::var("CARGO_ENCODED_RUSTFLAGS").is_ok_and(|flags| !flags.is_empty());
    let is_usual = env::var("RUSTC_LINKER").is_err() && !has_flags;
    if is_usual && is("TARGET", "x86_64-unknown-linux-gnu") && is("HOST", "x86_64-unknown-linux-gnu") {
        println!("cargo::rustc-link-arg-bins=-Wl,--icf=all");
    }
}
