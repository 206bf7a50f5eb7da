//! The keys that a command adds to its last line.

use serde::Serialize;

use super::bench::{Cycles, Echo, Rate, RoundTrip};
use super::capture::Capture;
use super::clocks::Clocks;
use super::demo::Demo;
#[cfg(feature = "standby")]
use super::demo_standby::DemoStandby;
use super::doctor::Doctor;
use super::eni::{EniExport, EniFile};
use super::esi::{EsiDeclared, EsiList, EsiShow};
use super::network::{Compare, Init};
#[cfg(feature = "standby")]
use super::remote::Remote;
use super::ring::Ring;
use super::run::Run;
use super::scan::Scan;
use super::sii::{SiiBuilt, SiiCompared, SiiSkeleton};
use super::sim::Sim;
#[cfg(feature = "standby")]
use super::standby::Standby;

/// The keys of one command.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
#[allow(missing_docs)]
pub enum Data {
    Scan(Scan),
    Init(Init),
    Compare(Compare),
    Run(Box<Run>),
    Ring(Ring),
    Clocks(Clocks),
    Doctor(Doctor),
    Capture(Capture),
    Sim(Sim),
    #[cfg(feature = "standby")]
    Standby(Standby),
    #[cfg(feature = "standby")]
    Remote(Remote),
    Eni(Box<EniFile>),
    EniExport(EniExport),
    EsiList(EsiList),
    EsiShow(EsiShow),
    EsiDeclared(EsiDeclared),
    SiiBuilt(SiiBuilt),
    SiiCompared(SiiCompared),
    SiiSkeleton(SiiSkeleton),
    Demo(Demo),
    #[cfg(feature = "standby")]
    DemoStandby(DemoStandby),
    Echo(Echo),
    RoundTrip(RoundTrip),
    Cycles(Cycles),
    Rate(Rate),
}
