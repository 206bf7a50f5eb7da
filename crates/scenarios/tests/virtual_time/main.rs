//! Whole systems in virtual time: an engine and a simulated segment, one module per subject.
//!
//! One program and not twenty, because each would be linked with everything; only those that count allocations are apart.

mod broken_ring;
mod calm;
mod captures;
mod clocks;
mod configuration;
mod copies;
mod determinism;
mod disturbed_frames;
mod domains;
mod eeprom;
mod eeprom_writes;
mod ethernet;
mod explorer;
mod failures;
mod fairness;
mod hot_connect;
mod junctions;
mod mail;
mod mail_extras;
mod mail_matrix;
mod mail_protocols;
mod mail_services;
mod mail_startup;
mod mail_storm;
mod mailbox_decoders;
mod odd_sii;
mod power_cycles;
mod real_images;
mod requests;
mod required;
mod rescans;
mod ring_events;
mod ring_matrix;
mod ring_merge;
mod ring_phases;
mod ring_remerge;
mod ring_services;
mod services;
mod slow_eeprom;
mod start_up;
mod startup_commands;
mod states;
mod strangers;
mod topologies;
