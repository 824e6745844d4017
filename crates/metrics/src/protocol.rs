//! Scoring protocols: every choice behind a number, named and versioned, as data.

use super::planes::floor;
use super::{LpipsVariant, MetricsError, PsnrVariant, Region, SsimVariant};
use crate::Aggregation;
use serde::{Deserialize, Serialize};
use skinsplat_core::choice::one_of;
use std::collections::BTreeSet;
use std::sync::LazyLock;

/// What a straight truth is composited over; the render must have been drawn over the same.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected captured, or a colour as [0.0, 0.0, 0.0]")]
pub enum Background {
    /// One colour.
    Colour([f32; 3]),
    /// None: the truth is scored as it was captured.
    Captured(Captured),
}

/// The word "captured" in a protocol file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Captured {
    /// The truth keeps its own background.
    Captured,
}

/// What happens to values outside \[0, 1\], in both images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clamp {
    /// Nothing.
    #[default]
    None,
    /// Cut at 1 from above.
    MaxOne,
    /// Cut to \[0, 1\].
    Unit,
}

/// Conversion to 8 bit and back, in both images, after clamping to \[0, 1\].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Quantisation {
    /// None.
    #[default]
    None,
    /// `floor(255 v + 0.5) / 255`, as image writers do.
    Round8,
    /// `floor(255 v) / 255`, as nerfbaselines does. Values that are 8-bit levels stay what they are.
    Trunc8,
}

/// Name and version of a protocol, in every record.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProtocolId {
    /// Name; for a varied preset the whole specification ("haha+ssim=torchmetrics-1.4").
    pub id: String,
    /// Raised when a change makes numbers incomparable.
    pub version: u32,
}

impl std::fmt::Display for ProtocolId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}@{}", self.id, self.version)
    }
}

/// How frames are scored. The steps, in this order:
///
/// 1. a straight truth is composited over `background` (the render already lies over it);
/// 2. `clamp`, then `quantise`, both images;
/// 3. `region`: crop, weights, or filling outside the mask;
/// 4. `psnr`, `ssim`, `lpips` of what is left;
/// 5. over the frames, `aggregate`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Name.
    pub id: String,
    /// Raised when a change makes numbers incomparable.
    pub version: u32,
    /// One line for lists.
    pub title: String,
    /// Where the choices were read off.
    pub source: String,
    /// Step 1.
    pub background: Background,
    /// Step 2.
    pub clamp: Clamp,
    /// Step 2.
    pub quantise: Quantisation,
    /// Step 3.
    pub region: Region,
    /// Mask values from here on are inside.
    pub mask_threshold: f32,
    /// Step 4.
    pub psnr: PsnrVariant,
    /// Step 4.
    pub ssim: SsimVariant,
    /// Step 4; which LPIPS belongs to the protocol, whether or not it is computed.
    pub lpips: LpipsVariant,
    /// Step 5.
    pub aggregate: Aggregation,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ProtocolFile {
    protocol: Vec<Protocol>,
}

/// The protocols that come with the program, from `protocols.toml`.
pub static PROTOCOLS: LazyLock<Vec<Protocol>> = LazyLock::new(|| {
    let file: ProtocolFile =
        toml::from_str(include_str!("protocols.toml")).expect("a test parses the embedded file");
    file.protocol
});

/// The preset that "default" stands for.
const DEFAULT_ID: &str = "avatar-v1";

