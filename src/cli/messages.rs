//! How errors look: problems of a graph with their place in the text, all others with what to do about them.

use crate::Error;
use crate::graph::Problem;
use miette::{
    Diagnostic, GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteError, MietteSpanContents, SourceCode,
    SourceSpan, SpanContents,
};
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
        let source = Text { name: path.to_string_lossy().into_owned(), text: source_text };
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
    source: &'a Text<'a>,
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
        let text = &self.source.text[place.range.clone()];
        let end = text.find('\n').unwrap_or(text.len());
        let end = text.floor_char_boundary(end.min(LONG / 2));
        Some(Box::new(std::iter::once(LabeledSpan::new(None, place.range.start, end))))
    }
}

/// A recipe's text. Of lines that are too long to be read, such as those of a recipe all on one line, only what lies
/// around the problem is shown.
#[derive(Debug)]
struct Text<'a> {
    name: String,
    text: &'a str,
}

/// Bytes of a line that are shown.
const LONG: usize = 160;

impl SourceCode for Text<'_> {
    fn read_span<'b>(
        &'b self,
        span: &SourceSpan,
        before: usize,
        after: usize,
    ) -> Result<Box<dyn SpanContents<'b> + 'b>, MietteError> {
        let found = self.text.read_span(span, before, after)?;
        let (mut start, mut end) = (found.span().offset(), found.span().offset() + found.span().len());
        let (mut line, column, lines) = (found.line(), found.column(), found.line_count());
        if before + after > 0 && self.text[start..end].lines().any(|line| line.len() > LONG) {
            line += self.text[start..span.offset()].matches('\n').count();
            let newline = |at: Option<usize>| at.filter(|at| (start..end).contains(at));
            let line_start = newline(self.text[..span.offset()].rfind('\n')).map_or(start, |at| at + 1);
            let line_end = newline(self.text[span.offset()..].find('\n').map(|at| at + span.offset())).unwrap_or(end);
            let room = LONG.saturating_sub(span.len()) / 2;
            start = line_start.max(self.text.ceil_char_boundary(span.offset().saturating_sub(room)));
            end = line_end.min(self.text.floor_char_boundary(span.offset() + span.len() + room));
        }
        let (data, span) = (&self.text.as_bytes()[start..end], (start, end - start).into());
        Ok(Box::new(MietteSpanContents::new_named(self.name.clone(), data, span, line, column, lines)))
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
        assert!(text.lines().count() < 12, "{text}");
        assert!(text.is_ascii(), "plain where there is no terminal");
        assert_eq!(describe(&Error::usage("a", "b"), false, false), "error: a\n help: b\n");
    }

    /// Recipes that programs write are often all on one line.
    #[test]
    fn long_lines_are_shown_where_the_problem_is() {
        for (before, after) in [(100_000, 0), (70_000, 70_000), (0, 100_000), (3, 3)] {
            for filling in ["x", "é", "\t"] {
                let (left, right) = (filling.repeat(before), filling.repeat(after));
                let source_text = format!("{{\n{left}\"wrong\"{right}\n}}");
                let at = 2 + left.len();
                let place = Some(Place::of(&source_text, at..at + 7));
                let problem = Problem { message: "what".into(), place, ..Problem::default() };
                let error = Error::Graph { path: PathBuf::from("r.json"), source_text, problems: vec![problem] };
                let text = describe(&error, false, false);
                assert!(text.contains("\"wrong\"") && text.contains("r.json:2:"), "{text}");
                assert!(text.len() < 3000, "{} bytes", text.len());
            }
        }
        let source_text = "\"".repeat(100_000);
        let place = Some(Place::of(&source_text, 0..100_000));
        let problem = Problem { message: "all of it".into(), place, ..Problem::default() };
        let error = Error::Graph { path: PathBuf::from("r.json"), source_text, problems: vec![problem] };
        assert!(describe(&error, true, true).len() < 3000);
    }
}
