//! Pages: how many pictures they hold.

use super::made_up::{results, run, table_7};
use image::{Rgb, RgbImage};
use skinsplat::report::html::{BOUND, Extras, KeptPictures, Stills, frames_that_fit, html};
use skinsplat::report::{FrameResult, Results};
use skinsplat_metrics::MetricId;
use std::collections::BTreeMap;
use std::time::Instant;

/// A picture that no codec makes small.
fn noise(seed: u32) -> RgbImage {
    let hash = |x: u32, y: u32, c: u32| {
        let mixed =
            (seed ^ x.wrapping_mul(0x9e37_79b9) ^ y.wrapping_mul(0x85eb_ca6b) ^ c.wrapping_mul(0xc2b2_ae35))
                .wrapping_mul(0x27d4_eb2f);
        (mixed ^ (mixed >> 15)).wrapping_mul(0x1656_67b1).to_be_bytes()[0]
    };
    RgbImage::from_fn(40, 30, |x, y| Rgb([hash(x, y, 1), hash(x, y, 2), hash(x, y, 3)]))
}

fn stills(results: &Results, count: u32) -> Vec<Stills> {
    let table = &results.tables[0];
    let sequence = &table.sequences[0];
    let still = |i: u32| Stills {
        table: table.experiment.clone(),
        sequence: sequence.id.clone(),
        frame: format!("image_{i:04}"),
        truth: noise(9 * i),
        variants: vec![(sequence.variants[0].id.clone(), noise(9 * i + 1))],
    };
    (0..count).map(still).collect()
}

/// A few frames tell how many fit, so that no more are read; they fill the page and stay within its bound.
#[test]
fn as_many_frames_are_read_as_a_page_can_show() {
    let results = results(&table_7(), run);
    let extras = |count: u32, kept: usize| {
        let pictures = KeptPictures { stills: stills(&results, count), kept, ..KeptPictures::default() };
        Extras { pictures, bound: 400_000, ..Extras::default() }
    };
    let kept = 3000;
    let fit = frames_that_fit(&results, &extras(8, kept), kept);
    assert!((8..300).contains(&fit), "{fit}");
    let page = html(&results, &extras(u32::try_from(fit).unwrap(), kept));
    assert!(page.len() <= 400_000 && page.len() > 300_000, "{fit} frames: {} bytes", page.len());
    assert!(page.contains(&format!("Pictures of {fit} of the {kept} frames")), "{fit}");
    // Where everything fits, everything is read.
    assert_eq!(frames_that_fit(&results, &extras(8, 10), 10), 10);
    assert!(!html(&results, &extras(8, 8)).contains("Pictures of"));
}

/// Points lead to pictures that are there; of others they say why not, and over the bend as over frames.
#[test]
fn points_lead_to_pictures_that_the_page_has() {
    let results = results(&table_7(), run);
    let stills = stills(&results, 1);
    let sequence = &results.tables[0].sequences[0];
    let frames = &sequence.variants[0].frames;
    let bends =
        frames.iter().zip(0..).map(|(frame, k)| (frame.key.clone(), 30.0 + 5.0 * f64::from(k))).collect();
    let name = |frame: &str| [stills[0].table.clone(), stills[0].sequence.clone(), frame.to_owned()];
    let unread = vec![name(&frames[1].name)];
    let first = Stills { frame: frames[0].name.clone(), ..stills.into_iter().next().unwrap() };
    let pictures = KeptPictures { stills: vec![first], kept: 2, unread, ..KeptPictures::default() };
    let page = html(&results, &Extras { pictures, bends, bound: 400_000, ..Extras::default() });
    for view in ["over frames", "over bend"] {
        assert!(page.contains(&format!("data-view=\"{view}\"")), "{view}");
    }
    assert!(page.contains("widest angle between joints"));
    let link = format!("data-frame=\"{}\"", frames[0].name);
    assert!(page.matches(&link).count() >= 2, "in both views");
    assert!(!page.contains(&format!("data-frame=\"{}\"", frames[1].name)), "it would lead nowhere");
    assert!(page.contains("its picture was left out to keep the page small"));
    let plain = html(&results, &Extras { bound: 400_000, ..Extras::default() });
    assert!(
        !plain.contains("over bend") && !plain.contains("its picture"),
        "nothing is known, nothing was kept"
    );
}

/// Sequences of thousands of frames: the page is small, quickly made, and says that it draws one frame in so many.
#[test]
fn ten_thousand_frames_are_one_page() {
    const FRAMES: usize = 10_000;
    let mut results = results(&table_7(), run);
    let (mut bends, mut unread) = (BTreeMap::new(), Vec::new());
    let table = &mut results.tables[0];
    let sequence = &mut table.sequences[0];
    for (v, variant) in sequence.variants.iter_mut().enumerate() {
        let model = variant.frames[0].clone();
        let frame = |k: usize| FrameResult {
            frame: k,
            name: format!("image_{k:05}"),
            key: format!("{v}/{k}"),
            ..model.clone()
        };
        variant.frames = (0..FRAMES).map(frame).collect();
        // A peak in no place of any pattern.
        variant.frames[4999].score.as_mut().unwrap().values.insert(MetricId::PSNR, 77.0);
        bends.extend(variant.frames.iter().map(|frame| (frame.key.clone(), frame.frame as f64 % 150.0)));
    }
    for frame in &sequence.variants[0].frames {
        unread.push([table.experiment.clone(), sequence.id.clone(), frame.name.clone()]);
    }
    let pictures = KeptPictures { kept: FRAMES, unread, ..KeptPictures::default() };
    let start = Instant::now();
    let page = html(&results, &Extras { pictures, bends, bound: BOUND, ..Extras::default() });
    eprintln!("{FRAMES} frames: {} bytes in {:.2} s", page.len(), start.elapsed().as_secs_f64());
    assert!(page.len() < 3_000_000 && page.len() < BOUND, "{} bytes", page.len());
    for every in [14, 67] {
        let told = format!("Of every {every} frames the lowest and the highest are drawn.");
        assert!(page.contains(&told), "{every}");
    }
    assert!(page.contains("image_04999: 77.000"), "a peak is drawn");
    // Less room: fewer points, which the page says.
    let small = html(&results, &Extras { bound: 120_000, ..Extras::default() });
    assert!(small.len() <= 120_000 && small.contains("Charts have fewer points"), "{}", small.len());
    assert!(!page.contains("Charts have fewer points"));
    assert!(start.elapsed().as_secs() < 30, "{:?}", start.elapsed());
}
