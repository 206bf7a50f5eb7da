//! Text behind text.

use std::fmt::{Arguments, Write};

/// `append!(text, "{a} {b}")`: writes behind a string, without a string in between.
macro_rules! append {
    ($text:expr, $($format:tt)*) => {
        $crate::append::formatted(&mut $text, format_args!($($format)*))
    };
}

pub(crate) use append;

/// See [`append!`]: one function, because each place that makes a string has to free it too.
#[inline(never)]
pub fn formatted(text: &mut String, format: Arguments<'_>) {
    // A string takes everything.
    let _ = text.write_fmt(format);
}
