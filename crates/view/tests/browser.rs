//! The page in a browser: it poses as `f64` does, plays, turns, compares, and shows no complaint.
#![expect(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../../page/tests/support/chromium.rs"]
mod chromium;

use chromium::Chromium;
use glam::{DVec3, Vec3};
use skinsplat_core::math::average::{Solver, average_rotation};
use skinsplat_core::math::rotation::{self, angle_between};
use skinsplat_core::math::{Quaternion, matrix3};
use skinsplat_core::scene::{
    Avatar, Binding, Camera, Gaussians, Pose, PosedBody, RestBody, Skeleton, SkinWeights,
};
use skinsplat_posing::{BoundAvatar, PoseOptions, Poser};
use skinsplat_render::{View, splat};
use skinsplat_view::{Motion, Page, ViewError};
use std::path::Path;

const NAME: &str = "<b>arm</b> {{data}} & \"co\"";

/// An arm along x with an elbow at 1 m.
fn body() -> RestBody {
    let names = vec!["shoulder".into(), "elbow".into(), "wrist".into()];
    let places = [DVec3::ZERO, DVec3::X, 2.0 * DVec3::X];
    let skeleton = Skeleton::from_joint_positions(names, vec![None, Some(0), Some(1)], &places).unwrap();
    RestBody {
        skeleton,
        vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
        faces: vec![[0, 1, 2]],
        weights: SkinWeights::from_rows([vec![(0, 1.0)], vec![(1, 1.0)], vec![(0, 1.0)]], 3).unwrap(),
        uv: None,
        pose_directions: Vec::new(),
    }
}

/// Flat Gaussians on a tube, striped, some of them shiny to one side, all joints blending.
fn avatar() -> Avatar {
    let (rings, around) = (90, 36);
    let mut gaussians = Gaussians { sh_degree: 1, ..Gaussians::default() };
    let mut rows = Vec::new();
    for ring in 0..rings {
        for step in 0..around {
            let x = 2.6 * ring as f32 / rings as f32;
            let angle = std::f32::consts::TAU * step as f32 / around as f32;
            let (s, c) = angle.sin_cos();
            gaussians.means.push(Vec3::new(x, 0.18 * c, 0.18 * s));
            gaussians.rotations.push([(angle / 2.0).cos(), (angle / 2.0).sin(), 0.0, 0.0]);
            gaussians.log_scales.push(Vec3::new(0.02_f32.ln(), 0.004_f32.ln(), 0.02_f32.ln()));
            gaussians.opacity_logits.push(3.0);
            let stripe = if (ring / 6) % 2 == 0 { [0.9, -0.4, -0.9] } else { [-0.6, 0.2, 1.2] };
            gaussians.sh.extend([stripe, [0.4; 3], [0.0; 3], [0.3, 0.0, 0.0]]);
            let smooth = |centre: f32| ((x - centre) / 0.5 + 0.5).clamp(0.0, 1.0);
            let (elbow, wrist) = (smooth(1.0), smooth(2.0));
            rows.push(vec![(0, 1.0 - elbow), (1, elbow * (1.0 - wrist)), (2, elbow * wrist)]);
        }
    }
    let rows = rows.into_iter().map(|row| row.into_iter().filter(|(_, w)| *w > 0.0).collect::<Vec<_>>());
    Avatar { gaussians, binding: Binding::Vertex(SkinWeights::from_rows(rows, 3).unwrap()) }
}

fn poses(body: &RestBody) -> Vec<Pose> {
    let pose = |k: usize| {
        let bend = f64::from(k as u32) * 0.25;
        let twist = DVec3::new(1.0, 0.0, 0.6) * bend;
        Pose::from_axis_angles(
            &body.skeleton,
            &[DVec3::Z * -0.6, DVec3::new(0.2, 0.5, 1.0) * bend, twist],
            DVec3::new(0.0, 0.2, 0.0),
        )
    };
    (0..10).map(pose).collect()
}

fn page() -> String {
    let (avatar, body) = (avatar(), body());
    let poses = poses(&body);
    let poses: Vec<&Pose> = poses.iter().collect();
    let motion = Motion { rest: &body, poses: &poses, framerate: 10.0 };
    Page::new(NAME, &avatar, motion).unwrap().note("made for <the> test").html()
}

