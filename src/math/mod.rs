//! Rotations, rotation averaging and its solvers, spherical harmonics. No I/O, no allocation in kernels.

pub mod rotation;
