//! Where the loader of programs finds the library: the cache that `ldconfig` writes (glibc, since version 2.2).
//!
//! A header with the number of entries, entries with two places of text each (name and path), texts that end with a
//! zero. A file may hold anything: what does not fit is left out.

/// The cache.
pub const PATH: &str = "/etc/ld.so.cache";
/// The name that programs are linked against.
pub const NAME: &str = "libethercat.so.1";

const MAGIC: &[u8] = b"glibc-ld.so.cache1.1";
const HEADER: usize = 48;
const ENTRY: usize = 24;
/// Most paths that are returned; a machine has a few.
const MOST: usize = 64;

/// Paths of the library, in the order of the cache.
pub fn places(cache: &[u8]) -> Vec<String> {
    let Some(begin) = cache.windows(MAGIC.len()).position(|bytes| bytes == MAGIC) else { return Vec::new() };
    let cache = &cache[begin..];
    let word = |at: usize| cache.get(at..at + 4).and_then(|bytes| bytes.try_into().ok()).map(u32::from_ne_bytes);
    let text = |at: u32| {
        let bytes = cache.get(at as usize..)?;
        std::str::from_utf8(bytes.split(|byte| *byte == 0).next()?).ok()
    };
    let entries = cache.get(HEADER..).unwrap_or_default().chunks_exact(ENTRY).len();
    let count = word(MAGIC.len()).map_or(0, |count| (count as usize).min(entries));
    let entry = |number: usize| {
        let at = HEADER + number * ENTRY;
        let (name, path) = (text(word(at + 4)?)?, text(word(at + 8)?)?);
        (name == NAME && path.starts_with('/')).then(|| path.to_owned())
    };
    (0..count).filter_map(entry).take(MOST).collect()
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A cache with these names and paths.
    pub fn cache(entries: &[(&str, &str)]) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend((entries.len() as u32).to_ne_bytes());
        bytes.resize(HEADER, 0);
        let (mut texts, begin) = (Vec::new(), HEADER + ENTRY * entries.len());
        for (name, path) in entries {
            let mut note = |text: &str| {
                let at = (begin + texts.len()) as u32;
                texts.extend(text.bytes().chain([0]));
                at
            };
            let words = [3, note(name), note(path), 0, 0, 0];
            bytes.extend(words.iter().flat_map(|word| word.to_ne_bytes()));
        }
        bytes.extend(texts);
        bytes
    }

    // covers: bench
    #[test]
    fn the_loader_cache_gives_paths_of_the_library_in_its_order() {
        let entries = [("libc.so.6", "/lib/libc.so.6"), (NAME, "/opt/etherlab/lib/x"), (NAME, "/usr/lib/y")];
        let whole = cache(&entries);
        assert_eq!(places(&whole), ["/opt/etherlab/lib/x", "/usr/lib/y"]);
        let mut behind_old = b"ld.so-1.7.0\0".to_vec();
        behind_old.extend(&whole);
        assert_eq!(places(&behind_old).len(), 2);
        for length in 0..whole.len() {
            assert!(places(&whole[..length]).len() <= 2);
        }
        let mut wild = whole.clone();
        wild[20..24].fill(0xff);
        wild[HEADER..].fill(0xff);
        assert!(places(&wild).is_empty() && places(&[0; 4_096]).is_empty());
        if let Ok(real) = std::fs::read(PATH) {
            assert!(real.windows(MAGIC.len()).any(|bytes| bytes == MAGIC), "this glibc writes another format");
            let _ = places(&real);
        }
    }
}
