//! MetaImage (`.mhd` with a data file, `.mha`).
//!
//! Source: the documentation of MetaIO, and how ITK lays its images in space: `Offset` is the centre of voxel 0, and
//! the rows of `TransformMatrix` are the directions of the index axes.

use std::collections::HashMap;

use glam::{DAffine3, DVec3};

use super::dense::{self, Data, Encoding, Header};
use super::fault::Fault;
use super::sample::Sample;
use super::text::{self, Lines};

/// Whether a file that begins so is a MetaImage header.
pub(super) fn is_metaimage(bytes: &[u8]) -> bool {
    let first = Lines::new(bytes).next().ok().flatten().and_then(|line| line.split_once('='));
    first.is_some_and(|(key, _)| matches!(key.trim(), "ObjectType" | "NDims" | "Comment"))
}

/// The header's values by key, each with the place of its line.
struct Fields<'a>(HashMap<&'a str, (&'a str, String)>);

impl<'a> Fields<'a> {
    /// The first of `keys` that is there, read by `read`.
    fn get<T>(&self, keys: &[&str], read: impl FnOnce(&'a str) -> Result<T, Fault>) -> Result<Option<T>, Fault> {
        let Some((key, (value, place))) = keys.iter().find_map(|key| Some((key, self.0.get(key)?))) else {
            return Ok(None);
        };
        read(value).map(Some).map_err(|fault| fault.within(&format!("{place}, '{key}'")))
    }

    fn need<T>(&self, key: &str, read: impl FnOnce(&'a str) -> Result<T, Fault>) -> Result<T, Fault> {
        self.get(&[key], read)?.ok_or_else(|| Fault::at(format!("header field '{key}'"), "missing"))
    }

    fn truth(&self, keys: &[&str]) -> Result<Option<bool>, Fault> {
        self.get(keys, |value| match value.chars().next() {
            Some('T' | 't' | '1') => Ok(true),
            Some('F' | 'f' | '0') => Ok(false),
            _ => Err(Fault::new(format!("'{}' is neither True nor False", text::shown(value)))),
        })
    }
}

/// Reads the header.
pub(super) fn header(bytes: &[u8]) -> Result<Header, Fault> {
    let mut lines = Lines::new(bytes);
    let mut fields = Fields(HashMap::new());
    // ElementDataFile is the last field by rule: what follows it is data.
    while !fields.0.contains_key("ElementDataFile") {
        let Some(line) = lines.next()? else {
            return Err(Fault::at("header field 'ElementDataFile'", "missing; it names the file of the values"));
        };
        if line.trim().is_empty() {
            continue;
        }
        let (key, value) = line.split_once('=').ok_or_else(|| {
            let what = format!("'{}' is not 'Key = Value', and no ElementDataFile stands before it", text::shown(line));
            Fault::at(lines.place(), what)
        })?;
        if fields.0.insert(key.trim(), (value.trim(), lines.place())).is_some() {
            return Err(Fault::at(lines.place(), format!("'{}' stands in the header twice", text::shown(key.trim()))));
        }
    }
    fields.get(&["ObjectType"], |kind| match kind {
        "Image" => Ok(()),
        other => Err(Fault::Unsupported(format!("a MetaIO object of type {}, not an Image", text::shown(other)))),
    })?;
    let rank: usize = fields.need("NDims", text::number)?;
    if !(3..=4).contains(&rank) {
        return Err(Fault::Unsupported(format!("{rank} dimensions; a volume has 3")));
    }
    let dims = fields.need("DimSize", |value| {
        let sides: Vec<i64> = text::numbers(value)?;
        match sides[..] {
            [x, y, z] | [x, y, z, 1] if sides.len() == rank => dense::dims([x, y, z]),
            [_, _, _, n] if rank == 4 => {
                Err(Fault::Unsupported(format!("{n} values along dimension 4; a volume has 3 dimensions")))
            }
            _ => Err(Fault::new(format!("{} sizes for {rank} dimensions", sides.len()))),
        }
    })?;
    let channels: i64 = fields.get(&["ElementNumberOfChannels"], text::number)?.unwrap_or(1);
    if channels != 1 {
        return Err(Fault::Unsupported(format!("{channels} channels a voxel; a density has 1")));
    }
    let sample = fields.need("ElementType", sample)?;
    let big_endian = fields.truth(&["ElementByteOrderMSB", "BinaryDataByteOrderMSB"])?.unwrap_or(false);
    let compressed = fields.truth(&["CompressedData"])?.unwrap_or(false);
    let binary = fields.truth(&["BinaryData"])?.unwrap_or(true);
    let encoding = match (compressed, binary) {
        (true, _) => Encoding::Deflate,
        (false, true) => Encoding::Raw,
        (false, false) => Encoding::Text,
    };
    let mut file = fields.need("ElementDataFile", dense::single_file).map(Some)?;
    if file.as_deref().is_some_and(str::is_empty) {
        return Err(Fault::at("header field 'ElementDataFile'", "empty; it names the file of the values, or is LOCAL"));
    }
    let start = match file.as_deref() {
        Some("LOCAL" | "Local" | "local") => {
            file = None;
            lines.at() as u64
        }
        _ => 0,
    };
    let mut data = Data { file, offset: start, lines: 0, skip: Some(0) };
    match fields.get(&["HeaderSize"], text::number::<i64>)?.unwrap_or(0) {
        -1 if encoding == Encoding::Raw => data.skip = None,
        n if n >= 0 => data.offset = start.saturating_add(n as u64),
        n => {
            let what = format!("{n}; bytes before the data, or -1 where raw data is the end of the file");
            return Err(Fault::at("header field 'HeaderSize'", what));
        }
    }
    let index_to_world = placement(&fields, rank)?;
    Ok(Header { dims, sample, big_endian, rescale: None, index_to_world, encoding, data })
}

/// The map of the fields that place an image, or none where there is none of them.
fn placement(fields: &Fields<'_>, rank: usize) -> Result<Option<DAffine3>, Fault> {
    let vector = |value: &str| {
        let all: Vec<f64> = text::numbers(value)?;
        if all.len() != rank {
            return Err(Fault::new(format!("{} numbers for {rank} dimensions", all.len())));
        }
        Ok(DVec3::new(all[0], all[1], all[2]))
    };
    let spacing = match fields.get(&["ElementSpacing"], vector)? {
        None => fields.get(&["ElementSize"], vector)?,
        some => some,
    };
    let origin = fields.get(&["Offset", "Position", "Origin"], vector)?;
    let turn = fields.get(&["TransformMatrix", "Rotation", "Orientation"], |value| {
        let all: Vec<f64> = text::numbers(value)?;
        if all.len() != rank * rank {
            return Err(Fault::new(format!("{} numbers, where {} belong", all.len(), rank * rank)));
        }
        Ok([0, 1, 2].map(|axis| DVec3::new(all[axis * rank], all[axis * rank + 1], all[axis * rank + 2])))
    })?;
    if spacing.is_none() && origin.is_none() && turn.is_none() {
        return Ok(None);
    }
    let edge = spacing.unwrap_or(DVec3::ONE);
    let [x, y, z] = turn.unwrap_or([DVec3::X, DVec3::Y, DVec3::Z]);
    Ok(Some(dense::affine(x * edge.x, y * edge.y, z * edge.z, origin.unwrap_or(DVec3::ZERO))))
}

fn sample(name: &str) -> Result<Sample, Fault> {
    Ok(match name {
        "MET_CHAR" => Sample::I8,
        "MET_UCHAR" => Sample::U8,
        "MET_SHORT" => Sample::I16,
        "MET_USHORT" => Sample::U16,
        // MetaIO fixes its long at 32 bits.
        "MET_INT" | "MET_LONG" => Sample::I32,
        "MET_UINT" | "MET_ULONG" => Sample::U32,
        "MET_LONG_LONG" => Sample::I64,
        "MET_ULONG_LONG" => Sample::U64,
        "MET_FLOAT" => Sample::F32,
        "MET_DOUBLE" => Sample::F64,
        other => {
            return Err(Fault::Unsupported(format!(
                "values of type '{}'; airlight reads MET_CHAR, MET_SHORT, MET_INT, MET_LONG_LONG, their unsigned \
                 kinds, MET_FLOAT and MET_DOUBLE",
                text::shown(other)
            )));
        }
    })
}
