//! Section `faces`: frames on triangles that are slivers, tiny, far away, inverted or without area.

use super::averages::rotation_error;
use super::table::{Cell, Findings, LIMITS, Row, Threshold, Verdict, bisect, exactly, label, line, words};
use glam::DVec3;
use skinsplat_core::math::rotation::{angle_between, polar};
use skinsplat_core::math::{Matrix3, Quaternion, matrix3};
use skinsplat_posing::{FaceFrame, RotationChoice, face_frame};
use skinsplat_table::{self as table, Table};

const SECTION: &str = "faces";

const KINDS: [FaceFrame; 3] = [FaceFrame::SplattingAvatar, FaceFrame::IHuman, FaceFrame::Haha];

/// Triangles along an axis.
struct Family {
    id: &'static str,
    axis: &'static str,
    points: &'static [f64],
    make: fn(f64) -> [DVec3; 3],
}

/// A triangle with a base of `size`, `height` over it (negative: turned over), `away` from the origin.
fn triangle(size: f64, height: f64, away: f64) -> [DVec3; 3] {
    let (x, y) = (DVec3::new(0.48, -0.64, 0.6), DVec3::new(0.8, 0.6, 0.0));
    let origin = DVec3::new(0.3, 0.5, -0.8) * away;
    [origin, origin + x * size, origin + x * (0.3 * size) + y * height]
}

const FAMILIES: [Family; 5] = [
    Family {
        id: "sliver",
        axis: "height over base",
        points: &[1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8, 0.0],
        make: |x| triangle(0.01, 0.01 * x, 0.0),
    },
    Family {
        id: "sliver, inverted",
        axis: "height over base, turned over",
        points: &[1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8],
        make: |x| triangle(0.01, -0.01 * x, 0.0),
    },
    Family {
        id: "sliver on a body",
        axis: "height over base, one metre from the origin",
        points: &[1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-8],
        make: |x| triangle(0.01, 0.01 * x, 1.0),
    },
    Family {
        id: "tiny",
        axis: "edge, metres",
        points: &[1e-2, 1e-4, 1e-8, 1e-12, 1e-16, 1e-20, 1e-30, 0.0],
        make: |x| triangle(x, x, 0.0),
    },
    Family {
        id: "far",
        axis: "distance from the origin of a face of 1 cm, metres",
        points: &[1.0, 10.0, 1e2, 1e3, 1e4, 1e5, 1e6],
        make: |x| triangle(0.01, 0.01, x),
    },
];

/// The frame by its definition, in `f64`.
fn exact(kind: FaceFrame, [a, b, c]: [DVec3; 3]) -> Option<Quaternion<f64>> {
    let (edge, side) = match kind {
        FaceFrame::SplattingAvatar | FaceFrame::IHuman => (b - a, c - a),
        FaceFrame::Haha | FaceFrame::HahaScaled => (c - b, a - b),
    };
    let (t, n) = (edge.try_normalize()?, edge.cross(side).try_normalize()?);
    let [x, y, z] = match kind {
        FaceFrame::SplattingAvatar => [t.cross(n), -n, t],
        FaceFrame::IHuman => [n, -t, n.cross(-t)],
        FaceFrame::Haha | FaceFrame::HahaScaled => [t, n, t.cross(n)],
    };
    polar(matrix3::transpose([x, y, z].map(|v| v.to_array())))
}

struct Measured {
    rotation_error: f64,
    degrees: f64,
    verdict: Verdict,
}

/// `None`: the face has no frame, and says so.
fn measure(kind: FaceFrame, family: &Family, x: f64) -> Option<Measured> {
    let corners = (family.make)(x);
    let frame: Matrix3<f64> =
        face_frame::frame(kind, corners.map(|v| v.as_vec3()))?.map(|row| row.map(f64::from));
    let degrees = angle_between(polar(frame)?, exact(kind, corners)?).to_degrees();
    let rotation_error = rotation_error(&frame);
    let verdict = Verdict::of(degrees, LIMITS.degrees).max(Verdict::of(rotation_error, LIMITS.rotation));
    Some(Measured { rotation_error, degrees, verdict })
}

