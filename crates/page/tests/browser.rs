//! The page in a browser: it loads without a complaint, sorts, slides by mouse and by keys, switches frames, prints, fits a phone.
#![expect(clippy::unwrap_used, reason = "tests")]

#[path = "support/chromium.rs"]
mod chromium;

use chromium::Chromium;
use skinsplat_page::{Chart, Frame, Page, Part, Picture, Point, Scale, Section, Series, View, Viewer};
use skinsplat_table::{Cell, Column, Digits, Direction, Label, Row, Table};
use std::path::Path;

const NAME: &str = "<img src=x onerror=\"console.error('markup')\">lab";

/// One colour, as an uncompressed bitmap of 2 x 1 pixels.
fn picture([r, g, b]: [u8; 3]) -> Picture {
    let mut bytes = b"BM".to_vec();
    let word = |value: u32| value.to_le_bytes();
    for value in [62, 0, 54, 40, 2, 1, 0x0018_0001, 0, 8, 2835, 2835, 0, 0] {
        bytes.extend(word(value));
    }
    bytes.extend([b, g, r, b, g, r, 0, 0]);
    Picture::new("image/bmp", &bytes, [320, 160])
}

fn table() -> Table {
    let value = |v: f64| Cell::number(v, Digits::Decimals(2));
    let judged = |text: &str, v: f64| Cell::phrase(v, text);
    Table {
        sentences: vec!["Made up for the test".into()],
        labels: vec![Label::new("sequence", "Sequence").once(), Label::new("variant", "Variant")],
        columns: vec![
            Column::new("psnr", "PSNR").better(Direction::Higher).about("decibel"),
            Column::new("difference", "Δ PSNR"),
        ],
        rows: vec![
            Row::new("a", [NAME, "Original"], vec![value(9.5), Cell::empty()]),
            Row::new(
                "b",
                [NAME, "Skinned"],
                vec![
                    Cell { best: true, ..value(30.25) },
                    judged("+20.75 [+20.00, +21.50], better, won 100 %", 20.75),
                ],
            ),
            Row::new(
                "c",
                [NAME, "Mesh"],
                vec![value(f64::INFINITY), judged("-0.10, too few frames, won 50 %", -0.1)],
            ),
            Row::new("d", [NAME, "None"], vec![Cell::empty(), Cell::empty()]),
        ],
        ..Table::new("t", "A table")
    }
}

fn page() -> Page {
    let colours = [[200, 40, 40], [40, 160, 60], [50, 80, 200]];
    let frame = |sequence: &str, i: usize| Frame {
        sequence: sequence.into(),
        name: format!("image_{i:04}"),
        views: (["Truth", "Original", "Skinned"].iter().zip(colours))
            .map(|(label, [r, g, b])| View {
                label: (*label).into(),
                picture: picture([r, g, b.wrapping_add(10 * i as u8)]),
                error: (*label != "Truth").then(|| picture([10, 0, r])),
                note: "30.2 dB".into(),
            })
            .collect(),
        crops: vec![colours.map(picture).to_vec()],
    };
    let viewer = Viewer {
        title: "Pictures".into(),
        frames: vec![frame(NAME, 0), frame(NAME, 1), frame(NAME, 2), frame("bike", 0), frame("bike", 7)],
        scale: Some(Scale::to(0.25)),
    };
    let point = |i: u8| Point::new(f64::from(i), f64::from(i % 3)).to("bike", format!("image_{i:04}"));
    let chart = Chart::lines("PSNR over frames", "frame", "PSNR, dB")
        .with(Series::new("Original", (0..9).map(point).collect()))
        .with(Series::new("Skinned", (0..9).map(|i| Point::new(f64::from(i), f64::from(i % 4))).collect()));
    let bent = Chart::scatter("PSNR over bend", "degrees", "PSNR, dB").with(Series::new(
        "Original",
        vec![
            Point::new(95.0, 20.0).to("bike", "image_0000"),
            Point::new(30.0, 25.0).titled("image_0003").without_picture("its picture was left out"),
        ],
    ));
    let views = |title: &str| {
        let points = vec![Point::new(0.0, 1.0), Point::new(1.0, 2.0)];
        let frames = Chart::lines(title, "frame", "dB").with(Series::new("Original", points));
        Part::Views(vec![("over frames".into(), frames), ("over bend".into(), bent.clone())])
    };
    let scatter = Chart::scatter("Time against error", "ns", "degrees").log(true, true).with(Series::new(
        "solvers",
        vec![Point::new(80.0, 0.001).labelled("closed-form"), Point::new(400.0, 3.0).labelled("power-15")],
    ));
    Page::new(format!("Results {NAME}"))
        .lead("Made by `reproduce run`.")
        .warning("2 scores are missing")
        .section(Section::new("tables", "Tables").part(Part::Table(table())).part(Part::Aside(table())))
        .section(
            Section::new("charts", "Charts")
                .part(Part::Chart(chart))
                .part(Part::Chart(scatter))
                .part(views("One"))
                .part(views("Two")),
        )
        .section(
            Section::new("pictures", "Pictures")
                .part(Part::Viewer(viewer))
                .part(Part::Figure(picture([9, 9, 9]), "A figure".into())),
        )
}

