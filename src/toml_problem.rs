//! What is wrong with a document of TOML, and where: one line.

use skinsplat_data::words::Language;

/// A place in a document and what is wrong there.
pub(crate) struct TomlProblem {
    /// Line, from 1.
    pub(crate) line: usize,
    /// What was found there, in the words of TOML.
    pub(crate) problem: String,
    /// What was expected, if the reader says so.
    pub(crate) expected: Option<String>,
    /// The line, its first 80 characters.
    pub(crate) excerpt: String,
}

impl TomlProblem {
    pub(crate) fn of(text: &str, error: &toml::de::Error) -> Self {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = text.as_bytes()[..start].iter().filter(|&&byte| byte == b'\n').count();
        let excerpt = text.lines().nth(line).unwrap_or_default().trim();
        let (problem, expected) = Language::Toml.told(&error.message().trim().replace('\n', ", "));
        Self { line: line + 1, problem, expected, excerpt: excerpt.chars().take(80).collect() }
    }

    /// What is wrong, and what was expected.
    pub(crate) fn message(&self) -> String {
        match &self.expected {
            Some(expected) => format!("{}; expected {expected}", self.problem),
            None => self.problem.clone(),
        }
    }
}
