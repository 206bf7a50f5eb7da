//! Process data by index or name, with its type: its place is determined once, before the cycles.
//!
//! [`Application::input`] and [`Application::output`] check that the object is mapped, in which direction and with how
//! many bits, and hand out an [`Input`] or [`Output`] that [`ProcessData::get`](crate::ProcessData::get) and
//! [`ProcessData::set`](crate::ProcessData::set) use without a further check. An input cannot be set: that does not
//! compile.

mod bits;
mod error;
mod place;
mod search;
mod write;

use ringcat_engine::info::Direction;
use ringcat_engine::main_device::SubDeviceId;

pub use bits::{DoesNotFit, OutputBits};
pub(crate) use bits::{signed, unsigned};
pub use error::{MapError, MappedObject, Wanted};
pub use place::{Input, Mapped, Output};
pub use ringcat_engine::main_device::ObjectOf;
pub use write::WriteError;

use crate::acyclic::AcyclicHalf;
use crate::application::Application;
use crate::links::Links;
use crate::value::Number;
use search::Search;

impl<L: Links, H: AcyclicHalf> Application<L, H> {
    /// The input with this object, sent by a declared SubDevice. Not for the cyclic path: this and the following
    /// methods allocate.
    ///
    /// ```
    /// # use std::time::Duration;
    /// # use ringcat::simulated::SimulatedSegment;
    /// # use ringcat::{Declaration, MainDevice, Options, SubDeviceConfig};
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let segment = SimulatedSegment::from_toml("[segment]\n[[device]]\ntype = \"servo\"\n")?;
    /// let mut main_device = MainDevice::request(segment, &Options::default());
    /// main_device.scan()?;
    /// let mut declaration = Declaration::new(Duration::from_millis(1));
    /// let drive = declaration.add(SubDeviceConfig::at_position(0));
    /// let application = main_device.activate(declaration)?;
    ///
    /// let actual = application.input::<i32>(drive, 0x6064, 0)?;
    /// let target = application.output_named::<i32>(drive, "Target position")?;
    /// // Errors say what is mapped.
    /// let wrong = application.output::<i16>(drive, 0x6064, 0).unwrap_err();
    /// assert!(wrong.to_string().contains("0x6064:00 \"Feedback.Position\" is an input"), "{wrong}");
    /// # let _ = (actual, target);
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// There is no such SubDevice, the object is not mapped, or it has another direction or number of bits.
    pub fn input<T: Number>(&self, subdevice: SubDeviceId, index: u16, sub_index: u8) -> Result<Input<T>, MapError> {
        let entry = self.search(subdevice)?.typed::<T>(&Wanted::Index { index, sub_index }, Direction::Inputs)?;
        Ok(Input::new(entry))
    }

    /// The output with this object, received by a declared SubDevice; as [`Application::input`].
    ///
    /// # Errors
    /// As [`Application::input`].
    pub fn output<T: Number>(&self, subdevice: SubDeviceId, index: u16, sub_index: u8) -> Result<Output<T>, MapError> {
        let entry = self.search(subdevice)?.typed::<T>(&Wanted::Index { index, sub_index }, Direction::Outputs)?;
        Ok(Output::new(entry))
    }

    /// The input with this name in the SII or dictionary of a declared SubDevice: `"Position"`, or with the PDO's name
    /// before it if several objects have the name, `"Channel 1.Input"`.
    ///
    /// # Errors
    /// As [`Application::input`], or the name is not unique.
    pub fn input_named<T: Number>(&self, subdevice: SubDeviceId, name: &str) -> Result<Input<T>, MapError> {
        let entry = self.search(subdevice)?.typed::<T>(&Wanted::Name(name.to_owned()), Direction::Inputs)?;
        Ok(Input::new(entry))
    }

    /// The output with this name; as [`Application::input_named`].
    ///
    /// # Errors
    /// As [`Application::input_named`].
    pub fn output_named<T: Number>(&self, subdevice: SubDeviceId, name: &str) -> Result<Output<T>, MapError> {
        let entry = self.search(subdevice)?.typed::<T>(&Wanted::Name(name.to_owned()), Direction::Outputs)?;
        Ok(Output::new(entry))
    }

    /// An output with any number of bits up to 64, whose values are checked when they are set.
    ///
    /// # Errors
    /// As [`Application::output`].
    pub fn output_bits(&self, subdevice: SubDeviceId, index: u16, sub_index: u8) -> Result<OutputBits, MapError> {
        self.search(subdevice)?.bits(&Wanted::Index { index, sub_index }, Direction::Outputs)
    }

    /// All mapped objects of a declared SubDevice, in the order of its SyncManagers.
    ///
    /// # Errors
    /// There is no such SubDevice.
    pub fn mapped(&self, subdevice: SubDeviceId) -> Result<Vec<MappedObject>, MapError> {
        Ok(self.search(subdevice)?.into_mapped())
    }

    fn search(&self, subdevice: SubDeviceId) -> Result<Search, MapError> {
        Search::new(self.directory(), subdevice, self.acyclic.info(subdevice))
    }
}
