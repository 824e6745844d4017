//! The name of a slice of the work, for runs on several machines. What it holds: [`super::Slices`].

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Slice `index` of `count`, counted from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Shard {
    // In the order in which slices are sorted: those of one splitting stay together.
    count: usize,
    index: usize,
}

/// Most slices of a plan.
pub const MOST_SHARDS: usize = 10_000;

impl Shard {
    /// Slice `index` of `count`.
    ///
    /// # Errors
    /// If not `1 <= index <= count <=` [`MOST_SHARDS`].
    pub fn new(index: usize, count: usize) -> Result<Self, String> {
        if index == 0 || index > count || count > MOST_SHARDS {
            return Err(format!(
                "shard {index}/{count}: expected i/n with 1 <= i <= n <= {MOST_SHARDS}, such as 1/4"
            ));
        }
        Ok(Self { count, index })
    }

    /// Every slice of so many.
    pub fn all(count: usize) -> impl Iterator<Item = Self> {
        (1..=count).map(move |index| Self { count, index })
    }

    /// Which slice, from 1.
    pub fn index(self) -> usize {
        self.index
    }

    /// Of how many.
    pub fn count(self) -> usize {
        self.count
    }

    /// Name of the shard's results file.
    pub fn file_name(self) -> String {
        format!("shard-{:02}-of-{:02}.jsonl", self.index, self.count)
    }

    /// Name of the file that says who computed the shard's results.
    pub fn provenance_name(self) -> String {
        format!("shard-{:02}-of-{:02}.json", self.index, self.count)
    }

    /// The shard whose results file has this name; none if it is the name of something else.
    pub fn of_file_name(name: &str) -> Option<Self> {
        let (index, count) = name.strip_prefix("shard-")?.strip_suffix(".jsonl")?.split_once("-of-")?;
        Self::new(index.parse().ok()?, count.parse().ok()?).ok()
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        let (index, count) =
            numbers.ok_or_else(|| format!("shard `{text}`: expected i/n with 1 <= i <= n, such as 1/4"))?;
        Self::new(index, count)
    }
}

impl From<Shard> for String {
    fn from(shard: Shard) -> Self {
        shard.to_string()
    }
}

impl TryFrom<String> for Shard {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_form_is_checked() {
        assert_eq!("2/3".parse(), Shard::new(2, 3));
        for wrong in ["", "1", "0/3", "4/3", "1/0", "a/b", "1/2/3", "-1/2", " 1/2", "1/10001"] {
            let error = wrong.parse::<Shard>().expect_err(wrong);
            assert!(error.contains("1 <= i <= n"), "{error}");
        }
        let shard = Shard::new(3, 16).expect("valid");
        assert_eq!(shard.file_name(), "shard-03-of-16.jsonl");
        assert_eq!(Shard::of_file_name("shard-03-of-16.jsonl"), Some(shard));
        for other in ["frames.jsonl", "shard-3.jsonl", "shard-03-of-16.json", "shard-17-of-16.jsonl"] {
            assert_eq!(Shard::of_file_name(other), None, "{other}");
        }
    }
}
