//! Files that may contain `unsafe`.
//!
//! Input: a tree. Output: findings: `unsafe` outside the allowed files, and a pure crate that does not forbid it.

use crate::Finding;
use crate::tokens::{Token, tokens};
use crate::tree::{File, Tree};

/// Crates and single files that may contain `unsafe`, each with its reason.
const ALLOWED: &[(&str, &str)] = &[
    ("crates/link/", "calls the kernel"),
    ("crates/ffi/", "is called from C"),
    ("crates/scenarios/src/counting_allocator.rs", "a global allocator that counts allocations of the cyclic path"),
    ("crates/scenarios/src/shared_memory.rs", "maps memory that two processes share"),
    ("crates/scenarios/src/bin/forward/bare.rs", "system calls alone: what the forwarder is compared with"),
    ("crates/scenarios/tests/on_the_wire/deaths/stopped_thread.rs", "traces a thread of a process, so that it hangs"),
    ("ci/no-std-proof/src/", "a program without std brings its own start and allocator"),
];

/// Crates whose root has to say `#![forbid(unsafe_code)]`.
const FORBIDDING: [&str; 9] = ["wire", "engine", "sim", "config", "control", "gateway", "ringcatd", "ethercat", "tidy"];

/// `unsafe` in a file that is not allowed to contain it.
pub fn misplaced(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for file in tree.rust().filter(|file| !allowed(&file.path)) {
        for token in tokens(&file.text).iter().filter(|token| token.is_ident("unsafe")) {
            let text = "`unsafe` belongs to link and ffi; the list of exceptions is in crates/tidy/src/safety.rs";
            findings.push(Finding::new(&file.path, token.line, text));
        }
    }
    findings
}

fn allowed(path: &str) -> bool {
    ALLOWED.iter().any(|(place, _)| path == *place || (place.ends_with('/') && path.starts_with(place)))
}

/// Pure crates that do not forbid `unsafe`.
pub fn not_forbidden(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for name in FORBIDDING {
        let path = format!("crates/{name}/src/lib.rs");
        if let Some(file) = tree.file(&path)
            && !forbids(file)
        {
            findings.push(Finding::new(&path, 1, "the crate root lacks `#![forbid(unsafe_code)]`"));
        }
    }
    findings
}

fn forbids(file: &File) -> bool {
    let is_forbid = |t: &[Token]| {
        t[0].is('!') && t[1].is('[') && t[2].is_ident("forbid") && t[3].is('(') && t[4].is_ident("unsafe_code")
    };
    tokens(&file.text).windows(5).any(is_forbid)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(path: &str, text: &str) -> Tree {
        Tree { files: vec![File::new(path, text)] }
    }

    #[test]
    fn unsafe_code_is_found_outside_of_its_files_only() {
        assert_eq!(misplaced(&tree("crates/engine/src/a.rs", "fn f() { unsafe { g() } }")).len(), 1);
        assert!(misplaced(&tree("crates/link/src/a.rs", "fn f() { unsafe { g() } }")).is_empty());
        assert!(
            misplaced(&tree("crates/engine/src/a.rs", "// unsafe\n\"unsafe\"; #![forbid(unsafe_code)]")).is_empty()
        );
    }

    #[test]
    fn a_pure_crate_must_forbid_unsafe_code_in_code_not_in_a_comment() {
        assert!(not_forbidden(&tree("crates/wire/src/lib.rs", "//! x\n#![forbid(unsafe_code)]")).is_empty());
        assert_eq!(not_forbidden(&tree("crates/wire/src/lib.rs", "//! #![forbid(unsafe_code)]\n")).len(), 1);
    }
}
