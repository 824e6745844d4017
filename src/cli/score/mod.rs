//! `reproduce score`: two images, or two folders of frames, by every metric variant, under one protocol or under all.

mod all;
mod pairs;
mod summary;

use super::lpips::LpipsWeights;
use super::output::{emit, emit_json, table_format, written};
use super::selection::parse_colour;
use super::{Context, Exit};
use anyhow::{Context as _, Result, bail};
use pairs::Pair;
use serde::Serialize;
use serde_json::{Map, Value, json};
use skinsplat_core::scene::Image;
use skinsplat_metrics::lpips::OneFrame;
use skinsplat_metrics::lpips::weights::Networks;
use skinsplat_metrics::{
    FrameScore, LpipsVariant, MetricId, MetricsError, PerceptualDistance, Planes, Protocol, Summary, Truth,
    Wanted, all_variants,
};
use skinsplat_table::{Table, text};
use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

/// Score renders against truth: two images, or two folders whose frames pair up by name.
///
/// Prints every variant of PSNR and SSIM by its name; with a mask also those of the masked pixels (`_mask`), of the mask's
/// bounding box (`_bbox`) and of images multiplied by the mask (`_image_times_mask`). --lpips adds LPIPS, and --protocol
/// the scores of a paper's own evaluation, LPIPS included: text, Markdown and LaTeX then hold these alone, CSV and JSON the
/// variants too. `--protocol all` prints a table with the scores under every protocol instead, which shows how much the
/// protocol alone moves them.
///
/// An alpha channel of the truth is its mask, unless --mask names another, and is composited over the background. In JSON,
/// `null` stands for an infinite PSNR (identical images); a variant that cannot be computed is listed under "not_computed"
/// with the reason. The other formats hold one table.
///
/// Images are PNG (grey, grey with alpha, RGB, RGBA, palettes; 1 to 16 bits, as v / 65535), JPEG (turned as their Exif
/// orientation says) or .npy arrays (H, W, 3 or 4); render, truth and mask must have one size. Masks are grey.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Score {
    /// Rendered image, or folder of frames
    render: PathBuf,
    /// True image, or folder of frames
    truth: PathBuf,
    /// Mask of the subject, or folder of masks, named as the truths or with their numbers
    #[arg(long, value_name = "M")]
    mask: Option<PathBuf>,
    /// Score under this protocol too: a preset, or a preset with changed choices (see `reproduce list protocols`); `all`
    /// for a table of every preset
    #[arg(long, value_name = "P")]
    protocol: Option<String>,
    /// Also every variant of LPIPS of the whole image
    #[arg(long)]
    lpips: bool,
    #[command(flatten)]
    weights: LpipsWeights,
    /// Background for images with alpha [default: the protocol's, else white]
    #[arg(long, value_name = "R,G,B", value_parser = parse_colour)]
    background: Option<[f32; 3]>,
    /// How to print the scores
    #[arg(long, value_name = "FORMAT", value_parser = table_format(), default_value = "text")]
    format: String,
}

const EXAMPLES: &str = "\
Examples:
  reproduce score render.png truth.png --lpips           every variant of every metric
  reproduce score RENDERS TRUTHS --protocol hugs-human   as HUGS evaluates
  reproduce score RENDERS TRUTHS --protocol all          as each of the papers evaluates";

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
    /// Why the protocol has no score for this frame, though it has for others.
    #[serde(skip_serializing_if = "Option::is_none")]
    protocol_not_computed: Option<String>,
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    over_another_background: bool,
}

impl Score {
    pub(super) fn run(&self, context: Context) -> Result<Exit> {
        let folders = self.truth.is_dir();
        let pairs = if folders { pairs::folders } else { pairs::single };
        let pairs = pairs(&self.render, &self.truth, self.mask.as_deref())?;
        if let Some(guess) = pairs.iter().find_map(|pair| pair.guessed()).filter(|_| folders) {
            context.note(format!("masks paired by their numbers: {guess}"));
        }
        for folder in [Some(&self.render), Some(&self.truth), self.mask.as_ref()].into_iter().flatten() {
            if let Some(found) = folders.then(|| pairs::passed_over(folder)).transpose()?.flatten() {
                context.note(format!("{found}: passed over"));
            }
        }
        if self.protocol.as_deref() == Some(all::ID) {
            all::run(self, &pairs, context)?;
            return Ok(Exit::Success);
        }
        let protocol = self.protocol.as_deref().map(Protocol::parse).transpose()?;
        let networks = self.weights.networks()?;
        let score = |pair: &Pair| self.score(pair, protocol.as_ref(), &networks);
        let scored = pairs::each(&pairs, context, score)?;
        if let Some(warning) = over_another_background(&scored) {
            context.note(format!("warning: {warning}"));
        }
        warn_of_missing(&scored, protocol.as_ref(), context)?;
        match (folders, self.format.as_str()) {
            (false, "json") => emit_json(&scored[0])?,
            (false, format) => emit_table(&table(&scored, None, None, format), format)?,
            (true, format) => emit_folder(&scored, protocol.as_ref(), format)?,
        }
        Ok(Exit::Success)
    }

    /// What images with alpha are composited over.
    fn background(&self, protocol: Option<&Protocol>) -> [f32; 3] {
        self.background.or(protocol.and_then(Protocol::background_colour)).unwrap_or([1.0; 3])
    }

