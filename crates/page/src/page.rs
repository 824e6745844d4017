//! The page: a heading, a table of contents, sections.

use super::{Chart, Picture, Viewer, table};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use skinsplat_table::Table;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// A page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    title: String,
    lead: Vec<String>,
    warnings: Vec<String>,
    sections: Vec<Section>,
}

/// A part of the page under a heading of its own.
#[derive(Clone, Debug, Default)]
pub struct Section {
    id: String,
    title: String,
    parts: Vec<Part>,
}

/// What a section is made of.
#[derive(Clone, Debug)]
pub enum Part {
    /// A paragraph.
    Text(String),
    /// A table with everything that it says.
    Table(Table),
    /// A table of something else's: printed in a paper, not measured here. It stands in a block of its own.
    Aside(Table),
    /// A chart.
    Chart(Chart),
    /// Charts of one thing, of which one is shown at a time, each under a name. Those of a section are switched together.
    Views(Vec<(String, Chart)>),
    /// Pictures under a slider.
    Viewer(Viewer),
    /// A picture by itself, which may move, with its caption.
    Figure(Picture, String),
    /// Parts that are folded away under a heading until somebody wants them.
    Folded(String, Vec<Part>),
}

impl Page {
    /// An empty page.
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), ..Self::default() }
    }

    /// With a paragraph under the title.
    pub fn lead(mut self, text: impl Into<String>) -> Self {
        self.lead.push(text.into());
        self
    }

    /// With something that a reader must not miss: that frames are missing, that pictures were left out.
    pub fn warning(mut self, text: impl Into<String>) -> Self {
        self.warnings.push(text.into());
        self
    }

    /// With a section.
    pub fn section(mut self, section: Section) -> Self {
        self.sections.push(section);
        self
    }

    /// The document.
    pub fn html(&self) -> String {
        let contents = self.sections.iter().enumerate();
        let document = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    meta name="viewport" content="width=device-width, initial-scale=1";
                    meta name="color-scheme" content="light dark";
                    // Nothing is ever fetched; a name that were markup after all would not run.
                    link rel="icon" href="data:,";
                    title { (self.title) }
                    style { (PreEscaped(STYLE)) }
                }
                body {
                    a.skip href="#content" { "Skip to the content" }
                    header {
                        h1 { (self.title) }
                        @for text in &self.lead { p { (prose(text)) } }
                        @for text in &self.warnings { p.warning role="note" { (prose(text)) } }
                        @if self.sections.len() > 1 {
                            nav aria-label="Contents" {
                                ul { @for (i, section) in contents { li { a href={ "#" (anchor(i, section)) } { (section.title) } } } }
                            }
                        }
                    }
                    main id="content" {
                        @for (i, section) in self.sections.iter().enumerate() { (section.markup(i)) }
                    }
                    script { (PreEscaped(SCRIPT)) }
                }
            }
        };
        document.into_string() + "\n"
    }
}

impl Section {
    /// An empty section; the id is what links name.
    pub fn new(id: impl Into<String>, title: impl Into<String>) -> Self {
        Self { id: id.into(), title: title.into(), parts: Vec::new() }
    }

    /// With a part.
    pub fn part(mut self, part: Part) -> Self {
        self.parts.push(part);
        self
    }

    /// Adds a part.
    pub fn push(&mut self, part: Part) {
        self.parts.push(part);
    }

    fn markup(&self, index: usize) -> Markup {
        let at = anchor(index, self);
        html! {
            section id=(at) aria-labelledby={ (at) "-h" } {
                h2 id={ (at) "-h" } { (self.title) }
                @for (i, part) in self.parts.iter().enumerate() {
                    @match part {
                        // Its title stands above it already.
                        Part::Table(table) if table.title == self.title => (table::untitled(table)),
                        part => (part.markup(&format!("{at}-{i}"))),
                    }
                }
            }
        }
    }
}

/// A fragment that no other section has and that is a valid one, whatever its name.
fn anchor(index: usize, section: &Section) -> String {
    let plain: String = section.id.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    format!("s{index}-{plain}")
}

impl Part {
    fn markup(&self, at: &str) -> Markup {
        match self {
            Self::Text(text) => html! { p { (prose(text)) } },
            Self::Table(table) => table::markup(table),
            Self::Aside(table) => html! {
                aside.paper aria-label={ "Printed: " (table.title) } { (table::markup(table)) }
            },
            Self::Chart(chart) => chart.markup(at),
            Self::Views(views) => switched(views, at),
            Self::Viewer(viewer) => viewer.markup(at),
            Self::Figure(picture, caption) => html! {
                figure.single { (picture.img(caption)) figcaption { (prose(caption)) } }
            },
            Self::Folded(title, parts) => html! {
                details {
                    summary { (title) }
                    @for (i, part) in parts.iter().enumerate() { (part.markup(&format!("{at}-{i}"))) }
                }
            },
        }
    }
}

