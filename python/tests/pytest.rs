//! The tests in Python on the extension module that cargo has just built: of the interpreter that PYTHON names, else python3. Where
//! it has no NumPy or no pytest they are skipped, with a word. `.ci/python` tests the wheel.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test without a harness")]

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

/// The folder of this package.
const PACKAGE: &str = env!("CARGO_MANIFEST_DIR");

/// The extension module beside this program.
fn module() -> PathBuf {
    let own = std::env::current_exe().unwrap();
    let name = format!("{}_skinsplat{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let places = own.ancestors().skip(1).take(2).map(|folder| folder.join(&name));
    let built = places.filter(|path| path.is_file());
    built.max_by_key(|path| path.metadata().and_then(|file| file.modified()).unwrap()).unwrap()
}

/// The package as it is installed: its sources with the module.
fn install(folder: &Path) {
    let package = folder.join("skinsplat");
    std::fs::create_dir(&package).unwrap();
    for entry in Path::new(PACKAGE).join("skinsplat").read_dir().unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            std::fs::copy(&path, package.join(path.file_name().unwrap())).unwrap();
        }
    }
    let name = if cfg!(windows) { "_skinsplat.pyd" } else { "_skinsplat.abi3.so" };
    std::fs::copy(module(), package.join(name)).unwrap();
}

fn main() -> ExitCode {
    let python = std::env::var_os("PYTHON").unwrap_or_else(|| OsString::from("python3"));
    let asked = Command::new(&python).args(["-c", "import numpy, pytest"]).stderr(Stdio::null()).status();
    if !asked.is_ok_and(|answer| answer.success()) {
        println!("skipped: {} has no NumPy or no pytest (PYTHON names another)", python.display());
        return ExitCode::SUCCESS;
    }
    let folder = tempfile::tempdir().unwrap();
    install(folder.path());
    let mut pytest = Command::new(&python);
    // Away from the sources, which would be imported in place of the package.
    pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]).arg(Path::new(PACKAGE).join("tests"));
    pytest.current_dir(folder.path());
    let status = pytest.env("PYTHONPATH", folder.path()).status().unwrap();
    if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
