//! Times and checks the skinning shader on an adapter.

use clap::Parser;
use serde_json::{Value, json};
use skinsplat_shader::errors::{self, Row};
use skinsplat_shader::gpu::{self, Gpu, Skinning};
use skinsplat_shader::timing::{self, Options, Timing};
use skinsplat_shader::{Colour, Rotation, cases};
use std::error::Error;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Poses avatars with the skinning shader: milliseconds per frame for each choice, and errors against f64.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    /// List the adapters and stop
    #[arg(long)]
    list: bool,
    /// Take the adapter whose name holds this, in any case [default: the best one]
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Avatars of a frame, each in a pose of its own
    #[arg(long, value_name = "N", default_value = "6", value_parser = clap::value_parser!(u32).range(1..=64))]
    avatars: u32,
    /// Gaussians of each avatar
    #[arg(long, value_name = "N", default_value = "100000", value_parser = clap::value_parser!(u32).range(24..=1_000_000))]
    gaussians: u32,
    /// Frames of a repeat; fewer where they take longer than a second
    #[arg(long, value_name = "N", default_value = "500", value_parser = clap::value_parser!(u32).range(3..=1000))]
    frames: u32,
    /// Repeats, of which the median is taken; 0 times nothing
    #[arg(long, value_name = "N", default_value = "5", value_parser = clap::value_parser!(u32).range(0..=100))]
    repeats: u32,
    /// Random blends whose errors are measured; 0 measures none
    #[arg(long, value_name = "N", default_value = "100000", value_parser = clap::value_parser!(u32).range(0..=1_000_000))]
    cases: u32,
    /// Write times and errors as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the table of errors as Markdown
    #[arg(long, value_name = "FILE")]
    errors: Option<PathBuf>,
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut out = std::io::stdout();
    if arguments.list {
        let names = gpu::list();
        if names.is_empty() {
            return Err(gpu::GpuError::NoAdapter.into());
        }
        for name in names {
            writeln!(out, "{name}")?;
        }
        return Ok(());
    }
    let gpu = Gpu::open(arguments.adapter.as_deref())?;
    let clock = if gpu.has_timestamps() { "timestamp queries" } else { "no timestamp queries: wall clock" };
    writeln!(out, "adapter: {}; {clock}\n", gpu.name)?;
    let options = Options {
        avatars: arguments.avatars as usize,
        gaussians: arguments.gaussians as usize,
        frames: arguments.frames,
        repeats: arguments.repeats as usize,
    };
    let timings = if options.repeats > 0 { timing::time(&gpu, options)? } else { Vec::new() };
    if !timings.is_empty() {
        writeln!(out, "{}", table(&timings, options))?;
        out.flush()?;
    }
    let rows = if arguments.cases > 0 { measure(&gpu, arguments.cases as usize)? } else { Vec::new() };
    if !rows.is_empty() {
        writeln!(
            out,
            "Errors of {} random blends against f64: median / 99.9 % / largest\n",
            arguments.cases
        )?;
        writeln!(out, "{}", errors::markdown(&rows))?;
    }
    if let Some(path) = &arguments.json {
        let value = json!({
            "adapter": gpu.name,
            "is_software": gpu.is_software,
            "has_timestamps": gpu.has_timestamps(),
            "avatars": options.avatars,
            "gaussians": options.gaussians,
            "times": timings.iter().map(time_value).collect::<Vec<_>>(),
            "errors": rows.iter().map(row_value).collect::<Vec<_>>(),
        });
        write_file(path, &format!("{value:#}\n"))?;
    }
    if let Some(path) = &arguments.errors {
        write_file(path, &errors_page(&gpu, arguments.cases, &rows))?;
    }
    Ok(())
}

fn write_file(path: &PathBuf, text: &str) -> Result<(), String> {
    std::fs::write(path, text).map_err(|e| format!("{}: {e}", path.display()))
}

fn measure(gpu: &Gpu, count: usize) -> Result<Vec<Row>, gpu::GpuError> {
    let skinning = Skinning::new(gpu)?;
    let batch = cases::blends(count, 1, cases::SEED);
    let mut rows = Vec::new();
    for rotation in Rotation::ALL {
        rows.extend(errors::measure(&batch, &skinning.pose(&batch, rotation)?, rotation));
    }
    Ok(rows)
}

