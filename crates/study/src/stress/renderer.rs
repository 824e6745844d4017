//! Section `renderer`: the splat renderer on extreme scenes, against the definition of the image in `f64`.

use super::scenes::{FAMILIES, Family, Scene};
use super::table::{
    Cell, Findings, LIMITS, Row, Threshold, Verdict, bisect, column, exactly, label, line, said, shown, words,
};
use skinsplat_core::scene::{Camera, Rendered, SceneError};
use skinsplat_render::splat::{Renderer, SimdLevel, render};
use skinsplat_render::{View, definition};
use skinsplat_table::{self as table, Table};

const SECTION: &str = "renderer";

/// Share of the pixels that may differ more than the verdict says: where alpha is 1/255, rounding decides whether a splat
/// is drawn at all.
const AT_THE_EDGE: f64 = 0.01;

struct Measured {
    finite: bool,
    deterministic: bool,
    /// Largest difference of a channel or alpha; the same without the [`AT_THE_EDGE`] worst pixels.
    errors: [f64; 2],
    visible: f64,
}

/// How scenes are seen.
fn view(camera: &Camera) -> View<'_> {
    View::new(camera).over([0.2, 0.4, 0.6])
}

fn measure(scene: &Scene, every_way: bool) -> Result<Measured, SceneError> {
    let own = render(&scene.posed.as_posed(), &view(&scene.camera))?;
    let (posed, camera) = scene.truth.as_ref().map_or((&scene.posed, &scene.camera), |(p, c)| (p, c));
    let truth = definition::render(&posed.as_posed(), &view(camera))?;
    // What is brighter than white is judged relative to how bright it is.
    let brightest = truth.iter().flat_map(|p| &p[..4]).fold(1.0f64, |m, v| m.max(v.abs()));
    let found = own.image.pixels().iter().zip(own.alpha.values());
    let mut errors: Vec<f64> = found
        .zip(&truth)
        .map(|((rgb, &alpha), truth)| {
            let channels = [rgb[0], rgb[1], rgb[2], alpha].map(f64::from);
            let off = channels.iter().zip(truth).map(|(a, b)| (a - b).abs() / brightest);
            off.fold(0.0, |m, v| if v > m || v.is_nan() { v } else { m })
        })
        .collect();
    errors.sort_unstable_by(f64::total_cmp);
    let kept = errors.len() - 1 - (AT_THE_EDGE * errors.len() as f64) as usize;
    Ok(Measured {
        finite: is_finite(&own),
        deterministic: !every_way || same_every_way(scene, &own),
        errors: [errors[errors.len() - 1], errors[kept]],
        visible: own.alpha.values().iter().fold(0.0, |m, &v| m.max(f64::from(v))),
    })
}

fn is_finite(rendered: &Rendered) -> bool {
    rendered.image.pixels().as_flattened().iter().all(|v| v.is_finite())
        && rendered.alpha.values().iter().chain(rendered.depth.values()).all(|v| v.is_finite())
}

/// Again, with one and with two threads, and with every vector width that this processor has.
fn same_every_way(scene: &Scene, own: &Rendered) -> bool {
    let (posed, view) = (scene.posed.as_posed(), view(&scene.camera));
    let pools = [1, 2].map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build());
    let by_threads = pools
        .iter()
        .flatten()
        .all(|pool| pool.install(|| render(&posed, &view)).is_ok_and(|drawn| drawn == *own));
    let by_width = SimdLevel::available()
        .filter_map(Renderer::with_simd_level)
        .all(|mut renderer| renderer.render(&posed, &view).is_ok_and(|drawn| drawn == own));
    by_threads && by_width
}

