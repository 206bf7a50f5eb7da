//! Lists of processors as the kernel writes them: `0-3,5`.

use std::fmt;
use std::str::FromStr;

/// Largest number of a processor that a kernel can be built for.
const LARGEST: u32 = 8_191;

/// Processors, as ranges in their order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ProcessorList(Vec<(u32, u32)>);

impl FromStr for ProcessorList {
    type Err = ();

    fn from_str(text: &str) -> Result<ProcessorList, ()> {
        let number = |text: &str| text.parse::<u32>().ok().filter(|number| *number <= LARGEST).ok_or(());
        let range = |text: &str| match text.split_once('-') {
            Some((first, last)) => Ok((number(first)?, number(last)?)),
            None => number(text).map(|number| (number, number)),
        };
        let text = text.trim();
        let ranges: Vec<(u32, u32)> = match text.is_empty() {
            true => Vec::new(),
            false => text.split(',').map(range).collect::<Result<_, ()>>()?,
        };
        let is_ordered = ranges.iter().all(|(first, last)| first <= last);
        if is_ordered && ranges.windows(2).all(|two| two[0].1 < two[1].0) { Ok(ProcessorList(ranges)) } else { Err(()) }
    }
}

impl fmt::Display for ProcessorList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, (first, last)) in self.0.iter().enumerate() {
            let comma = if at > 0 { "," } else { "" };
            match first == last {
                true => write!(f, "{comma}{first}")?,
                false => write!(f, "{comma}{first}-{last}")?,
            }
        }
        Ok(())
    }
}

impl ProcessorList {
    /// Their numbers.
    pub fn iter(&self) -> impl Iterator<Item = u32> + '_ {
        self.0.iter().flat_map(|(first, last)| *first..=*last)
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.iter().count()
    }

    /// The one with the largest number.
    pub fn last(&self) -> Option<u32> {
        self.0.last().map(|(_, last)| *last)
    }

    /// Whether a processor is in both lists.
    pub fn meets(&self, other: &ProcessorList) -> bool {
        self.0.iter().any(|one| other.0.iter().any(|two| one.0 <= two.1 && two.0 <= one.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: bench
    #[test]
    fn lists_of_processors_are_read_as_the_kernel_writes_them() {
        let list = |text: &str| text.parse::<ProcessorList>();
        for (text, count, last) in
            [("", 0, None), ("0", 1, Some(0)), ("0-3,5\n", 5, Some(5)), ("0-8191", 8_192, Some(8_191))]
        {
            let found = list(text).expect("the kernel writes this");
            assert_eq!((found.count(), found.last(), found.to_string().as_str()), (count, last, text.trim()), "{text}");
        }
        for wrong in ["-", "1-", "a", "3-1", "0-4294967295", "1,0", "0,,1", "(null)", "0-3:1/2"] {
            assert_eq!(list(wrong), Err(()), "{wrong}");
        }
        let meet = |a: &str, b: &str| list(a).is_ok_and(|a| list(b).is_ok_and(|b| a.meets(&b)));
        assert!(meet("0-3", "3") && meet("2,7", "0-1,5-9") && !meet("0-3", "4") && !meet("", "0"));
    }
}
