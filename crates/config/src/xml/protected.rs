//! Files that are encrypted, packed or signed (protocol ES-153): by their first bytes, by their entropy, by elements.

/// The beginnings of such files.
const BEGINNINGS: [(&[u8], &str); 5] = [
    (b"Salted__", "encrypted with a password (OpenSSL)"),
    (b"-----BEGIN", "a PEM container"),
    (&[0x30, 0x82], "a PKCS container"),
    (b"PK\x03\x04", "a ZIP archive"),
    (&[0x1F, 0x8B], "compressed with gzip"),
];

/// What the bytes of a file that is no XML are, if they are encrypted or packed.
pub(crate) fn packed(bytes: &[u8]) -> Option<&'static str> {
    let known = BEGINNINGS.iter().find(|(magic, _)| bytes.starts_with(magic)).map(|(_, what)| *what);
    known.or_else(|| is_random(bytes).then_some("random bytes"))
}

/// Whether an element belongs to XML encryption.
pub(crate) fn is_cipher(element: &str) -> bool {
    matches!(element, "EncryptedData" | "EncryptedKey" | "CipherData")
}

/// Whether an element belongs to an XML signature.
pub(crate) fn is_signature(element: &str) -> bool {
    matches!(element, "Signature" | "SignedInfo")
}

/// Whether the bytes have the entropy of random data, which text and tables do not reach.
fn is_random(bytes: &[u8]) -> bool {
    /// Number of bytes that are evaluated; fewer bytes are not significant.
    const LOOKED_AT: std::ops::RangeInclusive<usize> = 256..=4096;
    let bytes = &bytes[..bytes.len().min(*LOOKED_AT.end())];
    let mut counts = [0_u32; 256];
    bytes.iter().for_each(|byte| counts[usize::from(*byte)] += 1);
    let total = bytes.len() as u64;
    let all = counts.iter().map(|count| u64::from(*count)).filter(|count| *count > 0);
    let bits = all.map(|count| count * log2(total, count)).sum::<u64>() as f64 / (total.max(1) << FRACTION) as f64;
    // 256 random bytes have 7.2 bits each, text has less than 6.
    LOOKED_AT.contains(&bytes.len()) && bits > 6.8
}

/// Fractional bits of [`log2`].
const FRACTION: u32 = 16;

/// The logarithm of a ratio of at least 1, by squaring: libm would have to be linked into programs in C for this alone.
fn log2(total: u64, count: u64) -> u64 {
    let ratio = (total << 32) / count;
    let whole = ratio.ilog2();
    // Between 1 and 2, with 31 fractional bits.
    let mut mantissa = (ratio << (63 - whole)) >> 32;
    let mut log = u64::from(whole.saturating_sub(32));
    for _ in 0..FRACTION {
        mantissa = (mantissa * mantissa) >> 31;
        let is_two = mantissa >> 32;
        mantissa >>= is_two;
        log = log << 1 | is_two;
    }
    log
}