fn opened(width: u32) -> Option<(tempfile::TempDir, Chromium)> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("view.html");
    std::fs::write(&file, page()).unwrap();
    let mut browser = Chromium::open(&file, width, 800, true)?;
    browser.wait_for("document.body.dataset.state !== undefined && document.body.dataset.drawn > 1");
    assert_eq!(browser.value("document.body.dataset.state"), "ready", "{:?}", browser.complaints);
    Some((folder, browser))
}

/// Keeps a screenshot for people, where they ask for it.
fn keep(browser: &mut Chromium, name: &str) {
    if let Some(folder) = std::env::var_os("SKINSPLAT_SCREENSHOTS") {
        std::fs::write(Path::new(&folder).join(name), browser.screenshot()).unwrap();
    }
}

/// What the page complained about. That reading numbers back takes time is said by the software driver alone.
fn complaints(browser: &Chromium) -> Vec<&str> {
    let all = browser.complaints.iter().map(String::as_str);
    all.filter(|complaint| !complaint.contains("GPU stall due to ReadPixels")).collect()
}

/// Sets a control as a person does, and waits for the picture.
fn set(browser: &mut Chromium, id: &str, value: &str) {
    let script = format!(
        "(() => {{ const e = document.getElementById('{id}'); window.seen = Number(document.body.dataset.drawn); \
         if (e.type === 'checkbox') e.checked = {value} === true; else e.value = {value}; \
         e.dispatchEvent(new Event('input', {{ bubbles: true }})); }})()"
    );
    browser.value(&script);
    browser.wait_for("Number(document.body.dataset.drawn) > window.seen");
}

/// Degrees off the average in the last pose, largest over the Gaussians: of a choice in `f64`.
fn largest_degrees(choice: &str) -> f64 {
    let (avatar, body) = (avatar(), body());
    let poses = poses(&body);
    let posed = PosedBody::new(&body, &poses[9]).unwrap();
    let Binding::Vertex(weights) = &avatar.binding else { unreachable!() };
    let wxyz = |j: usize| {
        let q = posed.joints[j].rotation;
        [q.w, q.x, q.y, q.z]
    };
    let of_gaussian = |i: usize| {
        let (joints, weights) = weights.row(i);
        let quats: Vec<Quaternion<f64>> = joints.iter().map(|&j| wxyz(usize::from(j))).collect();
        let weights: Vec<f64> = weights.iter().map(|&w| f64::from(w)).collect();
        let solve = |solver| average_rotation(&quats, &weights, solver).unwrap();
        let found = match choice {
            "average" => solve(Solver::ClosedForm),
            "power" => solve("power-2".parse().unwrap()),
            "aligned" | "dual" => solve(Solver::Nlerp),
            "unaligned" => {
                let mut sum = [0.0; 4];
                for (q, w) in quats.iter().zip(&weights) {
                    let sign = if q[0] < 0.0 { -w } else { *w };
                    (0..4).for_each(|k| sum[k] += sign * q[k]);
                }
                sum
            }
            _ => {
                let mut blend = [[0.0; 3]; 3];
                for (q, w) in quats.iter().zip(&weights) {
                    let r = rotation::quaternion_to_matrix(*q);
                    (0..9).for_each(|k| blend[k / 3][k % 3] += w * r[k / 3][k % 3]);
                }
                assert!(matrix3::determinant(blend) > 0.0);
                rotation::matrix_to_quaternion(rotation::gram_schmidt_columns(blend).unwrap())
            }
        };
        angle_between(found, solve(Solver::ClosedForm)).to_degrees()
    };
    (0..avatar.gaussians.len()).map(of_gaussian).fold(0.0, f64::max)
}

#[test]
fn every_choice_poses_as_f64_does() {
    let Some((_folder, mut browser)) = opened(1200) else { return };
    browser.click("#play", 0.5);
    set(&mut browser, "frame", "9");
    set(&mut browser, "steps", "2");
    for choice in ["average", "power", "aligned", "dual", "unaligned", "gram-schmidt"] {
        browser.value("window.heard = Number(document.body.dataset.said || 0)");
        set(&mut browser, "choice-a", &format!("'{choice}'"));
        // One answer may have been under way.
        browser.wait_for("document.body.dataset.said > window.heard");
        std::thread::sleep(std::time::Duration::from_millis(300));
        let said = browser.value("document.getElementById('numbers').textContent");
        let said = said.as_str().unwrap();
        assert!(said.starts_with("Frame 9. A: "), "{said}");
        let found: f64 = said.split("at most ").nth(1).unwrap().split('°').next().unwrap().parse().unwrap();
        let expected = largest_degrees(choice);
        assert!((found - expected).abs() < 0.06, "{choice}: {found}° instead of {expected}°");
        assert!(choice == "average" || expected > 0.5, "{choice}: {expected}° tells nothing");
    }
    assert_eq!(complaints(&browser), [""; 0]);
}

