//! The result of one case on one device, and the file that keeps it. `docs/conformance.md` documents the format.

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use airlight::device::DeviceInfo;
use airlight_formats::FormatError;
use airlight_formats::output::write_atomically;
use libtest_mimic::Failed;
use serde::{Deserialize, Serialize};

use crate::Subject;
use crate::case::{Case, Labels};
use crate::record::{Mismatches, Picture, Place, Record, Score};

/// What the first field of every sidecar says.
pub const FORMAT: &str = "airlight-conformance";

/// The version of the format that is written, and the only one that is read.
pub const FORMAT_VERSION: u32 = 1;

/// The largest file that is read as a sidecar, bytes; the pictures of the reference scene take less than one of it.
const LARGEST: u64 = 256 << 20;

/// How a case ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", content = "reason", rename_all = "lowercase")]
pub enum Outcome {
    /// All held.
    Passed,
    /// Something did not hold, and what.
    Failed(String),
    /// The case means nothing on the device, and why.
    Skipped(String),
}

impl Outcome {
    /// Whether all held.
    pub fn passed(&self) -> bool {
        matches!(self, Self::Passed)
    }

    /// Whether something did not hold.
    pub fn failed(&self) -> bool {
        matches!(self, Self::Failed(_))
    }

    /// One word for it.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Failed(_) => "failed",
            Self::Skipped(_) => "skipped",
        }
    }

    /// Why, unless all held.
    pub fn reason(&self) -> Option<&str> {
        match self {
            Self::Passed => None,
            Self::Failed(reason) | Self::Skipped(reason) => Some(reason),
        }
    }
}

/// Which device it was.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct DeviceRecord {
    /// `backend:index`; the subject's name where the device could not be opened.
    pub id: String,
    /// The device's own name.
    pub name: String,
    /// As [`airlight::device::DeviceKind::as_str`] says it.
    pub kind: String,
    /// Name of the backend.
    pub backend: String,
    /// Instruction sets, extensions, driver, in the backend's words.
    pub features: Vec<String>,
    /// Memory in bytes, where it is known.
    pub memory_bytes: Option<u64>,
    /// Sizes it does not exceed.
    pub limits: LimitsRecord,
    /// Bits of a filter weight between two texels.
    pub filter_bits: u32,
    /// Whether its compilers may round a product and a sum as one.
    pub contracts: bool,
}

/// Sizes that a device does not exceed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LimitsRecord {
    /// The largest buffer, bytes.
    pub buffer_bytes: u64,
    /// The largest part of a buffer that one stage sees at a time, bytes.
    pub binding_bytes: u64,
    /// The longest side of a field, texels.
    pub field_side: u32,
    /// How often the loops of one invocation of a kernel may turn together, where the driver bounds that.
    pub loop_turns: Option<u32>,
}

impl From<&DeviceInfo> for DeviceRecord {
    fn from(info: &DeviceInfo) -> Self {
        Self {
            id: info.id(),
            name: info.name.clone(),
            kind: info.kind.as_str().to_owned(),
            backend: info.backend.to_owned(),
            features: info.features.clone(),
            memory_bytes: info.memory_bytes,
            limits: LimitsRecord {
                buffer_bytes: info.limits.buffer_bytes,
                binding_bytes: info.limits.binding_bytes,
                field_side: info.limits.field_side,
                loop_turns: info.limits.loop_turns,
            },
            filter_bits: info.filter_bits,
            contracts: info.contracts,
        }
    }
}

impl DeviceRecord {
    /// A folder's name for the device's results: legible, and another one for each id, name and set of features.
    pub fn folder(&self) -> String {
        let plain = |text: &str| {
            let words = text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
            words.collect::<Vec<_>>().join("-").to_lowercase()
        };
        let mut legible = plain(&format!("{} {}", self.id, self.name));
        legible.truncate(60);
        // Fowler, Noll and Vo's hash (FNV-1a): stable, and nobody attacks a folder's name.
        let identity = format!("{}\n{}\n{}", self.id, self.name, self.features.join("\n"));
        let hash = identity.bytes().fold(0x811c_9dc5u32, |h, b| (h ^ u32::from(b)).wrapping_mul(0x0100_0193));
        format!("{legible}-{hash:08x}")
    }
}

/// The labels of an axis.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct AxisRecord {
    /// The axis's name.
    pub axis: String,
    /// The labels of its choices.
    pub values: Vec<String>,
}