/// What happens to colour, in words.
fn colour_name(colour: Option<Colour>) -> &'static str {
    match colour {
        Some(Colour::AlongView) => "read along the turned view",
        Some(Colour::TurnSh) => "SH turned",
        None => "left to the engine",
    }
}

fn table(timings: &[Timing], options: Options) -> String {
    let mut text = format!(
        "{} avatars of {} Gaussians, four influences, SH of degree 3; median of {} repeats (smallest to largest)\n\n\
         | rotation | shape | colour | ms per frame, device | frames per second | ms per frame, wall clock |\n\
         |---|---|---|--:|--:|--:|\n",
        options.avatars, options.gaussians, options.repeats
    );
    for timing in timings {
        let (device, wall) = timing.medians();
        let frame = timing.frame;
        text.push_str(&format!(
            "| {} | {} | {} | {device:.3} ({}) | {:.0} | {wall:.3} ({}) |\n",
            frame.rotation.name(),
            frame.shape.name(),
            colour_name(frame.colour),
            range(&timing.device_ms),
            1e3 / device,
            range(&timing.wall_ms),
        ));
    }
    text
}

fn range(values: &[f64]) -> String {
    let (low, high) =
        values.iter().fold((f64::INFINITY, 0.0), |(low, high): (f64, f64), &v| (low.min(v), high.max(v)));
    format!("{low:.3} to {high:.3}")
}

fn time_value(timing: &Timing) -> Value {
    let (device, wall) = timing.medians();
    json!({
        "rotation": timing.frame.rotation.name(),
        "shape": timing.frame.shape.name(),
        "colour": colour_name(timing.frame.colour),
        "device_ms": device,
        "device_ms_repeats": timing.device_ms,
        "wall_ms": wall,
        "wall_ms_repeats": timing.wall_ms,
        "frames_per_second": 1e3 / device,
    })
}

fn row_value(row: &Row) -> Value {
    let spread = |s: &errors::Spread| json!({"median": s.median, "most": s.most, "max": s.max});
    let quantities = errors::QUANTITIES.iter().zip(&row.spreads);
    let quantities: serde_json::Map<_, _> =
        quantities.map(|(name, s)| ((*name).to_owned(), spread(s))).collect();
    json!({
        "rotation": row.rotation.name(),
        "class": row.class,
        "count": row.count,
        "errors": quantities,
        "of_choice_degrees": spread(&row.of_choice),
    })
}

fn errors_page(gpu: &Gpu, cases: u32, rows: &[Row]) -> String {
    format!(
        "{}\nAdapter: {}. {cases} random blends of four influences.\n\n{}",
        ERRORS_HEAD,
        gpu.name,
        errors::markdown(rows)
    )
}

/// What the page of errors says before its table.
const ERRORS_HEAD: &str = "\
# Errors of the skinning shader

What `shaders/skinning.wgsl` answers against the same choice in `f64` (`skinsplat-core`, on the same `f32` inputs). Each cell: median / 99.9 % /
largest. Made by `cargo run --release -p skinsplat-shader --features gpu -- --repeats 0 --errors crates/shader/ERRORS.md`; `tests/adapter.rs` holds
every adapter to bounds of this form. Metres are those of Gaussians within 1 m of their joints, moved by up to 1 m.

Half of the blends are hard ones: two or more joints close to a tie. Classes say what decides:

* `gap`: (λ1 − λ2) / λ1 of Eq. 7. Rounding the joints to `f32` alone moves an average by about 6e-8 rad (3.4e-6 °) over the gap, and so far off is the
  shader. Below 1e-5 `f32` cannot tell which of two averages is larger; what it answers then loses less than 1e-6 of the maximum.
* `left`: the length of (A / λ1)¹⁵ times the heaviest joint, by whose inverse fifteen power steps magnify rounding.
* `cosine`: between the heaviest joint's quaternion and the one nearest to its opposite side. Below 1e-5 a sum's sign is a matter of rounding, in `f64` too:
  two signs, two rotations.

The last column is no error of the shader: it is how far the choice itself is from the average, both in `f64`.
";