/// The section. `quick`: no more than 100,000 splats at one place.
pub(super) fn run(quick: bool) -> Result<Findings, SceneError> {
    let mut findings =
        Findings { section: SECTION, title: "The splat renderer on extreme scenes", ..Findings::default() };
    let title =
        "Difference from the image of the definition in f64 (99 % of the pixels within), channels in [0, 1]";
    let mut table = Table {
        labels: ["family", "axis"].map(label).into(),
        columns: vec![column("verdict"), words("value: difference")],
        ..Table::new("scenes", title)
    };
    for family in &FAMILIES {
        let points: Vec<f64> =
            family.points.iter().copied().filter(|&x| !quick || x < 1e6 || family.continuous).collect();
        let mut cells = Vec::new();
        let (mut worst, mut sound) = (Verdict::Holds, None);
        for &x in &points {
            let measured = measure(&(family.make)(x), true)?;
            let row = row(family, x, &measured);
            worst = worst.max(row.verdict);
            cells.push(format!("{}: {}", exactly(x), row.error));
            if row.verdict == Verdict::Breaks {
                if let Some(sound) = sound.filter(|_| family.continuous) {
                    findings.thresholds.push(threshold(family, sound, x));
                }
                sound = None;
            } else {
                sound = Some(x);
            }
            findings.rows.push(row);
        }
        let broken = findings.thresholds.iter().find(|t| t.family == family.id);
        let verdict = broken.map_or_else(
            || table::Cell::text(worst.to_string()),
            |threshold| {
                let words = format!("breaks at {}", said(threshold.said));
                table::Cell::phrase(threshold.said, words)
            },
        );
        let labels = [family.id.to_owned(), family.axis.to_owned()];
        table.rows.push(line(labels, vec![verdict, table::Cell::text(cells.join(", "))]));
    }
    findings.tables.push(table);
    findings.causes = causes();
    Ok(findings)
}

fn verdict(measured: &Measured) -> Verdict {
    if measured.finite && measured.deterministic {
        Verdict::of(measured.errors[1], LIMITS.image)
    } else {
        Verdict::Breaks
    }
}

fn threshold(family: &Family, sound: f64, broken: f64) -> Threshold {
    // A scene that cannot be drawn breaks.
    let breaks = |x: f64| {
        measure(&(family.make)(x), false).map_or(Verdict::Breaks, |measured| verdict(&measured))
            == Verdict::Breaks
    };
    let breaks_at = bisect(sound, broken, breaks);
    Threshold {
        section: SECTION,
        family: family.id.to_owned(),
        subject: "splat renderer".to_owned(),
        precision: "f32",
        breaks_at,
        said: breaks_at,
        axis: family.axis.to_owned(),
    }
}

fn row(family: &Family, x: f64, measured: &Measured) -> Row {
    Row {
        section: SECTION,
        family: family.id.to_owned(),
        input: exactly(x),
        subject: "splat renderer".to_owned(),
        precision: "f32",
        finite: Cell::Flag(measured.finite),
        rotation_error: Cell::Word("no rotation"),
        error: Cell::number(measured.errors[1]),
        equivariance: Cell::Word("see scene shifted"),
        jump: Cell::Word("one frame"),
        deterministic: Cell::Flag(measured.deterministic),
        verdict: verdict(measured),
        note: format!(
            "largest difference {}, largest alpha {}",
            shown(measured.errors[0]),
            shown(measured.visible)
        ),
    }
}

fn causes() -> Vec<String> {
    [
        "Nothing is drawn at or in front of a view depth of 0.2, at an opacity below 1/255, or where a number leaves the \
         range of f32: by definition, and never with NaN.",
        "needle, larger than the screen: the determinant of the screen covariance is a difference of products in f32, as in \
         the original kernels: it is rounding once the longer axis is some thousand times the shorter. Same semantics as \
         what avatars were trained with, so it stays.",
        "scene shifted: means are f32: half a millimetre at 10 km, 6 cm at 1,000 km. Shift scene and camera back together \
         (both are f64 before posing) and nothing is lost.",
        "camera far: view depths are f32, so that neighbours change their order when the distance is some million times \
         their spacing.",
    ]
    .map(str::to_owned)
    .to_vec()
}
