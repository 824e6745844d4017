//! `reproduce batch`: scripts that hand a run to a cluster. It prints them; whoever runs them submits.

use super::output::emit;
use super::run::Run;
use super::{Cli, Command, Exit, one_line};
use anyhow::{Context as _, Result, bail};
use clap::Parser;
use skinsplat::experiment::MOST_SHARDS;
use skinsplat::quoting::quoted;
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

/// Print a script that runs the slices of a run on a cluster, and collects them.
///
/// Nothing is submitted: look at the script, then give it to bash. Everything after -- goes to `reproduce run` as it stands.
/// Slices go on where they stopped when they are started again, so that killed and requeued ones lose little; the merge says
/// what is missing, and is right whatever happened to the slices.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Batch {
    #[command(subcommand)]
    engine: Engine,
}

#[derive(Debug, clap::Subcommand)]
enum Engine {
    /// A job array of Slurm, and a job that merges once every slice has ended
    Slurm(Slurm),
    /// Slices side by side on this machine, by GNU parallel
    Array(Array),
}

/// The run and its slices.
#[derive(Debug, clap::Args)]
struct Work {
    /// Slices
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_SHARDS as i64))]
    shards: u16,
    /// Folder of the run, reached by that path from everywhere
    #[arg(long, value_name = "DIR", default_value = super::run::DEFAULT_OUT)]
    out: PathBuf,
    /// Arguments of `reproduce run`, but --out and --shard
    #[arg(value_name = "ARGUMENTS OF run", last = true)]
    arguments: Vec<OsString>,
}

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
struct Slurm {
    #[command(flatten)]
    work: Work,
    /// Most slices at a time
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    at_most: Option<u16>,
    /// Processors per slice: as many threads compute
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..))]
    cpus: u16,
    /// Memory per slice, as Slurm reads it: megabytes, or a number with K, M, G or T
    #[arg(long, value_name = "SIZE", default_value = "4G", value_parser = memory)]
    mem: String,
    /// Time limit per slice, as Slurm reads it (minutes, HH:MM:SS, DAYS-HH:MM): one that reaches it is requeued and goes on
    #[arg(long, value_name = "TIME", default_value = "04:00:00", value_parser = time_limit)]
    time: String,
    /// Further options of sbatch, such as --partition=long (may be repeated)
    #[arg(long = "sbatch", value_name = "OPTION", allow_hyphen_values = true)]
    further: Vec<OsString>,
}

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
struct Array {
    #[command(flatten)]
    work: Work,
    /// Slices at a time
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    jobs: u16,
}

const EXAMPLES: &str = "\
Examples:
  reproduce batch slurm --shards 16 --out runs/all -- --profile standard > submit.sh
  reproduce batch slurm --shards 8 --sbatch=--partition=long -- table1 --data /data/mine | bash
  reproduce batch array --shards 4 --jobs 2 --out runs/table1 -- table1 | bash";

/// Sizes that sbatch takes (its manual page, `--mem`), but none of nothing: 0 asks for the whole node there.
fn memory(text: &str) -> Result<String, String> {
    let number = text.strip_suffix(|c: char| "KMGTkmgt".contains(c)).unwrap_or(text);
    match number.parse::<u32>() {
        Ok(1..) if number.bytes().all(|b| b.is_ascii_digit()) => Ok(text.to_owned()),
        _ => Err("expected megabytes, or a whole number with K, M, G or T, such as 4G".to_owned()),
    }
}

/// Limits that sbatch takes (its manual page, `--time`): M, M:S, H:M:S, D-H, D-H:M, D-H:M:S.
fn time_limit(text: &str) -> Result<String, String> {
    let (days, clock) = text.split_once('-').map_or((None, text), |(days, clock)| (Some(days), clock));
    let parts: Vec<&str> = days.into_iter().chain(clock.split(':')).collect();
    let number = |part: &&str| (1..=6).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
    let most = if days.is_some() { 4 } else { 3 };
    let some = parts.iter().any(|part| part.bytes().any(|b| b != b'0'));
    match parts.len() <= most && parts.iter().all(number) && some {
        true => Ok(text.to_owned()),
        false => Err("expected minutes, HH:MM:SS or DAYS-HH:MM, above 0".to_owned()),
    }
}

/// Ends the lines that a job gets; no quoted argument holds it as a line, since none holds a line break.
const END: &str = "END_OF_JOB";

impl Batch {
    pub(super) fn run(&self) -> Result<Exit> {
        let text = match &self.engine {
            Engine::Slurm(slurm) => slurm.script()?,
            Engine::Array(array) => array.script()?,
        };
        emit(&text)?;
        Ok(Exit::Success)
    }
}

impl Work {
    /// Refuses what `run` would refuse, now instead of on every node.
    fn check(&self) -> Result<()> {
        let before = ["reproduce", "run"].map(OsString::from);
        let cli = Cli::try_parse_from(before.into_iter().chain(self.arguments.iter().cloned()));
        let cli =
            cli.map_err(|error| anyhow::anyhow!("arguments of run: {}", one_line(&error.to_string())))?;
        let Command::Run(run) = &cli.command else { bail!("arguments of run: expected those of `run`") };
        if let Some(option) = run.unsliced() {
            bail!("arguments of run: {option}; expected it before --, or not at all");
        }
        run.planning().experiments().context("arguments of run")?;
        Ok(())
    }

