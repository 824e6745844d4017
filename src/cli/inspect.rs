//! `reproduce inspect`: what a file holds, and what is wrong with it.

mod folder;
mod needs;
mod parts;

use super::Exit;
use super::output::emit;
use anyhow::{Context as _, Result, anyhow, bail};
use skinsplat::report::Results;
use skinsplat::run::store;
use skinsplat_core::math::portable;
use skinsplat_core::scene::{Avatar, Binding, Body, Image, Mask};
use skinsplat_data::arrays::Arrays;
use skinsplat_data::avatar::{Canonical, LoadedAvatar, read_avatar};
use skinsplat_data::entries::{Entry, entries};
use skinsplat_data::layouts::readers;
use skinsplat_data::poses::PoseTrack;
use skinsplat_data::{body, camera, frames, poses};
use std::path::{Path, PathBuf};

/// Show what a file or folder holds, and what is wrong with it.
///
/// Reads avatars (.ply, .npz, .pth, .ckpt, .glb with Gaussians, exports of SplattingAvatar), bodies (.npz, .pkl, .glb, .gltf), poses and cameras
/// (.npz, .pkl, .json), images, results.json and the results store of a run, parts of data sets (.npy, .tiff, .hdf5, .txt); and folders: a subject in any of the layouts that
/// are read, folders of subjects, a run, exports of SplattingAvatar, images that another program rendered.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Inspect {
    /// What to look at
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    motion: needs::Motion,
}

const EXAMPLES: &str = "\
Examples:
  reproduce inspect avatar.ply              Gaussians, binding, dialect
  reproduce inspect data/neuman/seattle     what a data set holds and lacks
  reproduce inspect runs/default/results.json";

impl Inspect {
    pub(super) fn run(&self, context: super::Context) -> Result<Exit> {
        let path = &self.file;
        if self.motion.asked() {
            self.motion.print(path, context)?;
            return Ok(Exit::Success);
        }
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        let text = match extension.as_str() {
            _ if path.is_dir() => folder::text(path)?,
            _ if !path.exists() => {
                bail!("{}: No such file or folder; expected one to look at", path.display())
            }
            "ply" | "pth" | "pt" | "ckpt" | "spz" | "splat" | "ksplat" | "sog" => {
                avatar_text(&read_avatar(path)?)
            }
            "glb" | "gltf" => gltf_text(path)?,
            "npz" | "pkl" | "pickle" => arrays_text(path)?,
            "json" => json_text(path)?,
            "jsonl" => store_text(path)?,
            "png" | "jpg" | "jpeg" => image_text(&frames::load_image(path)?),
            "npy" => parts::array_text(path)?,
            "tiff" | "tif" => parts::depth_text(path)?,
            "hdf5" | "h5" => parts::hdf5_text(path)?,
            "txt" => parts::text_text(path)?,
            _ => {
                let expected = ".ply, .pth, .ckpt, .npz, .pkl, .glb, .gltf, .json, .jsonl, .png, .jpg, .npy, .tiff, .hdf5, .txt \
                                or a folder";
                bail!("{}: unknown kind of file; expected {expected}", path.display())
            }
        };
        emit(&format!("{}\n{text}", path.display()))?;
        Ok(Exit::Success)
    }
}

/// Gaussians, a body, or both: a skinned file of Gaussians.
fn gltf_text(path: &Path) -> Result<String> {
    let rig = || Ok::<_, anyhow::Error>(body_text(&body::read(path)?) + &clips_text(path)?);
    match read_avatar(path) {
        Ok(loaded) if loaded.is_bound() => Ok(avatar_text(&loaded) + &rig()?),
        Ok(loaded) => Ok(avatar_text(&loaded)),
        // No Gaussians in it.
        Err(error) if error.field() == "avatar" => rig(),
        Err(error) => Err(error.into()),
    }
}

/// A line of a listing.
fn line(name: &str, value: impl std::fmt::Display) -> String {
    format!("  {name:<20} {value}\n")
}

/// Minimum, median and maximum.
fn spread(values: impl IntoIterator<Item = f32>) -> String {
    let mut sorted: Vec<f32> = values.into_iter().collect();
    sorted.sort_by(f32::total_cmp);
    match (sorted.first(), sorted.last()) {
        (Some(min), Some(max)) => {
            format!("{min:.4} / {:.4} / {max:.4} (min / median / max)", sorted[sorted.len() / 2])
        }
        _ => "none".to_owned(),
    }
}

