//! Values of `serde` as JSON, in little code: the types of this crate are structures, lists, numbers and texts.
//!
//! `serde_json` would make the tool a twentieth larger. Tests compare with it.

use std::fmt::{self, Display, Write};

use ringcat_control::is_hidden;
use serde::ser::{Error, Impossible, Serialize, SerializeSeq, SerializeStruct, SerializeTuple, Serializer};

use crate::hex;

/// A value of a kind that no type here has.
#[derive(Debug, PartialEq, Eq)]
pub struct Unsupported;

impl Display for Unsupported {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value of a kind that has no JSON here")
    }
}

impl std::error::Error for Unsupported {}

impl Error for Unsupported {
    fn custom<T: Display>(_: T) -> Unsupported {
        Unsupported
    }
}

/// This many digits identify every number of 64 bits.
const MOST_DIGITS: usize = 17;

/// A text of JSON that grows.
pub struct Writer {
    text: String,
    /// The next structure goes on with the object that is open.
    is_within: bool,
}

impl Writer {
    /// An object with these keys, which a structure goes on with.
    pub fn object(schema_version: u32, command: &str) -> Writer {
        let mut writer = Writer { text: String::from("{"), is_within: true };
        writer.key("schema_version");
        writer.number(&schema_version);
        writer.key("command");
        writer.quoted(command);
        writer
    }

    /// Its text.
    pub fn into_text(self) -> String {
        self.text
    }

    /// A comma where a value or key is not the first.
    fn separate(&mut self) {
        if !self.text.ends_with(['{', '[']) {
            self.text.push(',');
        }
    }

    fn key(&mut self, name: &str) {
        self.separate();
        self.quoted(name);
        self.text.push(':');
    }

    fn quoted(&mut self, text: &str) {
        self.text.push('"');
        for it in text.chars() {
            match it {
                '"' | '\\' => self.text.extend(['\\', it]),
                it if it < ' ' || is_hidden(it) => {
                    for unit in it.encode_utf16(&mut [0; 2]) {
                        // Writing to a string cannot fail.
                        _ = write!(self.text, "\\u{:04x}", u32::from(*unit));
                    }
                }
                it => self.text.push(it),
            }
        }
        self.text.push('"');
    }

    fn number(&mut self, value: &dyn Display) {
        _ = write!(self.text, "{value}");
    }

    /// A number with the fewest digits that `is_exact` accepts: read back, they give the number. JSON has finite ones
    /// only.
    /// The standard library has code of its own for this, which nothing else of the tool needs.
    fn float(&mut self, value: f64, is_exact: &dyn Fn(&str) -> bool) {
        if !value.is_finite() {
            return self.text.push_str("null");
        }
        let begin = self.text.len();
        for digits in 0..MOST_DIGITS {
            self.text.truncate(begin);
            _ = write!(self.text, "{value:.digits$e}");
            if is_exact(&self.text[begin..]) {
                break;
            }
        }
    }

    fn begin(&mut self, bracket: char) {
        if bracket == '[' || !std::mem::take(&mut self.is_within) {
            self.text.push(bracket);
        }
    }
}

type Done = Result<(), Unsupported>;

macro_rules! numbers {
    ($($name:ident $kind:ty),*) => {
        $(fn $name(self, value: $kind) -> Done {
            self.number(&value);
            Ok(())
        })*
    };
}

macro_rules! unsupported {
    ($($name:ident($($kind:ty),*) -> $value:ty;)*) => {
        $(fn $name(self, $(_: $kind),*) -> Result<$value, Unsupported> {
            Err(Unsupported)
        })*
    };
}

impl Serializer for &mut Writer {
    type Ok = ();
    type Error = Unsupported;
    type SerializeSeq = Self;
    type SerializeTuple = Self;
    type SerializeStruct = Self;
    type SerializeTupleStruct = Impossible<(), Unsupported>;
    type SerializeTupleVariant = Impossible<(), Unsupported>;
    type SerializeMap = Impossible<(), Unsupported>;
    type SerializeStructVariant = Impossible<(), Unsupported>;

    numbers!(serialize_i8 i8, serialize_i16 i16, serialize_i32 i32, serialize_i64 i64);
    numbers!(serialize_u8 u8, serialize_u16 u16, serialize_u32 u32, serialize_u64 u64, serialize_bool bool);

    fn serialize_f32(self, value: f32) -> Done {
        self.float(value.into(), &|text| text.parse() == Ok(value));
        Ok(())
    }

    fn serialize_f64(self, value: f64) -> Done {
        self.float(value, &|text| text.parse() == Ok(value));
        Ok(())
    }

    fn serialize_str(self, value: &str) -> Done {
        self.quoted(value);
        Ok(())
    }

    /// As hexadecimal digits.
    fn serialize_bytes(self, value: &[u8]) -> Done {
        self.text.push('"');
        hex::put_digits(&mut self.text, value);
        self.text.push('"');
        Ok(())
    }

