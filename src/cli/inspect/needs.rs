//! `reproduce inspect --needs`: what an avatar and a motion need.

use super::super::Context as Terminal;
use super::super::output::{Format, emit, emit_json};
use super::line;
use anyhow::{Context as _, Result, bail};
use skinsplat::run::foreign::on_body;
use skinsplat_core::scene::{Body, Pose, RestBody};
use skinsplat_data::avatar::read_avatar;
use skinsplat_data::{body, poses};
use skinsplat_posing::needs::{Degrees, Extreme, Needs};
use skinsplat_posing::{BoundAvatar, RotationChoice};
use skinsplat_table::{Cell, Column, Label, Row, Table, text};
use std::path::{Path, PathBuf};

/// Pairs that are listed; JSON has them all.
const LISTED_PAIRS: usize = 12;

/// The motion, and what is asked of it.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Needs")]
pub(super) struct Motion {
    /// Say what FILE, an avatar, needs in a motion: SH degree, influences, joints, angles, and which solvers are enough
    #[arg(long, requires = "poses")]
    needs: bool,
    /// Poses: .npz or .pkl (smplx, AMASS, AIST++), transforms.json, or a .glb or .gltf with clips
    #[arg(long, value_name = "POSES", requires = "needs")]
    poses: Option<PathBuf>,
    /// Body model [default: the poses' file if it is glTF, else the one that the avatar names]
    #[arg(long, value_name = "BODY", requires = "needs")]
    body: Option<PathBuf>,
    /// Clip of a glTF file with several
    #[arg(long, value_name = "NAME", requires = "needs")]
    clip: Option<String>,
    /// Degrees by which a rotation may differ from the exact average
    #[arg(long, value_name = "DEG", requires = "needs", default_value_t = 0.5, value_parser = tolerance)]
    tolerance: f64,
    /// Bound this rotation choice instead of the usual ones (may be repeated)
    #[arg(long = "rotation", value_name = "ID", requires = "needs")]
    rotations: Vec<RotationChoice>,
    /// How the needs are printed
    #[arg(long, value_enum, default_value_t, requires = "needs")]
    format: Format,
}

fn tolerance(text: &str) -> Result<f64, String> {
    Needs::parse_tolerance(text).map_err(|expected| format!("expected {expected}"))
}

impl Motion {
    /// True if needs were asked for.
    pub(super) fn asked(&self) -> bool {
        self.needs
    }

    /// Prints what the avatar needs.
    pub(super) fn print(&self, avatar: &Path, terminal: Terminal) -> Result<()> {
        let loaded = read_avatar(avatar)?;
        let path = self.poses.as_deref().context("--poses is missing")?;
        let track = poses::load_clip(path, self.clip.as_deref())?;
        let (body_path, model) = self.model(avatar, path, loaded.body.as_deref())?;
        let betas = loaded.betas.clone().unwrap_or_else(|| track.betas.clone());
        let shaped = body::shape(&model, &betas, &track.expression);
        let (rest, _) = shaped.with_context(|| format!("{}", path.display()))?;
        let motion: Vec<Pose> = track.poses(&rest.skeleton)?.to_vec();
        let on_body = on_body(loaded, &rest)?;
        on_body.notes.iter().for_each(|note| terminal.note(format!("{}: {note}", avatar.display())));
        let rest = on_body.body.unwrap_or(rest);
        let bound = BoundAvatar::new(&on_body.avatar, &rest).with_context(|| {
            format!("{}: does not fit the body {}", avatar.display(), body_path.display())
        })?;
        let choices = if self.rotations.is_empty() { Needs::listed() } else { self.rotations.clone() };
        let needs = Needs::new(&bound, &rest, &motion, &choices, self.tolerance)?;
        match self.format {
            Format::Json => emit_json(&needs),
            Format::Text => emit(&format!("{}\n{}", avatar.display(), described(&needs, &rest))),
        }
    }

    fn model(&self, avatar: &Path, poses: &Path, named: Option<&str>) -> Result<(PathBuf, Body)> {
        let is_rig = poses.extension().is_some_and(|e| e == "glb" || e == "gltf");
        let path = match (&self.body, named) {
            (Some(path), _) => path.clone(),
            (None, _) if is_rig => poses.to_owned(),
            (None, Some(named)) => avatar.parent().unwrap_or(Path::new("")).join(named),
            (None, None) => {
                bail!("--body is missing: neither the poses nor {} name a body", avatar.display())
            }
        };
        let model = body::load(&path)?;
        Ok((path, model))
    }
}

fn described(needs: &Needs, body: &RestBody) -> String {
    let mut text = line("Gaussians", needs.gaussians) + &line("poses", needs.poses);
    text += &line("SH degree", format!("{} of {} stored", needs.sh_degree_present, needs.sh_degree_stored));
    let share = |(n, count): (usize, &u64)| {
        (*count > 0)
            .then(|| format!("{n}: {count} ({:.1} %)", 100.0 * *count as f64 / needs.gaussians.max(1) as f64))
    };
    let shares: Vec<String> = needs.influences.iter().enumerate().filter_map(share).collect();
    text += &line("influences", shares.join(", "));
    text += &line("joints used", format!("{} of {}", needs.joints_used.len(), needs.joints));
    let name = |joint: u16| match body.skeleton.names.get(usize::from(joint)) {
        Some(name) if !name.is_empty() => name.clone(),
        _ => joint.to_string(),
    };
    text += &line("worst bone angle", at(needs.worst_angle, "°"));
    text += &line("smallest gap", needs.gap.map_or("not searched for".to_owned(), |gap| at(gap, "")));
    text += &line("its bound", at(needs.gap_bound, ""));
    let mut widest: Vec<_> = needs.pairs.iter().collect();
    widest.sort_by(|a, b| b.worst_angle.value.total_cmp(&a.worst_angle.value));
    let pairs = widest.iter().take(LISTED_PAIRS).map(|pair| {
        let [a, b] = pair.joints.map(name);
        (format!("{a} - {b}"), format!("{}, {} Gaussians", at(pair.worst_angle, "°"), pair.gaussians))
    });
    text += &list("joints that share Gaussians, widest first", pairs);
    if widest.len() > LISTED_PAIRS {
        text += &format!("    and {} more\n", widest.len() - LISTED_PAIRS);
    }
    let bounds = needs.bounds.iter().map(|bound| (bound.rotation.to_string(), bound.degrees.to_string()));
    text += &list("farthest from the exact average that it can be (proved + rounding to f32)", bounds);
    let fewer =
        (1..).zip(&needs.fewer_influences).map(|(kept, degrees)| (format!("{kept}"), degrees.to_string()));
    text += &list("exact average of the heaviest influences only", fewer);
    text + &line("verdict", &needs.verdict)
}

/// Names and values under a heading.
fn list(heading: &str, rows: impl Iterator<Item = (String, String)>) -> String {
    let row = |(name, value): (String, String)| Row::new(&name, [heading, &name], vec![Cell::text(value)]);
    let table = Table {
        labels: vec![Label::new("list", "").once(), Label::new("name", "")],
        columns: vec![Column::text("value", "")],
        rows: rows.map(row).collect(),
        ..Table::default()
    };
    text::rows(&table).lines().map(|line| format!("  {line}\n")).collect()
}

fn at(extreme: Extreme, unit: &str) -> String {
    let value = match unit {
        "°" => Degrees(extreme.value).to_string(),
        _ => format!("{:.6}", extreme.value),
    };
    format!("{value} in pose {}", extreme.pose)
}
