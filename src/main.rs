//! `reproduce`: the command-line program. All of it lives in [`skinsplat::cli`].

fn main() -> std::process::ExitCode {
    skinsplat::cli::main()
}
