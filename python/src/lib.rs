//! The extension module behind the Python package `skinsplat`: arrays in, arrays out; the package's own files make arrays of
//! whatever a caller has.
#![allow(missing_docs, unreachable_pub, reason = "Python sees what `skinsplat/_skinsplat.pyi` documents")]

mod arrays;
mod maths;
mod posed;
mod scene;
mod scoring;

/// The program's command line, compiled in.
#[path = "../../src/cli/mod.rs"]
mod cli;

use pyo3::prelude::*;
use std::ffi::OsString;

/// Runs the program `reproduce`; its exit code.
#[pyfunction]
fn run_program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::run(arguments)) as u8
}

#[pymodule(name = "_skinsplat")]
mod module {
    #[pymodule_export]
    use super::maths::{average, rotate_sh};
    #[pymodule_export]
    use super::posed::{Posed, pose, render};
    #[pymodule_export]
    use super::run_program;
    #[pymodule_export]
    use super::scene::{Avatar, Body, Camera, Pose};
    #[pymodule_export]
    use super::scoring::score_images;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
