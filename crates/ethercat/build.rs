//! A release of the program has no symbols: a profile of Cargo has one setting for all programs, and benches need
//! theirs.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if !env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        return;
    }
    println!("cargo::rustc-link-arg-bins=-Wl,--strip-all");
}
