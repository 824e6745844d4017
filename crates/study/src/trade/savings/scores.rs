//! Metrics that no column shows.

use super::Saving;
use super::rows::{Bench, identical, strategy};
use crate::trade::Error;
use crate::trade::clock::in_turns;
use skinsplat_core::scene::Image;
use skinsplat_data::Truth;
use skinsplat_metrics::lpips::weights;
use skinsplat_metrics::lpips::{Network, NetworkSource, OneFrame};
use skinsplat_metrics::{FrameScore, LpipsNet, MetricId, MetricsError, Protocol, Wanted};
use skinsplat_posing::pose;
use skinsplat_render::View;
use skinsplat_render::splat::render;
use std::hint::black_box;

const PSNR_SSIM: [MetricId; 2] = [MetricId::PSNR, MetricId::SSIM];
const WITH_LPIPS: [MetricId; 3] = [MetricId::PSNR, MetricId::SSIM, MetricId::LPIPS];

/// A frame of the scene, drawn, and its truth.
struct Scored {
    protocol: Protocol,
    drawn: Image,
    truth: Truth,
}

impl Scored {
    fn new(bench: &Bench<'_>) -> Result<Self, Error> {
        let protocol = Protocol::parse("default")?;
        let background = protocol.background_colour().unwrap_or_default();
        let posed = pose(&bench.bound, &bench.bodies[0], &strategy("quaternion-average")?)?;
        let view = View::new(bench.cameras[0]).over(background);
        let drawn = render(&posed.as_posed(), &view)?.image;
        Ok(Self { protocol, drawn, truth: bench.scene.test.truth(bench.scene.frames[0])? })
    }

    fn score(&self, wanted: Wanted<'_>) -> Result<FrameScore, MetricsError> {
        let truth = skinsplat_metrics::Truth::Straight { rgb: &self.truth.rgb, alpha: &self.truth.alpha };
        self.protocol.score_with(&self.drawn, truth, wanted)
    }
}

/// A network that was read for one frame.
struct Fresh(Network);

impl NetworkSource for Fresh {
    fn network(&self, _: LpipsNet) -> Result<&Network, MetricsError> {
        Ok(&self.0)
    }
}

/// No column for SSIM.
pub(super) fn ssim(bench: &Bench<'_>) -> Result<Saving, Error> {
    let frame = Scored::new(bench)?;
    let [all, needed] = [&PSNR_SSIM[..], &PSNR_SSIM[..1]].map(Wanted::of);
    let same = frame.score(all)?.channel_mse == frame.score(needed)?.channel_mse;
    let run = |wanted| frame.score(wanted).map(|score| drop(black_box(score)));
    let [without, with] = in_turns(bench.options.runs, || run(all), || run(needed))?;
    let what = "no column for SSIM: PSNR alone computed".to_owned();
    Ok(Saving { what, unit: "frame, scored", without, with, result: identical(f64::NAN, same, "PSNR") })
}

/// No column for LPIPS.
pub(super) fn lpips(bench: &Bench<'_>) -> Result<Saving, Error> {
    let frame = Scored::new(bench)?;
    let all = || {
        let network = Fresh(weights::read_embedded());
        frame.score(Wanted { lpips: Some(&OneFrame::new(&network)), ..Wanted::of(&WITH_LPIPS) })
    };
    let needed = || frame.score(Wanted::of(&PSNR_SSIM));
    let (full, part) = (all()?, needed()?);
    let same =
        full.channel_mse == part.channel_mse && full.value(MetricId::SSIM) == part.value(MetricId::SSIM);
    let [without, with] = in_turns(
        bench.options.runs,
        || all().map(|score| drop(black_box(score))),
        || needed().map(|score| drop(black_box(score))),
    )?;
    let what = "no column for LPIPS: its weights not read, its network not run".to_owned();
    let result = identical(f64::NAN, same, "PSNR and SSIM");
    Ok(Saving { what, unit: "first frame, scored", without, with, result })
}
