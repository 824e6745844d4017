//! A run as one page for a browser: its tables, how scores go over frames, how fits went, and pictures to compare.

mod charts;
mod encode;
mod pictures;

pub use pictures::{KeptPictures, MovingPicture, Stills};

use super::comparison;
use super::results::{Results, TableResults};
use crate::experiment::Source;
use pictures::Budget;
use skinsplat_page::{Page, Part, Section};
use skinsplat_table::Table;
use skinsplat_table::markdown::code_span;
use std::collections::BTreeMap;

/// What a page may hold beside the results.
#[derive(Debug, Default)]
pub struct Extras {
    /// The pictures that the run kept.
    pub pictures: KeptPictures,
    /// By key of a record, how far the body is bent in its frame, degrees.
    pub bends: BTreeMap<String, f64>,
    /// How its fits went, as `curves.csv` says.
    pub curves: String,
    /// Further tables, each at the end of the page: where the time went.
    pub tables: Vec<Table>,
    /// Files of a run's folder that are not there, and what the page has not because of them.
    pub absent: Vec<String>,
    /// Most bytes of the page.
    pub bound: usize,
}

/// Most bytes of a page, unless another bound is given.
pub const BOUND: usize = 15_000_000;

/// The page, as HTML.
pub fn html(results: &Results, extras: &Extras) -> String {
    let pictures = &extras.pictures;
    // Where not all were read, so many were as fit in the smallest size.
    let thinned = thinned(results, extras);
    let mut budget = match pictures.stills.len() {
        read if read < pictures.kept => Budget::smallest(pictures, read),
        _ => Budget::new(pictures),
    };
    budget = budget.thinned(thinned);
    let page = page(results, extras, &budget);
    let mut html = page.html();
    // Smaller pictures, then fewer, until it fits.
    while html.len() > extras.bound && budget.shrink() {
        html = self::page(results, extras, &budget).html();
    }
    match html.len() > extras.bound {
        true => self::page(results, extras, &budget.over()).html(),
        false => html,
    }
}

/// Of how many of `kept` frames a page can show pictures, as far as a few of them tell: those among the extras, which stand for
/// all. Who has thousands of frames reads so many and no more.
pub fn frames_that_fit(results: &Results, extras: &Extras, kept: usize) -> usize {
    let sample = extras.pictures.stills.len();
    let thinned = thinned(results, extras);
    let bytes = |frames: usize| {
        let budget = Budget::smallest(&extras.pictures, frames).thinned(thinned);
        page(results, extras, &budget).html().len()
    };
    let rest = bytes(0);
    let each = bytes(sample).saturating_sub(rest) as f64 / sample.max(1) as f64;
    let room = SAFE * extras.bound.saturating_sub(rest) as f64;
    if each > 0.0 { kept.min((room / each) as usize) } else { kept }
}

/// How many times charts lose half of their points, so that the page stays within its bound without pictures, and within half of it
/// if there are some.
fn thinned(results: &Results, extras: &Extras) -> u32 {
    let room = if extras.pictures.is_empty() { extras.bound } else { extras.bound / 2 };
    let fits = |thinned: &u32| page(results, extras, &Budget::none().thinned(*thinned)).html().len() <= room;
    (0..MOST_THINNED).find(fits).unwrap_or(MOST_THINNED)
}

/// From here on charts have two points a line.
const MOST_THINNED: u32 = 10;

/// The part of the room that pictures are chosen for: those that were not looked at may be larger.
const SAFE: f64 = 0.9;

fn page(results: &Results, extras: &Extras, budget: &Budget) -> Page {
    let titles: Vec<&str> = results.tables.iter().map(|table| table.table.title.as_str()).collect();
    let mut page = Page::new(match titles.as_slice() {
        [one] => format!("Results: {one}"),
        _ => "Results".to_owned(),
    });
    page = page.lead(format!(
        "Made by {}. Bold is the best value of a sequence, with everything that the frames do not decide to be worse: where \
         they are too few to decide anything, all of it. Counts are bold only where they are what the table is about. ↑: more is \
         better, ↓: less is better; n/c: not computed. Headings sort; whoever points at a number sees all of its digits, or its \
         interval.",
        code_span(&super::page::command(results))
    ));
    let code = results.code;
    page = page.lead(format!(
        "Plan `{}`; code versions: fit {}, strategy {}, render {}, metrics {}.",
        results.plan, code.fit, code.strategy, code.render, code.metrics
    ));
    for text in warnings(results, extras, budget) {
        page = page.warning(text);
    }
    for table in &results.tables {
        page = page.section(section(table, extras, budget));
    }
    let mut rest = Section::new("run", "The run");
    extras.tables.iter().for_each(|table| rest.push(Part::Table(table.clone())));
    if extras.tables.is_empty() { page } else { page.section(rest) }
}

/// Lost pictures that are named; others are counted.
const NAMED: usize = 5;

/// What a reader must not miss.
fn warnings(results: &Results, extras: &Extras, budget: &Budget) -> Vec<String> {
    let mut texts = Vec::new();
    if results.missing() > 0 {
        texts.push(format!(
            "Incomplete: {} missing; see the footnotes.",
            super::captions::count(results.missing(), "score")
        ));
    }
    if !results.options.subset.is_everything() {
        texts.push("Partial: only a part of the data was asked for; the tables say which.".to_owned());
    }
    let empty = results.tables.iter().filter(|table| table.table.rows.is_empty());
    texts.extend(empty.map(|table| format!("{}: not run, no data for it.", table.table.title)));
    if !extras.pictures.lost.is_empty() {
        let lost = &extras.pictures.lost;
        let named: Vec<String> = lost.iter().take(NAMED).map(|name| code_span(name)).collect();
        let more = match lost.len() - named.len() {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        let what = "Pictures that the run kept could not be read and are not shown";
        texts.push(format!("{what}: {}{more}.", named.join("; ")));
    } else if extras.pictures.is_empty() {
        texts.push(
            "Without pictures: the run kept none (`reproduce run --html FILE --images key|all` keeps them)."
                .to_owned(),
        );
    }
    texts.extend(budget.says(extras.bound));
    if !extras.absent.is_empty() {
        texts.push(format!("Not beside the results: {}.", extras.absent.join(", ")));
    }
    texts
}

fn section(results: &TableResults, extras: &Extras, budget: &Budget) -> Section {
    let mut section = Section::new(&results.experiment, &results.table.title);
    section.push(Part::Table(results.table.clone()));
    if !results.comparisons.is_empty() {
        let mut table = comparison::table(&results.comparisons);
        table.sentences.push("Mean differences, and what their 95 % intervals decide".to_owned());
        section.push(Part::Table(table));
    }
    if let Some(paper) = &results.paper {
        let mut paper = paper.clone();
        let beside = match results.source {
            Source::Own => "The numbers above are of the same data set",
            Source::StandIn | Source::Absent => "The numbers above are of other data: the two do not compare",
        };
        paper.sentences.push(beside.to_owned());
        section.push(Part::Aside(paper));
    }
    let viewer = budget.viewer(results, &extras.pictures);
    for part in charts::over_frames(results, budget, &extras.pictures, &extras.bends) {
        section.push(part);
    }
    if let Some(viewer) = viewer {
        section.push(Part::Viewer(viewer));
    }
    let moving: Vec<Part> = budget.moving(results, &extras.pictures);
    if !moving.is_empty() {
        section.push(Part::Folded("Moving pictures".to_owned(), moving));
    }
    let curves = charts::training(results, &extras.curves);
    if !curves.is_empty() {
        section.push(Part::Folded("How the fits went".to_owned(), curves));
    }
    section
}
