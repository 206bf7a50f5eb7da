//! The C interface `ecrt.h` on RingCAT: programs that were written for it compile, link and run unchanged.
//!
//! The crate is linked into `libethercat.so.1` by the C compiler (`crates/ffi/install`). Its layers, from below:
//!
//! | for | see |
//! |---|---|
//! | return codes, lines for the operator, structures of C | `code`, `types` |
//! | links from the environment; the buses of this process | `environment`, `any_links`, `bus` |
//! | questions, answered here or through a daemon | `responder` |
//! | mutexes outside of the cyclic path; values of this process alone | `locks` |
//! | settings of a SubDevice, a network file, the declaration under construction | `settings`, `network`, `draft` |
//! | a handle of a master: reservation, activation, cyclic calls | `master`, `active`, `claim` |
//! | words that any thread reads | `live`, `domain_words` |
//! | requests of the cyclic thread, blocking transfers, information | `request`, `mailbox`, `information` |
//! | the functions of C | `c` |
//!
//! `unsafe` is in `c` (pointers of C), `claim` (a value for one caller at a time), `locks` (values of a process) and
//! `host` (calls of the system).
//! docs/ecrt.md has each function with its return codes by phase.
#![deny(unsafe_op_in_unsafe_fn)]

mod active;
mod any_links;
mod bus;
mod c;
mod claim;
mod code;
mod domain_words;
mod draft;
mod environment;
mod given_time;
mod host;
mod information;
mod live;
mod locks;
mod mailbox;
mod master;
mod network;
mod request;
mod responder;
mod settings;
mod types;
