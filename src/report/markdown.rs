//! A table of a run as Markdown: with what its variants compare to, and the paper's own numbers.

use super::comparison;
use super::results::TableResults;
use skinsplat_table::markdown as write;

/// The table under a heading, with its footnotes, comparisons and, folded away, the paper's own numbers.
pub fn markdown(results: &TableResults) -> String {
    let mut text = write::markdown(&results.table);
    if !results.comparisons.is_empty() {
        text += "\nFrame by frame: mean difference, its 95 % interval over what the column names, what that decides, and the \
                 share of frames won.\n\n";
        text += &write::grid(&comparison::table(&results.comparisons));
    }
    if let Some(paper) = &results.paper {
        let summary = "the paper's values on its data and avatars (not comparable with a stand-in's)";
        let heading = format!("{}: {summary}", paper.title.replace('<', "&lt;"));
        let body = write::body(paper);
        text += &format!("\n<details>\n<summary>{heading}</summary>\n\n{body}\n</details>\n");
    }
    text
}
