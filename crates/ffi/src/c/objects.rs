//! What is behind the handles of C, and which handles end together.

use std::sync::{Arc, Mutex};

use ringcat::{DomainId, EmergencyRing, RegisterRequest, SdoRequest, SoeRequest, SubDeviceId, VoeHandler};

use super::handle::{Ending, Handle, Kind, bury, ending, give};
use crate::claim::Claim;
use crate::code::{Code, Outcome};
use crate::domain_words::DomainWords;
use crate::locks::locked;
use crate::master::Master;
use crate::network::Network;
use crate::request::Requested;
use crate::settings::Name;

/// A master with the handles that end with its application.
pub struct Owner {
    /// The master.
    pub master: Master,
    children: Mutex<Vec<Ending>>,
    /// Handles of SubDevices by their index.
    slaves: Mutex<Vec<Option<usize>>>,
    /// Handles of the domains of a network file by their number.
    domains: Mutex<Vec<usize>>,
}

/// Behind `ec_master_t`.
pub struct MasterObject(pub Arc<Owner>);

/// Behind `ec_slave_config_t`.
pub struct SlaveObject {
    /// Its master.
    pub owner: Arc<Owner>,
    /// Index in the declaration.
    pub index: usize,
    /// Its emergencies, once a ring was asked for.
    pub emergencies: Claim<Option<EmergencyRing>>,
}

/// Behind `ec_domain_t`.
pub struct DomainObject {
    /// Its master.
    pub owner: Arc<Owner>,
    /// Number in the declaration.
    pub id: DomainId,
    /// Its state and memory.
    pub words: Arc<DomainWords>,
}

macro_rules! kinds {
    ($($(#[$doc:meta])* $name:ident = $object:ty, $mark:literal;)*) => {$(
        impl Kind for $object {
            const MARK: u64 = $mark;
        }

        $(#[$doc])*
        #[allow(non_camel_case_types)]
        pub type $name = Handle<$object>;
    )*};
}

kinds! {
    /// `ec_master_t`
    ec_master_t = MasterObject, 0x7269_6e67_6d61_7374;
    /// `ec_slave_config_t`
    ec_slave_config_t = SlaveObject, 0x7269_6e67_736c_6176;
    /// `ec_domain_t`
    ec_domain_t = DomainObject, 0x7269_6e67_646f_6d61;
    /// `ec_sdo_request_t`
    ec_sdo_request_t = Requested<SdoRequest>, 0x7269_6e67_7364_6f72;
    /// `ec_soe_request_t`
    ec_soe_request_t = Requested<SoeRequest>, 0x7269_6e67_736f_6572;
    /// `ec_reg_request_t`
    ec_reg_request_t = Requested<RegisterRequest>, 0x7269_6e67_7265_6772;
    /// `ec_voe_handler_t`
    ec_voe_handler_t = Requested<VoeHandler>, 0x7269_6e67_766f_6568;
}

impl Owner {
    /// A master without further handles.
    pub fn new(master: Master) -> Owner {
        Owner { master, children: Mutex::default(), slaves: Mutex::default(), domains: Mutex::default() }
    }

    /// Makes a handle that ends with the application.
    pub fn give_child<T: Kind>(&self, object: T) -> *mut Handle<T> {
        let handle = give(object);
        locked(&self.children).push(ending(handle));
        handle
    }

    /// Whether a handle ends with the application.
    pub fn has_child(&self, address: usize) -> bool {
        locked(&self.children).iter().any(|child| child.is_of(address))
    }

    /// From now on all handles but that of the master are refused.
    pub fn fail_children(&self) {
        locked(&self.children).iter().for_each(Ending::fail);
    }

    /// Ends all handles but that of the master.
    pub fn end_children(&self) {
        locked(&self.slaves).clear();
        locked(&self.domains).clear();
        let children = std::mem::take(&mut *locked(&self.children));
        children.into_iter().for_each(bury);
    }

    /// Declares the network of a file.
    ///
    /// # Errors
    /// The application is active, something is declared already, or the file does not fit the bus.
    pub fn load(self: &Arc<Owner>, file: &Network) -> Outcome {
        self.master.load(file)?;
        let domains = self.master.look(|draft| draft.domains().to_vec())?;
        let handles = (0..).zip(domains).map(|(number, words)| {
            self.give_child(DomainObject { owner: self.clone(), id: DomainId(number), words }) as usize
        });
        *locked(&self.domains) = handles.collect();
        Ok(())
    }

    /// The handle of a domain of a network file: always the same one.
    ///
    /// # Errors
    /// There is no such domain.
    pub fn domain(&self, id: DomainId) -> Outcome<*mut ec_domain_t> {
        let address = locked(&self.domains).get(id.0).copied().ok_or(Code::NOT_FOUND)?;
        Ok(address as *mut ec_domain_t)
    }

    /// The index of the SubDevice with a name, which is declared if it was not.
    ///
    /// # Errors
    /// Another SubDevice is declared at this place; the application is active and the SubDevice is new.
    pub fn declare(&self, name: Name) -> Outcome<usize> {
        if let Some(known) = self.master.look(|draft| draft.known(name))?? {
            return Ok(known);
        }
        let (index, is_found) = self.master.change(|draft| {
            let index = match draft.known(name)? {
                Some(known) => known,
                None => draft.add(name),
            };
            Ok((index, draft.info(index).is_some()))
        })?;
        // It may have come since the last scan that the declaration contains. A question for it takes long.
        if !is_found {
            self.master.refresh()?;
        }
        Ok(index)
    }

    /// The handle of a declared SubDevice: always the same one.
    pub fn slave(self: &Arc<Owner>, index: usize) -> *mut ec_slave_config_t {
        let mut slaves = locked(&self.slaves);
        if slaves.len() <= index {
            slaves.resize(index + 1, None);
        }
        if let Some(address) = slaves[index] {
            return address as *mut ec_slave_config_t;
        }
        let owner = self.clone();
        let handle = self.give_child(SlaveObject { owner, index, emergencies: Claim::new(None) });
        slaves[index] = Some(handle as usize);
        handle
    }
}

impl SlaveObject {
    /// Its index for the engine.
    pub fn id(&self) -> SubDeviceId {
        SubDeviceId(self.index)
    }

    /// Its emergencies.
    ///
    /// # Errors
    /// No ring was asked for; another thread uses it.
    pub fn emergencies<R>(&self, work: impl FnOnce(&EmergencyRing) -> R) -> Outcome<R> {
        self.emergencies.use_now(|ring| ring.as_ref().map(work))?.ok_or(Code::NOT_FOUND)
    }
}
