//! Pictures to compare: two of a frame over each other under a slider, with the error of each, for every frame and variant.

use super::Scale;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, PreEscaped, html};
use serde::Serialize;

/// An encoded picture.
#[derive(Clone, Debug)]
pub struct Picture {
    uri: String,
    size: [usize; 2],
}

/// What one variant drew of a frame; the truth is one too, without an error.
#[derive(Clone, Debug)]
pub struct View {
    /// What it is called.
    pub label: String,
    /// What it looks like.
    pub picture: Picture,
    /// Where it is wrong.
    pub error: Option<Picture>,
    /// Its scores.
    pub note: String,
}

/// A frame.
#[derive(Clone, Debug)]
pub struct Frame {
    /// What its sequence is called.
    pub sequence: String,
    /// What it is called.
    pub name: String,
    /// Truth and variants, in order.
    pub views: Vec<View>,
    /// Places where the variants differ most: each a picture per view, in their order.
    pub crops: Vec<Vec<Picture>>,
}

/// Frames to choose from.
#[derive(Clone, Debug)]
pub struct Viewer {
    /// Its heading.
    pub title: String,
    /// The frames.
    pub frames: Vec<Frame>,
    /// The colours of errors.
    pub scale: Option<Scale>,
}

impl Picture {
    /// A picture in the bytes of its file, of width and height.
    pub fn new(mime: &str, bytes: &[u8], size: [usize; 2]) -> Self {
        Self { uri: format!("data:{mime};base64,{}", STANDARD.encode(bytes)), size }
    }

    /// Bytes that it takes in a page.
    pub fn bytes(&self) -> usize {
        self.uri.len()
    }

    pub(super) fn img(&self, alt: &str) -> Markup {
        html! { img src=(self.uri) width=(self.size[0]) height=(self.size[1]) alt=(alt); }
    }
}

/// A frame as the script reads it: positions in the list of pictures.
#[derive(Serialize)]
struct Entry<'a> {
    sequence: &'a str,
    name: &'a str,
    size: [usize; 2],
    views: Vec<EntryView<'a>>,
    crops: Vec<Vec<usize>>,
}

#[derive(Serialize)]
struct EntryView<'a> {
    label: &'a str,
    note: &'a str,
    picture: usize,
    error: Option<usize>,
}

/// All that the script needs.
#[derive(Serialize)]
struct Data<'a> {
    pictures: Vec<&'a str>,
    frames: Vec<Entry<'a>>,
}

impl Viewer {
    fn data(&self) -> Data<'_> {
        let mut pictures: Vec<&str> = Vec::new();
        let frames = self.frames.iter().map(|frame| frame.entry(&mut pictures)).collect();
        Data { pictures, frames }
    }

    pub(super) fn markup(&self, at: &str) -> Markup {
        let Some(first) = self.frames.first() else { return html! {} };
        // In a script element nothing is escaped but what would end it.
        let json = serde_json::to_string(&self.data()).unwrap_or_default().replace('<', "\\u003c");
        let of = |name: &str| format!("{at}-{name}");
        html! {
            div.viewer tabindex="0" role="group" aria-label=(self.title) {
                h3 { (self.title) }
                div.controls {
                    (select(&of("sequence"), "sequence", "Sequence"))
                    (select(&of("frame"), "frame", "Frame"))
                    (select(&of("left"), "left", "Left"))
                    (select(&of("right"), "right", "Right"))
                    label.check { input type="checkbox" data-role="error"; " errors" }
                }
                div.stage {
                    div.pair {
                        (first.views.first().map_or_else(|| html! {}, |view| view.picture.img(&view.label)))
                        img.over alt="" hidden;
                    }
                    label.slider for=(of("slider")) { span.hidden { "How much of the left picture is shown" } }
                    input.slide id=(of("slider")) type="range" min="0" max="100" value="50" data-role="slide";
                    p.names aria-live="polite" { span data-role="left-name" { (first.views.first().map_or("", |v| &v.label)) } span data-role="right-name" {} }
                }
                @if let Some(scale) = self.scale { (scale.legend()) }
                div.crops data-role="crops" {}
                p.remark.keys-help { "Keys: ← → frame, ↑ ↓ right variant, e errors, with the focus on the pictures; ← → on the slider move it." }
                script type="application/json" data-role="data" { (PreEscaped(json)) }
                noscript { p.remark { "Without scripts only the first picture is shown." } }
            }
        }
    }
}

impl Frame {
    /// The frame with its pictures added to the list.
    fn entry<'a>(&'a self, pictures: &mut Vec<&'a str>) -> Entry<'a> {
        let mut add = |picture: &'a Picture| {
            pictures.push(&picture.uri);
            pictures.len() - 1
        };
        let mut views = Vec::new();
        for View { label, picture, error, note } in &self.views {
            let picture = add(picture);
            views.push(EntryView { label, note, picture, error: error.as_ref().map(&mut add) });
        }
        let crops = self.crops.iter().map(|crop| crop.iter().map(&mut add).collect()).collect();
        let size = self.views.first().map_or([1, 1], |view| view.picture.size);
        Entry { sequence: &self.sequence, name: &self.name, size, views, crops }
    }
}

fn select(id: &str, role: &str, label: &str) -> Markup {
    html! { label for=(id) { (label) " " select id=(id) data-role=(role) {} } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_kept_once_and_named() {
        let picture = |byte: u8| Picture::new("image/png", &[byte], [4, 2]);
        let view = |label: &str, byte: u8| View {
            label: label.into(),
            picture: picture(byte),
            error: Some(picture(byte + 1)),
            note: "30 dB".into(),
        };
        let frame = Frame {
            sequence: "lab".into(),
            name: "image_0000".into(),
            views: vec![view("Truth", 1), view("Ours", 3)],
            crops: vec![vec![picture(9), picture(10)]],
        };
        let viewer = Viewer { title: "T".into(), frames: vec![frame], scale: Some(Scale::to(0.25)) };
        let html = viewer.markup("s").into_string();
        assert!(html.contains(r#""picture":2,"error":3"#) && html.contains(r#""crops":[[4,5]]"#), "{html}");
        assert!(html.contains(r#"alt="Truth""#), "{html}");
        assert_eq!(picture(1).bytes(), "data:image/png;base64,AQ==".len());
    }
}