impl From<&Labels> for AxisRecord {
    fn from(labels: &Labels) -> Self {
        Self { axis: labels.axis.to_owned(), values: labels.values.clone() }
    }
}

/// A tolerance and why it is what it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToleranceRecord {
    /// Its name in [`crate::tolerance`].
    pub name: String,
    /// The largest relative L2 error.
    #[serde(with = "float")]
    pub relative_l2: f64,
    /// The largest error of one value as a share of the largest expected value.
    #[serde(with = "float")]
    pub peak: f64,
    /// Why.
    pub reason: String,
}

/// The result of one case on one device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sidecar {
    /// [`FORMAT`].
    pub format: String,
    /// [`FORMAT_VERSION`].
    pub format_version: u32,
    /// Version of airlight.
    pub airlight_version: String,
    /// Seconds since 1970 when the case began.
    pub unix_time: u64,
    /// How long it took.
    pub seconds: f64,
    /// The device.
    pub device: DeviceRecord,
    /// The case's name, `group::case`.
    pub case: String,
    /// What it checks.
    pub checks: String,
    /// Where the case stands on axes that it shares with others.
    #[serde(with = "pairs")]
    pub parameters: Place,
    /// Choices that change the truth.
    pub permutations: Vec<AxisRecord>,
    /// Choices that must not.
    pub variants: Vec<AxisRecord>,
    /// How it ended.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// What was measured.
    pub scores: Vec<Score>,
    /// The tolerances that the scores name.
    pub tolerances: Vec<ToleranceRecord>,
    /// Values that are not what they should be.
    pub mismatches: Vec<Mismatches>,
    /// Pictures with their truth.
    pub pictures: Vec<Picture>,
}

impl Sidecar {
    pub(crate) fn new(
        case: &Case,
        subject: &Subject,
        record: Option<Record>,
        outcome: Outcome,
        when: SystemTime,
        time: Duration,
    ) -> Self {
        let device = record.as_ref().map(|r| DeviceRecord::from(r.info()));
        let unknown = || DeviceRecord { id: subject.name().to_owned(), ..DeviceRecord::default() };
        let used = record.iter().flat_map(|r| &r.used);
        let tolerances = used.map(|t| ToleranceRecord {
            name: t.name.to_owned(),
            relative_l2: t.relative_l2,
            peak: t.peak,
            reason: t.reason.to_owned(),
        });
        let tolerances = tolerances.collect();
        let (scores, mismatches, pictures) =
            record.map_or_else(Default::default, |r| (r.scores, r.mismatches, r.pictures));
        Self {
            format: FORMAT.to_owned(),
            format_version: FORMAT_VERSION,
            airlight_version: env!("CARGO_PKG_VERSION").to_owned(),
            unix_time: when.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs()),
            seconds: time.as_secs_f64(),
            device: device.unwrap_or_else(unknown),
            case: case.name.clone(),
            checks: case.checks.clone(),
            parameters: case.parameters.iter().map(|(axis, choice)| ((*axis).to_owned(), choice.clone())).collect(),
            permutations: case.permutations.iter().map(AxisRecord::from).collect(),
            variants: case.variants.iter().map(AxisRecord::from).collect(),
            outcome,
            scores,
            tolerances,
            mismatches,
            pictures,
        }
    }

    /// The outcome as a test's result; a skip is well.
    ///
    /// # Errors
    /// What did not hold.
    pub fn verdict(&self) -> Result<(), Failed> {
        match &self.outcome {
            Outcome::Failed(reason) => Err(reason.into()),
            Outcome::Passed | Outcome::Skipped(_) => Ok(()),
        }
    }

    /// Its place in a folder of results: a folder for the device, a file for the case.
    pub fn path(&self, results: &Path) -> PathBuf {
        results.join(self.device.folder()).join(format!("{}.json", self.case.replace("::", ".")))
    }

    /// Writes it into a folder of results, in place of an earlier result of the case on the device. The file appears
    /// whole or not at all.
    ///
    /// # Errors
    /// A folder that cannot be made; a file that cannot be written.
    pub fn write(&self, results: &Path) -> Result<PathBuf, FormatError> {
        let path = self.path(results);
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder).map_err(FormatError::io(folder))?;
        }
        let text = serde_json::to_string_pretty(self)
            .map_err(|e| FormatError::content(&path, None, format!("cannot be written: {e}")))?;
        write_atomically(&path, |file| writeln!(file, "{text}").map_err(FormatError::io(&path)))?;
        Ok(path)
    }

    /// Reads one.
    ///
    /// # Errors
    /// A file that cannot be read, is none, is damaged, or is of another version of the format.
    pub fn read(path: &Path) -> Result<Self, FormatError> {
        let wrong = |what: String| FormatError::content(path, None, what);
        let file = File::open(path).map_err(FormatError::io(path))?;
        let mut text = String::new();
        let size = file.take(LARGEST + 1).read_to_string(&mut text).map_err(FormatError::io(path))?;
        if size as u64 > LARGEST {
            return Err(wrong(format!("is larger than {LARGEST} bytes, as no result is")));
        }
        #[derive(Deserialize)]
        struct Head {
            format: String,
            format_version: u32,
        }
        let head: Head = serde_json::from_str(&text).map_err(|e| wrong(format!("is no result of a case: {e}")))?;
        if head.format != FORMAT || head.format_version != FORMAT_VERSION {
            let Head { format, format_version } = head;
            return Err(wrong(format!("is {format} {format_version}; {FORMAT} {FORMAT_VERSION} is read")));
        }
        let sidecar: Self = serde_json::from_str(&text).map_err(|e| wrong(format!("is damaged: {e}")))?;
        for Picture { name, size: [width, height], found, expected, .. } in &sidecar.pictures {
            let pixels = u64::from(*width) * u64::from(*height);
            if (found.len() as u64, expected.len() as u64) != (pixels, pixels) {
                return Err(wrong(format!("is damaged: the picture \"{name}\" is not of {width} × {height} pixels")));
            }
        }
        Ok(sidecar)
    }
}

