//! PeopleSnapshot as prepared for InstantAvatar (and used by SplattingAvatar, Animatable 3D Gaussians, 3DGS-Avatar).
//!
//! ```text
//! <subject>/cameras.npz                        intrinsic, extrinsic, width, height
//!           images/*.png                       undistorted, one per video frame
//!           masks/*.npy or *.png               one per image, same order
//!           poses/anim_nerf_{train,test}.npz   refined poses, one per frame of the split (used if there)
//!           poses.npz                          poses of all video frames
//! ```
//! The two pose files of a subject may hold different betas; each split keeps its own.

use super::{Layout, Request};
use crate::folder::{Models, Subject};
use crate::{Capture, Error, FrameRef, FrameSource, Sequence, camera, poses};
use std::path::{Path, PathBuf};

pub(super) const LAYOUT: Layout = Layout {
    id: "peoplesnapshot",
    summary: "PeopleSnapshot as prepared for InstantAvatar: cameras.npz, images, masks, poses.npz or refined poses",
    load,
};

/// Loads the two sequences, `train` and `test`, of a subject.
///
/// # Errors
/// Missing files, no split or body model, a split that leaves the video, poses that do not match it.
fn load(request: &Request<'_>) -> Result<Subject, Error> {
    let Request { folder, options, .. } = *request;
    let split = request.required_split()?;
    let mut models = Models::new(folder, options);
    let mut sequence = |id: &str, range: [usize; 3]| sequence(folder, id, range, &mut models);
    let (train, test) = (vec![sequence("train", split.train)?], vec![sequence("test", split.test)?]);
    let id = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    Ok(Subject { id, capture: Capture::Monocular, train, test })
}

fn sequence(folder: &Path, id: &str, range: [usize; 3], models: &mut Models) -> Result<Sequence, Error> {
    let cameras = camera::load(&folder.join("cameras.npz"))?;
    let images = files(&folder.join("images"), &["png", "jpg"])?;
    let masks = files(&folder.join("masks"), &["npy", "png"])?;
    if masks.len() != images.len() {
        let problem = format!("{} masks", masks.len());
        return Err(Error::invalid(
            folder.join("masks"),
            "masks",
            problem,
            format!("{} (images)", images.len()),
        ));
    }
    let [first, last, step] = range;
    if step == 0 || first > last || last >= images.len() {
        let expected = format!("[first, last, step] within the {} images", images.len());
        return Err(Error::invalid(folder, format!("split.{id}"), format!("{range:?}"), expected));
    }
    let chosen: Vec<usize> = (first..=last).step_by(step).collect();
    let refined = folder.join(format!("poses/anim_nerf_{id}.npz"));
    let all = folder.join("poses.npz");
    let (path, rows) =
        if refined.is_file() { (refined, (0..chosen.len()).collect()) } else { (all, chosen.clone()) };
    let track = poses::load(&path)?;
    let needed = rows.last().map_or(0, |row| row + 1);
    if track.len() < needed {
        let expected = format!("at least {needed}, one per frame of the split");
        return Err(Error::invalid(path, "poses", format!("{} poses", track.len()), expected));
    }
    let body = models.named(&path, None, &track.betas)?;
    let poses = track.poses(&body.skeleton)?;
    let frame = |(&frame, &pose): (&usize, &usize)| FrameRef {
        name: images[frame].file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        pose,
        camera: 0,
        source: FrameSource::Files { image: images[frame].clone(), mask: Some(masks[frame].clone()) },
    };
    let frames = chosen.iter().zip(&rows).map(frame).collect();
    Ok(Sequence { id: id.to_owned(), body, poses, cameras: cameras.into(), frames, stored_sizes: None })
}

/// The files of a folder with one of the extensions, sorted by name.
fn files(folder: &Path, extensions: &[&str]) -> Result<Vec<PathBuf>, Error> {
    let entries = std::fs::read_dir(folder)
        .map_err(|cause| Error::read(folder, "frames", "a folder of images or masks", cause))?;
    let fits = |path: &PathBuf| {
        path.extension().is_some_and(|e| extensions.iter().any(|x| e.eq_ignore_ascii_case(x)))
    };
    let mut found: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).filter(fits).collect();
    found.sort();
    Ok(found)
}