impl Protocol {
    /// The preset of this name; "default" is `avatar-v1`.
    pub fn preset(id: &str) -> Option<&'static Self> {
        let id = if id == "default" { DEFAULT_ID } else { id };
        PROTOCOLS.iter().find(|protocol| protocol.id == id)
    }

    /// A preset, or a preset with other choices: `haha`, `haha+ssim=torchmetrics-1.4`,
    /// `hugs-human+background=captured+region=full`, `default+background=[0, 0, 0]`. Field names and values are those of
    /// `protocols.toml`; the id of the result is the whole specification.
    ///
    /// # Errors
    /// An unknown preset, field or value.
    pub fn parse(specification: &str) -> Result<Self, MetricsError> {
        let error = |problem: String, expected: &str| MetricsError::Protocol {
            id: specification.to_owned(),
            problem,
            expected: expected.to_owned(),
        };
        // A name as it is printed ends with the version.
        let (specification, version) = match specification.rsplit_once('@') {
            Some((name, version)) => (name, Some(version)),
            None => (specification, None),
        };
        let mut parts = specification.split('+').map(str::trim);
        let preset = parts.next().unwrap_or_default();
        let base = Self::preset(preset).ok_or_else(|| {
            let ids: Vec<&str> = PROTOCOLS.iter().map(|protocol| protocol.id.as_str()).collect();
            error(format!("no preset \"{preset}\""), &one_of(preset, &ids))
        })?;
        if let Some(version) = version.filter(|version| **version != base.version.to_string()) {
            return Err(error(
                format!("version {version}"),
                &format!("version {}, which this program has", base.version),
            ));
        }
        let mut table = toml::Table::try_from(base).map_err(|e| error(e.to_string(), "a protocol"))?;
        let mut varied = BTreeSet::new();
        for part in parts {
            const FIELDS: [&str; 9] = [
                "background",
                "clamp",
                "quantise",
                "region",
                "mask_threshold",
                "psnr",
                "ssim",
                "lpips",
                "aggregate",
            ];
            let choices =
                |field: &str| format!("FIELD=VALUE with a field that is {}", one_of(field, &FIELDS));
            let (field, value) =
                part.split_once('=').ok_or_else(|| error(format!("\"{part}\""), &choices(part)))?;
            if !FIELDS.contains(&field) {
                return Err(error(format!("no field \"{field}\""), &choices(field)));
            }
            if !varied.insert(field) {
                return Err(error(format!("\"{field}\" twice"), "each field once"));
            }
            table.insert(field.to_owned(), value_of(value));
        }
        if !varied.is_empty() {
            table.insert("id".to_owned(), specification.into());
        }
        let protocol: Self = table.try_into().map_err(|e: toml::de::Error| {
            error(e.message().trim().replace('\n', " "), "the values that protocols.toml documents")
        })?;
        protocol.check()?;
        Ok(protocol)
    }

    /// Checks the numbers of a protocol that was read from a file.
    ///
    /// # Errors
    /// An empty id, a version of 0, a background outside \[0, 1\], a threshold outside (0, 1].
    pub fn check(&self) -> Result<(), MetricsError> {
        let in_range = match self.background {
            Background::Colour(colour) => colour.iter().all(|v| (0.0..=1.0).contains(v)),
            Background::Captured(_) => true,
        };
        let wrong = [
            (self.id.is_empty(), "id: empty", "a name"),
            (self.version == 0, "version: 0", "at least 1"),
            (!in_range, "background: out of range", "three numbers in [0, 1] or \"captured\""),
            (
                !(self.mask_threshold > 0.0 && self.mask_threshold <= 1.0),
                "mask_threshold: out of range",
                "above 0, at most 1",
            ),
        ];
        match wrong.into_iter().find(|(is_wrong, ..)| *is_wrong) {
            None => Ok(()),
            Some((_, problem, expected)) => {
                let (problem, expected) = (problem.to_owned(), expected.to_owned());
                Err(MetricsError::Protocol { id: self.id.clone(), problem, expected })
            }
        }
    }

    /// Name and version.
    pub fn key(&self) -> ProtocolId {
        ProtocolId { id: self.id.clone(), version: self.version }
    }

    /// The colour to draw renders over; `None` if they belong over the captured background.
    pub fn background_colour(&self) -> Option<[f32; 3]> {
        match self.background {
            Background::Colour(colour) => Some(colour),
            Background::Captured(_) => None,
        }
    }
}

impl Default for Protocol {
    fn default() -> Self {
        Self::preset(DEFAULT_ID).expect("a test finds the default preset").clone()
    }
}

/// A TOML value, or a string if it is none.
fn value_of(text: &str) -> toml::Value {
    let parsed: Result<toml::Table, _> = toml::from_str(&format!("value = {text}"));
    parsed.ok().and_then(|mut table| table.remove("value")).unwrap_or_else(|| text.into())
}

impl Clamp {
    /// Clamps values in place.
    #[inline(always)]
    pub(crate) fn apply(self, values: &mut [f64]) {
        match self {
            Self::None => (),
            Self::MaxOne => values.iter_mut().for_each(|v| *v = v.min(1.0)),
            Self::Unit => values.iter_mut().for_each(|v| *v = v.clamp(0.0, 1.0)),
        }
    }
}