fn avatar_text(loaded: &LoadedAvatar) -> String {
    let Avatar { gaussians, binding } = &loaded.avatar;
    let binding = match binding {
        Binding::Static => "none: a static scene".to_owned(),
        Binding::Vertex(weights) => format!("joint weights, up to {} per Gaussian", weights.max_influences()),
        Binding::Face(_) => "faces: barycentric coordinates and offset".to_owned(),
    };
    let mut text = line("kind", loaded.format.title()) + &line("Gaussians", gaussians.len());
    text += &line("SH degree", gaussians.sh_degree);
    text += &line("binding", binding);
    let low = gaussians.means.iter().copied().reduce(glam::Vec3::min).unwrap_or_default();
    let high = gaussians.means.iter().copied().reduce(glam::Vec3::max).unwrap_or_default();
    text += &line("extent, metres", format!("{low:.3} to {high:.3}"));
    text += &line(
        "scale, metres",
        spread(gaussians.log_scales.iter().flat_map(|s| s.map(portable::exp).to_array())),
    );
    text += &line("opacity", spread(gaussians.opacities()));
    match &loaded.canonical {
        Canonical::Rest => {}
        Canonical::Mesh(mesh) => {
            text += &line("canonical", format!("a mesh of {} vertices", mesh.vertices.len()))
        }
        Canonical::Pose(pose) => {
            text += &line("canonical", format!("a pose of {} joints", pose.axis_angles.len()))
        }
        Canonical::Faces => {
            text += &line("canonical", "the frame of each Gaussian's face, lengths in units of its size")
        }
    }
    if let Some(texture) = &loaded.texture {
        text += &line("texture", format!("{}x{}, on the body's mesh", texture.width(), texture.height()));
    }
    if let Some(betas) = &loaded.betas {
        text += &line("betas", format!("{betas:?}"));
    }
    if let Some(body) = &loaded.body {
        text += &line("body", body);
    }
    if !loaded.ignored.is_empty() {
        text += &line("not read", listed(&loaded.ignored));
    }
    let comments = loaded.comments.iter().map(|comment| line("comment", comment));
    let notes = loaded.notes.iter().map(|note| line("note", note));
    let beside = loaded.files.iter().skip(1).map(|file| line("belongs to it", file.display()));
    text + &comments.chain(notes).chain(beside).collect::<String>()
}

/// Names, the first of many.
fn listed(names: &[String]) -> String {
    const MOST: usize = 24;
    let shown: Vec<String> = names.iter().take(MOST).map(|name| name.escape_debug().to_string()).collect();
    let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
    shown.join(" ") + &more
}

fn body_text(loaded: &body::Loaded) -> String {
    let body::Loaded { body: Body { rest, shape }, notes } = loaded;
    let mut text = line("kind", "body model") + &line("vertices", rest.vertices.len());
    text += &line("faces", rest.faces.len());
    text += &line("joints", rest.skeleton.num_joints());
    text += &line("influences", format!("up to {} per vertex", rest.weights.max_influences()));
    text += &line("shape directions", shape.as_ref().map_or(0, |shape| shape.directions.len()));
    text += &line("expressions", shape.as_ref().map_or(0, |shape| shape.expressions.len()));
    text += &line("pose directions", rest.pose_directions.len());
    text += &line("texture coordinates", if rest.uv.is_some() { "yes" } else { "no" });
    let flat = |f: &&[u32; 3]| {
        let [a, b, c] = f.map(|i| rest.vertices[i as usize]);
        (b - a).cross(c - a).length() < 1e-14
    };
    text += &line("zero-area faces", rest.faces.iter().filter(flat).count());
    text += &line("joint names", rest.skeleton.names.join(" "));
    text + &notes_text(notes)
}

fn notes_text(notes: &[String]) -> String {
    notes.iter().map(|note| line("note", note)).collect()
}

fn clips_text(path: &Path) -> Result<String> {
    let rig = skinsplat_data::gltf::Rig::load(path)?;
    let clip = |clip: &skinsplat_data::gltf::Clip| {
        let keys = format!("{} keys", clip.key_times().len());
        line(&format!("clip {}", clip.name), keys) + &notes_text(&clip.notes(&rig))
    };
    Ok(rig.clips.iter().map(clip).collect())
}

/// An `.npz` archive or a pickle: its arrays, and what they are together.
fn arrays_text(path: &Path) -> Result<String> {
    let mut arrays = Arrays::open(path, "archive")?;
    let entries = entries(&mut arrays)?;
    let mut text = line("kind", arrays.kind()) + &entries_text(&entries);
    let meaning = meaning_text(path, &arrays);
    let readers = readers(path);
    if readers.is_empty() {
        return Ok(text + &meaning?.unwrap_or_else(|| unread_text(&arrays.names(), &[])));
    }
    // A part of a data set may be called as another kind of file is, and be less than one.
    text += &meaning.ok().flatten().unwrap_or_default();
    let names: Vec<String> = entries.into_iter().map(|entry| entry.name).collect();
    Ok(text + &parts::read_by(&readers, &names))
}