/// The picture as this project's renderer draws it, in 8 bits.
fn rendered(strategy: &str, centre: DVec3, distance: f64, width: u32, height: u32) -> Vec<[u8; 3]> {
    let (avatar, body) = (avatar(), body());
    let posed_body = PosedBody::new(&body, &poses(&body)[8]).unwrap();
    let back = DVec3::Z * 0.1_f64.cos() + DVec3::Y * 0.1_f64.sin();
    let focal = f64::from(height) / 2.0 / (std::f64::consts::PI / 8.0).tan();
    let camera = Camera::look_at(centre + distance * back, centre, DVec3::Y, focal, width, height);
    let bound = BoundAvatar::new(&avatar, &body).unwrap();
    let mut poser = Poser::new();
    let posed = poser.pose(&bound, &posed_body, &strategy.parse().unwrap(), &PoseOptions::default()).unwrap();
    let frame = splat::render(&posed, &View::new(&camera).over([0.0; 3])).unwrap();
    frame.image.pixels().iter().map(|rgb| rgb.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8)).collect()
}

/// Red, green and blue of the picture, row by row from the top, in hexadecimal digits.
const PIXELS: &str = "(() => { const c = document.getElementById('canvas'); const d = document.createElement('canvas'); d.width = c.width; d.height = c.height; \
     const x = d.getContext('2d'); x.drawImage(c, 0, 0); const p = x.getImageData(0, 0, c.width, c.height).data; const s = []; \
     for (let i = 0; i < p.length; i += 4) s.push((65536 * p[i] + 256 * p[i + 1] + p[i + 2]).toString(16).padStart(6, '0')); return s.join(''); })()";

#[test]
fn pictures_are_those_of_the_renderer() {
    let Some((_folder, mut browser)) = opened(700) else { return };
    browser.click("#play", 0.5);
    set(&mut browser, "frame", "8");
    let number = |browser: &mut Chromium, script: &str| browser.value(script).as_f64().unwrap();
    let meta = "JSON.parse(document.getElementById('meta').textContent)";
    let centre = [0, 1, 2].map(|k| number(&mut browser, &format!("{meta}.centres[8][{k}]")));
    let distance = 3.0 * number(&mut browser, &format!("{meta}.reach"));
    let side = |browser: &mut Chromium, name: &str| {
        number(browser, &format!("document.getElementById('canvas').{name}")) as u32
    };
    let (width, height) = (side(&mut browser, "width"), side(&mut browser, "height"));
    for (choice, turned, strategy) in [
        ("average", true, "quaternion-average"),
        ("average", false, "quaternion-average+colour=none"),
        ("aligned", true, "quaternion-average+rotation=nlerp"),
        ("dual", true, "dual-quaternion"),
        ("gram-schmidt", true, "quaternion-average+rotation=gram-schmidt-columns"),
    ] {
        set(&mut browser, "choice-a", &format!("'{choice}'"));
        set(&mut browser, "turned-a", &turned.to_string());
        let digits = browser.value(PIXELS);
        let digits = digits.as_str().unwrap();
        let level = |k: usize| u8::from_str_radix(&digits[2 * k..2 * k + 2], 16).unwrap();
        let expected = rendered(strategy, DVec3::from_array(centre), distance, width, height);
        assert_eq!(digits.len(), 6 * expected.len(), "{width} x {height}");
        let off = |k: usize| f64::from(level(k)) - f64::from(expected[k / 3][k % 3]);
        let squares: f64 = (0..3 * expected.len()).map(|k| off(k) * off(k)).sum();
        let psnr = 10.0 * (255.0 * 255.0 * 3.0 * expected.len() as f64 / squares).log10();
        println!("{strategy}: {psnr:.1} dB");
        assert!(psnr > 60.0, "{strategy}: {psnr} dB");
    }
}

/// Bytes of the picture, as a number that changes with it.
const PICTURE: &str = "(() => { const c = document.getElementById('canvas'); let h = 0; for (const b of c.toDataURL()) h = (h * 31 + b.charCodeAt(0)) | 0; return h; })()";

