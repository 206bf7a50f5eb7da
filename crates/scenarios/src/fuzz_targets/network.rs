//! Network files and any bytes: every file is a network with a canonical text that gives the same network, or an error.

use ringcat_config::network::NetworkFile;

use crate::dice::Dice;

/// A file with all keys.
pub const WHOLE: &str = include_str!("../../../config/tests/files/whole.network.toml");

/// Reads a file, its configuration, and its canonical text.
pub fn target(bytes: &[u8]) {
    let _ = is_read(bytes);
}

/// The same; returns whether the file was read.
pub fn is_read(bytes: &[u8]) -> bool {
    let file = match NetworkFile::read("any.toml", bytes) {
        Ok(file) => file,
        Err(error) => {
            assert!(error.to_string().starts_with("any.toml:"), "{error}");
            return false;
        }
    };
    let text = file.to_text();
    let again = NetworkFile::read("again.toml", text.as_bytes()).expect("a canonical text is valid");
    assert_eq!(again.to_text(), text);
    assert_eq!(again.digest(), file.digest());
    let (configuration, same) = (file.configuration(), again.configuration());
    assert_eq!(configuration.declaration.subdevices, same.declaration.subdevices);
    assert_eq!(configuration.image, same.image);
    true
}

/// Values of other types and sizes.
const VALUES: [&str; 12] =
    ["0", "1", "-1", "255", "65536", "4294967296", "true", "\"\"", "\"Drive\"", "\"1ms\"", "[]", "{ index = 1 }"];

/// One to three changes of lines: a line less, twice or at another place, another value, another digit.
pub fn mutate(text: &str, dice: &mut Dice) -> String {
    let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
    for _ in 0..=dice.below(2) {
        let at = dice.below(lines.len() as u64) as usize;
        match dice.below(8) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(at, lines[dice.below(lines.len() as u64) as usize].clone()),
            2 => lines.swap(at, 0),
            3 => {
                if let Some((key, _)) = lines[at].split_once(" = ") {
                    lines[at] = format!("{key} = {}", dice.pick(&VALUES));
                }
            }
            _ => {
                let digits: Vec<usize> = lines[at].match_indices(|c: char| c.is_ascii_digit()).map(|it| it.0).collect();
                if !digits.is_empty() {
                    let digit = *dice.pick(&digits);
                    lines[at].replace_range(digit..=digit, &dice.below(10).to_string());
                }
            }
        }
    }
    lines.join("\n")
}
