//! COLMAP's text models: `cameras.txt` and `images.txt` of a `sparse` folder.
//!
//! A line per camera, two lines per image, the second with the image's points: it may be empty, and it is skipped. Lines that
//! start with `#` say nothing. Quaternions are w x y z; they and the translation lead from the world to the camera, OpenCV axes.
//! Layout: <https://colmap.github.io/format.html>.

use crate::{Error, error};
use glam::{DMat4, DQuat, DVec3};
use skinsplat_core::scene::Camera;
use std::collections::BTreeMap;
use std::path::{Component, Path};

/// A registered image.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Registered {
    /// Its file below the folder of images.
    pub(super) name: String,
    /// The pinhole part of its camera.
    pub(super) camera: Camera,
    /// True if the camera has distortion coefficients that are not zero.
    pub(super) distorted: bool,
}

/// The models of cameras: focal lengths (1 or 2), principal point (2), distortion.
const MODELS: [(&str, usize, usize); 5] = [
    ("SIMPLE_PINHOLE", 1, 0),
    ("PINHOLE", 2, 0),
    ("SIMPLE_RADIAL", 1, 1),
    ("RADIAL", 1, 2),
    ("OPENCV", 2, 4),
];

/// The registered images, in the order of the file.
///
/// # Errors
/// Missing or malformed files, camera models that are not read, images of unknown cameras, two images of one name.
pub(super) fn load(folder: &Path) -> Result<Vec<Registered>, Error> {
    let cameras = cameras(&folder.join("cameras.txt")).map_err(|e| e.about("camera"))?;
    let path = folder.join("images.txt");
    let text = text(&path, "images")?;
    let mut images = Vec::new();
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.starts_with('#')).peekable();
    while let Some((number, line)) = lines.next() {
        if line.trim().is_empty() {
            continue;
        }
        images.push(image(&path, number + 1, line, &cameras).map_err(|e| e.about("image"))?);
        // The points of the image, unless a tool has dropped the empty line of an image without any.
        lines.next_if(|(_, line)| !is_image(line));
    }
    let mut names: Vec<&str> = images.iter().map(|image| image.name.as_str()).collect();
    names.sort_unstable();
    if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
        return Err(Error::invalid(path, "images", format!("{} twice", pair[0]), "an image of a name"));
    }
    if images.is_empty() {
        return Err(Error::invalid(path, "images", "none", "two lines per registered image"));
    }
    Ok(images)
}

/// Ten words or, where the name has spaces, more, and the last is no number as the last of a point is.
fn is_image(line: &str) -> bool {
    let words: Vec<&str> = line.split_whitespace().collect();
    words.len() >= 10 && words[words.len() - 1].parse::<f64>().is_err()
}

fn text(path: &Path, field: &str) -> Result<String, Error> {
    let binary = path.with_extension("bin");
    if !path.is_file() && binary.is_file() {
        let expected = "COLMAP's text form (colmap model_converter --output_type TXT)";
        return Err(Error::invalid(path, field, format!("only {} is here", binary.display()), expected));
    }
    error::read_text(path, field, "a text model of COLMAP")
}

/// A camera's pinhole part and whether it is distorted.
type Intrinsics = (Camera, bool);

fn cameras(path: &Path) -> Result<BTreeMap<u64, Intrinsics>, Error> {
    let mut cameras = BTreeMap::new();
    for (number, line) in text(path, "cameras")?.lines().enumerate() {
        if line.starts_with('#') || line.trim().is_empty() {
            continue;
        }
        let (id, camera) = camera(path, number + 1, line)?;
        if cameras.insert(id, camera).is_some() {
            return Err(at(path, number + 1, format!("camera {id} again"), "an id of its own"));
        }
    }
    Ok(cameras)
}

fn camera(path: &Path, line_number: usize, line: &str) -> Result<(u64, Intrinsics), Error> {
    let expected = "CAMERA_ID MODEL WIDTH HEIGHT PARAMS";
    let words: Vec<&str> = line.split_whitespace().collect();
    let [id, model, size_and_more @ ..] = &words[..] else {
        return Err(at(path, line_number, format!("{} words", words.len()), expected));
    };
    let Some((_, focals, distortions)) = MODELS.iter().find(|(name, ..)| name == model) else {
        let known: Vec<&str> = MODELS.iter().map(|(name, ..)| *name).collect();
        return Err(at(path, line_number, format!("camera model {model}"), known.join(", ")));
    };
    let values = numbers(path, line_number, size_and_more)?;
    let count = 2 + focals + 2 + distortions;
    if values.len() != count {
        let problem = format!("{} numbers after {model}", values.len());
        return Err(at(path, line_number, problem, format!("{count}: width, height, parameters")));
    }
    let side = |value: f64| (value.fract() == 0.0 && (1.0..=1e6).contains(&value)).then_some(value as u32);
    let (Some(width), Some(height)) = (side(values[0]), side(values[1])) else {
        return Err(at(path, line_number, format!("a size of {}x{}", values[0], values[1]), "pixels"));
    };
    let Ok(id) = id.parse() else {
        return Err(at(path, line_number, format!("id {id:?}"), "a number"));
    };
    // One focal length is both.
    let (fx, fy) = (values[2], values[1 + focals]);
    let (cx, cy) = (values[2 + focals], values[3 + focals]);
    let distorted = values[4 + focals..].iter().any(|&k| k != 0.0);
    let camera = Camera { width, height, fx, fy, cx, cy, camera_from_world: DMat4::IDENTITY };
    camera
        .validate()
        .map_err(|e| at(path, line_number, format!("{}: {}", e.field, e.problem), e.expected))?;
    Ok((id, (camera, distorted)))
}

