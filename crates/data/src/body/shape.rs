//! A body of given shape coefficients, whatever their number.

use skinsplat_core::scene::{Body, RestBody, SceneError};

/// The body of `betas` and `expression` (SMPL: `v_template + shapedirs betas + exprdirs expression`, joints regressed from
/// it). Coefficients that are missing are zero; those that the model has no directions for are left out, which is said
/// unless they are zero.
///
/// # Errors
/// A coefficient that is not finite, or one that moves the body out of any sensible range.
pub fn shape(model: &Body, betas: &[f64], expression: &[f64]) -> Result<(RestBody, Vec<String>), SceneError> {
    let [shapes, expressions] =
        model.shape.as_ref().map_or([0; 2], |own| [own.directions.len(), own.expressions.len()]);
    let mut notes = Vec::new();
    let mut kept = |name: &str, values: &[f64], known: usize| {
        let finite = values.iter().position(|v| !v.is_finite());
        if let Some(i) = finite {
            return Err(SceneError::new(format!("{name}[{i}]"), "NaN or infinite", "finite values"));
        }
        let kept = values.len().min(known);
        if values[kept..].iter().any(|&v| v != 0.0) {
            let left = values.len() - kept;
            notes.push(format!(
                "{name}: {} values for a model of {known} directions; the last {left} left out",
                values.len()
            ));
        } else if !values.is_empty() && values.len() < known {
            notes.push(format!(
                "{name}: {} values for a model of {known} directions; the others are zero",
                values.len()
            ));
        }
        Ok(kept)
    };
    let betas = &betas[..kept("betas", betas, shapes)?];
    let expression = &expression[..kept("expression", expression, expressions)?];
    Ok((model.shaped_with(betas, expression)?, notes))
}
