//! What the headers of dense volume formats say, and one way from there to a grid.

use airlight_core::media::{Grid, Lattice};
use glam::{DAffine3, DMat3, DVec3, UVec3};

use super::fault::{Fault, room};
use super::inflate::inflate;
use super::sample::Sample;
use super::{GridInfo, Open, Volume};

/// How the values are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    /// As they are in memory.
    Raw,
    /// Raw in a gzip or zlib stream.
    Deflate,
    /// Decimal numbers with white space between them.
    Text,
}

/// Where the values are.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Data {
    /// The file that holds them, as the header writes it; none: the header's own.
    pub(super) file: Option<String>,
    /// Bytes of the file before them.
    pub(super) offset: u64,
    /// Lines to skip after `offset`.
    pub(super) lines: u64,
    /// Bytes to skip after that, once decompressed; none: the values are the file's last bytes (raw only).
    pub(super) skip: Option<u64>,
}

/// A dense volume but for its values.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    pub(super) dims: UVec3,
    pub(super) sample: Sample,
    pub(super) big_endian: bool,
    /// Slope and intercept.
    pub(super) rescale: Option<(f64, f64)>,
    /// None: the file does not say.
    pub(super) index_to_world: Option<DAffine3>,
    pub(super) encoding: Encoding,
    pub(super) data: Data,
}

/// The name that a format without names gives its one grid.
const NAME: &str = "density";

/// The sides of a volume as the header claims them, each from 1 to 2³¹ - 1.
pub(super) fn dims(claimed: [i64; 3]) -> Result<UVec3, Fault> {
    let side = |n: i64| i32::try_from(n).ok().filter(|n| *n > 0).map(|n| n as u32);
    match claimed.map(side) {
        [Some(x), Some(y), Some(z)] => Ok(UVec3::new(x, y, z)),
        _ => {
            let [x, y, z] = claimed;
            Err(Fault::new(format!("{x} × {y} × {z} voxels; each side must be from 1 to 2147483647")))
        }
    }
}

/// A map from the three steps between voxels and the centre of voxel 0.
pub(super) fn affine(x: DVec3, y: DVec3, z: DVec3, origin: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), origin)
}

impl Header {
    /// The map of the file; where it has none, a voxel a metre, and the box starts at the origin.
    fn map(&self) -> DAffine3 {
        self.index_to_world.unwrap_or(DAffine3::from_translation(DVec3::splat(0.5)))
    }

    /// The header as [`super::inspect`] tells it.
    pub(super) fn info(&self) -> GridInfo {
        let usable = Lattice::new(self.dims, self.map()).map(drop).map_err(|e| e.to_string());
        GridInfo {
            name: NAME.into(),
            value_type: self.sample.name().into(),
            class: String::new(),
            encoding: match self.encoding {
                Encoding::Raw => "raw",
                Encoding::Deflate => "deflate",
                Encoding::Text => "text",
            }
            .into(),
            usable,
            bounds: Some(airlight_core::media::IndexBox { min: glam::IVec3::ZERO, dims: self.dims }),
            index_to_world: Some(self.map()),
            active_voxels: None,
            placed: self.index_to_world.is_some(),
        }
    }

    /// Decodes the values; `bytes` is the header's own file.
    pub(super) fn load(&self, bytes: &[u8], grid: Option<&str>, open: Open<'_>) -> Result<Volume, Fault> {
        if let Some(name) = grid.filter(|name| *name != NAME) {
            return Err(Fault::new(format!(
                "there is no grid '{name}': this format holds one grid without a name, which '{NAME}' stands for"
            )));
        }
        Lattice::new(self.dims, self.map()).map_err(|e| Fault::at("header", e.to_string()))?;
        let values = match &self.data.file {
            None => self.values(bytes),
            Some(name) => {
                let detached = open(name).map_err(Fault::File)?;
                self.values(&detached).map_err(|fault| fault.within(&format!("data file '{name}'")))
            }
        }?;
        let grid = Grid::dense(self.dims, self.map(), values).map_err(|e| Fault::new(e.to_string()))?;
        Ok(Volume { name: NAME.into(), grid, placed: self.index_to_world.is_some() })
    }