    fn serialize_none(self) -> Done {
        self.text.push_str("null");
        Ok(())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Done {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Done {
        self.serialize_none()
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, name: &'static str) -> Done {
        self.serialize_str(name)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(self, _: &'static str, value: &T) -> Done {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(self, _: &'static str, _: u32, _: &'static str, _: &T) -> Done {
        Err(Unsupported)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Self, Unsupported> {
        self.begin('[');
        Ok(self)
    }

    fn serialize_tuple(self, _: usize) -> Result<Self, Unsupported> {
        self.begin('[');
        Ok(self)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self, Unsupported> {
        self.begin('{');
        Ok(self)
    }

    unsupported! {
        serialize_char(char) -> ();
        serialize_unit_struct(&'static str) -> ();
        serialize_map(Option<usize>) -> Self::SerializeMap;
        serialize_tuple_struct(&'static str, usize) -> Self::SerializeTupleStruct;
        serialize_tuple_variant(&'static str, u32, &'static str, usize) -> Self::SerializeTupleVariant;
        serialize_struct_variant(&'static str, u32, &'static str, usize) -> Self::SerializeStructVariant;
    }
}

impl SerializeSeq for &mut Writer {
    type Ok = ();
    type Error = Unsupported;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Done {
        self.separate();
        value.serialize(&mut **self)
    }

    fn end(self) -> Done {
        self.text.push(']');
        Ok(())
    }
}

impl SerializeTuple for &mut Writer {
    type Ok = ();
    type Error = Unsupported;

    fn serialize_element<T: Serialize + ?Sized>(&mut self, value: &T) -> Done {
        SerializeSeq::serialize_element(self, value)
    }

    fn end(self) -> Done {
        SerializeSeq::end(self)
    }
}

impl SerializeStruct for &mut Writer {
    type Ok = ();
    type Error = Unsupported;

    fn serialize_field<T: Serialize + ?Sized>(&mut self, name: &'static str, value: &T) -> Done {
        self.key(name);
        value.serialize(&mut **self)
    }

    fn end(self) -> Done {
        self.text.push('}');
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data_types::Scalar;
    use serde::Serialize;
    use serde_json::Value;

    #[derive(Serialize)]
    struct Outer<'a> {
        text: &'a str,
        list: Vec<Inner>,
        nothing: Option<u8>,
        some: Option<Inner>,
        empty: Vec<u8>,
        pair: [u8; 2],
    }

    #[derive(Serialize)]
    struct Inner {
        number: Scalar,
        large: u64,
        small: i64,
        is: bool,
    }

    fn inner(number: Scalar) -> Inner {
        Inner { number, large: u64::MAX, small: i64::MIN, is: true }
    }

    fn written(value: &impl Serialize) -> String {
        let mut writer = Writer::object(7, "a\"b");
        value.serialize(&mut writer).expect("it has JSON");
        writer.into_text()
    }

    // covers: daemon, json
    #[test]
    fn what_is_written_is_what_serde_json_writes() {
        let texts: [String; 4] = [
            String::new(),
            (0..=0x100).filter_map(char::from_u32).collect(),
            "\u{2028}\u{FEFF}\u{10FFFF}{[,".to_owned(),
            "}]\"\\".to_owned(),
        ];
        for text in texts {
            let floats = [0.0, -0.0, 0.1, 1.0, 1e300, -5e-324, f64::MAX, f64::NAN, f64::INFINITY];
            let singles = [0.1, 1.0, -1e38, f32::MIN_POSITIVE, f32::NEG_INFINITY];
            let scalars = floats.map(Scalar::Double).into_iter().chain(singles.map(Scalar::Float));
            let more = [Scalar::Nothing, Scalar::Text(text.clone()), Scalar::Signed(-1), Scalar::Unsigned(1)];
            let value = Outer {
                text: &text,
                list: scalars.chain(more).map(inner).collect(),
                nothing: None,
                some: Some(inner(Scalar::Nothing)),
                empty: Vec::new(),
                pair: [1, 2],
            };
            let own: Value = serde_json::from_str(&written(&value)).expect("it is JSON");
            let mut wanted = serde_json::to_value(&value).expect("it is JSON");
            wanted["schema_version"] = 7.into();
            wanted["command"] = "a\"b".into();
            // As a number of 32 bits is the shortest text, and another one of 64 bits.
            let theirs = serde_json::to_string(&value).expect("it is JSON");
            let theirs: Value = serde_json::from_str(&theirs).expect("it is JSON");
            wanted["list"] = theirs["list"].clone();
            assert_eq!(own, wanted);
        }
    }

    // covers: daemon, json
    #[test]
    fn a_line_is_one_line_and_kinds_without_json_are_refused() {
        let value = inner(Scalar::Text("a\nb\r\u{7f}\u{9b}\u{200f}\u{2028}\u{e0001}".to_owned()));
        let text = "{\"schema_version\":7,\"command\":\"a\\\"b\",\"number\":\
                    \"a\\u000ab\\u000d\\u007f\\u009b\\u200f\\u2028\\udb40\\udc01\",\
                    \"large\":18446744073709551615,\"small\":-9223372036854775808,\"is\":true}";
        assert_eq!(written(&value), text);
        let map = std::collections::BTreeMap::from([(1, 2)]);
        assert_eq!(map.serialize(&mut Writer::object(1, "x")), Err(Unsupported));
        assert_eq!('c'.serialize(&mut Writer::object(1, "x")), Err(Unsupported));
    }
}