impl Quantisation {
    /// Takes values to 8 bit and back in place.
    #[inline(always)]
    pub(crate) fn apply(self, values: &mut [f64]) {
        let offset = match self {
            Self::None => return,
            Self::Round8 => 0.5,
            Self::Trunc8 => 1e-9, // k / 255 * 255 may fall short of k by a rounding
        };
        values.iter_mut().for_each(|v| *v = floor(v.clamp(0.0, 1.0) * 255.0 + offset) / 255.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn presets_are_sound_and_unique() {
        let expected = [
            "avatar-v1",
            "hugs-human",
            "hugs-full",
            "ihuman",
            "splattingavatar",
            "animatable-ps",
            "animatable-gala",
            "haha",
            "3dgs",
            "nerfbaselines",
            "gauhuman",
            "3dgs-avatar",
            "3dgs-avatar-zju",
        ];
        let ids: Vec<&str> = PROTOCOLS.iter().map(|protocol| protocol.id.as_str()).collect();
        assert_eq!(ids, expected);
        for protocol in PROTOCOLS.iter() {
            protocol.check().unwrap();
            let text = toml::to_string(protocol).unwrap();
            assert_eq!(&toml::from_str::<Protocol>(&text).unwrap(), protocol);
            assert_eq!(&Protocol::parse(&protocol.id).unwrap(), protocol);
        }
        assert_eq!(Protocol::preset("default"), Some(&Protocol::default()));
        assert_eq!(Protocol::preset("ihuman").unwrap().ssim, SsimVariant::Reflect);
    }

    /// The network and the input range as read off each code.
    #[test]
    fn presets_have_the_lpips_of_their_papers() {
        let expected = [
            ("avatar-v1", "alex-pm1"),
            ("hugs-human", "alex-raw01"),
            ("hugs-full", "alex-raw01"),
            ("ihuman", "alex-raw01"),
            ("splattingavatar", "alex-pm1"),
            ("animatable-ps", "alex-raw01"),
            ("animatable-gala", "alex-raw01"),
            ("haha", "alex-raw01"),
            ("3dgs", "vgg-raw01"),
            ("nerfbaselines", "alex-pm1"),
            ("gauhuman", "vgg-raw01"),
            ("3dgs-avatar", "alex-raw01"),
            ("3dgs-avatar-zju", "vgg-pm1"),
        ];
        let found: Vec<(&str, &str)> = PROTOCOLS.iter().map(|p| (p.id.as_str(), p.lpips.id())).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn specifications_vary_a_preset() {
        let varied = Protocol::parse("haha+ssim=torchmetrics-1.4+background=[0, 0.5, 1]+mask_threshold=0.25");
        let varied = varied.unwrap();
        assert_eq!(varied.id, "haha+ssim=torchmetrics-1.4+background=[0, 0.5, 1]+mask_threshold=0.25");
        assert_eq!(varied.ssim, SsimVariant::Valid);
        assert_eq!(varied.background_colour(), Some([0.0, 0.5, 1.0]));
        assert_eq!(varied.aggregate, Aggregation::PooledMse);
        let captured = Protocol::parse("default+background=captured").unwrap();
        assert_eq!(captured.background_colour(), None);
        for wrong in [
            "",
            "nosuch",
            "haha+",
            "haha+ssim",
            "haha+ssim=nosuch",
            "haha+id=x",
            "haha+version=2",
            "haha+background=[0, 0]",
            "haha+background=[0, 0, nan]",
            "haha+mask_threshold=0",
            "haha+lpips=alex",
        ] {
            let error = Protocol::parse(wrong).unwrap_err();
            assert!(matches!(&error, MetricsError::Protocol { id, .. } if id == wrong), "{wrong}: {error}");
            assert!(!error.to_string().contains('\n'), "{error}");
        }
    }

    #[test]
    fn quantisation_keeps_levels() {
        for k in 0..=255u8 {
            for quantise in [Quantisation::Round8, Quantisation::Trunc8] {
                let mut value = [f64::from(k) / 255.0];
                quantise.apply(&mut value);
                assert_eq!(value[0], f64::from(k) / 255.0, "{quantise:?} {k}");
            }
        }
        let between = [100.49, 100.5, 100.99].map(|v| v / 255.0);
        let (mut rounded, mut truncated) = (between, between);
        Quantisation::Round8.apply(&mut rounded);
        Quantisation::Trunc8.apply(&mut truncated);
        assert_eq!(rounded, [100.0, 101.0, 101.0].map(|v| v / 255.0));
        assert_eq!(truncated, [100.0 / 255.0; 3]);
        let mut outside = [-0.2, 1.7];
        Quantisation::Round8.apply(&mut outside);
        assert_eq!(outside, [0.0, 1.0]);
    }

    #[test]
    fn clamps() {
        let clamped = |clamp: Clamp| {
            let mut values = [-0.5, 0.5, 1.5];
            clamp.apply(&mut values);
            values
        };
        assert_eq!(clamped(Clamp::None), [-0.5, 0.5, 1.5]);
        assert_eq!(clamped(Clamp::MaxOne), [-0.5, 0.5, 1.0]);
        assert_eq!(clamped(Clamp::Unit), [0.0, 0.5, 1.0]);
    }
}
