//! A comparison for people: as text, and as Markdown for the comment on a change.

use super::{Changes, Counts, Fate, moved, verdicts};
use skinsplat_table::markdown::{body, escape};
use skinsplat_table::{Table, markdown as table_markdown, text as table_text};

/// Rows of a comment: GitHub takes 65,536 characters.
const COMMENT_ROWS: usize = 200;

/// The fates that people want to see: everything but what is as it was, unless that was asked for too.
fn shown(changes: &Changes, all: bool) -> Table {
    verdicts(changes, |fate| all || fate != Fate::Unchanged)
}

/// For a terminal. `all`: also what is unchanged.
pub fn text(changes: &Changes, all: bool) -> String {
    let mut text = changes.summary() + "\n";
    for note in &changes.notes {
        text += &format!("note: {}\n", note.text);
    }
    for table in [shown(changes, all), moved(changes)].iter().filter(|table| !table.rows.is_empty()) {
        text += &format!("\n{}", table_text(table));
    }
    text
}

/// For a comment: the verdict as its heading, notes, what moved, and the frames behind it folded away.
pub fn markdown(changes: &Changes, all: bool) -> String {
    let Counts { regressed, missing, improved, new, unchanged } = changes.counts;
    let word = changes.verdict.id();
    let mut text = format!(
        "# Comparison: {word}\n\n{regressed} regressed, {missing} missing, {improved} improved, {new} new, {unchanged} unchanged; \
         {} sequences and variants compared.\n",
        changes.compared
    );
    if !changes.notes.is_empty() {
        text.push('\n');
        text.extend(changes.notes.iter().map(|note| format!("- {}\n", escape(&note.text))));
    }
    let mut lines = shown(changes, all);
    if lines.rows.len() > COMMENT_ROWS {
        let more = format!("The first {COMMENT_ROWS} of {} numbers", lines.rows.len());
        lines.sentences.push(more);
        lines.rows.truncate(COMMENT_ROWS);
    }
    if !lines.rows.is_empty() {
        text += &format!("\n{}", table_markdown(&lines));
    }
    let frames = moved(changes);
    if !frames.rows.is_empty() {
        let summary = "<summary>Frames that moved most</summary>";
        text += &format!("\n<details>{summary}\n\n{}\n</details>\n", body(&frames).trim_start());
    }
    text
}
