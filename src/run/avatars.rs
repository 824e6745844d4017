//! Avatars that jobs need: built from training frames once, kept in the run's folder, read back bit for bit.

use super::curve_frames::CurveFrames;
use super::fitting::{self, FitEvent, FitFiles, Tests};
use super::textured::TexturedFiles;
use super::{Error, Event, Library};
use crate::experiment::{AvatarBuild, AvatarRecipe, PlannedFit};
use skinsplat_data::{Sequence, ply};
use skinsplat_fit::surface::{BindTo, Placement, SurfaceInit, surface_init};
use skinsplat_fit::texture::{TextureInit, TexturedBody, gather_texture};
use skinsplat_posing::BoundAvatar;
use std::path::{Path, PathBuf};

/// An avatar that is ready to be posed.
#[derive(Debug)]
pub enum Prepared {
    /// Gaussians, bound to the subject's body.
    Gaussians(Box<BoundAvatar>),
    /// The body's mesh under a texture.
    Textured(TexturedBody),
    /// Both, drawn together.
    Hybrid(Box<BoundAvatar>, TexturedBody),
}

/// Reads an avatar from the run's folder, or builds it and keeps it there. Whether it was kept makes no difference to a
/// single bit: a fresh avatar is read back too.
///
/// # Errors
/// Training frames that cannot be read or used, or a folder that cannot be written.
pub(super) fn prepare(
    build: &AvatarBuild,
    library: &Library,
    curves: &mut CurveFrames<'_>,
    folder: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<Prepared, Error> {
    let sequence = training(build, library)?;
    let file = kept(build, folder);
    if let AvatarRecipe::TexturedMesh { size } = build.recipe {
        return Ok(Prepared::Textured(textured(&sequence, size, &file)?));
    }
    if let Some(planned) = &build.fit
        && !file.is_file()
    {
        let tests = curves.of(build, library)?;
        fit(build, planned, &sequence, &tests, file.clone(), folder, watch)?;
    }
    if !file.is_file() {
        let avatar = surface_init(&sequence, &surface_options(build))?;
        ply::write_avatar(&file, &avatar, &ply::Metadata::default(), ply::Encoding::LittleEndian)?;
    }
    let bound = Box::new(BoundAvatar::new(&ply::read_avatar(&file)?, &sequence.body)?.without_zero_bands());
    let mesh = build.fit.as_ref().and_then(|planned| planned.options.recipe.mesh.as_ref());
    Ok(match mesh {
        Some(_) => {
            Prepared::Hybrid(bound, FitFiles { avatar: file, start: None }.mesh().read(&sequence.body)?)
        }
        None => Prepared::Gaussians(bound),
    })
}

/// Fits an avatar into `file`.
fn fit(
    build: &AvatarBuild,
    planned: &PlannedFit,
    sequence: &Sequence,
    tests: &[Sequence],
    file: PathBuf,
    folder: &Path,
    watch: &(dyn Fn(Event) + Sync),
) -> Result<(), Error> {
    let start = Some(folder.join(format!("{}.ply", planned.start)));
    let files = FitFiles { avatar: file, start };
    let name = format!("{}/{}/{}", build.dataset, build.subject, sequence.id);
    let every = planned.options.iterations.div_ceil(CURVE_POINTS);
    let tests = Tests { sequences: tests, every: Some(every), ssim: false };
    fitting::fit(sequence, &planned.options, &name, &files, tests, &mut |event| {
        if let FitEvent::Step(step) = event {
            watch(Event::Fitting(step));
        }
        Ok(())
    })?;
    Ok(())
}

/// Points of the curve of test scores, after the start.
const CURVE_POINTS: u32 = 5;

/// The frames that an avatar is made from.
fn training(build: &AvatarBuild, library: &Library) -> Result<Sequence, Error> {
    let Some(id) = &build.sequence else {
        return Err(Error::Absent {
            name: format!("{}/{}: training sequence", build.dataset, build.subject),
        });
    };
    let sequence = library.sequence(&build.dataset, &build.subject, id)?.selected(&build.frames)?;
    Ok(match build.resolution {
        Some(side) => sequence.reduced(side),
        None => sequence,
    })
}

fn kept(build: &AvatarBuild, folder: &Path) -> PathBuf {
    let extension = if build.recipe.is_gaussian() { "ply" } else { "npy" };
    folder.join(format!("{}.{extension}", build.key))
}

/// A textured body: its texture in `file`, its dressed vertices beside it.
fn textured(sequence: &Sequence, size: u32, file: &Path) -> Result<TexturedBody, Error> {
    let files = TexturedFiles { texture: file.to_owned(), vertices: file.with_extension("vertices.npy") };
    if !files.exist() {
        files.write(&gather_texture(sequence, &TextureInit { size, ..TextureInit::default() })?)?;
    }
    files.read(&sequence.body)
}

fn surface_options(build: &AvatarBuild) -> SurfaceInit {
    let (placement, bind_to) = match build.recipe {
        AvatarRecipe::SurfaceFace {} => (Placement::Faces, BindTo::Faces),
        _ => (Placement::Vertices, BindTo::Joints),
    };
    let default = SurfaceInit::default();
    let sh_degree = build.sh_degree.map_or(default.sh_degree, usize::from);
    let longest_edge = f64::from(build.edge_mm) / 1000.0;
    SurfaceInit { placement, bind_to, sh_degree, longest_edge, ..default }
}
