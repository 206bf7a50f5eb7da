//! What a program declares before it activates: SubDevices, domains, places of process data.

use std::sync::Arc;
use std::time::Duration;

use ringcat::{
    ClockConfig, Declaration, DomainId, Entry, EntryPlace, PulseGrid, ReferenceClock, RegisterError, Required,
    SubDeviceConfig, SubDeviceId, SubDeviceInfo,
};

use crate::code::{Code, Outcome, report};
use crate::domain_words::DomainWords;
use crate::network::{self, Area, Names, Network};
use crate::settings::{Name, Settings};

/// A declaration under construction.
#[derive(Debug, Default)]
pub struct Draft {
    declaration: Declaration,
    settings: Vec<Settings>,
    domains: Vec<Arc<DomainWords>>,
    /// Time from one send to the next that the program expects.
    send_interval: Option<Duration>,
    /// Shortest period of a network file.
    file_period: Option<Duration>,
    reference: Option<usize>,
    /// Of a network file.
    names: Names,
    found: Vec<SubDeviceInfo>,
    /// Vendor and product 0xFFFFFFFF stand for any.
    has_wildcards: bool,
    /// A panic within the end of the application.
    #[cfg(test)]
    pub panics_when_cleared: bool,
}

impl Draft {
    /// Takes over the result of the last scan.
    pub fn set_found(&mut self, found: Vec<SubDeviceInfo>) {
        self.found = found;
    }

    /// Makes the declaration one that cannot be loaded, or repairs it.
    #[cfg(test)]
    pub fn spoil(&mut self, is_spoiled: bool) {
        self.declaration.domains.iter_mut().for_each(|domain| domain.under_way = u8::from(!is_spoiled));
    }

    /// The SubDevices of that scan.
    pub fn found(&self) -> &[SubDeviceInfo] {
        &self.found
    }

    /// Whether vendor and product 0xFFFFFFFF stand for any, in SubDevices that are declared from now on.
    pub fn set_wildcards(&mut self, has_wildcards: bool) {
        self.has_wildcards = has_wildcards;
    }

    /// The index of a SubDevice with a name, if it was declared before.
    ///
    /// # Errors
    /// Another SubDevice was declared at this place.
    pub fn known(&self, name: Name) -> Outcome<Option<usize>> {
        let is_place = |other: &Settings| (other.name.alias, other.name.position) == (name.alias, name.position);
        match self.settings.iter().position(is_place) {
            Some(index) if self.settings[index].name != name => Err(Code::NOT_FOUND),
            known => Ok(known),
        }
    }

    /// Declares a SubDevice.
    pub fn add(&mut self, name: Name) -> usize {
        let settings = Settings::new(name).with_wildcards(self.has_wildcards);
        self.declaration.add_without_domain(settings.config(None));
        self.settings.push(settings);
        self.settings.len() - 1
    }

    /// Declares a domain.
    pub fn add_domain(&mut self) -> (DomainId, Arc<DomainWords>) {
        let words = Arc::new(DomainWords::default());
        self.domains.push(words.clone());
        (self.declaration.add_domain(Duration::ZERO), words)
    }

    /// Whether lost frames of a domain are sent again within their cycle.
    ///
    /// # Errors
    /// There is no such domain.
    pub fn set_sends_again(&mut self, domain: DomainId, sends_again: bool) -> Outcome {
        self.declaration.domains.get_mut(domain.0).ok_or(Code::INVALID)?.sends_again = sends_again;
        Ok(())
    }

    /// The expected time from one send to the next; 0: it is not known.
    pub fn set_send_interval(&mut self, interval: Duration) {
        self.send_interval = (!interval.is_zero()).then_some(interval);
    }

    /// The expected time from one send to the next. Without one of the program it is the shortest period of a network
    /// file.
    pub fn send_interval(&self) -> Option<Duration> {
        self.send_interval.or(self.file_period)
    }

