//! Names of data types and their CoE codes (protocol ES-76).

const NAMES: [(&str, u16); 38] = [
    ("BOOL", 0x01),
    ("SINT", 0x02),
    ("INT", 0x03),
    ("DINT", 0x04),
    ("USINT", 0x05),
    ("UINT", 0x06),
    ("UDINT", 0x07),
    ("REAL", 0x08),
    ("STRING", 0x09),
    ("OCTET_STRING", 0x0A),
    ("UNICODE_STRING", 0x0B),
    ("TIME_OF_DAY", 0x0C),
    ("TIME_DIFFERENCE", 0x0D),
    ("INT24", 0x10),
    ("LREAL", 0x11),
    ("INT40", 0x12),
    ("INT48", 0x13),
    ("INT56", 0x14),
    ("LINT", 0x15),
    ("UINT24", 0x16),
    ("UINT40", 0x18),
    ("UINT48", 0x19),
    ("UINT56", 0x1A),
    ("ULINT", 0x1B),
    ("GUID", 0x1D),
    ("BYTE", 0x1E),
    ("WORD", 0x1F),
    ("DWORD", 0x20),
    ("BITARR8", 0x2D),
    ("BITARR16", 0x2E),
    ("BITARR32", 0x2F),
    ("ARRAY_OF_INT", 0x260),
    ("ARRAY_OF_SINT", 0x261),
    ("ARRAY_OF_DINT", 0x262),
    ("ARRAY_OF_UDINT", 0x263),
    // Other spellings.
    ("BIT", 0x30),
    ("INT8", 0x02),
    ("UINT8", 0x05),
];
/// Code of BIT1; up to BIT16 they follow each other.
const BIT1: u16 = 0x30;

/// The CoE code of a type; `None` for names of a dictionary's own types.
pub fn code_of(name: &str) -> Option<u16> {
    let name = name.trim();
    if let Some((_, code)) = NAMES.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)) {
        return Some(*code);
    }
    let upper = name.to_ascii_uppercase();
    if upper.starts_with("STRING(") {
        return Some(0x09);
    }
    let bits: u16 = upper.strip_prefix("BIT")?.parse().ok()?;
    (1..=16).contains(&bits).then(|| BIT1 + bits - 1)
}

/// The name of a CoE code; empty for 0 and for codes without a name.
pub fn name_of(code: u16) -> String {
    if (BIT1..BIT1 + 16).contains(&code) {
        return format!("BIT{}", code - BIT1 + 1);
    }
    NAMES.iter().find(|(_, known)| *known == code).map(|(name, _)| (*name).to_owned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The codes of the sheet, as it lists them.
    const SHEET: &str = "BOOL 1, SINT 2, INT 3, DINT 4, USINT 5, UINT 6, UDINT 7, REAL 8, STRING 9, OCTET_STRING A, \
        UNICODE_STRING B, TIME_OF_DAY C, TIME_DIFFERENCE D, INT24 10, LREAL 11, INT40 12, INT48 13, INT56 14, LINT 15, \
        UINT24 16, UINT40 18, UINT48 19, UINT56 1A, ULINT 1B, GUID 1D, BYTE 1E, WORD 1F, DWORD 20, BITARR8 2D, \
        BITARR16 2E, BITARR32 2F, ARRAY_OF_INT 260, ARRAY_OF_SINT 261, ARRAY_OF_DINT 262, ARRAY_OF_UDINT 263";

    // covers: ES-76
    #[test]
    fn data_types_have_the_codes_of_coe() {
        let sheet = SHEET.split(", ").map(|pair| pair.split_once(' ').expect("a name and a code"));
        for (name, code) in sheet {
            let code = u16::from_str_radix(code, 16).expect("hexadecimal");
            assert_eq!((code_of(name), name_of(code).as_str()), (Some(code), name));
        }
        for bits in 1..=16 {
            let name = format!("BIT{bits}");
            assert_eq!((code_of(&name), name_of(0x2F + bits)), (Some(0x2F + bits), name));
        }
        for (name, code) in
            [("BOOL", 1), ("UDINT", 7), ("STRING(32)", 9), ("BIT2", 0x31), ("BIT16", 0x3F), ("byte", 0x1E)]
        {
            assert_eq!(code_of(name), Some(code), "{name}");
        }
        assert_eq!([code_of("DT1018"), code_of("BIT17"), code_of("")], [None; 3]);
        assert_eq!((name_of(0x31), name_of(7), name_of(0)), ("BIT2".to_owned(), "UDINT".to_owned(), String::new()));
    }
}
