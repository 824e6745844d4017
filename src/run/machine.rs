//! Which machine computed.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;

/// A machine, as far as a difference between two results could come from it. No result depends on it.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Machine {
    /// Its name; of a node of Slurm that which Slurm gives it.
    pub host: Option<String>,
    /// Model of its processor, where the system says it.
    pub processor: Option<String>,
}

impl Machine {
    /// This one.
    pub fn here() -> Self {
        Self { host: host(), processor: processor() }
    }
}

impl fmt::Display for Machine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let host = self.host.as_deref().unwrap_or("a machine without a name");
        match &self.processor {
            Some(processor) => write!(f, "{host} ({processor})"),
            None => f.write_str(host),
        }
    }
}

fn host() -> Option<String> {
    let named = |variable: &str| std::env::var(variable).ok();
    let of_system = || skinsplat_data::source::read_to_string(Path::new("/proc/sys/kernel/hostname")).ok();
    let name = named("SLURMD_NODENAME").or_else(of_system).or_else(|| named("HOSTNAME"));
    let name = name.or_else(|| named("COMPUTERNAME"))?;
    Some(name.trim().to_owned()).filter(|name| !name.is_empty())
}

/// The processor as Linux names it.
fn processor() -> Option<String> {
    let text = skinsplat_data::source::read_to_string(Path::new("/proc/cpuinfo")).ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}