    /// Nothing is declared any more; what the scan has found and the program expects stays.
    pub fn clear(&mut self) {
        #[cfg(test)]
        assert!(!self.panics_when_cleared, "provoked by a test");
        let (found, send_interval, has_wildcards) =
            (std::mem::take(&mut self.found), self.send_interval, self.has_wildcards);
        *self = Draft { found, send_interval, has_wildcards, ..Draft::default() };
    }

    /// The domains.
    pub fn domains(&self) -> &[Arc<DomainWords>] {
        &self.domains
    }

    /// The settings of a SubDevice, and what the scan has found at its place.
    ///
    /// # Errors
    /// No such SubDevice; its settings are those of a network file.
    pub fn settings(&mut self, index: usize) -> Outcome<(&mut Settings, Option<SubDeviceInfo>)> {
        let info = self.info(index).cloned();
        let settings = self.settings.get_mut(index).ok_or(Code::INVALID)?;
        if settings.is_of_file() { Err(Code::BUSY) } else { Ok((settings, info)) }
    }

    /// The SubDevice that the scan has found at the place of a declared one; `None` if it is absent or another one.
    pub fn info(&self, index: usize) -> Option<&SubDeviceInfo> {
        self.declaration.found(&self.found, SubDeviceId(index))
    }

    /// Declares the network of a network file or an ENI. Process data and mailboxes that it leaves to the EEPROM are
    /// those of the SubDevices that were found.
    ///
    /// # Errors
    /// SubDevices or domains are declared already; process data of the file does not fit.
    pub fn load(&mut self, file: &Network) -> Outcome {
        if !(self.settings.is_empty() && self.domains.is_empty()) {
            return Err(Code::BUSY);
        }
        let loaded = network::declaration(file);
        for (index, config) in loaded.subdevices.iter().enumerate() {
            self.declaration.add_without_domain(config.clone());
            self.settings.push(Settings::of_file(network::name(index, config), config.clone()));
        }
        self.declaration.clocks = loaded.clocks;
        let mut areas = Vec::new();
        for domain in &loaded.domains {
            let (id, _) = self.add_domain();
            self.set_sends_again(id, domain.sends_again)?;
            for member in &domain.members {
                self.place(id, member.subdevice, member.sync_managers.as_deref(), &mut areas)?;
            }
            self.registered(id);
        }
        let shortest = loaded.domains.iter().map(|domain| domain.period).filter(|period| !period.is_zero()).min();
        self.file_period = shortest;
        self.names = network::names(&file.configuration, &file.domains, &areas);
        Ok(())
    }

    /// Places the process data of a member of a domain.
    fn place(
        &mut self,
        domain: DomainId,
        subdevice: SubDeviceId,
        wanted: Option<&[u8]>,
        areas: &mut Vec<Area>,
    ) -> Outcome {
        let found = self.info(subdevice.0).cloned();
        let config = self.declaration.subdevices.get(subdevice.0).ok_or(Code::INVALID)?;
        for sync_manager in network::sync_managers(config, found.as_ref(), wanted) {
            let placed = self.declaration.register_sync_manager(domain, subdevice, sync_manager, found.as_ref());
            let area = placed.map_err(refusal)?;
            let (direction, start, length) = (area.direction, area.start, area.length.into());
            areas.push(Area { subdevice: subdevice.0, sync_manager, domain, direction, start, length });
        }
        Ok(())
    }

    /// Names of the network file; none without one.
    pub const fn names(&self) -> &Names {
        &self.names
    }

    fn config(&self, index: usize) -> Option<SubDeviceConfig> {
        Some(self.settings.get(index)?.config(self.info(index)))
    }

    /// Places an object in a domain.
    ///
    /// # Errors
    /// It is not mapped, or the SubDevice has too few FMMUs.
    pub fn register(&mut self, index: usize, domain: DomainId, object: (u16, u8)) -> Outcome<Entry> {
        let found = self.prepare(index)?;
        let (object, sub_index) = object;
        let placed = self.declaration.register_entry(domain, SubDeviceId(index), object, sub_index, found.as_ref());
        self.registered(domain);
        placed.map_err(refusal)
    }

