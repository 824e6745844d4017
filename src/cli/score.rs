//! `reproduce score`: two images, or two folders of frames, by every metric variant.

use super::Exit;
use super::output::{Format, emit, emit_json};
use super::selection::parse_colour;
use crate::data::frames::{load_image, load_mask};
use crate::metrics::{FrameScore, Protocol, Truth, all_variants};
use crate::scene::{Image, Mask};
use anyhow::{Context as _, Result, bail};
use rayon::prelude::*;
use serde::Serialize;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Score renders against truth: two images, or two folders whose frames pair up by name.
///
/// Prints every metric variant by its name; with a mask also those of the masked pixels (`_mask`), of the mask's
/// bounding box (`_bbox`) and of images multiplied by the mask (`_image_times_mask`). An alpha channel of the truth is
/// its mask, unless --mask names another, and is composited over the background. In JSON, `null` stands for an infinite
/// PSNR (identical images); a variant that cannot be computed is listed under "not_computed" with the reason.
#[derive(Debug, clap::Args)]
pub(super) struct Score {
    /// Rendered image, or folder of frames
    render: PathBuf,
    /// True image, or folder of frames
    truth: PathBuf,
    /// Mask of the subject, or folder of masks
    #[arg(long, value_name = "M")]
    mask: Option<PathBuf>,
    /// Score under this protocol too: a preset, or a preset with changed choices (see `reproduce list protocols`)
    #[arg(long, value_name = "P")]
    protocol: Option<String>,
    /// Background for images with alpha [default: the protocol's, else white]
    #[arg(long, value_name = "R,G,B", value_parser = parse_colour)]
    background: Option<[f32; 3]>,
    /// How to print the scores
    #[arg(long, value_enum, default_value_t)]
    format: Format,
}

/// The files of one frame.
struct Pair {
    name: String,
    render: PathBuf,
    truth: PathBuf,
    mask: Option<PathBuf>,
}

/// The scores of one frame.
#[derive(Serialize)]
struct Scored {
    #[serde(skip)]
    name: String,
    #[serde(flatten)]
    variants: Map<String, Value>,
    #[serde(skip_serializing_if = "Map::is_empty")]
    not_computed: Map<String, Value>,
    #[serde(skip_serializing_if = "Option::is_none")]
    protocol: Option<FrameScore>,
}

impl Score {
    pub(super) fn run(&self) -> Result<Exit> {
        let protocol = self.protocol.as_deref().map(Protocol::parse).transpose()?;
        let folders = self.truth.is_dir();
        let pairs = if folders { self.paired_folders()? } else { vec![self.single()?] };
        let score = |pair: &Pair| self.score(pair, protocol.as_ref());
        let scored: Vec<Scored> = pairs.par_iter().map(score).collect::<Result<_>>()?;
        match (folders, self.format) {
            (false, Format::Json) => emit_json(&scored[0])?,
            (false, Format::Text) => emit(&scored[0].text())?,
            (true, format) => self.emit_folder(&scored, protocol.as_ref(), format)?,
        }
        Ok(Exit::Success)
    }

    fn single(&self) -> Result<Pair> {
        if self.render.is_dir() || self.mask.as_ref().is_some_and(|mask| mask.is_dir()) {
            bail!("{}: a file; expected a folder, like the other arguments", self.truth.display());
        }
        let name = self.truth.display().to_string();
        Ok(Pair { name, render: self.render.clone(), truth: self.truth.clone(), mask: self.mask.clone() })
    }

    fn paired_folders(&self) -> Result<Vec<Pair>> {
        let renders = frames_of(&self.render)?;
        let truths = frames_of(&self.truth)?;
        let masks = self.mask.as_deref().map(frames_of).transpose()?;
        same_names(&self.render, &renders, &self.truth, &truths)?;
        if let (Some(folder), Some(masks)) = (&self.mask, &masks) {
            same_names(folder, masks, &self.truth, &truths)?;
        }
        let pair = |((name, truth), render): ((String, PathBuf), PathBuf)| {
            let mask = masks.as_ref().and_then(|masks| masks.get(&name)).cloned();
            Pair { name, render, truth, mask }
        };
        Ok(truths.into_iter().zip(renders.into_values()).map(pair).collect())
    }

    fn score(&self, pair: &Pair, protocol: Option<&Protocol>) -> Result<Scored> {
        let of_protocol = protocol.and_then(Protocol::background_colour);
        let background = self.background.or(of_protocol).unwrap_or([1.0; 3]);
        let (render, _) = loaded_over(&pair.render, background)?;
        let (truth, alpha) = loaded_over(&pair.truth, background)?;
        let mask = match &pair.mask {
            Some(path) => Some(load_mask(path)?),
            None => alpha,
        };
        let context = || format!("{} against {}", pair.render.display(), pair.truth.display());
        let (mut variants, mut not_computed) = (Map::new(), Map::new());
        for (id, value) in all_variants(&render, &truth, mask.as_ref()).with_context(context)? {
            match value {
                Ok(value) => variants.insert(id.to_owned(), number(value)),
                Err(reason) => not_computed.insert(id.to_owned(), json!(reason.to_string())),
            };
        }
        let truth = Truth::Composited { rgb: &truth, mask: mask.as_ref() };
        let protocol = protocol.map(|p| p.score(&render, truth)).transpose().with_context(context)?;
        Ok(Scored { name: pair.name.clone(), variants, not_computed, protocol })
    }

