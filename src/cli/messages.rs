//! How errors look: problems of a graph with their place in the text, all others with what to do about them.

use crate::Error;
use crate::graph::Problem;
use miette::{Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, NamedSource, SourceCode};
use std::fmt::{self, Display, Write};
use std::io::IsTerminal;

/// Prints an error to stderr.
pub fn print_error(error: &Error) {
    let terminal = std::io::stderr().is_terminal();
    let colour = terminal && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty());
    eprint!("{}", describe(error, terminal, colour));
}

fn describe(error: &Error, terminal: bool, colour: bool) -> String {
    let mut text = String::new();
    if let Error::Graph { path, source_text, problems } = error {
        let theme = match (terminal, colour) {
            (true, true) => GraphicalTheme::unicode(),
            (true, false) => GraphicalTheme::unicode_nocolor(),
            _ => GraphicalTheme::none(),
        };
        let handler = GraphicalReportHandler::new_themed(theme).with_links(false).with_context_lines(1);
        let source = NamedSource::new(path.to_string_lossy(), source_text.clone());
        for problem in problems {
            handler.render_report(&mut text, &Placed { problem, source: &source }).expect("writing to a string");
        }
        let count = problems.len();
        writeln!(text, "error: {count} problem{} in {}", if count == 1 { "" } else { "s" }, path.display())
    } else if error.help().is_empty() {
        writeln!(text, "error: {error}")
    } else {
        writeln!(text, "error: {error}\n help: {}", error.help())
    }
    .expect("writing to a string");
    text
}

/// A problem together with the text that it is in.
#[derive(Debug)]
struct Placed<'a> {
    problem: &'a Problem,
    source: &'a NamedSource<String>,
}

impl Display for Placed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.problem.message)
    }
}

impl std::error::Error for Placed<'_> {}

impl Diagnostic for Placed<'_> {
    fn help<'b>(&'b self) -> Option<Box<dyn Display + 'b>> {
        (!self.problem.help.is_empty()).then(|| Box::new(&self.problem.help) as _)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.problem.place.as_ref().map(|_| self.source as _)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        let place = self.problem.place.as_ref()?;
        // The first line of what is meant is enough: a whole node would fill the screen.
        let text = &self.source.inner()[place.range.clone()];
        let end = text.find('\n').unwrap_or(text.len());
        Some(Box::new(std::iter::once(LabeledSpan::new(None, place.range.start, end))))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Place;
    use std::path::PathBuf;

    #[test]
    fn problems_show_line_column_and_text() {
        let source_text = "{\n  \"nodes\": {}\n}".to_owned();
        let problem = Problem {
            message: "what".into(),
            help: "do this".into(),
            place: Some(Place::of(&source_text, 4..11)),
            ..Problem::default()
        };
        let error = Error::Graph { path: PathBuf::from("r.json"), source_text, problems: vec![problem] };
        let text = describe(&error, false, false);
        for part in ["what", "r.json:2:3", "\"nodes\": {}", "do this", "1 problem in r.json"] {
            assert!(text.contains(part), "{part} is not in {text}");
        }
        assert!(text.is_ascii(), "plain where there is no terminal");
        assert_eq!(describe(&Error::usage("a", "b"), false, false), "error: a\n help: b\n");
    }
}