    /// Places the entry at a place in a domain.
    ///
    /// # Errors
    /// There is none, or the SubDevice has too few FMMUs.
    pub fn register_at(&mut self, index: usize, domain: DomainId, place: EntryPlace) -> Outcome<Entry> {
        let found = self.prepare(index)?;
        let placed = self.declaration.register_entry_at(domain, SubDeviceId(index), place, found.as_ref());
        self.registered(domain);
        placed.map_err(refusal)
    }

    fn registered(&self, domain: DomainId) {
        if let Some(words) = self.domains.get(domain.0) {
            words.set_bytes(self.image_bytes(domain));
        }
    }

    /// Puts the present settings of a SubDevice into the declaration.
    fn prepare(&mut self, index: usize) -> Outcome<Option<SubDeviceInfo>> {
        let config = self.config(index).ok_or(Code::INVALID)?;
        let found = self.info(index).cloned();
        self.declaration.subdevices[index] = config;
        Ok(found)
    }

    /// Bytes of the image of a domain.
    fn image_bytes(&self, domain: DomainId) -> usize {
        self.declaration.image_bytes(domain)
    }

    /// Chooses the reference clock; `None`: the first SubDevice with a clock.
    ///
    /// # Errors
    /// The SubDevice was found and has no clock.
    pub fn choose_reference(&mut self, index: Option<usize>) -> Outcome {
        self.check_reference(index)?;
        self.reference = index;
        Ok(())
    }

    /// Checks a reference clock; `None`: the first SubDevice with a clock.
    ///
    /// # Errors
    /// The SubDevice was found and has no clock.
    pub fn check_reference(&self, index: Option<usize>) -> Outcome {
        let info = index.and_then(|index| self.info(index));
        if info.is_some_and(|info| info.receive_times.is_none()) { Err(Code::INVALID) } else { Ok(()) }
    }

    /// Whether the bus has a SubDevice with a clock.
    pub fn has_clock(&self) -> bool {
        self.found.iter().any(|info| info.receive_times.is_some())
    }

    /// The declaration with all settings. Absent SubDevices are no obstacle. Clocks as with IgH: datagrams on call, no
    /// drift compensation in advance.
    pub fn declaration(&self) -> Declaration {
        let mut declaration = self.declaration.clone().with_required(Required::Nothing);
        for index in 0..self.settings.len() {
            if let Some(config) = self.config(index) {
                declaration.subdevices[index] = config;
            }
        }
        // Those with SYNC signals may come later.
        if self.has_clock() || declaration.subdevices.iter().any(|config| config.sync.is_some()) {
            let mut clocks = match declaration.clocks.take() {
                // Windows and limits of a network file; the rest is that of ecrt.h.
                Some(of_file) => of_file.with_pulse_grid(PulseGrid::FirstApplicationTime),
                None => ClockConfig::default().as_igh().with_reference(ReferenceClock::FirstWithClock),
            };
            if let Some(index) = self.reference {
                clocks = clocks.with_reference(ReferenceClock::Declared(SubDeviceId(index)));
            }
            declaration.clocks = Some(clocks.with_drift_distributions(0));
        }
        declaration
    }
}

fn refusal(error: RegisterError) -> Code {
    let code = match error {
        RegisterError::TooManyPlaces { .. } | RegisterError::TooLarge { .. } => Code::OVERFLOW,
        RegisterError::Plan { .. }
        | RegisterError::Unknown { .. }
        | RegisterError::NotMapped { .. }
        | RegisterError::NoProcessData { .. }
        | RegisterError::NoSuchPlace { .. } => Code::NOT_FOUND,
        _ => Code::INVALID,
    };
    report(format_args!("process data: {error}"));
    code
}
