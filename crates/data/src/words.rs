//! What readers of types say is wrong with a document, in the words of the document instead of those of the types.

/// What a document calls the things that it is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// Objects with fields.
    Json,
    /// Tables with keys.
    Toml,
}

impl Language {
    fn object(self) -> &'static str {
        match self {
            Self::Json => "an object",
            Self::Toml => "a table",
        }
    }

    /// Types by what they are in the language.
    fn in_words(self, text: &str) -> String {
        let words: [(&[&str], &str); 5] = [
            (&["f64", "f32", "floating point"], "a number"),
            (&["u8", "u16", "u32", "u64", "usize", "i32", "i64"], "a whole number"),
            (&["a sequence", "sequence", "a tuple", "tuple"], "a list"),
            (&["a map", "map", "struct", "internally", "adjacently"], self.object()),
            (&["string", "a string"], "text"),
        ];
        let named = words.iter().find_map(|(names, word)| {
            let rest = names.iter().find_map(|name| {
                let rest = text.strip_prefix(name)?;
                (rest.is_empty() || rest.starts_with([' ', ','])).then_some(rest)
            })?;
            // Of a type only its name follows, of what was found its value.
            Some(if rest.contains(['"', '`']) { format!("{word}{rest}") } else { (*word).to_owned() })
        });
        named.unwrap_or_else(|| text.to_owned())
    }

    /// What was found, and what was expected in its place if the reader says so, in the words of the language. What is no message
    /// about types (of a text that cannot be parsed) stays as it is.
    ///
    /// ```
    /// use skinsplat_data::words::Language;
    /// let (found, expected) = Language::Toml.told("invalid type: string \"much\", expected f64");
    /// assert_eq!((found.as_str(), expected.as_deref()), ("text \"much\"", Some("a number")));
    /// ```
    pub fn told(self, message: &str) -> (String, Option<String>) {
        if !["invalid ", "missing ", "unknown ", "duplicate "].iter().any(|start| message.starts_with(start))
        {
            return (message.to_owned(), None);
        }
        let (problem, expected) = match message.split_once(", expected ") {
            Some((problem, expected)) => (problem, Some(self.in_words(expected))),
            None => (message, None),
        };
        let problem = ["invalid type: ", "invalid value: "]
            .iter()
            .find_map(|start| problem.strip_prefix(start))
            .unwrap_or(problem);
        // Types of objects read lists too, of as many fields.
        let problem = if problem.starts_with("invalid length") { "a list" } else { problem };
        (self.in_words(problem), expected)
    }
}