/// Entries that are listed.
const LISTED_ENTRIES: usize = 40;

fn entries_text(entries: &[Entry]) -> String {
    let one = |entry: &Entry| {
        let reach = entry.reach.map_or(String::new(), |reach| format!(", {reach}"));
        line(&entry.name.escape_debug().to_string(), format!("{}{reach}", entry.what))
    };
    let more = entries.len().saturating_sub(LISTED_ENTRIES);
    let rest = (more > 0).then(|| line("…", format!("{more} more")));
    entries.iter().take(LISTED_ENTRIES).map(one).chain(rest).collect()
}

/// What the arrays of a file are together, if their names tell.
fn meaning_text(path: &Path, arrays: &Arrays) -> Result<Option<String>> {
    let has = |name: &str| arrays.contains(name);
    Ok(Some(if has("means") && has("quats") {
        avatar_text(&read_avatar(path)?)
    } else if has("v_template") {
        body_text(&body::read(path)?) + &unread_text(&arrays.names(), &body::ARRAYS)
    } else if has("intrinsic") || has("K") {
        cameras_text(path)?
    } else if poses::is_motion(arrays) {
        motion_text(&poses::load(path)?)
    } else {
        return Ok(None);
    }))
}

/// Arrays that nothing reads.
fn unread_text(names: &[String], read: &[&str]) -> String {
    let left: Vec<String> = names.iter().filter(|name| !read.contains(&name.as_str())).cloned().collect();
    if left.is_empty() { String::new() } else { line("not read", listed(&left)) }
}

fn motion_text(track: &PoseTrack) -> String {
    let mut text = line("poses", track.len()) + &line("joints", track.num_joints());
    text += &line("betas", format!("{:?}", track.betas));
    text += &track.gender.iter().map(|gender| line("gender", gender.escape_debug())).collect::<String>();
    text += &track.framerate.iter().map(|rate| line("poses per second", rate)).collect::<String>();
    text + &notes_text(track.notes())
}

fn cameras_text(path: &Path) -> Result<String> {
    let views = camera::load_views(path)?;
    let describe = |(i, view): (usize, &camera::CameraView)| {
        let c = &view.camera;
        let centre = format!("centre ({:.1}, {:.1})", c.cx, c.cy);
        line(
            &format!("camera {i}"),
            format!("{}x{}, focal {:.1} {:.1}, {centre}", c.width, c.height, c.fx, c.fy),
        )
    };
    let note = views.iter().find_map(|view| view.note.as_ref()).map(|note| line("note", note));
    Ok(views.iter().enumerate().map(describe).chain(note).collect())
}

fn json_text(path: &Path) -> Result<String> {
    let text = skinsplat_data::error::read_text(path, "file", "a JSON document")?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let value: serde_json::Value =
        serde_json::from_str(text).with_context(|| format!("{}: not JSON", path.display()))?;
    if value.get("schema").is_some() && value.get("tables").is_some() {
        let results = Results::from_json(text).map_err(|problem| anyhow!("{}: {problem}", path.display()))?;
        let mut text = line("kind", "results of a run") + &line("plan", &results.plan);
        for table in &results.tables {
            let protocol = format!("{}@{}", table.protocol.id, table.protocol.version);
            text +=
                &line(&table.experiment, format!("{} sequences, protocol {protocol}", table.sequences.len()));
        }
        return Ok(text + &line("missing scores", results.missing()));
    }
    let mut text = line("kind", "cameras") + &cameras_text(path)?;
    if value.get("poses").is_some() {
        text += &line("poses", poses::load(path)?.len());
    }
    Ok(text)
}

fn store_text(path: &Path) -> Result<String> {
    let records = store::read(path)?;
    let failed = |r: &&skinsplat::experiment::FrameRecord| {
        matches!(r.outcome, skinsplat::experiment::Outcome::Error(_))
    };
    let failures: Vec<_> = records.values().filter(failed).collect();
    let mut text = line("kind", "results store") + &line("records", records.len());
    text += &line("failed", failures.len());
    for record in failures {
        if let skinsplat::experiment::Outcome::Error(problem) = &record.outcome {
            text += &line(&record.label, problem);
        }
    }
    Ok(text)
}

fn image_text((image, alpha): &(Image, Option<Mask>)) -> String {
    let mut text = line("kind", "image") + &line("size", format!("{}x{}", image.width(), image.height()));
    text += &line("values", spread(image.pixels().iter().flatten().copied()));
    if let Some(alpha) = alpha {
        text += &line("alpha", spread(alpha.values().iter().copied()));
    }
    text
}
