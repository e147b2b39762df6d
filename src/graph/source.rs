//! The text of a recipe, and where in it each part of its JSON lies.

use super::problem::{Place, Problem};
use serde_json::Value as Json;
use std::collections::HashMap;
use std::ops::Range;

/// Strict JSON with byte ranges.
pub struct Source {
    pub text: String,
    /// By JSON pointer: the key (of a member of an object) and the value.
    ranges: HashMap<String, (Option<Range<usize>>, Range<usize>)>,
}

/// Which part of a member of an object is meant.
#[derive(Clone, Copy, PartialEq)]
pub enum Part {
    Key,
    Value,
}

/// A step down in a JSON pointer (RFC 6901).
pub fn child(pointer: &str, name: &str) -> String {
    format!("{pointer}/{}", name.replace('~', "~0").replace('/', "~1"))
}

impl Source {
    /// Reads strict JSON: no comments, no trailing commas, numbers that are finite, at most 128 levels.
    ///
    /// # Errors
    /// The first thing that is no JSON. Names that are given twice are not an error here, but are returned beside the
    /// source and its JSON.
    pub fn parse(text: &str) -> Result<(Self, Json, Vec<Problem>), Problem> {
        // serde_json is the judge of what is JSON; the second parser only tells where things are.
        let root: Json = serde_json::from_str(text).map_err(|error| syntax_problem(text, &error))?;
        let mut source = Self { text: text.to_owned(), ranges: HashMap::new() };
        let mut problems = Vec::new();
        let options = jsonc_parser::ParseOptions {
            allow_comments: false,
            allow_loose_object_property_names: false,
            allow_trailing_commas: false,
        };
        if let Ok(parsed) = jsonc_parser::parse_to_ast(text, &Default::default(), &options)
            && let Some(value) = &parsed.value
        {
            source.walk(String::new(), None, value, &mut problems);
        }
        Ok((source, root, problems))
    }

    fn walk(
        &mut self,
        pointer: String,
        key: Option<Range<usize>>,
        value: &jsonc_parser::ast::Value,
        problems: &mut Vec<Problem>,
    ) {
        use jsonc_parser::ast::Value;
        use jsonc_parser::common::Ranged;
        match value {
            Value::Object(object) => {
                for property in &object.properties {
                    let name = property.name.as_str();
                    let range = property.name.range();
                    let inner = child(&pointer, name);
                    if self.ranges.contains_key(&inner) {
                        // The first is forgotten, so that what both hold is not given twice as well.
                        let inside = format!("{inner}/");
                        self.ranges.retain(|pointer, _| !pointer.starts_with(&inside));
                        problems.push(Problem {
                            message: format!("\"{name}\" is given twice"),
                            help: "keep one of the two".to_owned(),
                            pointer: inner.clone(),
                            place: Some(Place::of(&self.text, range.start..range.end)),
                        });
                    }
                    self.walk(inner, Some(range.start..range.end), &property.value, problems);
                }
            }
            Value::Array(array) => {
                for (index, element) in array.elements.iter().enumerate() {
                    self.walk(format!("{pointer}/{index}"), None, element, problems);
                }
            }
            _ => {}
        }
        self.ranges.insert(pointer, (key, value.start()..value.end()));
    }

    /// The place of what a pointer names, or of the nearest part around it that is written.
    pub fn place(&self, pointer: &str, part: Part) -> Option<Place> {
        let mut pointer = pointer;
        let mut part = part;
        loop {
            if let Some((key, value)) = self.ranges.get(pointer) {
                let range = key.clone().filter(|_| part == Part::Key).unwrap_or_else(|| value.clone());
                return Some(Place::of(&self.text, range));
            }
            pointer = &pointer[..pointer.rfind('/')?];
            // Something is missing inside of this: its name says where.
            part = Part::Key;
        }
    }

    pub fn problem(&self, pointer: &str, part: Part, message: impl Into<String>, help: impl Into<String>) -> Problem {
        Problem {
            message: message.into(),
            help: help.into(),
            pointer: pointer.to_owned(),
            place: self.place(pointer, part),
        }
    }
}

fn syntax_problem(text: &str, error: &serde_json::Error) -> Problem {
    let line_start = match error.line() {
        0 | 1 => 0,
        line => text.match_indices('\n').nth(line - 2).map_or(text.len(), |(at, _)| at + 1),
    };
    let at = text.floor_char_boundary((line_start + error.column().saturating_sub(1)).min(text.len()));
    let message = error.to_string();
    let message = message.split(" at line ").next().unwrap_or(&message);
    let help = if text.trim().is_empty() {
        "the file is empty".to_owned()
    } else if error.is_eof() {
        "the file ends too early: it may have been cut short".to_owned()
    } else if text.starts_with('\u{feff}') {
        "save the file as UTF-8 without a byte order mark".to_owned()
    } else if text[at..].starts_with("//") || text[at..].starts_with("/*") || text[at..].starts_with('#') {
        "a recipe is plain JSON and holds no comments".to_owned()
    } else {
        String::new()
    };
    let end = if at < text.len() { at + 1 } else { at };
    Problem {
        message: format!("this is not JSON: {message}"),
        help,
        pointer: String::new(),
        place: Some(Place::of(text, at..end)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn first_problem(text: &str) -> Problem {
        match Source::parse(text) {
            Ok((.., mut problems)) => problems.remove(0),
            Err(problem) => problem,
        }
    }

    #[test]
    fn pointers_lead_to_places() {
        let (source, _, problems) = Source::parse("{\n  \"a/b\": [1, {\"c\": true}]\n}").unwrap();
        assert!(problems.is_empty());
        let place = source.place("/a~1b/1/c", Part::Value).unwrap();
        assert_eq!(&source.text[place.range], "true");
        let key = source.place("/a~1b", Part::Key).unwrap();
        assert_eq!((key.line, key.column), (2, 3));
        let around = source.place("/a~1b/1/missing", Part::Value).unwrap();
        assert_eq!(&source.text[around.range], "{\"c\": true}");
    }

    #[test]
    fn only_strict_json_is_read() {
        for (text, word, column) in [
            ("{\"a\": 1,}", "trailing comma", 9),
            ("{\"a\": 1 \"b\": 2}", "expected `,`", 9),
            ("{\"a\": 1e999}", "out of range", 11),
            ("{\"a\": NaN}", "expected value", 7),
        ] {
            let problem = first_problem(text);
            assert!(problem.message.contains(word), "{}", problem.message);
            assert_eq!(problem.place.unwrap().column, column, "{text}");
        }
        assert!(first_problem("{} // note").help.is_empty() || first_problem("// note\n{}").help.contains("comments"));
        assert!(first_problem("{\"a\": [1, 2").help.contains("too early"));
        assert!(first_problem("").help.contains("empty"));
        assert!(first_problem(&"[".repeat(1_000_000)).message.contains("recursion limit"));
    }

    #[test]
    fn a_name_given_twice_is_a_problem_at_the_second() {
        let problem = first_problem("{\"a\": 1,\n \"a\": 2}");
        assert_eq!((problem.message.as_str(), problem.place.unwrap().line), ("\"a\" is given twice", 2));
    }
}