/// Floats in JSON: those that it has no numbers for are the strings `"NaN"`, `"inf"` and `"-inf"`.
pub(crate) mod float {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(value: &f64, out: S) -> Result<S::Ok, S::Error> {
        if value.is_finite() { out.serialize_f64(*value) } else { out.serialize_str(&value.to_string()) }
    }

    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Either {
        Number(f64),
        Text(String),
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<f64, D::Error> {
        match Either::deserialize(input)? {
            Either::Number(value) => Ok(value),
            Either::Text(text) if ["NaN", "inf", "-inf"].contains(&&text[..]) => {
                text.parse().map_err(serde::de::Error::custom)
            }
            Either::Text(text) => Err(serde::de::Error::custom(format!("\"{text}\" is no number"))),
        }
    }
}

/// Pairs in JSON: an object, in the pairs' order.
pub(crate) mod pairs {
    use std::fmt;

    use serde::de::{MapAccess, Visitor};
    use serde::{Deserializer, Serializer};

    use crate::record::Place;

    pub(crate) fn serialize<S: Serializer>(pairs: &Place, out: S) -> Result<S::Ok, S::Error> {
        out.collect_map(pairs.iter().map(|(key, value)| (key, value)))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<Place, D::Error> {
        struct Pairs;
        impl<'de> Visitor<'de> for Pairs {
            type Value = Place;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of strings")
            }

            fn visit_map<M: MapAccess<'de>>(self, mut map: M) -> Result<Place, M::Error> {
                let mut pairs = Place::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(pairs)
            }
        }
        input.deserialize_map(Pairs)
    }
}

/// Pixels in JSON: base64 of 32-bit floats in little-endian order.
pub(crate) mod pixels {
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;
    use serde::{Deserialize, Deserializer, Serializer};

    pub(crate) fn serialize<S: Serializer>(pixels: &[[f32; 3]], out: S) -> Result<S::Ok, S::Error> {
        let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        out.serialize_str(&STANDARD.encode(bytes))
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(input: D) -> Result<Vec<[f32; 3]>, D::Error> {
        let text = String::deserialize(input)?;
        let bytes = STANDARD.decode(text).map_err(serde::de::Error::custom)?;
        let (pixels, rest) = bytes.as_chunks::<12>();
        if !rest.is_empty() {
            return Err(serde::de::Error::custom("a picture that ends within a pixel"));
        }
        let value = |p: &[u8; 12], c: usize| f32::from_le_bytes([p[4 * c], p[4 * c + 1], p[4 * c + 2], p[4 * c + 3]]);
        Ok(pixels.iter().map(|p| [0, 1, 2].map(|c| value(p, c))).collect())
    }
}
