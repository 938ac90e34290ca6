//! NRRD, versions 1 to 5, with its data attached or in one file of its own.
//!
//! Source: the file format's definition by the Teem project, `teem.sourceforge.net/nrrd/format.html`.

use std::collections::HashMap;

use glam::{DAffine3, DVec3, UVec3};

use super::dense::{self, Data, Encoding, Header};
use super::fault::Fault;
use super::sample::Sample;
use super::text::{self, Lines};

/// The tag that is followed by the version.
const MAGIC: &[u8] = b"NRRD00";

/// The most dimensions that an NRRD has.
const MAX_RANK: usize = 16;

/// Whether a file that begins so is an NRRD of any version.
pub(super) fn is_nrrd(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// The header's fields, each with the place of its line; alternative spellings are one key.
struct Fields<'a>(HashMap<&'a str, (&'a str, String)>);

impl<'a> Fields<'a> {
    fn get<T>(&self, field: &str, read: impl FnOnce(&'a str) -> Result<T, Fault>) -> Result<Option<T>, Fault> {
        let Some((value, place)) = self.0.get(field) else {
            return Ok(None);
        };
        read(value).map(Some).map_err(|fault| fault.within(&format!("{place}, '{field}'")))
    }

    fn need<T>(&self, field: &str, read: impl FnOnce(&'a str) -> Result<T, Fault>) -> Result<T, Fault> {
        self.get(field, read)?.ok_or_else(|| Fault::at(format!("header field '{field}'"), "missing"))
    }
}

/// The spelling of a field that is kept.
fn canonical(field: &str) -> &str {
    match field {
        "datafile" => "data file",
        "byteskip" => "byte skip",
        "lineskip" => "line skip",
        "centerings" => "centers",
        "axismins" => "axis mins",
        "axismaxs" => "axis maxs",
        other => other,
    }
}

/// Reads the header.
pub(super) fn header(bytes: &[u8]) -> Result<Header, Fault> {
    let mut lines = Lines::new(bytes);
    let magic = lines.next()?.unwrap_or_default();
    if !matches!(magic, "NRRD0001" | "NRRD0002" | "NRRD0003" | "NRRD0004" | "NRRD0005" | "NRRD00.01") {
        let what = format!("'{}'; airlight reads NRRD0001 to NRRD0005", text::shown(magic));
        return Err(if is_nrrd(bytes) { Fault::Unsupported(what) } else { Fault::at(lines.place(), what) });
    }
    let mut fields = Fields(HashMap::new());
    let mut attached = None;
    while let Some(line) = lines.next()? {
        if line.is_empty() {
            attached = Some(lines.at() as u64);
            break;
        }
        if line.starts_with('#') {
            continue;
        }
        let (field, value) = line
            .split_once(':')
            .ok_or_else(|| Fault::at(lines.place(), format!("'{}' is not 'field: value'", text::shown(line))))?;
        // `key:=value` pairs are the writer's own words.
        if value.starts_with('=') {
            continue;
        }
        if fields.0.insert(canonical(field.trim()), (value.trim(), lines.place())).is_some() {
            return Err(Fault::at(
                lines.place(),
                format!("'{}' stands in the header twice", text::shown(field.trim())),
            ));
        }
    }
    let axes = axes(&fields)?;
    let sample = fields.need("type", sample)?;
    let encoding = fields.need("encoding", encoding)?;
    let big_endian = fields.get("endian", |value| match value.to_ascii_lowercase().as_str() {
        "little" => Ok(false),
        "big" => Ok(true),
        other => Err(Fault::new(format!("'{}' is neither little nor big", text::shown(other)))),
    })?;
    if big_endian.is_none() && sample.size() > 1 && encoding != Encoding::Text {
        return Err(Fault::at("header field 'endian'", format!("missing; {} values need it", sample.name())));
    }
    let file = fields.get("data file", dense::single_file)?;
    let offset = match (&file, attached) {
        (Some(_), _) => 0,
        (None, Some(offset)) => offset,
        (None, None) => {
            return Err(Fault::new(
                "the header does not end: it has neither an empty line before its data nor a 'data file'",
            ));
        }
    };
    let skip = match fields.get("byte skip", text::number::<i64>)?.unwrap_or(0) {
        -1 if encoding == Encoding::Raw => None,
        n => Some(u64::try_from(n).map_err(|_| {
            Fault::at("header field 'byte skip'", format!("{n}; it is a number of bytes, or -1 with raw data"))
        })?),
    };
    let lines = fields.get("line skip", text::number::<u64>)?.unwrap_or(0);
    let index_to_world = placement(&fields, &axes)?;
    Ok(Header {
        dims: axes.dims,
        sample,
        big_endian: big_endian.unwrap_or(false),
        rescale: None,
        index_to_world,
        encoding,
        data: Data { file, offset, lines, skip },
    })
}

/// The three axes of a volume among those of the file.
struct Axes {
    rank: usize,
    kept: [usize; 3],
    dims: UVec3,
    directions: Option<[DVec3; 3]>,
}

impl Axes {
    /// The three of a list with a word for each axis of the file.
    fn pick<T: Copy>(&self, all: &[T]) -> Result<[T; 3], Fault> {
        if all.len() != self.rank {
            return Err(Fault::new(format!("{} values for {} dimensions", all.len(), self.rank)));
        }
        Ok(self.kept.map(|axis| all[axis]))
    }
}

fn axes(fields: &Fields<'_>) -> Result<Axes, Fault> {
    let rank: usize = fields.need("dimension", text::number)?;
    if !(1..=MAX_RANK).contains(&rank) {
        return Err(Fault::at("header field 'dimension'", format!("{rank}; an NRRD has from 1 to {MAX_RANK}")));
    }
    let sizes: Vec<i64> = fields.need("sizes", text::numbers)?;
    if sizes.len() != rank {
        return Err(Fault::at("header field 'sizes'", format!("{} sizes for {rank} dimensions", sizes.len())));
    }
    let directions = fields.get("space directions", vectors)?;
    if let Some(found) = directions.as_ref().filter(|all| all.len() != rank) {
        let what = format!("{} directions for {rank} dimensions", found.len());
        return Err(Fault::at("header field 'space directions'", what));
    }
    let mut kept: Vec<usize> = (0..rank).collect();
    let outside_space = |axis: usize| directions.as_ref().is_some_and(|all| all[axis].is_none());
    while kept.len() > 3 {
        let (first, last) = (kept[0], kept[kept.len() - 1]);
        if sizes[first] == 1 && outside_space(first) {
            kept.remove(0);
        } else if sizes[last] == 1 {
            kept.pop();
        } else if sizes[first] == 1 {
            kept.remove(0);
        } else {
            break;
        }
    }
    let kept: [usize; 3] = kept.try_into().map_err(|_| {
        let what = format!("{rank} dimensions of sizes {sizes:?}; a volume has 3, and others of size 1 at most");
        Fault::at("header field 'sizes'", what)
    })?;
    let dims = dense::dims(kept.map(|axis| sizes[axis])).map_err(|f| f.within("header field 'sizes'"))?;
    let directions = match directions {
        None => None,
        Some(all) => match kept.map(|axis| all[axis]) {
            [Some(x), Some(y), Some(z)] => Some([x, y, z]),
            _ => {
                let what = "'none' for an axis of the volume; each takes a vector";
                return Err(Fault::at("header field 'space directions'", what));
            }
        },
    };
    Ok(Axes { rank, kept, dims, directions })
}

/// Vectors in parentheses and the word "none" where an axis is not one of space.
fn vectors(value: &str) -> Result<Vec<Option<DVec3>>, Fault> {
    let mut found = Vec::new();
    let mut left = value.trim_start();
    while !left.is_empty() {
        if let Some(after) = left.strip_prefix("none") {
            found.push(None);
            left = after.trim_start();
            continue;
        }
        let (inside, after) = left
            .strip_prefix('(')
            .and_then(|text| text.split_once(')'))
            .ok_or_else(|| Fault::new(format!("'{}' is no vector; (x,y,z) would be", text::shown(left))))?;
        let parts: Vec<f64> = inside.split(',').map(text::number).collect::<Result<_, _>>()?;
        let [x, y, z] = parts[..] else {
            return Err(Fault::Unsupported(format!("a space of {} dimensions; airlight's has 3", parts.len())));
        };
        found.push(Some(DVec3::new(x, y, z)));
        left = after.trim_start();
    }
    Ok(found)
}

/// The map from index to metres, or none where no field speaks of it.
fn placement(fields: &Fields<'_>, axes: &Axes) -> Result<Option<DAffine3>, Fault> {
    let space_units = fields.get("space units", |value| match units(value)[..] {
        [x, y, z] => Ok(DVec3::new(x, y, z)),
        _ => Err(Fault::new("the space has 3 dimensions, and as many units belong here")),
    })?;
    let axis_units = fields.get("units", |value| axes.pick(&units(value)))?;
    let world = space_units.unwrap_or(DVec3::ONE);
    let origin = fields.get("space origin", |value| match vectors(value)?[..] {
        [Some(origin)] => Ok(origin * world),
        _ => Err(Fault::new("one vector belongs here, the centre of the first voxel: (x,y,z)")),
    })?;
    if let Some([x, y, z]) = axes.directions {
        return Ok(Some(dense::affine(x * world, y * world, z * world, origin.unwrap_or(DVec3::ZERO))));
    }
    let per_axis = |field| -> Result<Option<[f64; 3]>, Fault> {
        let given = fields.get(field, |value| axes.pick(&text::numbers::<f64>(value)?))?;
        match given {
            Some(all) if all.iter().all(|n| n.is_nan()) => Ok(None),
            Some(all) if all.iter().any(|n| !n.is_finite()) => {
                Err(Fault::at(format!("header field '{field}'"), "known along one axis of the volume but not another"))
            }
            other => Ok(other),
        }
    };
    let (spacings, mins, maxs) = (per_axis("spacings")?, per_axis("axis mins")?, per_axis("axis maxs")?);
    if spacings.is_none() && mins.is_none() && origin.is_none() {
        return Ok(None);
    }
    let centers = fields.get("centers", |value| axes.pick(&value.split_whitespace().collect::<Vec<_>>()))?;
    let (mut edge, mut first) = (DVec3::ONE, DVec3::ZERO);
    for axis in 0..3 {
        let unit = axis_units.map_or(1.0, |all| all[axis]);
        // Samples at nodes reach from end to end, samples in cells (also where it is not said) half a step less.
        let node = centers.is_some_and(|all| all[axis] == "node");
        let steps = f64::from(axes.dims[axis]) - if node { 1.0 } else { 0.0 };
        let step = match (spacings, mins, maxs) {
            (Some(all), ..) => all[axis],
            (None, Some(min), Some(max)) => (max[axis] - min[axis]) / steps,
            _ => 1.0,
        };
        let half = if node { 0.0 } else { 0.5 * step };
        edge[axis] = step * unit;
        first[axis] = mins.map_or(0.0, |all| all[axis] + half) * unit;
    }
    let [x, y, z] = DVec3::AXES;
    Ok(Some(dense::affine(x * edge.x, y * edge.y, z * edge.z, origin.unwrap_or(first))))
}

/// Metres of each of the quoted units; what is no unit of length is taken as metres.
fn units(value: &str) -> Vec<f64> {
    let words = value.split('"').skip(1).step_by(2);
    words
        .map(|word| match word.trim() {
            "km" => 1e3,
            "cm" => 1e-2,
            "mm" | "millimeter" | "millimeters" => 1e-3,
            "um" | "µm" | "micron" | "microns" => 1e-6,
            "nm" => 1e-9,
            _ => 1.0,
        })
        .collect()
}

fn encoding(name: &str) -> Result<Encoding, Fault> {
    match name.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gz" | "gzip" => Ok(Encoding::Deflate),
        "txt" | "text" | "ascii" => Ok(Encoding::Text),
        other => Err(Fault::Unsupported(format!(
            "NRRD encoding '{}'; airlight reads raw, gzip and text (teem's `unu save -e gzip` converts)",
            text::shown(other)
        ))),
    }
}

fn sample(name: &str) -> Result<Sample, Fault> {
    Ok(match name {
        "signed char" | "int8" | "int8_t" => Sample::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => Sample::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => Sample::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => Sample::U16,
        "int" | "signed int" | "int32" | "int32_t" => Sample::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => Sample::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => Sample::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => Sample::U64,
        "float" => Sample::F32,
        "double" => Sample::F64,
        "block" => return Err(Fault::Unsupported("values of type block, which are no numbers".into())),
        other => return Err(Fault::new(format!("'{}' is no type of NRRD values", text::shown(other)))),
    })
}