    /// `run` on the slice that `index` stands for in the shell.
    fn slice(&self, index: &str) -> Result<String> {
        let words = [program()?, "run".into()].into_iter().chain(self.arguments.iter().cloned());
        let words: Vec<String> = words.map(|word| quoted(&word)).collect();
        Ok(format!(
            "{} --shard \"{index}/{}\" --out {}",
            words.join(" "),
            self.shards,
            quoted(self.out.as_os_str())
        ))
    }

    fn merge(&self) -> Result<String> {
        Ok(format!("{} merge {}", quoted(&program()?), quoted(self.out.as_os_str())))
    }

    /// A name for queues: that of the folder.
    fn name(&self) -> String {
        let name = self.out.file_name().unwrap_or(OsStr::new("run")).to_string_lossy();
        format!("reproduce-{}", name.replace(|c: char| !c.is_ascii_alphanumeric(), "-"))
    }

    /// The file of a log, as sbatch reads it: a percent sign in the folder's name is doubled, and what is no text in it is
    /// replaced.
    fn log(&self, pattern: &str) -> OsString {
        let folder = self.out.join("logs").to_string_lossy().replace('%', "%%");
        format!("{folder}/{pattern}").into()
    }
}

/// This program, so that every node runs the same one.
fn program() -> Result<OsString> {
    Ok(std::env::current_exe().context("this program's own path: cannot find it")?.into_os_string())
}

impl Slurm {
    fn script(&self) -> Result<String> {
        self.work.check()?;
        let Work { shards, out, .. } = &self.work;
        let at_most = self.at_most.map_or_else(String::new, |most| format!("%{most}"));
        let name = self.work.name();
        let with = |name: &str, value: &OsStr| {
            let mut option = OsString::from(format!("--{name}="));
            option.push(value);
            quoted(&option)
        };
        let further: String = self.further.iter().map(|option| format!(" {}", quoted(option))).collect();
        let array = [
            format!("--job-name={name} --array=1-{shards}{at_most} --cpus-per-task={}", self.cpus),
            format!("{} {}", with("mem", OsStr::new(&self.mem)), with("time", OsStr::new(&self.time))),
            format!(
                "--requeue --signal=B:USR1@120 --open-mode=append {}{further}",
                with("output", &self.work.log("%a.log"))
            ),
        ];
        let merge = [
            format!("--job-name={name}-merge --dependency=afterany:\"${{array%%;*}}\" --cpus-per-task=1"),
            format!(
                "{} {}{further}",
                with("mem", OsStr::new(&self.mem)),
                with("output", &self.work.log("merge.log"))
            ),
        ];
        Ok(format!(
            "#!/bin/bash\n\
             # Submits {shards} slices of a run to Slurm, and the job that collects them.\n\
             set -euo pipefail\n\
             mkdir -p {logs}\n\
             array=$(sbatch --parsable {array} <<'{END}'\n\
             {slice}\
             {END}\n\
             )\n\
             # Collects whatever happened to the slices, and says what is missing.\n\
             sbatch {merge} <<'{END}'\n\
             #!/bin/bash\n\
             exec {collect}\n\
             {END}\n",
            logs = quoted(out.join("logs").as_os_str()),
            array = array.join(" \\\n  "),
            slice = self.job()?,
            merge = merge.join(" \\\n  "),
            collect = self.work.merge()?,
        ))
    }

    /// What a task of the array does.
    fn job(&self) -> Result<String> {
        Ok(format!(
            "#!/bin/bash\n\
             {slice} &\n\
             program=$!\n\
             # Two minutes before the time limit: what is done is kept, the rest goes back into the queue.\n\
             trap 'kill -TERM \"$program\"; wait \"$program\"; scontrol requeue \"$SLURM_JOB_ID\"; exit 0' USR1\n\
             trap 'kill -TERM \"$program\"; wait \"$program\"; exit 143' TERM\n\
             wait \"$program\"\n",
            slice = self.work.slice("$SLURM_ARRAY_TASK_ID")?,
        ))
    }
}

impl Array {
    fn script(&self) -> Result<String> {
        self.work.check()?;
        Ok(format!(
            "#!/bin/bash\n\
             # Runs {shards} slices of a run, {jobs} at a time, and collects them.\n\
             slice() {{ {slice}; }}\n\
             export -f slice\n\
             # GNU parallel returns the number of slices that failed: the merge says what is missing.\n\
             seq {shards} | parallel --jobs {jobs} slice\n\
             exec {merge}\n",
            shards = self.work.shards,
            jobs = self.jobs,
            slice = self.work.slice("$1")?,
            merge = self.work.merge()?,
        ))
    }
}

impl Run {
    /// The first option that makes no sense for all slices together, if one was given.
    fn unsliced(&self) -> Option<&'static str> {
        self.whole_run_options().into_iter().find_map(|(option, given)| given.then_some(option))
    }
}

#[cfg(test)]
mod tests {
    use super::{memory, time_limit};

    #[test]
    fn limits_are_those_that_slurm_reads() {
        for time in ["30", "30:00", "04:00:00", "2-12", "1-00:30", "1-02:03:04"] {
            assert!(time_limit(time).is_ok(), "{time}");
        }
        for time in ["", "soon", "4h", "0", "00:00:00", "1:2:3:4", "1-", "-1", "1-2:3:4:5", "1 2"] {
            assert!(time_limit(time).is_err(), "{time}");
        }
        for size in ["4G", "400M", "2048", "1T", "10k"] {
            assert!(memory(size).is_ok(), "{size}");
        }
        for size in ["", "G", "0", "0G", "4GB", "-4G", "+4G", "1.5G", "lots"] {
            assert!(memory(size).is_err(), "{size}");
        }
    }
}
