//! A table as HTML: headings that sort, footnotes, and numbers in full precision for whoever points at them.

use super::page::prose;
use maud::{Markup, html};
use skinsplat_table::{Align, Cell, Column, Content, Row, RowKind, Table};

/// The table under its title, in a box that scrolls by itself.
pub(super) fn markup(table: &Table) -> Markup {
    html! {
        h3 { (table.title) }
        (untitled(table))
    }
}

/// The table without its title.
pub(super) fn untitled(table: &Table) -> Markup {
    html! {
        div.table {
            @for sentence in &table.sentences { p.sentence { (prose(sentence)) "." } }
            @if !table.rows.is_empty() {
                div.scroll tabindex="0" role="region" aria-label=(table.title) {
                    table style={ "--ems:" (ems(table)) } {
                        thead { (groups(table)) tr { (headings(table)) } }
                        tbody { @for (row, repeats) in table.rows.iter().zip(repeats(table)) { (line(table, row, repeats)) } }
                    }
                }
            }
            @if !table.notes.is_empty() {
                ol.notes { @for note in &table.notes { li { (prose(note)) } } }
            }
            (legend(table))
            @for remark in &table.remarks { p.remark { (prose(remark)) } }
        }
    }
}

/// Em that a letter takes, the bold ones of headings included.
const LETTER: f64 = 0.62;
/// Em beside the text of a column: style.css, on paper.
const BESIDE: f64 = 0.9;

/// The least width of the table in em, by which it is set small enough for paper: words do not break, nor do numbers.
fn ems(table: &Table) -> usize {
    let word = |text: &str| text.split([' ', '\n']).map(|word| word.chars().count()).max().unwrap_or(0);
    let label = |i: usize| {
        let rows = table.rows.iter().filter_map(|row| Some(word(row.labels.get(i)?))).max();
        rows.unwrap_or(0).max(word(&table.labels[i].title))
    };
    let column = |(i, column): (usize, &Column)| {
        let cell = |cell: &Cell| match cell.content {
            Content::Phrase(_) => word(&cell.text),
            _ if column.align != Align::Right => word(&cell.text),
            _ => cell.text.chars().count(),
        };
        let rows = table.rows.iter().filter_map(|row| Some(cell(row.cells.get(i)?))).max();
        rows.unwrap_or(0).max(word(&column.heading()))
    };
    let widths = (0..table.labels.len()).map(label).chain(table.columns.iter().enumerate().map(column));
    widths.map(|letters| LETTER * letters as f64 + BESIDE).sum::<f64>().ceil() as usize
}

/// A line of headings over neighbouring columns, if there are any.
fn groups(table: &Table) -> Markup {
    let mut spans: Vec<(&str, usize)> = Vec::new();
    for column in &table.columns {
        let group = column.group.as_deref().unwrap_or_default();
        match spans.last_mut() {
            Some((last, count)) if *last == group => *count += 1,
            _ => spans.push((group, 1)),
        }
    }
    let any = spans.iter().any(|(group, _)| !group.is_empty());
    html! {
        @if any {
            tr.groups {
                td colspan=(table.labels.len()) {}
                @for (group, count) in spans { th scope="colgroup" colspan=(count) { (group) } }
            }
        }
    }
}

fn headings(table: &Table) -> Markup {
    html! {
        @for label in &table.labels {
            th scope="col" { button type="button" { (label.title) } }
        }
        @for column in &table.columns {
            th.num[column.align == Align::Right] scope="col" title=[column.about.as_deref()] {
                button type="button" { (column.heading()) }
            }
        }
    }
}

/// Per row, whether its first label is that of the row above: it is shown faintly until somebody sorts.
fn repeats(table: &Table) -> Vec<bool> {
    let once = table.labels.len() > 1 && table.labels[0].once;
    let same = |r: usize| {
        let (above, row) = (&table.rows[r - 1], &table.rows[r]);
        let mean = |row: &Row| row.kind == RowKind::Mean;
        above.labels.first() == row.labels.first() && mean(above) == mean(row)
    };
    (0..table.rows.len()).map(|r| once && r > 0 && same(r)).collect()
}

fn line(table: &Table, row: &Row, repeats: bool) -> Markup {
    html! {
        tr class=(row.kind.id()) {
            @for (i, label) in row.labels.iter().enumerate() {
                @if i + 1 == row.labels.len() {
                    th scope="row" { (label) }
                } @else {
                    td.repeat[repeats && i == 0] { (label) }
                }
            }
            @for (column, cell) in table.columns.iter().zip(&row.cells) { (field(column, cell)) }
        }
    }
}

fn field(column: &Column, cell: &Cell) -> Markup {
    let value = cell.content.value();
    // Sorted by what is printed in full precision; infinity is a number, and what is none comes last.
    let key = value.map(|v| if v.is_finite() { v.to_string() } else { "Infinity".to_owned() });
    let exact = matches!(cell.content, Content::Number(_)).then_some(value).flatten();
    let title = exact.map(|v| v.to_string()).filter(|text| *text != cell.text);
    html! {
        td.num[column.align == Align::Right].best[cell.best] data-v=[key] title=[title] {
            @if let Some(verdict) = Verdict::of(cell) { (verdict.markup()) }
            @else if cell.best { strong { (minus(&cell.text)) } }
            @else { (minus(&cell.text)) }
            @if let Some(notes) = cell.footnotes() { sup { (notes) } }
            @if cell.missing > 0 { span.missing { " (" (cell.missing) " missing)" } }
        }
    }
}

