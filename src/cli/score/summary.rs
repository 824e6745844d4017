//! Scores of frames as a table: a row per variant, under its frame.

use super::Scored;
use serde_json::{Map, Value};
use skinsplat_metrics::{FrameScore, Summary};
use skinsplat_table::{Cell, Column, Content, Digits, Label, Row, RowKind, Table};

/// As printed.
const DIGITS: Digits = Digits::Decimals(6);

/// The frames, and under several their means.
pub(super) fn table(
    scored: &[Scored],
    means: Option<&Map<String, Value>>,
    summary: Option<&Summary>,
) -> Table {
    let mut table = Table {
        labels: vec![Label::new("frame", "Frame").once(), Label::new("metric", "Metric")],
        columns: vec![Column::new("value", "Value").digits(DIGITS)],
        ..Table::new("scores", "Scores")
    };
    for frame in scored {
        Frame { name: &frame.name, kind: RowKind::Measured, table: &mut table }.add(frame);
    }
    if let Some(means) = means {
        let name = format!("mean of {} frames", scored.len());
        let mut mean = Frame { name: &name, kind: RowKind::Mean, table: &mut table };
        mean.values(means);
        let missing = scored.iter().find_map(|frame| frame.protocol.as_ref()?.lpips_missing.as_deref());
        if let Some(Summary { protocol, psnr, ssim, lpips, .. }) = summary {
            mean.protocol(protocol, *psnr, *ssim, *lpips, missing);
        }
    }
    table
}

/// The rows of one frame, or of the mean.
struct Frame<'a> {
    name: &'a str,
    kind: RowKind,
    table: &'a mut Table,
}

impl Frame<'_> {
    fn add(&mut self, frame: &Scored) {
        self.values(&frame.variants);
        for (id, reason) in &frame.not_computed {
            self.none(id, &format!("{id} not computed: {}", reason.as_str().unwrap_or_default()));
        }
        if let Some(FrameScore { protocol, psnr, ssim, lpips, lpips_missing, .. }) = &frame.protocol {
            self.protocol(protocol, *psnr, *ssim, *lpips, lpips_missing.as_deref());
        }
    }

    fn values(&mut self, values: &Map<String, Value>) {
        for (id, value) in values {
            // JSON has no infinity.
            self.push(id, Cell::number(value.as_f64().unwrap_or(f64::INFINITY), DIGITS));
        }
    }

    fn protocol(
        &mut self,
        protocol: &impl std::fmt::Display,
        psnr: f64,
        ssim: Option<f64>,
        lpips: Option<f64>,
        missing: Option<&str>,
    ) {
        let missing = missing.unwrap_or("no reason given");
        for (metric, value, why) in
            [("psnr", Some(psnr), ""), ("ssim", ssim, "not asked for"), ("lpips", lpips, missing)]
        {
            let id = format!("protocol {protocol}: {metric}");
            match value {
                Some(value) => self.push(&id, Cell::number(value, DIGITS)),
                None => self.none(&id, &format!("{id} not computed ({why})")),
            }
        }
    }

    /// A row without a number, and the note that says why.
    fn none(&mut self, id: &str, note: &str) {
        let notes = &mut self.table.notes;
        let index = notes.iter().position(|known| known == note).unwrap_or(notes.len());
        if index == notes.len() {
            notes.push(note.to_owned());
        }
        self.push(id, Cell { notes: vec![index], ..Cell::new(Content::NotComputed, DIGITS) });
    }

    fn push(&mut self, id: &str, cell: Cell) {
        let row = Row::new(format!("{}/{id}", self.name), [self.name, id], vec![cell]);
        self.table.rows.push(Row { kind: self.kind, ..row });
    }
}
