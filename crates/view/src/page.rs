//! The page: template, scripts, data.

use super::pack::{Motion, Packed, ViewError, WIDTH};
use base64::Engine;
use serde_json::json;
use skinsplat_core::scene::Avatar;

const TEMPLATE: &str = include_str!("page/page.html");
const STYLE: &str = include_str!("page/page.css");
const DRAW_VERTEX: &str = include_str!("page/draw.vert");
const DRAW_FRAGMENT: &str = include_str!("page/draw.frag");

/// Scripts in the order in which they are read.
const SCRIPTS: [&str; 5] = [
    include_str!("page/data.js"),
    include_str!("page/gl.js"),
    include_str!("page/order.js"),
    include_str!("page/camera.js"),
    include_str!("page/main.js"),
];

/// Which axis of the world points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Up {
    /// +y, as SMPL and glTF have it.
    #[default]
    Y,
    /// −y, as images and OpenCV's cameras have it.
    MinusY,
    /// +z, as Blender has it.
    Z,
}

impl Up {
    fn direction(self) -> [f64; 3] {
        match self {
            Self::Y => [0.0, 1.0, 0.0],
            Self::MinusY => [0.0, -1.0, 0.0],
            Self::Z => [0.0, 0.0, 1.0],
        }
    }
}

/// A page that plays an avatar.
#[derive(Debug)]
pub struct Page {
    title: String,
    notes: Vec<String>,
    up: Up,
    packed: Packed,
}

impl Page {
    /// An avatar whose Gaussians have skinning weights, in a motion. SH are stored in 16 bits.
    ///
    /// # Errors
    /// What [`ViewError`] says.
    pub fn new(title: impl Into<String>, avatar: &Avatar, motion: Motion<'_>) -> Result<Self, ViewError> {
        let packed = Packed::new(avatar, motion)?;
        Ok(Self { title: title.into(), notes: Vec::new(), up: Up::default(), packed })
    }

    /// Says something below the picture.
    #[must_use]
    pub fn note(mut self, note: impl Into<String>) -> Self {
        self.notes.push(note.into());
        self
    }

    /// Another axis up.
    #[must_use]
    pub fn up(self, up: Up) -> Self {
        Self { up, ..self }
    }

    /// The page: one file that reads no other.
    pub fn html(&self) -> String {
        let packed = &self.packed;
        let meta = json!({
            "count": packed.count,
            "width": WIDTH,
            "rows": packed.rows,
            "influenceSets": packed.influence_sets,
            "shDegree": packed.sh_degree,
            "joints": packed.joints,
            "frames": packed.frames,
            "framerate": packed.framerate,
            "centres": packed.centres,
            "reach": packed.reach,
            "up": self.up.direction(),
        });
        let shaders = json!({
            "skin": skinsplat_shader::VIEW_GLSL,
            "drawVertex": DRAW_VERTEX,
            "drawFragment": DRAW_FRAGMENT,
        });
        let blocks = [
            ("gaussians", &packed.gaussians),
            ("indices", &packed.indices),
            ("weights", &packed.weights),
            ("sh", &packed.sh),
            ("motion", &packed.motion),
        ];
        let encode = |bytes: &[u8]| base64::engine::general_purpose::STANDARD.encode(bytes);
        let data: String = blocks
            .iter()
            .map(|(name, bytes)| {
                format!("<script type=\"text/plain\" id=\"data-{name}\">{}</script>\n", encode(bytes))
            })
            .collect();
        let notes: String = self.notes.iter().map(|note| format!("<p>{}</p>\n", escaped(note))).collect();
        // Each place once, in the order of the template: nothing that a name holds is taken for a place.
        let places = [
            ("{{title}}", escaped(&self.title)),
            ("{{style}}", STYLE.to_owned()),
            ("{{heading}}", escaped(&self.title)),
            ("{{notes}}", notes),
            ("{{meta}}", in_script(&meta.to_string())),
            ("{{shaders}}", in_script(&shaders.to_string())),
            ("{{data}}", data),
            ("{{script}}", SCRIPTS.concat()),
        ];
        let (mut page, mut rest) = (String::new(), TEMPLATE);
        for (place, text) in &places {
            let (before, after) = rest.split_once(place).unwrap_or((rest, ""));
            page.push_str(before);
            page.push_str(text);
            rest = after;
        }
        page + rest
    }
}

/// Text as HTML shows it.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// JSON that ends no script.
fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}
