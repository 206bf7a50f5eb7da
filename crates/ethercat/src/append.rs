//! Appends formatted text to a string.

use std::fmt::{Arguments, Write};

/// `append!(text, "{a} {b}")`: appends to a string, without a temporary string.
macro_rules! append {
    ($text:expr, $($format:tt)*) => {
        $crate::append::formatted(&mut $text, format_args!($($format)*))
    };
}

pub(crate) use append;

/// See [`append!`]: one function, because each place that makes a string has to free it too.
#[inline(never)]
pub fn formatted(text: &mut String, format: Arguments<'_>) {
    // Writing to a string cannot fail.
    let _ = text.write_fmt(format);
}