fn opened(width: u32, dark: bool) -> Option<(tempfile::TempDir, Chromium)> {
    opened_as(&page(), width, dark)
}

fn opened_as(page: &Page, width: u32, dark: bool) -> Option<(tempfile::TempDir, Chromium)> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("page.html");
    std::fs::write(&file, page.html()).unwrap();
    let browser = Chromium::open(&file, width, 900, dark)?;
    Some((folder, browser))
}

/// Keeps a screenshot for people, where they ask for it.
fn keep(browser: &mut Chromium, name: &str) {
    if let Some(folder) = std::env::var_os("SKINSPLAT_SCREENSHOTS") {
        std::fs::write(Path::new(&folder).join(name), browser.screenshot()).unwrap();
    }
}

#[test]
fn a_person_can_sort_slide_switch_and_print() {
    let Some((_folder, mut browser)) = opened(1400, false) else { return };
    keep(&mut browser, "page-1400.png");
    let column = "[...document.querySelectorAll('#s0-tables table')[0].tBodies[0].rows].map(r => r.cells[1].textContent).join()";
    assert_eq!(browser.value(column), "Original,Skinned,Mesh,None");
    browser.click("#s0-tables th:nth-child(3) button", 0.5);
    assert_eq!(
        browser.value(column),
        "Original,Skinned,Mesh,None",
        "by number: 9.5 before 30.25, what is none last"
    );
    browser.click("#s0-tables th:nth-child(3) button", 0.5);
    assert_eq!(browser.value(column), "Mesh,Skinned,Original,None");
    browser.focus("#s0-tables th:nth-child(2) button");
    browser.press("Enter", 13);
    browser.value("document.activeElement.click()");
    assert_eq!(
        browser
            .value("document.querySelector('#s0-tables th:nth-child(2)').getAttribute('aria-sort') !== null"),
        true
    );

    let clip = "document.querySelector('.over').style.clipPath";
    assert_eq!(browser.value(clip), "inset(0px 50% 0px 0px)");
    browser.click(".slide", 0.25);
    let after_mouse = browser.value("Number(document.querySelector('.slide').value)").as_f64().unwrap();
    assert!((15.0..35.0).contains(&after_mouse), "{after_mouse}");
    browser.press("ArrowRight", 39);
    assert_eq!(browser.value("Number(document.querySelector('.slide').value)"), after_mouse + 1.0, "by key");
    browser.click(".pair", 0.75);
    let on_picture = browser.value("Number(document.querySelector('.slide').value)").as_f64().unwrap();
    assert!((70.0..80.0).contains(&on_picture), "{on_picture}");

    let alt = "document.querySelector('.pair img').alt";
    assert_eq!(browser.value(alt), format!("{NAME} image_0000: Skinned"));
    browser.focus(".viewer");
    browser.press("ArrowRight", 39);
    assert_eq!(browser.value(alt), format!("{NAME} image_0001: Skinned"));
    browser.press("ArrowUp", 38);
    assert_eq!(browser.value(alt), format!("{NAME} image_0001: Original"));
    browser.press("e", 69);
    assert_eq!(browser.value(alt), format!("{NAME} image_0001: error of Original"));
    browser.press("ArrowDown", 40);
    assert_eq!(browser.value(alt), format!("{NAME} image_0001: error of Skinned"));
    browser.value("document.querySelector('a[data-frame=\"image_0007\"]').dispatchEvent(new MouseEvent('click', {bubbles: true, cancelable: true}))");
    assert_eq!(
        browser.value(alt),
        "bike image_0007: error of Original",
        "a point of a chart leads to its frame and variant"
    );

    let shown = "[...document.querySelectorAll('.views [data-view]')].filter(e => e.checkVisibility()).map(e => e.dataset.view).join()";
    assert_eq!(browser.value(shown), "over frames,over frames");
    browser.click(".switch button:last-child", 0.5);
    assert_eq!(browser.value(shown), "over bend,over bend", "those of a section change together");
    let pressed =
        "[...document.querySelectorAll('.switch button')].map(e => e.getAttribute('aria-pressed')).join()";
    assert_eq!(browser.value(pressed), "false,true,false,true");
    keep(&mut browser, "page-bend-1400.png");
    let hollow = "document.querySelector('.views circle.hollow')";
    assert_eq!(browser.value(&format!("{hollow}.textContent")), "image_0003; its picture was left out");
    assert_eq!(browser.value(&format!("{hollow}.closest('a') === null")), true);
    browser.value("document.querySelector('.views a[data-frame=\"image_0000\"]').dispatchEvent(new MouseEvent('click', {bubbles: true, cancelable: true}))");
    assert_eq!(browser.value(alt), "bike image_0000: error of Original", "so does one of the other view");
    browser.focus(".switch button:first-child");
    browser.press("Enter", 13);
    browser.value("document.activeElement.click()");
    assert_eq!(browser.value(shown), "over frames,over frames", "by key");

    let pdf = browser.pdf();
    assert!(pdf.starts_with(b"%PDF") && pdf.len() > 10_000, "{}", pdf.len());
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn it_fits_a_phone_and_has_what_readers_of_screens_need() {
    let Some((_folder, mut browser)) = opened(400, true) else { return };
    keep(&mut browser, "page-400-dark.png");
    let wide = "[...document.querySelectorAll('body *')].filter(e => !e.closest('.scroll, .skip') && \
        e.getBoundingClientRect().right > 400).map(e => `${e.tagName}.${e.className.baseVal ?? e.className}`).join()";
    assert_eq!(browser.value(wide), "", "nothing sticks out sideways");
    assert_eq!(browser.value("document.documentElement.scrollWidth"), 400);
    for nothing in [
        "document.querySelectorAll('img:not([alt])').length",
        "[...document.querySelectorAll('select, input')].filter(e => !e.labels.length).length",
        "[...document.querySelectorAll('svg[role=img]')].filter(e => !document.getElementById(e.getAttribute('aria-labelledby'))).length",
        "document.querySelectorAll('h1').length - 1",
        "new Set([...document.querySelectorAll('[id]')].map(e => e.id)).size - document.querySelectorAll('[id]').length",
    ] {
        assert_eq!(browser.value(nothing), 0, "{nothing}");
    }
    assert!(browser.value(CONTRAST).as_f64().unwrap() >= 4.5, "{}", browser.value(CONTRAST));
    assert_eq!(browser.complaints, Vec::<String>::new());
}

/// A4, upright, less its margins.
const PAPER: u32 = 718;

#[test]
fn wide_tables_are_whole_on_paper() {
    let value = |v: f64| Cell::number(v, Digits::Decimals(2));
    let judged = || Cell::phrase(-20.75, "-20.75 [-21.50, -20.00], undecided, won 100 %");
    let cells = || (0..24).map(|i| if i % 8 == 7 { judged() } else { value(1234.5 - f64::from(i)) });
    let wide = Table {
        columns: (0..24).map(|i| Column::new(format!("c{i}"), format!("Metric {i} ↑"))).collect(),
        rows: vec![Row::new("a", ["lab / sequence_of_some_length", "Original"], cells().collect())],
        ..table()
    };
    let narrow = Section::new("narrow", "Narrow").part(Part::Table(table()));
    let page = Page::new("Tables").section(narrow).section(Section::new("w", "Wide").part(Part::Table(wide)));
    let Some((_folder, mut browser)) = opened_as(&page, 1400, false) else { return };
    browser.on_paper(PAPER);
    keep(&mut browser, "paper-718.png");
    let beyond = "[...document.querySelectorAll('table')].filter(t => t.getBoundingClientRect().right > innerWidth).length";
    assert_eq!(browser.value(beyond), 0, "{}", browser.value("document.documentElement.outerHTML"));
    let size = "[...document.querySelectorAll('table')].map(t => parseFloat(getComputedStyle(t).fontSize))";
    let sizes = browser.value(size);
    let [narrow, wide] = [0, 1].map(|i| sizes[i].as_f64().unwrap());
    assert!(narrow > 11.0 && wide > 4.0 && wide < narrow, "{sizes}");
}

#[test]
fn letters_stand_out_in_the_light_too() {
    let Some((_folder, mut browser)) = opened(1400, false) else { return };
    assert!(browser.value(CONTRAST).as_f64().unwrap() >= 4.5, "{}", browser.value(CONTRAST));
}

/// The least contrast of text against what is behind it, as WCAG has it; hidden repeats are none.
const CONTRAST: &str = "(() => {
  const parse = c => { const m = c.match(/[\\d.]+/g).map(Number); return m.length > 3 && m[3] === 0 ? null : m.slice(0, 3); };
  const light = c => { const [r, g, b] = c.map(v => v / 255).map(v => v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4); return 0.2126 * r + 0.7152 * g + 0.0722 * b; };
  const behind = e => { for (; e; e = e.parentElement) { const c = parse(getComputedStyle(e).backgroundColor); if (c) return c; } return [255, 255, 255]; };
  let least = 21;
  for (const e of document.querySelectorAll('p, th, td, button, li, figcaption, label, summary, b, a, span')) {
    if (![...e.childNodes].some(n => n.nodeType === 3 && n.textContent.trim()) || !e.checkVisibility()) continue;
    const front = parse(getComputedStyle(e).color);
    if (!front) continue;
    const [a, b] = [light(front), light(behind(e))].sort((x, y) => y - x);
    least = Math.min(least, (a + 0.05) / (b + 0.05));
  }
  return least;
})()";