fn image(
    path: &Path,
    line_number: usize,
    line: &str,
    cameras: &BTreeMap<u64, Intrinsics>,
) -> Result<Registered, Error> {
    let words: Vec<&str> = line.split_whitespace().collect();
    if words.len() < 10 {
        let expected = "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then a line of points";
        return Err(at(path, line_number, format!("{} words", words.len()), expected));
    }
    let values = numbers(path, line_number, &words[1..8])?;
    let rotation = DQuat::from_xyzw(values[1], values[2], values[3], values[0]);
    if rotation.length() <= 1e-6 {
        return Err(at(path, line_number, "a quaternion of length 0", "QW QX QY QZ"));
    }
    let translation = DVec3::new(values[4], values[5], values[6]);
    let camera = words[8]
        .parse()
        .ok()
        .and_then(|id: u64| cameras.get(&id))
        .ok_or_else(|| at(path, line_number, format!("camera {}", words[8]), "an id of cameras.txt"))?;
    let name = words[9..].join(" ");
    let plain = Path::new(&name).components().all(|part| matches!(part, Component::Normal(_)));
    if !plain {
        return Err(at(path, line_number, format!("the path {name:?}"), "a file below the folder of images"));
    }
    let camera_from_world = DMat4::from_rotation_translation(rotation.normalize(), translation);
    Ok(Registered { name, camera: Camera { camera_from_world, ..camera.0.clone() }, distorted: camera.1 })
}

fn numbers(path: &Path, line_number: usize, words: &[&str]) -> Result<Vec<f64>, Error> {
    let number = |word: &&str| {
        let value: Option<f64> = word.parse().ok().filter(|v: &f64| v.is_finite());
        value.ok_or_else(|| at(path, line_number, format!("{word:?}"), "a number"))
    };
    words.iter().map(number).collect()
}

fn at(path: &Path, line: usize, problem: impl Into<String>, expected: impl Into<String>) -> Error {
    Error::invalid(path, format!("line {line}"), problem, expected)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn load_text(cameras: &str, images: &str) -> Result<Vec<Registered>, Error> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("cameras.txt"), cameras).unwrap();
        std::fs::write(folder.path().join("images.txt"), images).unwrap();
        load(folder.path())
    }

    const CAMERAS: &str = "# Camera list\n1 PINHOLE 64 48 50 51 30 20\n7 SIMPLE_RADIAL 64 48 50 32 24 0.1\n\
                           8 OPENCV 64 48 50 51 32 24 0 0 0 0\n";

    #[test]
    fn every_model_gives_its_pinhole() {
        let images = "# Image list\n3 2 0 0 0 1 2 3 7 b.png\n\n1 1 0 0 0 0 0 0 1 a.png\n1.5 2.5 -1 3 4 7\n\
                      9 0 1 0 0 0 0 4 8 dir/c.png\n\n";
        let loaded = load_text(CAMERAS, images).unwrap();
        let names: Vec<&str> = loaded.iter().map(|image| image.name.as_str()).collect();
        assert_eq!(names, ["b.png", "a.png", "dir/c.png"]);
        let pinhole = |i: usize| {
            let c = &loaded[i].camera;
            ([c.fx, c.fy, c.cx, c.cy], loaded[i].distorted)
        };
        assert_eq!(pinhole(0), ([50.0, 50.0, 32.0, 24.0], true));
        assert_eq!(pinhole(1), ([50.0, 51.0, 30.0, 20.0], false));
        assert_eq!(pinhole(2), ([50.0, 51.0, 32.0, 24.0], false));
        assert_eq!(loaded[0].camera.camera_from_world.w_axis.truncate(), DVec3::new(1.0, 2.0, 3.0));
        // A tool that drops empty lines loses no image.
        let dropped = "3 1 0 0 0 0 0 0 1 b.png\n1 1 0 0 0 0 0 0 1 a.png\n";
        assert_eq!(load_text(CAMERAS, dropped).unwrap().len(), 2);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        let image = "1 1 0 0 0 0 0 0 1 a.png\n\n";
        for (cameras, images, field, word) in [
            ("1 FISHEYE 64 48 1 2 3", image, "camera line 1", "FISHEYE"),
            ("1 PINHOLE 64 48 50 51 30", image, "camera line 1", "6: width"),
            ("1 PINHOLE 64 48 x 51 30 20", image, "camera line 1", "\"x\""),
            ("1 PINHOLE 64 0 50 51 30 20", image, "camera line 1", "size"),
            (CAMERAS, "1 1 0 0 0 0 0 0 2 a.png\n\n", "image line 1", "camera 2"),
            (CAMERAS, "1 0 0 0 0 0 0 0 1 a.png\n\n", "image line 1", "length 0"),
            (CAMERAS, "1 1 0 0 0 0 0 0 1 ../a.png\n\n", "image line 1", "path"),
            (CAMERAS, "1 1 0 0\n", "image line 1", "4 words"),
            (CAMERAS, "1 1 0 0 0 0 0 0 1 a.png\n\n2 1 0 0 0 0 0 0 1 a.png\n\n", "images", "twice"),
            (CAMERAS, "# nothing\n", "images", "none"),
        ] {
            let error = load_text(cameras, images).unwrap_err();
            assert_eq!(error.field(), field, "{error}");
            assert!(error.to_string().contains(word) && error.to_string().lines().count() == 1, "{error}");
        }
    }
}