    fn emit_folder(&self, scored: &[Scored], protocol: Option<&Protocol>, format: Format) -> Result<()> {
        let mean = means(scored);
        let scores: Option<Vec<FrameScore>> = scored.iter().map(|frame| frame.protocol.clone()).collect();
        let summary = match (protocol, scores) {
            (Some(protocol), Some(scores)) => Some(protocol.aggregate(&scores)?),
            _ => None,
        };
        if format == Format::Json {
            let frames: BTreeMap<&str, &Scored> = scored.iter().map(|f| (f.name.as_str(), f)).collect();
            return emit_json(&json!({ "frames": frames, "mean": mean, "protocol": summary }));
        }
        let mean =
            Scored { name: format!("mean of {} frames", scored.len()), variants: mean, ..Scored::empty() };
        emit(&(scored.iter().map(Scored::text).collect::<String>() + &mean.text()))?;
        if let Some(s) = summary {
            let lpips = s.lpips.map_or("not computed".to_owned(), |v| format!("{v:.6}"));
            emit(&format!(
                "protocol {}: psnr {:.6}  ssim {:.6}  lpips {lpips}\n",
                s.protocol, s.psnr, s.ssim
            ))?;
        }
        Ok(())
    }
}

impl Scored {
    fn empty() -> Self {
        Self { name: String::new(), variants: Map::new(), not_computed: Map::new(), protocol: None }
    }

    fn text(&self) -> String {
        let mut text = format!("{}\n", self.name);
        for (id, value) in &self.variants {
            let value = value.as_f64().map_or("inf".to_owned(), |v| format!("{v:.6}"));
            text += &format!("  {id:36} {value}\n");
        }
        for (id, reason) in &self.not_computed {
            text += &format!("  {id:36} not computed: {}\n", reason.as_str().unwrap_or_default());
        }
        if let Some(score) = &self.protocol {
            let lpips = score.lpips.map_or("not computed".to_owned(), |v| format!("{v:.6}"));
            let FrameScore { protocol, psnr, ssim, .. } = score;
            text += &format!("  {protocol}: psnr {psnr:.6}  ssim {ssim:.6}  lpips {lpips}\n");
        }
        text
    }
}

/// Means over the frames, in their order; only of variants that every frame has. One infinite PSNR makes its mean
/// infinite.
fn means(scored: &[Scored]) -> Map<String, Value> {
    let Some(first) = scored.first() else { return Map::new() };
    let mean = |id: &String| {
        let values: Option<Vec<&Value>> = scored.iter().map(|frame| frame.variants.get(id)).collect();
        let sum: f64 = values?.iter().map(|v| v.as_f64().unwrap_or(f64::INFINITY)).sum();
        Some((id.clone(), number(sum / scored.len() as f64)))
    };
    first.variants.keys().filter_map(mean).collect()
}

/// JSON has no infinity: `null`.
fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or(Value::Null, Value::Number)
}

/// An image over a background, and its alpha.
fn loaded_over(path: &Path, background: [f32; 3]) -> Result<(Image, Option<Mask>)> {
    let (rgb, alpha) = load_image(path)?;
    match alpha {
        None => Ok((rgb, None)),
        Some(alpha) => Ok((rgb.composited(&alpha, background)?, Some(alpha))),
    }
}

/// Image files of a folder by stem, sorted.
fn frames_of(folder: &Path) -> Result<BTreeMap<String, PathBuf>> {
    let context = || format!("{}: cannot list the folder", folder.display());
    let mut frames = BTreeMap::new();
    for entry in std::fs::read_dir(folder).with_context(context)? {
        let path = entry.with_context(context)?.path();
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        let Some(stem) = path.file_stem().and_then(|s| s.to_str()) else { continue };
        if !["png", "jpg", "jpeg", "npy"].contains(&extension.as_str()) {
            continue;
        }
        if let Some(other) = frames.insert(stem.to_owned(), path.clone()) {
            bail!("{} and {}: one name; expected one image per frame", other.display(), path.display());
        }
    }
    if frames.is_empty() {
        bail!("{}: no frames; expected .png, .jpg or .npy images", folder.display());
    }
    Ok(frames)
}

fn same_names(
    left: &Path,
    a: &BTreeMap<String, PathBuf>,
    right: &Path,
    b: &BTreeMap<String, PathBuf>,
) -> Result<()> {
    let strangers = |a: &BTreeMap<String, PathBuf>, b: &BTreeMap<String, PathBuf>| {
        let names: Vec<&str> = a.keys().filter(|k| !b.contains_key(*k)).map(String::as_str).collect();
        let more = if names.len() > 5 { format!(" and {} more", names.len() - 5) } else { String::new() };
        (!names.is_empty()).then(|| names.iter().take(5).copied().collect::<Vec<_>>().join(", ") + &more)
    };
    for (here, there, names) in [(left, right, strangers(a, b)), (right, left, strangers(b, a))] {
        if let Some(names) = names {
            let (here, there) = (here.display(), there.display());
            bail!("{here}: frames {names} have no partner in {there}; expected the same names in both");
        }
    }
    Ok(())
}
