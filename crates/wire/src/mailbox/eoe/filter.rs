//! The MAC address filter of an EoE SubDevice (protocol 6.5).

use super::{FieldWriter, PayloadError, split};

/// Maximum number of addresses: the count has four bits.
const MAX_ADDRESSES: usize = 15;
/// Maximum number of masks: the count has two bits.
const MAX_MASKS: usize = 3;
/// Slots for addresses and masks in the message.
const ADDRESS_PLACES: usize = 16;
const MASK_PLACES: usize = 4;
const MAC_LEN: usize = 6;
const NO_BROADCAST: u16 = 1 << 7;

/// The filter settings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AddressFilter {
    /// Broadcasts do not pass.
    pub no_broadcast: bool,
    addresses: [[u8; MAC_LEN]; MAX_ADDRESSES],
    address_count: u8,
    masks: [[u8; MAC_LEN]; MAX_MASKS],
    mask_count: u8,
}

impl AddressFilter {
    /// A filter with these addresses and masks; `None` with more than 15 addresses or 3 masks.
    pub fn new(addresses: &[[u8; MAC_LEN]], masks: &[[u8; MAC_LEN]], no_broadcast: bool) -> Option<AddressFilter> {
        let mut filter = AddressFilter {
            no_broadcast,
            address_count: addresses.len() as u8,
            mask_count: masks.len() as u8,
            ..AddressFilter::default()
        };
        filter.addresses.get_mut(..addresses.len())?.copy_from_slice(addresses);
        filter.masks.get_mut(..masks.len())?.copy_from_slice(masks);
        Some(filter)
    }

    /// The addresses.
    pub fn addresses(&self) -> &[[u8; MAC_LEN]] {
        &self.addresses[..usize::from(self.address_count)]
    }

    /// The masks.
    pub fn masks(&self) -> &[[u8; MAC_LEN]] {
        &self.masks[..usize::from(self.mask_count)]
    }

    pub(super) fn decode(data: &[u8]) -> Result<AddressFilter, PayloadError> {
        let (options, rest) = split(data, "EoE address filter")?;
        let options = u16::from_le_bytes(*options);
        let (addresses, rest) = split::<{ ADDRESS_PLACES * MAC_LEN }>(rest, "EoE filter addresses")?;
        let (masks, _) = split::<{ MASK_PLACES * MAC_LEN }>(rest, "EoE filter masks")?;
        let mut filter = AddressFilter {
            no_broadcast: options & NO_BROADCAST != 0,
            address_count: (options & 0x0F) as u8,
            mask_count: (options >> 4 & 0x03) as u8,
            ..AddressFilter::default()
        };
        let (address_count, mask_count) = (usize::from(filter.address_count), usize::from(filter.mask_count));
        for (place, bytes) in filter.addresses.iter_mut().take(address_count).zip(addresses.chunks_exact(MAC_LEN)) {
            place.copy_from_slice(bytes);
        }
        for (place, bytes) in filter.masks.iter_mut().take(mask_count).zip(masks.chunks_exact(MAC_LEN)) {
            place.copy_from_slice(bytes);
        }
        Ok(filter)
    }

    pub(super) fn encode(&self, writer: &mut FieldWriter<'_>) -> Option<()> {
        let broadcast = if self.no_broadcast { NO_BROADCAST } else { 0 };
        writer.put_u16(u16::from(self.address_count) | u16::from(self.mask_count) << 4 | broadcast)?;
        for address in &self.addresses {
            writer.put(address)?;
        }
        writer.put(&[0; MAC_LEN * (ADDRESS_PLACES - MAX_ADDRESSES)])?;
        for mask in &self.masks {
            writer.put(mask)?;
        }
        writer.put(&[0; MAC_LEN * (MASK_PLACES - MAX_MASKS)])
    }
}
