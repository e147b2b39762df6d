//! One thing that is wrong with a graph, and where.

use std::ops::Range;

#[derive(Clone, Debug, Default, PartialEq)]
pub struct Problem {
    /// What was found and what was expected.
    pub message: String,
    /// What to do about it; empty when nothing useful can be said.
    pub help: String,
    /// JSON pointer of the place in the recipe; empty for the whole of it.
    pub pointer: String,
    /// Where that is in the text; `None` for what is not written there (a value from the command line).
    pub place: Option<Place>,
}

/// A stretch of the recipe's text.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Place {
    /// Counted from 1.
    pub line: usize,
    /// In characters, counted from 1.
    pub column: usize,
    /// In bytes.
    pub range: Range<usize>,
}

impl Place {
    /// The place of a byte range, which is moved onto character boundaries inside the text.
    pub fn of(text: &str, range: Range<usize>) -> Self {
        let start = text.floor_char_boundary(range.start.min(text.len()));
        let end = text.ceil_char_boundary(range.end.clamp(start, text.len()));
        let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
        Self {
            line: 1 + text[..start].matches('\n').count(),
            column: 1 + text[line_start..start].chars().count(),
            range: start..end,
        }
    }
}

impl std::fmt::Display for Problem {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(place) = &self.place {
            write!(f, "{}:{}: ", place.line, place.column)?;
        }
        f.write_str(&self.message)?;
        if self.help.is_empty() { Ok(()) } else { write!(f, " ({})", self.help) }
    }
}

/// All problems, one a line, each with its line and column in front.
pub fn summary(problems: &[Problem]) -> String {
    problems.iter().map(Problem::to_string).collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_count_characters_and_stay_inside_the_text() {
        let text = "ab\nüx!\n";
        let place = Place::of(text, 5..6);
        assert_eq!((place.line, place.column, &text[place.range]), (2, 2, "x"));
        assert_eq!(Place::of(text, 4..4).range, 3..5, "half a character grows to the whole of it");
        assert_eq!(Place::of(text, 90..99).range, 8..8);
    }
}
