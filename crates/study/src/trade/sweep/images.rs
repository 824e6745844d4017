//! The rasterizer: what it leaves out, and how many pixels it draws.

use super::Bench;
use crate::trade::exact::Shot;
use crate::trade::{Error, Fidelity, Outcome, Sweep, SweepRow, Unit, clock};
use skinsplat_core::scene::{Camera, Image, OwnedPosed};
use skinsplat_render::definition::{self, Cutoffs};
use skinsplat_render::splat::{RenderSettings, Renderer};

/// What the plain renderer does.
#[derive(Clone, PartialEq)]
struct Way {
    name: String,
    cutoffs: Cutoffs,
    antialiased: bool,
}

/// Cut-offs that are swept.
fn ways() -> Vec<Way> {
    let none = Cutoffs::NONE;
    let way = |name: String, cutoffs| Way { name, cutoffs, antialiased: false };
    let mut all = vec![way("none".to_owned(), none)];
    for least in [1024.0, 255.0, 64.0, 16.0] {
        all.push(way(format!("alpha 1/{least}"), Cutoffs { alpha: 1.0 / least, ..none }));
    }
    for least in [1e-4, 1e-3, 1e-2, 1e-1] {
        all.push(way(format!("transmittance {least}"), Cutoffs { transmittance: least, ..none }));
    }
    all.push(way("3 sigma".to_owned(), Cutoffs { three_sigma: true, ..none }));
    all.push(Way { antialiased: true, ..way("antialiasing".to_owned(), none) });
    for (alpha, transmittance) in [(64.0, 1e-2), (16.0, 1e-1)] {
        let name = format!("alpha 1/{alpha}, transmittance {transmittance}");
        all.push(way(name, Cutoffs { alpha: 1.0 / alpha, transmittance, ..none }));
    }
    all.push(way("3DGS: alpha 1/255, transmittance 1e-4, 3 sigma".to_owned(), Cutoffs::STOCK));
    all
}

/// Every cut-off alone and together, in a plain renderer that can do without.
pub(super) fn cutoffs(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let motion = &stage.motions[0];
    let posed: Vec<OwnedPosed> =
        motion.shots.iter().map(|shot| shot.exactly(&stage.rig, &stage.avatar.gaussians)).collect();
    let one = |way: &Way, posed: &OwnedPosed, shot: &Shot| -> Image {
        let settings = RenderSettings { antialiased: way.antialiased, ..stage.settings };
        definition::draw(&posed.as_posed(), &shot.camera, &settings, way.cutoffs).image
    };
    let draw = |way: &Way| -> Vec<Image> {
        posed.iter().zip(&motion.shots).map(|(posed, shot)| one(way, posed, shot)).collect()
    };
    let ways = ways();
    let exact = draw(&ways[0]);
    let row = |name: String, outcome, note: &str| SweepRow {
        motion: motion.id,
        choice: vec![name],
        outcome: Ok(outcome),
        note: note.to_owned(),
    };
    let mut rows = Vec::new();
    for way in &ways {
        let fidelity = Some(Fidelity::between(draw(way).iter().zip(&exact))?);
        let repeats = stage.options.repeats.div_ceil(3);
        let work = || clock::time(repeats, || one(way, &posed[0], &motion.shots[0]));
        let time = Some(bench.pool.install(work));
        let note = match (*way == ways[0], way.antialiased) {
            (true, _) => "the exact image",
            (_, true) => "another definition of the image: judged under Resolution",
            _ => "",
        };
        rows.push(row(way.name.clone(), Outcome { time, fidelity, ..Outcome::default() }, note));
    }
    let fidelity = Some(Fidelity::between(bench.exact[0].iter().zip(&exact))?);
    let outcome = Outcome { fidelity, ..Outcome::default() };
    rows.push(row(
        "the program's rasterizer".to_owned(),
        outcome,
        "3DGS in f32 and vector lanes; timed under Resolution",
    ));
    Ok(Sweep {
        id: "cutoffs",
        title: "Cut-offs of the renderer",
        about: "A plain f64 renderer with each cut-off alone, on exact rotations of the test motion, against the image without \
                any (3 sigma ends splats at whole tiles, alpha and none at the pixel): what a cut-off saves there is the work that it leaves out, not what a tuned rasterizer would save."
            .to_owned(),
        axes: vec!["Cut-off"],
        unit: Unit::PerFrame,
        by_bytes: false,
        rows,
    })
}

/// Shares of the resolution, numerator and denominator.
const SHARES: [(u32, u32); 5] = [(2, 1), (1, 1), (3, 4), (1, 2), (1, 4)];

