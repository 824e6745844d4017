//! PeopleSnapshot as prepared for InstantAvatar (and used by SplattingAvatar, Animatable 3D Gaussians, 3DGS-Avatar).
//!
//! ```text
//! <subject>/cameras.npz                        intrinsic, extrinsic, width, height
//!           images/image_0000.png              undistorted, one per video frame, background kept
//!           masks/mask_0000.npy or .png        0 and 1, or 0 to 255 (SplattingAvatar's)
//!           poses/anim_nerf_{train,test}.npz   refined poses, one per frame of the split (used if there)
//!           poses.npz                          poses of all video frames
//!           config.json                        gender and ranges of frames (SplattingAvatar's)
//! ```
//! Images and masks are paired by the number in their names. A frame of a range is a frame of the video, counted from 0, last
//! frame included; names may start at 0 or, as ffmpeg writes them, at 1. The two pose files of a subject may hold different
//! betas; each split keeps its own. The principal point stays where the file has it.
//!
//! Layout: `scripts/peoplesnapshot/preprocess_PeopleSnapshot.py` and `instant_avatar/datasets/peoplesnapshot.py` of
//! InstantAvatar 3cdfd49, `dataset/instant_avatar_reader.py` of SplattingAvatar 3847314.

use super::split::{self, Config, Range, Splits};
use super::video::Numbered;
use super::{Layout, Part as Place, Request};
use crate::folder::Subject;
use crate::models::{Family, Gender, Models};
use crate::poses::{self, PoseTrack};
use crate::{Capture, Error, FrameFiles, FrameRef, FrameSource, Sequence, camera, listing};
use skinsplat_core::scene::Camera;
use std::path::{Path, PathBuf};

pub(super) const LAYOUT: Layout = Layout {
    id: "peoplesnapshot",
    summary: "PeopleSnapshot as prepared for InstantAvatar: cameras.npz, images, masks, poses.npz or refined poses",
    parts: &[
        Place::needed("images", "images/*.{png,jpg,jpeg}"),
        Place::needed("masks", "masks/*.{npy,png}"),
        Place::needed("cameras", "cameras.npz").telling(),
        Place::needed("poses", "poses.npz").telling(),
        Place::needed("poses", "poses/anim_nerf_train.npz").telling(),
        Place::optional("poses of the test frames", "poses/anim_nerf_test.npz").telling(),
        Place::optional("gender and ranges", "config.json"),
    ],
    load,
};

/// Loads the two sequences, `train` and `test`, of a subject.
///
/// # Errors
/// Missing files, no split or body model, a split that leaves the video, poses or masks that do not match it.
fn load(request: &Request<'_>) -> Result<Subject, Error> {
    let config = Config::of(request.folder)?;
    let splits = Splits::of(request, config.as_ref())?;
    let (gender, mut notes) = gender(request.folder, config.as_ref())?;
    let mut video = Video::open(request.folder)?;
    let mut models = Models::new(request.folder, request.options);
    let mut sequence = |id: &str| video.sequence(id, &splits.ranges(id), gender, &mut models);
    let (train, test) = (vec![sequence("train")?], vec![sequence("test")?]);
    notes.extend_from_slice(models.notes());
    let subject = request.subject(Capture::Monocular, train, test, notes);
    Ok(models.told(subject))
}

/// The subject's gender: as `config.json` says, else as its folder's name does; neutral with a note if neither does.
pub(super) fn gender(folder: &Path, config: Option<&Config>) -> Result<(Gender, Vec<String>), Error> {
    if let Some(name) = config.and_then(|config| config.gender.as_deref()) {
        let gender = Gender::named(name).ok_or_else(|| {
            Error::invalid(
                folder.join("config.json"),
                "gender",
                format!("{name:?}"),
                "female, male or neutral",
            )
        })?;
        return Ok((gender, Vec::new()));
    }
    // A link may be called otherwise than what it leads to.
    let target = folder.canonicalize().unwrap_or_default();
    let names = [listing::file_name(folder), listing::file_name(&target)];
    Ok(match names.iter().find_map(|name| Gender::in_name(name)) {
        Some(gender) => (gender, Vec::new()),
        None => {
            let note =
                format!("{}: neither config.json nor the folder's name tells the gender; neutral", names[0]);
            (Gender::Neutral, vec![note])
        }
    })
}

/// What both sequences are cut from.
struct Video<'a> {
    folder: &'a Path,
    camera: Camera,
    images: Numbered,
    masks: Numbered,
}

