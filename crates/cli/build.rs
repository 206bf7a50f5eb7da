//! A release of the program `ringcat` has no symbols. Other programs of the workspace keep theirs, because benches
//! count calls and instructions by function; a profile of Cargo has one setting for all of them.

use std::env;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if env::var("PROFILE").is_ok_and(|profile| profile == "release") {
        println!("cargo::rustc-link-arg-bins=-Wl,--strip-all");
    }
}