    fn values(&self, bytes: &[u8]) -> Result<Vec<f32>, Fault> {
        let voxels = self
            .dims
            .to_array()
            .iter()
            .try_fold(1u64, |n, side| n.checked_mul(u64::from(*side)))
            .filter(|n| n.checked_mul(8).is_some_and(|bytes| usize::try_from(bytes).is_ok()))
            .ok_or_else(|| Fault::at("header", format!("{} voxels are more than memory can address", self.dims)))?;
        let wanted = voxels * self.sample.size();
        let mut data = usize::try_from(self.data.offset).ok().and_then(|n| bytes.get(n..)).ok_or_else(|| {
            Fault::new(format!("the data is to start at byte {}, past the end of {}", self.data.offset, bytes.len()))
        })?;
        for n in 0..self.data.lines {
            let Some(end) = data.iter().position(|b| *b == b'\n') else {
                return Err(Fault::new(format!("{} lines are to be skipped, but there are only {n}", self.data.lines)));
            };
            data = &data[end + 1..];
        }
        let shape = format!("{} × {} × {} {} voxels", self.dims.x, self.dims.y, self.dims.z, self.sample.name());
        let short = |found: usize| {
            Fault::new(format!("{shape} take {wanted} bytes of data, but there are {found}: the file is cut short"))
        };
        let skip = self.data.skip;
        match self.encoding {
            Encoding::Raw => {
                let left = data.len() as u64;
                let start = skip.or(left.checked_sub(wanted)).filter(|start| left.saturating_sub(*start) >= wanted);
                let Some(start) = start else {
                    return Err(short(left.saturating_sub(skip.unwrap_or(0)) as usize));
                };
                self.sample.decode(&data[start as usize..][..wanted as usize], self.big_endian, self.rescale)
            }
            Encoding::Deflate => {
                let start = skip.ok_or_else(|| Fault::new("compressed data cannot be found from the file's end"))?;
                let unpacked = inflate(data, start.saturating_add(wanted)).map_err(|f| f.within(&shape))?;
                self.sample.decode(&unpacked[start as usize..], self.big_endian, self.rescale)
            }
            Encoding::Text => {
                let start = skip.and_then(|n| usize::try_from(n).ok()).and_then(|n| data.get(n..));
                self.text(start.ok_or_else(|| short(data.len()))?, voxels)
            }
        }
    }

    fn text(&self, data: &[u8], voxels: u64) -> Result<Vec<f32>, Fault> {
        // Each number but the last takes a digit and a space.
        let most = data.len().div_ceil(2);
        let too_few = |n: u64| Fault::new(format!("{voxels} numbers are needed, but there are at most {n}"));
        if voxels > most as u64 {
            return Err(too_few(most as u64));
        }
        let mut values = room(voxels as usize)?;
        let (slope, intercept) = self.rescale.unwrap_or((1.0, 0.0));
        let mut words = data.split(|b| b.is_ascii_whitespace() || *b == b',').filter(|w| !w.is_empty());
        for n in 0..voxels {
            let word = words.next().ok_or_else(|| too_few(n))?;
            let number = std::str::from_utf8(word).ok().and_then(|w| w.parse::<f64>().ok()).ok_or_else(|| {
                let shown = String::from_utf8_lossy(&word[..word.len().min(40)]);
                Fault::at(format!("value {}", n + 1), format!("'{shown}' is not a number"))
            })?;
            values.push((number * slope + intercept) as f32);
        }
        Ok(values)
    }
}

/// The name of a data file, refused where it stands for several files.
pub(super) fn single_file(name: &str) -> Result<String, Fault> {
    if name.split_whitespace().next() == Some("LIST") || name.contains('%') {
        return Err(Fault::Unsupported(format!(
            "the data is spread over several files ('{name}'); airlight reads one data file, so join them first"
        )));
    }
    Ok(name.into())
}
