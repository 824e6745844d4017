//! Pages: how many pictures they hold.

use super::made_up::{results, run, table_7};
use image::{Rgb, RgbImage};
use skinsplat::report::Results;
use skinsplat::report::html::{Extras, KeptPictures, Stills, frames_that_fit, html};

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