impl<'a> Video<'a> {
    fn open(folder: &'a Path) -> Result<Self, Error> {
        let path = folder.join("cameras.npz");
        let mut cameras = camera::load(&path).map_err(|e| e.about("camera"))?;
        let (Some(camera), true) = (cameras.pop(), cameras.is_empty()) else {
            return Err(Error::invalid(path, "camera intrinsic", "several cameras", "one camera"));
        };
        let images = Numbered::open(folder.join("images"), "images", &["png", "jpg", "jpeg"])?;
        let masks = Numbered::open(folder.join("masks"), "masks", &["npy", "png"])?;
        masks.starts_with(&images)?;
        Ok(Self { folder, camera, images, masks })
    }

    fn sequence(
        &mut self,
        id: &str,
        ranges: &[Range],
        gender: Gender,
        models: &mut Models,
    ) -> Result<Sequence, Error> {
        let folder = self.folder;
        let in_video = |images: &Numbered| split::chosen(folder, id, ranges[0], images.count());
        in_video(&self.images)?;
        let (path, track, rows) = self.poses(id, ranges)?;
        // The poses may have told another first frame.
        let frames = in_video(&self.images)?;
        self.masks.start_as(&self.images);
        let body = models.of_person(&path, Family::Smpl, gender, &track)?;
        let poses = track.poses(&body.skeleton).map_err(|e| e.about("poses"))?;
        let frame = |(&frame, pose): (&usize, usize)| {
            let image = self.images.frame(frame)?.clone();
            let mask = Some(self.masks.frame(frame)?.clone().into());
            let name = listing::stem(&image);
            let source = FrameSource::Files(FrameFiles { image, mask, background: None });
            Ok(FrameRef { name, time: frame, pose, camera: 0, source })
        };
        let frames = frames.iter().zip(rows).map(frame).collect::<Result<_, Error>>()?;
        let cameras = vec![self.camera.clone()].into();
        Ok(Sequence { id: id.to_owned(), body, poses, cameras, frames, stored_sizes: None })
    }

    /// The pose file of a part, what it holds, and its row for each frame of the range.
    fn poses(&mut self, id: &str, ranges: &[Range]) -> Result<(PathBuf, PoseTrack, Vec<usize>), Error> {
        let refined = ["anim_nerf_", ""].map(|prefix| self.folder.join(format!("poses/{prefix}{id}.npz")));
        let [first, last, step] = ranges[0];
        if let Some(path) = refined.into_iter().find(|path| path.is_file()) {
            let track = poses::load(&path).map_err(|e| e.about("poses"))?;
            let rows = refined_rows(&path, id, track.len(), ranges)?;
            return Ok((path, track, rows));
        }
        let path = self.folder.join("poses.npz");
        let track = poses::load(&path).map_err(|e| e.about("poses"))?;
        self.images.fit_to(track.len(), &path, "poses")?;
        Ok((path, track, (first..=last).step_by(step).collect()))
    }
}

/// The rows of a file of refined poses for the frames of the first range. It was refined on one of the known ranges: on that
/// of which it has as many rows as there are frames.
fn refined_rows(path: &Path, id: &str, rows: usize, ranges: &[Range]) -> Result<Vec<usize>, Error> {
    let [first, last, step] = ranges[0];
    let row_of = |frame: usize, [start, end, step]: Range| {
        (start..=end)
            .contains(&frame)
            .then(|| frame - start)
            .filter(|d| d.is_multiple_of(step))
            .map(|d| d / step)
    };
    let all = |&range: &Range| {
        (first..=last).step_by(step).map(|frame| row_of(frame, range)).collect::<Option<_>>()
    };
    let fitting = ranges.iter().filter(|range| rows > 0 && split::count(**range) == rows).find_map(all);
    fitting.ok_or_else(|| {
        let expected = format!("{}, one per frame of split.{id} {:?}", split::count(ranges[0]), ranges[0]);
        Error::invalid(path, "poses", format!("{rows} poses"), expected)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refined_poses_are_of_the_range_that_they_were_refined_on() {
        let path = Path::new("anim_nerf_test.npz");
        let rows = |rows, ranges: &[Range]| refined_rows(path, "test", rows, ranges);
        assert_eq!(rows(3, &[[4, 8, 2]]).unwrap(), [0, 1, 2]);
        // Every eighth frame of a file that has every fourth.
        assert_eq!(rows(4, &[[8, 20, 8], [8, 20, 4]]).unwrap(), [0, 2]);
        let error = rows(4, &[[4, 7, 2]]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "anim_nerf_test.npz: poses: 4 poses; expected 2, one per frame of split.test [4, 7, 2]"
        );
        assert!(rows(4, &[[9, 21, 8], [8, 20, 4]]).is_err(), "frames that the file does not have");
    }
}