/// Pixels that are not black.
const LIT: &str = "(() => { const c = document.getElementById('canvas'); const d = document.createElement('canvas'); d.width = c.width; d.height = c.height; \
     const x = d.getContext('2d'); x.drawImage(c, 0, 0); const p = x.getImageData(0, 0, c.width, c.height).data; let n = 0; \
     for (let i = 0; i < p.length; i += 4) if (p[i] + p[i + 1] + p[i + 2] > 30) n++; return n / (p.length / 4); })()";

#[test]
fn a_person_can_play_turn_compare_and_mark() {
    let Some((_folder, mut browser)) = opened(1200) else { return };
    assert_eq!(browser.value("document.querySelector('h1').textContent"), NAME);
    assert_eq!(
        browser.value("document.querySelector('footer p:last-of-type').textContent"),
        "made for <the> test"
    );
    browser.wait_for("Number(document.getElementById('frame').value) > 2");
    browser.click("#play", 0.5);
    assert_eq!(browser.value("document.getElementById('play').textContent"), "Play");
    set(&mut browser, "frame", "8");
    keep(&mut browser, "view-one.png");
    let lit = browser.value(LIT).as_f64().unwrap();
    assert!((0.02..0.6).contains(&lit), "{lit} of the picture shows the arm");

    let mut last = browser.value(PICTURE);
    let mut differs = |browser: &mut Chromium, what: &str| {
        let picture = browser.value(PICTURE);
        assert_ne!(picture, last, "{what} changes nothing");
        last = picture;
    };
    set(&mut browser, "turned-a", "false");
    differs(&mut browser, "SH not turned");
    set(&mut browser, "turned-a", "true");
    set(&mut browser, "choice-a", "'gram-schmidt'");
    differs(&mut browser, "Gram-Schmidt");
    set(&mut browser, "choice-a", "'average'");
    set(&mut browser, "mark", "true");
    differs(&mut browser, "marks");
    set(&mut browser, "mode", "'side'");
    differs(&mut browser, "A beside B");
    keep(&mut browser, "view-side-marked.png");
    assert_eq!(
        browser.value("document.getElementById('label-b').textContent"),
        "Gram-Schmidt of the blended matrix"
    );
    set(&mut browser, "mark", "false");
    set(&mut browser, "mode", "'wipe'");
    differs(&mut browser, "the wipe");
    browser.focus("#canvas");
    browser.value("window.seen = Number(document.body.dataset.drawn)");
    // To a quarter, beyond the elbow.
    (0..5).for_each(|_| browser.press("[", 219));
    browser.wait_for("Number(document.body.dataset.drawn) > window.seen");
    std::thread::sleep(std::time::Duration::from_millis(300));
    differs(&mut browser, "moving the wipe");
    set(&mut browser, "mode", "'difference'");
    differs(&mut browser, "the difference");
    keep(&mut browser, "view-difference.png");
    set(&mut browser, "choice-b", "'average'");
    assert!(browser.value(LIT).as_f64().unwrap() == 0.0, "a choice does not differ from itself");
    set(&mut browser, "mode", "'one'");
    browser.focus("#canvas");
    browser.value("window.seen = Number(document.body.dataset.drawn)");
    browser.press("ArrowRight", 39);
    browser.wait_for("Number(document.body.dataset.drawn) > window.seen");
    differs(&mut browser, "an arrow key");
    assert_eq!(complaints(&browser), [""; 0]);
}

#[test]
fn it_fits_a_phone() {
    let Some((_folder, mut browser)) = opened(360) else { return };
    keep(&mut browser, "view-phone.png");
    assert_eq!(browser.value("document.documentElement.scrollWidth <= innerWidth"), true);
    assert!(browser.value("document.getElementById('canvas').clientHeight").as_f64().unwrap() > 250.0);
}

#[test]
fn what_the_page_cannot_show_is_refused() {
    let (mut avatar, body) = (avatar(), body());
    let mut poses = poses(&body);
    poses[3].locals[1].scale = DVec3::splat(2.0);
    let made = |avatar: &Avatar, poses: &[Pose]| {
        let poses: Vec<&Pose> = poses.iter().collect();
        Page::new("", avatar, Motion { rest: &body, poses: &poses, framerate: 30.0 }).unwrap_err()
    };
    assert_eq!(made(&avatar, &poses), ViewError::Scales(3, 1));
    assert_eq!(made(&avatar, &[]), ViewError::NoPose);
    avatar.binding = Binding::Static;
    let error = made(&avatar, &poses[..1]);
    assert!(error.to_string().contains("expected skinning weights per Gaussian"), "{error}");
}
