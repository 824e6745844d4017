//! The program from outside: every subcommand, every exit code, every kind of bad input.
#![allow(clippy::unwrap_used, clippy::disallowed_methods, reason = "tests")]

#[path = "../support/files.rs"]
mod files;
#[path = "../support/program.rs"]
mod program;
#[path = "../support/schema.rs"]
mod schema;
#[path = "../support/mod.rs"]
mod support;

mod bad_avatars;
mod bad_bodies;
mod bad_images;
mod bad_outputs;
mod bad_plans;
mod blending;
mod bodies_of_tables;
mod catalogues;
mod comparing;
mod conforming;
mod first_minutes;
mod fitting;
mod foreign_avatars;
mod foreign_bodies;
mod foreign_images;
mod inspecting;
mod lpips;
mod made_up;
mod merging;
mod motion;
mod needs;
mod other_formats;
mod posing;
mod rendering;
mod renders;
mod reports;
mod robust_runs;
mod scoring;
mod scoring_inputs;
mod streams;
mod stressing;
mod temporal;
mod usage;
mod viewing;
mod widths;
