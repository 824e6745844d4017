//! A slice of the jobs, for runs on several machines.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

/// Slice `index` of `count`, counted from 1: every `count`-th job, so that slices are alike in cost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct Shard {
    index: usize,
    count: usize,
}

impl Shard {
    /// Slice `index` of `count`.
    ///
    /// # Errors
    /// If not `1 <= index <= count`.
    pub fn new(index: usize, count: usize) -> Result<Self, String> {
        if index == 0 || index > count {
            return Err(format!("shard {index}/{count}: expected i/n with 1 <= i <= n, such as 1/4"));
        }
        Ok(Self { index, count })
    }

    /// True for the job at this position of the plan.
    pub fn contains(self, position: usize) -> bool {
        position % self.count == self.index - 1
    }

    /// Those of the items that belong to the shard, in order.
    pub fn slice<T>(self, items: &[T]) -> impl Iterator<Item = &T> {
        items.iter().skip(self.index - 1).step_by(self.count)
    }

    /// Name of the shard's results file.
    pub fn file_name(self) -> String {
        format!("shard-{:02}-of-{:02}.jsonl", self.index, self.count)
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
    use proptest::prelude::{prop_assert_eq, proptest};

    #[test]
    fn the_form_is_checked() {
        assert_eq!("2/3".parse(), Shard::new(2, 3));
        for wrong in ["", "1", "0/3", "4/3", "1/0", "a/b", "1/2/3", "-1/2", " 1/2"] {
            let error = wrong.parse::<Shard>().expect_err(wrong);
            assert!(error.contains("1 <= i <= n"), "{error}");
        }
        assert_eq!(Shard::new(3, 16).expect("valid").file_name(), "shard-03-of-16.jsonl");
    }

    proptest! {
        #[test]
        fn shards_partition_the_jobs_exactly(jobs in 0_usize..50, count in 1_usize..20) {
            let all: Vec<usize> = (0..jobs).collect();
            let mut seen = Vec::new();
            for index in 1..=count {
                let shard = Shard::new(index, count).expect("within range");
                let slice: Vec<usize> = shard.slice(&all).copied().collect();
                let by_position: Vec<usize> = all.iter().copied().filter(|&p| shard.contains(p)).collect();
                prop_assert_eq!(&slice, &by_position);
                seen.extend(slice);
            }
            seen.sort_unstable();
            prop_assert_eq!(seen, all);
        }
    }
}
