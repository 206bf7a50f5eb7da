//! Values of variables: words and numbers.

use std::fmt::Display;
use std::str::FromStr;

pub(super) fn yes_or_no(value: &str) -> Result<bool, String> {
    match value {
        "yes" => Ok(true),
        "no" => Ok(false),
        _ => Err(format!("expected yes or no, got {value:?}")),
    }
}

pub(super) fn number<T: FromStr + PartialOrd + Display>(text: &str, least: T, most: T) -> Result<T, String> {
    let is_plain = text.bytes().all(|it| it.is_ascii_digit());
    let number = text.parse().ok().filter(|it| is_plain && *it >= least && *it <= most);
    number.ok_or_else(|| format!("expected a number from {least} to {most}, got {text:?}"))
}