    fn score(&self, pair: &Pair, protocol: Option<&Protocol>, networks: &Networks) -> Result<Scored> {
        let background = self.background(protocol);
        let loaded = pair.load()?;
        let (render, truth) = loaded.over(background)?;
        let mask = loaded.mask();
        let distances = OneFrame::new(networks);
        let context = || pair.files();
        let mut values = all_variants(&render, &truth, mask).with_context(context)?;
        if self.lpips {
            values.extend(lpips_variants(&render, &truth, &distances).with_context(context)?);
        }
        let (mut variants, mut not_computed) = (Map::new(), Map::new());
        for (id, value) in values {
            match value {
                Ok(value) => variants.insert(id.to_owned(), number(value)),
                Err(reason) => not_computed.insert(id.to_owned(), json!(reason.to_string())),
            };
        }
        let truth = Truth::Composited { rgb: &truth, mask };
        let metrics: Vec<MetricId> = MetricId::of_images().collect();
        let wanted = Wanted { lpips: Some(&distances), ..Wanted::of(&metrics) };
        let protocol = protocol.map(|p| p.score_with(&render, truth, wanted)).transpose();
        let (protocol, protocol_not_computed) = match protocol {
            Err(empty @ MetricsError::EmptyRegion { .. }) => (None, Some(empty.to_string())),
            protocol => (protocol.with_context(context)?, None),
        };
        let over_another_background = loaded.lies_over_another(background);
        let name = pair.name.clone();
        Ok(Scored { name, variants, not_computed, protocol, protocol_not_computed, over_another_background })
    }
}

/// All variants of LPIPS of two images.
fn lpips_variants(
    render: &Image,
    truth: &Image,
    distances: &OneFrame<'_>,
) -> Result<Vec<skinsplat_metrics::variants::VariantScore>> {
    let (render, truth) = (Planes::new(render, "render")?, Planes::new(truth, "truth")?);
    let value = |variant: LpipsVariant| (variant.metric(), distances.distance(&render, &truth, variant));
    Ok(LpipsVariant::ALL.map(value).into())
}

/// What is wrong if renders evidently lie over something else.
fn over_another_background(scored: &[Scored]) -> Option<String> {
    let mut others = scored.iter().filter(|frame| frame.over_another_background);
    let first = others.next()?;
    Some(format!(
        "The background of {} of {} renders ({}) is not the one under the truth: not the protocol's numbers; --background \
         R,G,B changes the latter",
        1 + others.count(),
        scored.len(),
        first.name
    ))
}

/// Frames without a score under the protocol; it is an error if none has one.
fn warn_of_missing(scored: &[Scored], protocol: Option<&Protocol>, context: Context) -> Result<()> {
    let missing = |frame: &Scored| Some((frame.name.clone(), frame.protocol_not_computed.clone()?));
    let missing: Vec<(String, String)> = scored.iter().filter_map(missing).collect();
    let (Some(protocol), Some((name, reason))) = (protocol, missing.first()) else { return Ok(()) };
    if missing.len() == scored.len() {
        bail!("{name}: {reason}, protocol {}", protocol.id);
    }
    let (some, all) = (missing.len(), scored.len());
    context.note(format!(
        "warning: protocol {}: no score for {some} of {all} frames ({name}: {reason})",
        protocol.id
    ));
    Ok(())
}

fn emit_folder(scored: &[Scored], protocol: Option<&Protocol>, format: &str) -> Result<()> {
    let mean = Means::of(scored);
    let scores: Vec<FrameScore> = scored.iter().filter_map(|frame| frame.protocol.clone()).collect();
    let summary = protocol.map(|protocol| protocol.aggregate(&scores)).transpose()?;
    if format == "json" {
        let frames: BTreeMap<&str, &Scored> = scored.iter().map(|f| (f.name.as_str(), f)).collect();
        return emit_json(&json!({ "frames": frames, "mean": mean, "protocol": summary }));
    }
    emit_table(&table(scored, Some(&mean), summary.as_ref(), format), format)
}

/// For people, what was asked for: the protocol's scores alone, if there is one. For programs, everything.
fn table(scored: &[Scored], means: Option<&Means>, summary: Option<&Summary>, format: &str) -> Table {
    match scored.iter().find_map(|frame| frame.protocol.as_ref()) {
        Some(score) if format != "csv" => {
            let mut table = summary::under_protocol(&score.protocol, scored, summary);
            table.sentences.extend(over_another_background(scored));
            table
        }
        _ => summary::table(scored, means, summary),
    }
}

/// Terminals get the rows of a list without headings, and notes.
fn emit_table(table: &Table, format: &str) -> Result<()> {
    match format {
        "text" if table.columns.len() == 1 => emit(&(text::rows(table) + &text::notes(table))),
        format => emit(&written(table, format)),
    }
}

/// Means over the frames, in their order, of variants that every frame has. One infinite PSNR makes its mean infinite.
#[derive(Serialize)]
struct Means {
    #[serde(flatten)]
    variants: Map<String, Value>,
    /// Variants that only some frames have.
    #[serde(skip_serializing_if = "Map::is_empty")]
    not_computed: Map<String, Value>,
}

impl Means {
    fn of(scored: &[Scored]) -> Self {
        let ids: BTreeSet<&String> = scored.iter().flat_map(|frame| frame.variants.keys()).collect();
        let (mut variants, mut not_computed) = (Map::new(), Map::new());
        for id in ids {
            let values: Vec<&Value> = scored.iter().filter_map(|frame| frame.variants.get(id)).collect();
            if values.len() < scored.len() {
                let reason = format!("{} of {} frames have it", values.len(), scored.len());
                not_computed.insert(id.clone(), reason.into());
                continue;
            }
            let sum: f64 = values.iter().map(|v| v.as_f64().unwrap_or(f64::INFINITY)).sum();
            variants.insert(id.clone(), number(sum / scored.len() as f64));
        }
        Self { variants, not_computed }
    }
}

/// JSON has no infinity: `null`.
fn number(value: f64) -> Value {
    serde_json::Number::from_f64(value).map_or(Value::Null, Value::Number)
}