/// A judged difference: `+0.12 ± 0.03 over seeds [+0.05, +0.20], better, won 83 %`.
struct Verdict<'a> {
    /// The difference, with its spread.
    difference: &'a str,
    /// The interval, if there is one.
    interval: Option<&'a str>,
    /// What it decides.
    words: &'a str,
    /// The share of the frames.
    won: &'a str,
}

impl<'a> Verdict<'a> {
    /// The parts of a phrase that reads like one.
    fn of(cell: &'a Cell) -> Option<Self> {
        let Content::Phrase(_) = cell.content else { return None };
        let (front, won) = cell.text.rsplit_once(", won ")?;
        let (numbers, words) = front.rsplit_once(", ")?;
        let (difference, interval) = match numbers.split_once(" [") {
            Some((difference, interval)) => (difference, interval.strip_suffix(']')),
            None => (numbers, None),
        };
        Some(Self { difference, interval, words, won })
    }

    /// Difference and verdict; the interval for whoever points at it, and on paper.
    fn markup(&self) -> Markup {
        let kind = match self.words {
            "better" => "better",
            "worse" => "worse",
            words if words.starts_with("no difference") => "same",
            _ => "open",
        };
        let interval =
            self.interval.map_or_else(|| "no interval".to_owned(), |i| format!("95 % interval [{i}]"));
        let more = minus(&format!("{interval}, won {}", self.won));
        html! {
            span.verdict.(kind) tabindex="0" title=(more) {
                (minus(self.difference)) " " b { (self.words) }
                span.more { (more) }
            }
        }
    }
}

/// The text with a minus sign in place of the hyphen before a digit, where that begins a number.
fn minus(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut before = ' ';
    let mut rest = text.chars().peekable();
    while let Some(c) = rest.next() {
        let sign =
            c == '-' && matches!(before, ' ' | '[' | '(') && rest.peek().is_some_and(char::is_ascii_digit);
        out.push(if sign { '−' } else { c });
        before = c;
    }
    out
}

fn legend(table: &Table) -> Markup {
    let explained: Vec<(&str, &str)> =
        table.columns.iter().filter_map(|c| Some((c.title.as_str(), c.about.as_deref()?))).collect();
    html! {
        @if !explained.is_empty() {
            dl.legend { @for (title, about) in explained { dt { (title) } dd { (prose(about)) } } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_table::{Digits, Label};

    #[test]
    fn verdicts_are_taken_apart() {
        let cell =
            Cell::phrase(0.12, "+0.12 ± 0.03 over seeds [+0.05, +0.20], no difference above 0.5, won 83 %");
        let verdict = Verdict::of(&cell).unwrap();
        assert_eq!(verdict.difference, "+0.12 ± 0.03 over seeds");
        assert_eq!(verdict.interval, Some("+0.05, +0.20"));
        assert_eq!((verdict.words, verdict.won), ("no difference above 0.5", "83 %"));
        let few = Cell::phrase(0.1, "+0.1, too few frames, won 100 %");
        let few = Verdict::of(&few).unwrap();
        assert_eq!((few.difference, few.interval, few.words), ("+0.1", None, "too few frames"));
        assert!(Verdict::of(&Cell::phrase(133.0, "breaks at 133")).is_none());
        assert!(Verdict::of(&Cell::text("a, won b")).is_none());
    }

    #[test]
    fn only_signs_become_minus() {
        assert_eq!(minus("-0.1 [-2, +3], image-1, 5e-4"), "−0.1 [−2, +3], image-1, 5e-4");
    }

    #[test]
    fn cells_keep_their_digits_and_sort_by_their_value() {
        let mut table = Table::new("t", "T");
        table.labels = vec![Label::new("s", "Sequence").once(), Label::new("v", "Variant")];
        table.columns = vec![Column::new("psnr", "PSNR").digits(Digits::Decimals(2))];
        let cell = |value: f64| Cell::number(value, Digits::Decimals(2));
        table.rows = vec![
            Row::new("a", ["lab", "x"], vec![Cell { best: true, ..cell(19.7) }]),
            Row::new("b", ["lab", "y"], vec![cell(f64::INFINITY)]),
            Row::new("c", ["lab", "z"], vec![Cell::new(Content::NotComputed, Digits::Exact)]),
        ];
        let html = markup(&table).into_string();
        assert!(html.contains(r#"data-v="19.7" title="19.7"><strong>19.70</strong>"#), "{html}");
        assert!(html.contains(r#"data-v="Infinity">∞"#), "{html}");
        assert!(html.contains(r#"<td class="num">n/c"#), "{html}");
        assert_eq!(html.matches(r#"<td class="repeat">lab"#).count(), 2, "{html}");
    }
}
