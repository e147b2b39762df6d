//! One thing that is wrong with a graph, and where.

#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    pub message: String,
}

/// All problems, one a line.
pub fn summary(problems: &[Problem]) -> String {
    problems.iter().map(|p| p.message.as_str()).collect::<Vec<_>>().join("\n")
}
