//! Identification numbers of the data of a drive (protocol 6.6).

use core::fmt;
use core::str::FromStr;

/// An IDN: bit 15 distinguishes product from standard, bits 14:12 are the parameter set, bits 11:0 the number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Idn(pub u16);

const PRODUCT: u16 = 1 << 15;
const SET_SHIFT: u16 = 12;
const SET: u16 = 0x07;
const NUMBER: u16 = 0x0FFF;

impl Idn {
    /// S-set-number. Values above their range lose their upper bits.
    pub const fn standard(set: u8, number: u16) -> Idn {
        Idn((set as u16 & SET) << SET_SHIFT | number & NUMBER)
    }

    /// P-set-number. Values above their range lose their upper bits.
    pub const fn product(set: u8, number: u16) -> Idn {
        Idn(PRODUCT | Idn::standard(set, number).0)
    }

    /// Whether the IDN is a product IDN (P) of the vendor, not a standard IDN (S).
    pub const fn is_product(self) -> bool {
        self.0 & PRODUCT != 0
    }

    /// Parameter set, 0..=7.
    pub const fn set(self) -> u8 {
        (self.0 >> SET_SHIFT & SET) as u8
    }

    /// Number, 0..=4095.
    pub const fn number(self) -> u16 {
        self.0 & NUMBER
    }
}

impl fmt::Display for Idn {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kind = if self.is_product() { 'P' } else { 'S' };
        write!(f, "{kind}-{}-{:04}", self.set(), self.number())
    }
}

/// The text is no IDN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ParseIdnError;

impl fmt::Display for ParseIdnError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("expected S or P, set 0 to 7 and number 0 to 4095, as in S-0-0015")
    }
}

impl core::error::Error for ParseIdnError {}

impl FromStr for Idn {
    type Err = ParseIdnError;

    fn from_str(text: &str) -> Result<Idn, ParseIdnError> {
        let mut parts = text.split('-');
        let kind = parts.next().ok_or(ParseIdnError)?;
        let mut part = |limit: u16| {
            let text = parts.next().filter(|text| text.bytes().all(|byte| byte.is_ascii_digit()))?;
            text.parse().ok().filter(|value: &u16| *value <= limit)
        };
        let (set, number) = (part(SET).ok_or(ParseIdnError)?, part(NUMBER).ok_or(ParseIdnError)?);
        match (kind, parts.next()) {
            ("S" | "s", None) => Ok(Idn::standard(set as u8, number)),
            ("P" | "p", None) => Ok(Idn::product(set as u8, number)),
            _ => Err(ParseIdnError),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::string::ToString;

    // covers: 6.6
    #[test]
    fn bit_15_is_p_and_bits_14_to_12_are_the_set() {
        assert_eq!(Idn::standard(0, 15), Idn(0x000F));
        assert_eq!(Idn::product(2, 0x0123), Idn(0xA123));
        assert_eq!((Idn(0xA123).is_product(), Idn(0xA123).set(), Idn(0xA123).number()), (true, 2, 0x0123));
        assert_eq!((Idn(15).to_string(), Idn(0xA123).to_string()), ("S-0-0015".into(), "P-2-0291".into()));
    }

    #[test]
    fn an_invalid_idn_is_refused() {
        for text in ["", "S", "S-0", "S-8-1", "S-0-4096", "Q-0-1", "S-0-1-2", "S-+1-2", "S-0-", "S-0- 1"] {
            assert_eq!(text.parse::<Idn>(), Err(ParseIdnError), "{text}");
        }
        assert_eq!("p-0-7".parse(), Ok(Idn(0x8007)));
    }

    proptest! {
        // covers: codec-mailbox
        #[test]
        fn any_idn_reads_back(code in any::<u16>()) {
            prop_assert_eq!(Idn(code).to_string().parse(), Ok(Idn(code)));
        }
    }
}
