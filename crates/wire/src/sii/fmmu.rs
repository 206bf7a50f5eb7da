//! Category FMMU: one byte per FMMU, its usage (protocol 4.2).

/// Usage of an FMMU.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FmmuUsage {
    /// 0x00 or 0xFF: unused. Written as 0x00.
    Unused,
    /// 1: process data outputs.
    Outputs,
    /// 2: process data inputs.
    Inputs,
    /// 3: status of the mailbox that the MainDevice reads.
    MailboxStatus,
    /// Any other code.
    Other(u8),
}

impl FmmuUsage {
    /// From the byte of the category.
    pub const fn from_code(code: u8) -> FmmuUsage {
        match code {
            0 | 0xFF => FmmuUsage::Unused,
            1 => FmmuUsage::Outputs,
            2 => FmmuUsage::Inputs,
            3 => FmmuUsage::MailboxStatus,
            code => FmmuUsage::Other(code),
        }
    }

    /// The byte of the category.
    pub const fn code(self) -> u8 {
        match self {
            FmmuUsage::Unused => 0,
            FmmuUsage::Outputs => 1,
            FmmuUsage::Inputs => 2,
            FmmuUsage::MailboxStatus => 3,
            FmmuUsage::Other(code) => code,
        }
    }
}

/// Iterator over the bytes of a category, FMMU 0 first.
#[derive(Clone, Debug)]
pub struct FmmuUsages<'a> {
    data: &'a [u8],
}

impl<'a> FmmuUsages<'a> {
    /// Reads the data of a category.
    pub const fn new(data: &'a [u8]) -> FmmuUsages<'a> {
        FmmuUsages { data }
    }
}

impl Iterator for FmmuUsages<'_> {
    type Item = FmmuUsage;

    fn next(&mut self) -> Option<FmmuUsage> {
        let (code, rest) = self.data.split_first()?;
        self.data = rest;
        Some(FmmuUsage::from_code(*code))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    // covers: 4.2, codec-sii
    #[test]
    fn each_byte_is_one_fmmu() {
        let usages: Vec<_> = FmmuUsages::new(&[1, 2, 3, 0, 0xFF, 4]).collect();
        let expected = [
            FmmuUsage::Outputs,
            FmmuUsage::Inputs,
            FmmuUsage::MailboxStatus,
            FmmuUsage::Unused,
            FmmuUsage::Unused,
            FmmuUsage::Other(4),
        ];
        assert_eq!(usages, expected);
    }

    #[test]
    fn every_code_but_ff_is_written_as_it_was_read() {
        for code in 0..0xFF {
            assert_eq!(FmmuUsage::from_code(code).code(), code);
        }
        assert_eq!(FmmuUsage::from_code(0xFF).code(), 0);
    }
}
