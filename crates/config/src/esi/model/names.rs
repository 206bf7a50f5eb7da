//! A text in several languages.

/// Texts by LcId, in document order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names(Box<[(u32, String)]>);

/// English (USA): the default of LcId, and the second choice.
const ENGLISH: u32 = 1033;
/// Bits of an LcId that name the language without the country.
const LANGUAGE: u32 = 0x3FF;

impl Names {
    /// Texts by LcId.
    pub fn new(names: Vec<(u32, String)>) -> Names {
        Names(names.into())
    }

    /// The text in a language: the exact LcId, then the same language of another country, English, the first; empty if
    /// there is none.
    pub fn in_language(&self, lcid: u32) -> &str {
        let by = |wanted: &dyn Fn(u32) -> bool| self.0.iter().find(|(id, _)| wanted(*id));
        let found = by(&|id| id == lcid).or_else(|| by(&|id| id & LANGUAGE == lcid & LANGUAGE));
        let found = found.or_else(|| by(&|id| id == ENGLISH)).or(self.0.first());
        found.map(|(_, text)| text.as_str()).unwrap_or_default()
    }

    /// The English text, or the first.
    pub fn english(&self) -> &str {
        self.in_language(ENGLISH)
    }

    /// All texts by LcId.
    pub fn all(&self) -> &[(u32, String)] {
        &self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // covers: ES-12
    #[test]
    fn a_text_falls_back_to_its_language_then_to_english_then_to_the_first() {
        let names = |ids: &[u32]| Names::new(ids.iter().map(|id| (*id, id.to_string())).collect());
        assert_eq!(names(&[1033, 1031]).in_language(1031), "1031");
        assert_eq!(names(&[1031, 1033, 2057]).in_language(2057), "2057");
        assert_eq!(names(&[1031, 2057]).in_language(1033), "2057", "both are English");
        assert_eq!(names(&[1031, 1033]).in_language(1036), "1033");
        assert_eq!(names(&[1041, 1042]).in_language(1036), "1041");
        assert_eq!(Names::default().english(), "");
    }
}
