//! The first word of an EoE message: type, port and fragment flags (protocol 6.5).

/// Bytes before the data: this word and a word that depends on the type.
pub(super) const OVERHEAD: usize = 4;

pub(super) const FRAGMENT: u16 = 0;
pub(super) const TIME_STAMP_RESPONSE: u16 = 1;
pub(super) const SET_IP_REQUEST: u16 = 2;
pub(super) const SET_IP_RESPONSE: u16 = 3;
pub(super) const SET_FILTER_REQUEST: u16 = 4;
pub(super) const SET_FILTER_RESPONSE: u16 = 5;
pub(super) const GET_IP_REQUEST: u16 = 6;
pub(super) const GET_IP_RESPONSE: u16 = 7;
pub(super) const GET_FILTER_REQUEST: u16 = 8;
pub(super) const GET_FILTER_RESPONSE: u16 = 9;

pub(super) const KIND: u16 = 0x000F;
pub(super) const PORT_SHIFT: u16 = 4;
pub(super) const LAST: u16 = 1 << 8;
pub(super) const TIME_APPENDED: u16 = 1 << 9;
pub(super) const TIME_REQUESTED: u16 = 1 << 10;