/// The section.
pub(super) fn run() -> Findings {
    let mut findings = Findings { section: SECTION, title: "Frames on bad faces", ..Findings::default() };
    let mut table = Table {
        labels: ["frame", "family", "axis"].map(label).into(),
        columns: vec![words("value: degrees")],
        remarks: vec![
            "A face whose |edge × side| is at most 1e-5 |edge| |side| has no frame; its Gaussians turn with the quaternion \
             average. The corners are rounded to f32 before the frame is made, as the posed mesh is."
                .to_owned(),
        ],
        ..Table::new("frames", "Degrees off the frame of the same face in f64")
    };
    for kind in KINDS {
        for family in &FAMILIES {
            let mut cells = Vec::new();
            let mut sound = None;
            for &x in family.points {
                let measured = measure(kind, family, x);
                let verdict = measured.as_ref().map_or(Verdict::Degrades, |m| m.verdict);
                let degrees = measured.as_ref().map_or(Cell::Word("no frame"), |m| Cell::number(m.degrees));
                cells.push(format!("{}: {degrees}", exactly(x)));
                findings.rows.push(Row {
                    section: SECTION,
                    family: family.id.to_owned(),
                    input: exactly(x),
                    subject: RotationChoice::FaceFrame(kind).to_string(),
                    precision: "f32",
                    finite: Cell::Flag(true),
                    rotation_error: measured
                        .as_ref()
                        .map_or(Cell::Word("no frame"), |m| Cell::number(m.rotation_error)),
                    error: degrees,
                    equivariance: Cell::Word("see poses"),
                    jump: Cell::Word("see sequences"),
                    deterministic: Cell::Word("see poses"),
                    verdict,
                    note: if measured.is_none() {
                        "falls back on the average".to_owned()
                    } else {
                        String::new()
                    },
                });
                if verdict == Verdict::Breaks {
                    if let Some(sound) = sound {
                        let broken =
                            |x: f64| measure(kind, family, x).is_some_and(|m| m.verdict == Verdict::Breaks);
                        let breaks_at = bisect(sound, x, broken);
                        findings.thresholds.push(Threshold {
                            section: SECTION,
                            family: family.id.to_owned(),
                            subject: RotationChoice::FaceFrame(kind).to_string(),
                            precision: "f32",
                            breaks_at,
                            said: breaks_at,
                            axis: family.axis.to_owned(),
                        });
                    }
                    sound = None;
                } else {
                    sound = Some(x);
                }
            }
            let labels =
                [RotationChoice::FaceFrame(kind).to_string(), family.id.to_owned(), family.axis.to_owned()];
            table.rows.push(line(labels, vec![table::Cell::text(cells.join(", "))]));
        }
    }
    findings.tables.push(table);
    findings.causes = vec![
        "The normal of a sliver is its edges' rounding over their sine: on a body one metre from the origin, a corner \
         stored in f32 is off by 6e-8 m, which turns the frame of a 1 cm face by a degree once it is lower than some \
         micrometres, and any frame beyond tens of kilometres. The f32 mesh is the limit, not the formula."
            .to_owned(),
        "An inverted face has a proper frame: it is that of the face seen from behind, half a turn from before."
            .to_owned(),
    ];
    findings
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn good_faces_have_the_frame_of_the_definition() {
        for kind in KINDS {
            let measured = measure(kind, &FAMILIES[0], 1.0).unwrap();
            assert!(measured.degrees < 1e-4 && measured.verdict == Verdict::Holds, "{}", measured.degrees);
        }
        assert!(face_frame::frame(FaceFrame::Haha, [Vec3::ZERO; 3]).is_none());
    }
}
