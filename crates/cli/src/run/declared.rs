//! What is declared: the network of a file, or the SubDevices found as their SIIs describe them.

use std::time::Duration;

use clap::Args;
use ringcat::{Declaration, ReadPdos, SubDeviceInfo, Trigger, automatic};

use super::configured::{ConfiguredArguments, ConfiguredNetwork};
use crate::clock_options::ClockOptions;
use crate::failure::Failure;
use crate::times::cycle;

/// Options of a declaration.
#[derive(Args, Clone, Debug, Default)]
pub struct DeclarationArguments {
    /// Cycle time, with its unit: 250us, 1ms; 10us to 1s
    #[arg(long, value_name = "TIME", default_value = "1ms", value_parser = cycle, help_heading = "Cycle")]
    pub cycle: Duration,
    #[command(flatten)]
    pub configured: ConfiguredArguments,
    /// Use the distributed clocks
    #[arg(long, help_heading = "Clocks")]
    pub clocks: bool,
    #[command(flatten)]
    pub clock_options: ClockOptions,
}

impl DeclarationArguments {
    /// The network of the file, if there is one: options that do not fit it are refused before anything is sent.
    /// `has_redundant`: whether there is a redundant interface, where it is known.
    pub fn load(&self, has_redundant: Option<bool>) -> Result<Option<ConfiguredNetwork>, Failure> {
        let network = self.configured.load(has_redundant)?;
        if let Some(network) = &network {
            self.clock_options.check_with_file(network.of_file(), self.asks_for_clocks())?;
        }
        Ok(network)
    }

    fn asks_for_clocks(&self) -> bool {
        self.clocks || self.clock_options.are_given()
    }

    /// The declaration: the network of the file, or the SubDevices found as their SIIs describe them.
    pub fn declare(
        &self,
        network: Option<&ConfiguredNetwork>,
        found: &[SubDeviceInfo],
    ) -> Result<Declaration, Failure> {
        let options = &self.clock_options;
        let Some(network) = network else {
            let mut declaration = automatic(found, self.cycle);
            if self.asks_for_clocks() {
                options.declare(&mut declaration, found)?;
            }
            return Ok(declaration);
        };
        let mut declaration = network.declaration(found)?;
        options.adapt(&mut declaration);
        Ok(declaration)
    }

    /// What makes cycles begin, where there are clocks.
    pub fn trigger(&self, declaration: &Declaration) -> Option<Trigger> {
        declaration.clocks.as_ref().map(|clocks| self.clock_options.trigger(clocks.bus_shift))
    }
}

/// When PDOs are read. A file that declares all SyncManagers states which PDOs there are.
pub fn pdos(network: Option<&ConfiguredNetwork>) -> ReadPdos {
    if network.is_some_and(ConfiguredNetwork::is_complete) { ReadPdos::Never } else { ReadPdos::default() }
}