/// The first of several charts, and buttons that show another.
fn switched(views: &[(String, Chart)], at: &str) -> Markup {
    let label = views.first().map(|(_, chart)| chart.title()).unwrap_or_default();
    html! {
        div.views {
            div.switch role="group" aria-label={ "View of " (label) } {
                @for (i, (name, _)) in views.iter().enumerate() {
                    button type="button" aria-pressed=(i == 0) { (name) }
                }
            }
            @for (i, (name, chart)) in views.iter().enumerate() {
                div data-view=(name) hidden[i > 0] { (chart.markup(&format!("{at}-v{i}"))) }
            }
        }
    }
}

/// Text in which code stands between backticks, as many before it as after it.
pub(crate) fn prose(text: &str) -> Markup {
    html! {
        @match code(text) {
            Some((before, code, after)) => { (before) code { (code) } (prose(after)) },
            None => { (text) },
        }
    }
}

/// The first code in a text, and what is around it.
fn code(text: &str) -> Option<(&str, &str, &str)> {
    let run = |at: usize| text[at..].bytes().take_while(|&byte| byte == b'`').count();
    let mut open = text.find('`')?;
    loop {
        let fence = run(open);
        let begin = open + fence;
        let mut close = begin;
        while let Some(found) = text[close..].find('`').map(|at| close + at) {
            if run(found) == fence {
                let inner = &text[begin..found];
                let padded = inner.strip_prefix(' ').and_then(|inner| inner.strip_suffix(' '));
                return Some((&text[..open], padded.unwrap_or(inner), &text[found + fence..]));
            }
            close = found + run(found);
        }
        open = begin + text[begin..].find('`')?;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use skinsplat_table::{Cell, Column, Digits, Label, Row};

    const STRANGE: &str = "<script>alert(1)</script>\"'&`</style>";

    #[test]
    fn names_are_escaped_wherever_they_stand() {
        let mut table = Table::new(STRANGE, STRANGE);
        table.sentences = vec![STRANGE.into()];
        table.labels = vec![Label::new(STRANGE, STRANGE)];
        table.columns = vec![Column::new(STRANGE, STRANGE).group(STRANGE).about(STRANGE)];
        table.notes = vec![STRANGE.into()];
        table.remarks = vec![STRANGE.into()];
        table.rows = vec![Row::new("r", [STRANGE], vec![Cell { notes: vec![0], ..Cell::text(STRANGE) }])];
        let series = crate::Series::new(STRANGE, vec![crate::Point::new(0.0, 1.0).titled(STRANGE)]);
        let chart = Chart::lines(STRANGE, STRANGE, STRANGE).with(series);
        let picture = Picture::new("image/gif", b"GIF", [1, 1]);
        let view = crate::View {
            label: STRANGE.into(),
            picture: picture.clone(),
            error: None,
            note: STRANGE.into(),
        };
        let frame = crate::Frame {
            sequence: STRANGE.into(),
            name: STRANGE.into(),
            views: vec![view],
            crops: Vec::new(),
        };
        let viewer = Viewer { title: STRANGE.into(), frames: vec![frame], scale: None };
        let section = Section::new(STRANGE, STRANGE)
            .part(Part::Text(STRANGE.into()))
            .part(Part::Table(table))
            .part(Part::Chart(chart))
            .part(Part::Viewer(viewer))
            .part(Part::Figure(picture, STRANGE.into()));
        let html = Page::new(STRANGE).lead(STRANGE).warning(STRANGE).section(section).html();
        assert_eq!(html.matches("<script>").count(), 1, "the page's own");
        assert!(!html.contains("<script>alert"));
        assert_eq!(html.matches("</style>").count(), 1);
        assert_eq!(html.matches("</script>").count(), 2, "the page's own, and the data of the viewer");
    }

    #[test]
    fn a_page_asks_for_nothing() {
        let table = Table {
            labels: vec![Label::new("a", "A")],
            columns: vec![Column::new("b", "B").digits(Digits::Decimals(1))],
            rows: vec![Row::new("r", ["x"], vec![Cell::number(1.0, Digits::Decimals(1))])],
            ..Table::new("t", "T")
        };
        let html = Page::new("P").section(Section::new("a", "A").part(Part::Table(table))).html();
        for outside in ["http:", "https:", "src=\"//", "@import", "url(", "fetch(", "XMLHttpRequest"] {
            let found = html.replace("http://www.w3.org/", "").contains(outside);
            assert!(!found, "{outside}");
        }
    }

    #[test]
    fn backticks_mark_code_in_pairs() {
        assert_eq!(prose("a `b<` c").into_string(), "a <code>b&lt;</code> c");
        assert_eq!(prose("a ` c").into_string(), "a ` c");
        assert_eq!(prose("``a`b`` and `` `c` ``").into_string(), "<code>a`b</code> and <code>`c`</code>");
        assert_eq!(prose("``a` b `c`").into_string(), "``a<code>b</code>c`");
    }
}
