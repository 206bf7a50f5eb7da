//! Numbers in the text of a file, and other ones in their places.

use scenarios::dice::Dice;

/// Ranges of numbers in the text of elements.
pub fn of(text: &str) -> Vec<(usize, usize)> {
    let mut found = Vec::new();
    for (at, _) in text.match_indices('>') {
        let rest = &text[at + 1..];
        let length = rest.find('<').unwrap_or(0);
        if length > 0 && rest[..length].chars().all(|c| c.is_ascii_hexdigit()) {
            found.push((at + 1, at + 1 + length));
        }
    }
    found
}

/// A file with up to three of its numbers replaced.
pub fn replaced(text: &str, numbers: &[(usize, usize)], dice: &mut Dice) -> String {
    let mut changed = text.to_owned();
    let mut places: Vec<(usize, usize)> = (0..=dice.below(3)).map(|_| *dice.pick(numbers)).collect();
    places.sort_unstable();
    places.dedup();
    for (start, end) in places.into_iter().rev() {
        let hex = changed[start..end].len() > 3 && dice.one_in(2);
        let number = match dice.below(5) {
            0 => "0".to_owned(),
            1 => "65535".to_owned(),
            2 => dice.below(300).to_string(),
            3 if hex => format!("{:016x}", dice.roll()),
            _ => dice.below(1 << 33).to_string(),
        };
        changed.replace_range(start..end, &number);
    }
    changed
}