/// Resolution and antialiasing, against what many samples per pixel see.
pub(super) fn resolutions(bench: &Bench) -> Result<Sweep, Error> {
    let stage = bench.stage;
    let motion = &stage.motions[0];
    let samples = if stage.options.quick { 2 } else { 4 };
    let posed: Vec<OwnedPosed> =
        motion.shots.iter().map(|shot| shot.exactly(&stage.rig, &stage.avatar.gaussians)).collect();
    let truth: Vec<Image> = posed
        .iter()
        .zip(&motion.shots)
        .map(|(posed, shot)| {
            let camera = scaled(&shot.camera, (samples, 1));
            let drawn = definition::draw(&posed.as_posed(), &camera, &stage.settings, Cutoffs::NONE).image;
            averaged(&drawn, samples as usize)
        })
        .collect();
    let mut rows = Vec::new();
    for share in SHARES {
        for antialiased in [false, true] {
            let settings = RenderSettings { antialiased, ..stage.settings };
            let mut renderer = Renderer::new();
            let images: Vec<Image> = posed
                .iter()
                .zip(&motion.shots)
                .map(|(posed, shot)| {
                    let drawn =
                        renderer.render(&posed.as_posed(), &scaled(&shot.camera, share), &settings).image;
                    if share == (2, 1) {
                        averaged(&drawn, 2)
                    } else {
                        enlarged(&drawn, shot.camera.width as usize, shot.camera.height as usize)
                    }
                })
                .collect();
            let camera = scaled(&motion.shots[0].camera, share);
            let mut rendered = renderer.render(&posed[0].as_posed(), &camera, &settings);
            let time =
                Some(bench.time(|| renderer.render_into(&posed[0].as_posed(), &camera, &settings, &mut rendered)));
            let fidelity = Some(Fidelity::between(images.iter().zip(&truth))?);
            let (over, under) = share;
            rows.push(SweepRow {
                motion: motion.id,
                choice: vec![
                    if under == 1 { over.to_string() } else { format!("{over}/{under}") },
                    if antialiased { "on" } else { "off" }.to_owned(),
                ],
                outcome: Ok(Outcome { time, fidelity, ..Outcome::default() }),
                note: format!("{} x {} pixels", camera.width, camera.height),
            });
        }
    }
    Ok(Sweep {
        id: "resolution",
        title: "Resolution and antialiasing",
        about: format!(
            "The program's rasterizer on exact rotations of the test motion, at shares of the resolution and enlarged \
             bilinearly (2: drawn twice as large and averaged), against {} samples per pixel without any cut-off. The time \
             is that of drawing alone.",
            samples * samples
        ),
        axes: vec!["Resolution", "Antialiasing"],
        unit: Unit::PerFrame,
        by_bytes: false,
        rows,
    })
}

fn scaled(camera: &Camera, (over, under): (u32, u32)) -> Camera {
    let side = |n: u32| (n * over / under).max(1);
    camera.resized(side(camera.width), side(camera.height))
}

/// The mean of every square of `samples` times `samples` pixels.
fn averaged(image: &Image, samples: usize) -> Image {
    let (width, height) = (image.width() / samples, image.height() / samples);
    let mut small = Image::filled(width, height, [0.0; 3]);
    for (i, pixel) in small.pixels_mut().iter_mut().enumerate() {
        let (left, top) = (i % width * samples, i / width * samples);
        let mut sum = [0.0_f64; 3];
        for y in top..top + samples {
            for x in left..left + samples {
                let colour = image.at(x, y);
                (0..3).for_each(|c| sum[c] += f64::from(colour[c]));
            }
        }
        *pixel = sum.map(|s| (s / (samples * samples) as f64) as f32);
    }
    small
}

/// The image enlarged bilinearly, pixel centres at +1/2, edges repeated. The same image if the size is its own.
fn enlarged(image: &Image, width: usize, height: usize) -> Image {
    if (image.width(), image.height()) == (width, height) {
        return image.clone();
    }
    let place = |i: usize, of: usize, from: usize| {
        let at = ((i as f64 + 0.5) * from as f64 / of as f64 - 0.5).clamp(0.0, (from - 1) as f64);
        let low = at.floor() as usize;
        (low, (low + 1).min(from - 1), (at - low as f64) as f32)
    };
    let mut large = Image::filled(width, height, [0.0; 3]);
    for (i, pixel) in large.pixels_mut().iter_mut().enumerate() {
        let (x0, x1, u) = place(i % width, width, image.width());
        let (y0, y1, v) = place(i / width, height, image.height());
        let mix = |a: [f32; 3], b: [f32; 3], t: f32| -> [f32; 3] {
            std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
        };
        let top = mix(image.at(x0, y0), image.at(x1, y0), u);
        *pixel = mix(top, mix(image.at(x0, y1), image.at(x1, y1), u), v);
    }
    large
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp along x survives both ways but for the repeated edges.
    #[test]
    fn ramps_survive_averaging_and_enlarging() {
        let ramp = |width: usize, step: f32| {
            let mut image = Image::filled(width, 4, [0.0; 3]);
            image
                .pixels_mut()
                .iter_mut()
                .enumerate()
                .for_each(|(i, p)| *p = [((i % width) as f32 + 0.5) * step; 3]);
            image
        };
        assert_eq!(averaged(&ramp(8, 0.1), 2).at(1, 1), [0.3; 3]);
        let large = enlarged(&ramp(4, 0.2), 8, 8);
        for x in 1..7 {
            assert!((large.at(x, 3)[0] - (x as f32 + 0.5) * 0.1).abs() < 1e-6);
        }
        assert_eq!(large.at(0, 0), ramp(4, 0.2).at(0, 0));
        assert_eq!(enlarged(&large, 8, 8), large);
    }
}
