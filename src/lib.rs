//! `skinsplat`: how should a Gaussian rotate on a skinned body?
//!
//! A batch evaluation harness for skinned 3D Gaussian avatars. One road, walked forwards to evaluate:
//!
//! ```text
//! experiments/*.toml ─┐
//! datasets.toml ──────┼─► plan ─► run ─► results ─► report
//! avatars, frames ────┘  (pure    │      (jsonl,     (pure functions of results:
//!                         data)   │       resumable)  tables, pages)
//!                                 │
//!      per frame:  Pose ─► PosedBody ─► strategy ─► Posed ─► render ─► Image ─► score
//! ```
//!
//! # Conventions
//! Column vectors (`x' = T x`), right-handed, metres, radians. Cameras are OpenCV (x right, y down, z forward) and
//! held as `camera_from_world`. Quaternions are (w, x, y, z) in files, in prose and in `[T; 4]` arrays. SH follow the
//! 3DGS basis and order. Colours are sRGB values in \[0, 1\], blended as such. Images are `f32` RGB, row-major, with
//! pixel centres at +0.5.
//!
//! # Layers
//! The harness's modules, lowest first: [`datasets`] → [`experiment`] → [`run`] → [`report`]; `tests/architecture.rs`
//! reads the imports. They stand on crates of their own, which anybody may use alone: ARCHITECTURE.md draws them.

pub mod datasets;
pub mod experiment;
pub mod quoting;
pub mod report;
pub mod run;

mod toml_problem;
