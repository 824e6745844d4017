#![doc = include_str!("../README.md")]

use pulp::Arch;
use std::fmt;
use std::sync::OnceLock;

/// The environment variable that forces a [`Level`].
pub const VARIABLE: &str = "SKINSPLAT_SIMD";

/// A set of vector instructions, narrowest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// No assumption about the processor.
    Scalar,
    /// x86-64 with AVX2 and FMA.
    Avx2,
    /// x86-64 with AVX-512 F, BW, CD, DQ and VL.
    Avx512,
}

impl Level {
    /// All of them, narrowest first.
    pub const ALL: [Self; 3] = [Self::Scalar, Self::Avx2, Self::Avx512];

    /// The widest set that this processor has.
    pub fn detected() -> Self {
        Self::ALL.into_iter().rev().find(|level| level.arch().is_some()).unwrap_or(Self::Scalar)
    }

    /// The levels that this processor has, narrowest first.
    pub fn available() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|level| level.arch().is_some())
    }

    /// Its name, as in [`VARIABLE`].
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// What kernels are dispatched with; `None` if this processor lacks the instructions.
    pub fn arch(self) -> Option<Arch> {
        match self {
            Self::Scalar => Some(scalar()),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().map(Arch::V3),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::try_new().map(Arch::V4),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => None,
        }
    }
}

/// Portable code. On x86-64 without vector instructions beyond the compiler's own; elsewhere whatever `pulp` finds.
fn scalar() -> Arch {
    if cfg!(target_arch = "x86_64") { Arch::Scalar } else { Arch::new() }
}

impl fmt::Display for Level {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// [`VARIABLE`] asks for what cannot be given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LevelError {
    asked: String,
    problem: &'static str,
}

impl fmt::Display for LevelError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let known: Vec<&str> = Level::available().map(Level::name).collect();
        write!(f, "{VARIABLE}: {:?} {}; expected one of {}", self.asked, self.problem, known.join(", "))
    }
}

impl std::error::Error for LevelError {}

/// The level of this process: what [`VARIABLE`] asks for, else the widest that the processor has. The variable is read
/// once, at the first call.
///
/// # Errors
/// A name that no level has, a level that this processor lacks. A program asks for the level first and ends with the
/// error: [`arch`] cannot say it.
pub fn level() -> Result<Level, LevelError> {
    static CHOSEN: OnceLock<Result<Level, LevelError>> = OnceLock::new();
    CHOSEN
        .get_or_init(|| std::env::var_os(VARIABLE).map_or(Ok(Level::detected()), |text| parsed(&text)))
        .clone()
}

fn parsed(text: &std::ffi::OsStr) -> Result<Level, LevelError> {
    let refused = |problem| LevelError { asked: text.to_string_lossy().into_owned(), problem };
    let level = Level::ALL.into_iter().find(|level| text == level.name());
    let level = level.ok_or_else(|| refused("is no set of vector instructions"))?;
    level.arch().map(|_| level).ok_or_else(|| refused("is not what this processor has"))
}

/// What every kernel is dispatched with: the instructions of [`level`], or, where that is an error, the widest that the
/// processor has.
pub fn arch() -> Arch {
    static ARCH: OnceLock<Arch> = OnceLock::new();
    *ARCH.get_or_init(|| level().ok().and_then(Level::arch).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_others_are_refused() {
        for level in Level::available() {
            assert_eq!(parsed(level.name().as_ref()), Ok(level));
        }
        assert_eq!(Level::available().last(), Some(Level::detected()));
        for wrong in ["", "AVX2", "sse"] {
            let error = parsed(wrong.as_ref()).map_err(|error| error.to_string());
            let start =
                format!("SKINSPLAT_SIMD: {wrong:?} is no set of vector instructions; expected one of scalar");
            assert!(error.as_ref().is_err_and(|text| text.starts_with(&start)), "{error:?}");
        }
    }

    #[test]
    fn kernels_get_what_is_chosen() {
        let same = |a: Arch, b: Arch| std::mem::discriminant(&a) == std::mem::discriminant(&b);
        let expected = level().unwrap_or_else(|_| Level::detected()).arch();
        assert!(expected.is_some_and(|expected| same(arch(), expected)));
    }
}
