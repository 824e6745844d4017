//! The dataset that needs no file.

mod anatomy;
mod field;
mod surface;

/// scratch
pub fn scratch() -> (Vec<glam::DVec3>, Vec<[u32; 3]>) {
    let p = anatomy::Proportions { height: 1.74, girth: 1.0, shoulders: 1.0 };
    let m = surface::mesh(&anatomy::flesh(p), 0.0195, &anatomy::lenses(p));
    (m.vertices, m.faces)
}
