//! Experiments with several seeds: every fitted variant is repeated with each of them.

use super::{AvatarRecipe, Error, Experiment, Variant};
use std::collections::BTreeSet;

/// Most seeds of an experiment.
const MOST: usize = 100;

/// Which variant of the file a variant repeats, and with which seed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Replicate {
    /// Id of the variant in the file.
    pub id: String,
    /// Label of the variant in the file.
    pub label: String,
    /// Seed of the fit.
    pub seed: u64,
}

impl Experiment {
    /// The experiment with every fitted variant repeated with these seeds; as it is without seeds, or if it fits nothing.
    ///
    /// # Errors
    /// Seeds that repeat or are too many, or an experiment (or one of its variants) that has seeds of its own.
    pub fn with_seeds(self, seeds: &[u64]) -> Result<Self, Error> {
        if seeds.is_empty() || !self.variants.iter().any(is_fitted) {
            return Ok(self);
        }
        let file = format!("{}.toml", self.id);
        if !self.seeds.is_empty() {
            return Err(Error::invalid(
                &file,
                "seeds",
                format!("{:?}", self.seeds),
                "none where others are given",
            ));
        }
        let seeded = Self { seeds: seeds.to_vec(), ..self };
        check(&seeded, &file)?;
        Ok(expand(seeded))
    }
}

fn is_fitted(variant: &Variant) -> bool {
    matches!(variant.avatar, AvatarRecipe::Fit { .. })
}

/// Checks `seeds`.
pub(super) fn check(e: &Experiment, file: &str) -> Result<(), Error> {
    let fail = |key: &str, problem: String, expected: &str| Err(Error::invalid(file, key, problem, expected));
    if e.seeds.is_empty() {
        return Ok(());
    }
    if e.seeds.len() > MOST || e.seeds.iter().collect::<BTreeSet<_>>().len() < e.seeds.len() {
        return fail("seeds", format!("{:?}", e.seeds), "at most 100 numbers, each once");
    }
    let own = |v: &Variant| matches!(v.avatar, AvatarRecipe::Fit { seed, .. } if seed != 0);
    match e.variants.iter().position(own) {
        Some(i) => fail(&format!("variants[{i}].avatar.seed"), "a seed".into(), "none beside `seeds`"),
        None => Ok(()),
    }
}

/// Repeats the fitted variants: `ID` becomes `ID-SEED` for each seed. All variants of a seed follow each other.
pub(super) fn expand(mut e: Experiment) -> Experiment {
    let Some(&first) = e.seeds.first() else { return e };
    if e.variants.iter().any(|v| v.id == e.baseline && is_fitted(v)) {
        e.baseline = format!("{}-{first}", e.baseline);
    }
    let (fits, others): (Vec<Variant>, Vec<Variant>) = e.variants.into_iter().partition(is_fitted);
    let repeated = e.seeds.iter().flat_map(|&seed| fits.iter().map(move |variant| repeat(variant, seed)));
    e.variants = repeated.chain(others).collect();
    e
}

fn repeat(variant: &Variant, seed: u64) -> Variant {
    let mut repeated = Variant {
        id: format!("{}-{seed}", variant.id),
        label: format!("{} (seed {seed})", variant.label),
        replicate: Some(Replicate { id: variant.id.clone(), label: variant.label.clone(), seed }),
        ..variant.clone()
    };
    if let AvatarRecipe::Fit { seed: own, .. } = &mut repeated.avatar {
        *own = seed;
    }
    repeated
}
