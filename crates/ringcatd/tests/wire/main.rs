//! The daemon on network interfaces: veth pairs between two namespaces, as root with `RINGCAT_ON_THE_WIRE=1`.
//!
//! The segment, the daemon and the applications are processes; the applications run as a user without privileges.

mod bench;
mod c_program;
mod debug_interfaces;
mod devices;
mod ends;
mod ethernet;
mod interfaces;
mod roles;
