//! Builds a declaration step by step.

use alloc::vec;
use core::time::Duration;

use crate::config::{ClockConfig, SubDeviceConfig};
use crate::declared::SubDeviceId;
use crate::domain::DomainId;
use crate::layout::LrwPolicy;
use crate::main_device::declaration::{Declaration, DomainConfig, DomainMember, Required};

impl Declaration {
    /// A declaration with one domain of this period, [`DomainId`] 0, and no SubDevices yet.
    #[must_use]
    pub fn new(period: Duration) -> Declaration {
        Declaration { domains: vec![DomainConfig::new(period, vec![])], ..Declaration::default() }
    }

    /// Adds a SubDevice; all its process data belongs to the first domain, if there is one.
    pub fn add(&mut self, config: SubDeviceConfig) -> SubDeviceId {
        self.add_to(DomainId(0), config)
    }

    /// Adds a SubDevice; all its process data belongs to this domain. If there is no such domain, the SubDevice is in
    /// none.
    pub fn add_to(&mut self, domain: DomainId, config: SubDeviceConfig) -> SubDeviceId {
        let subdevice = self.subdevices.len();
        self.subdevices.push(config);
        if let Some(domain) = self.domains.get_mut(domain.0) {
            domain.members.push(DomainMember { subdevice: SubDeviceId(subdevice), sync_managers: None });
        }
        SubDeviceId(subdevice)
    }

    /// Adds a SubDevice to no domain; [`Declaration::assign`] assigns single SyncManagers to domains.
    pub fn add_without_domain(&mut self, config: SubDeviceConfig) -> SubDeviceId {
        self.subdevices.push(config);
        SubDeviceId(self.subdevices.len() - 1)
    }

    /// Adds a domain with this period; zero for a domain that the application exchanges at irregular times.
    pub fn add_domain(&mut self, period: Duration) -> DomainId {
        self.domains.push(DomainConfig::new(period, vec![]));
        DomainId(self.domains.len() - 1)
    }

    /// Assigns the process data of one SyncManager to a domain. Without such a domain, nothing happens.
    pub fn assign(&mut self, domain: DomainId, subdevice: SubDeviceId, sync_manager: u8) {
        if let Some(domain) = self.domains.get_mut(domain.0) {
            let sync_managers = Some(vec![sync_manager]);
            domain.members.push(DomainMember { subdevice, sync_managers });
        }
    }

    /// The same declaration, with distributed clocks, or with `None` without.
    #[must_use]
    pub fn with_clocks(mut self, clocks: impl Into<Option<ClockConfig>>) -> Declaration {
        self.clocks = clocks.into();
        self
    }

    /// The same declaration, with this use of LRW.
    #[must_use]
    pub fn with_lrw(mut self, lrw: LrwPolicy) -> Declaration {
        self.lrw = lrw;
        self
    }

    /// The same declaration; these SubDevices must be present for the activation.
    #[must_use]
    pub fn with_required(mut self, required: Required) -> Declaration {
        self.required = required;
        self
    }
}
