//! Two images by the metrics of a protocol.

use crate::arrays::{invalid, rows, values};
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use skinsplat_core::scene::{Image, Mask};
use skinsplat_metrics::lpips::OneFrame;
use skinsplat_metrics::lpips::weights::Networks;
use skinsplat_metrics::{MetricId, Protocol, Truth, Wanted};
use std::collections::BTreeMap;

/// Metrics by name, and why some are missing.
type Scores = (BTreeMap<String, f64>, BTreeMap<String, String>);

/// render, truth (h, w, 3) in [0, 1]; mask (h, w).
#[pyfunction]
pub fn score_images(
    py: Python<'_>,
    render: PyReadonlyArrayDyn<'_, f32>,
    truth: PyReadonlyArrayDyn<'_, f32>,
    protocol: &str,
    mask: Option<PyReadonlyArrayDyn<'_, f32>>,
    metrics: Vec<String>,
) -> PyResult<Scores> {
    let protocol = Protocol::parse(protocol).map_err(invalid)?;
    let metrics = metrics.iter().map(|id| metric(id)).collect::<PyResult<Vec<MetricId>>>()?;
    let (render, truth) = (image(&render, "render")?, image(&truth, "truth")?);
    let mask = mask.as_ref().map(plane).transpose()?;
    let score = py.detach(|| {
        let networks = Networks::default();
        let wanted = Wanted { lpips: Some(&OneFrame::new(&networks)), ..Wanted::of(&metrics) };
        protocol.score_with(&render, Truth::Composited { rgb: &truth, mask: mask.as_ref() }, wanted)
    });
    let score = score.map_err(invalid)?;
    let values = score.values.iter().map(|(id, value)| (id.id().to_owned(), value)).collect();
    let missing =
        score.not_computed.iter().map(|(id, reason)| (id.id().to_owned(), reason.clone())).collect();
    Ok((values, missing))
}

fn metric(id: &str) -> PyResult<MetricId> {
    MetricId::from_id(id).ok_or_else(|| {
        let known: Vec<&str> = MetricId::of_frames().map(MetricId::id).collect();
        invalid(format!("metric `{id}`: unknown; expected one of {}", known.join(", ")))
    })
}

fn image(array: &PyReadonlyArrayDyn<'_, f32>, name: &str) -> PyResult<Image> {
    let (values, shape) = values(array, name, &[3])?;
    match shape[..] {
        [height, width] => Image::new(width, height, rows(&values)).map_err(invalid),
        _ => Err(invalid(format!("{name}: {} axes; expected (height, width, 3)", shape.len() + 1))),
    }
}

fn plane(array: &PyReadonlyArrayDyn<'_, f32>) -> PyResult<Mask> {
    let (values, shape) = values(array, "mask", &[])?;
    match shape[..] {
        [height, width] => Mask::new(width, height, values).map_err(invalid),
        _ => Err(invalid(format!("mask: {} axes; expected (height, width)", shape.len()))),
    }
}
