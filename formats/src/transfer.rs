//! Precomputed transfers, in the safetensors container (`.transfer`).
//!
//! A JSON header names the arrays, all little-endian, and a map of texts beside them:
//!
//! | text | content |
//! | --- | --- |
//! | `format` | `airlight transfer` |
//! | `version` | [`VERSION`] |
//! | `cells` | cells along x, y, z: `64 21 56` |
//! | `basis` | `dsf 642`, `srbf 642` (functions) or `sh 6` (bands) |
//! | `bands` | bands of the moments |
//! | `lattice`, `density`, `optics` | [`Origin`]: 128-bit hashes of what it was made from, in hexadecimal |
//! | `checksum` | 128-bit XXH3 of all arrays' bytes, one behind the other in the order of the table below, in hexadecimal |
//!
//! | array | type | shape |
//! | --- | --- | --- |
//! | `rows` | u32 | rows |
//! | `c.matrices` | f32 | clusters, 1 + components, bands², functions |
//! | `c.clusters` | u32 | rows |
//! | `c.weights` | f32 | rows, components |
//! | `c.errors` | f32 | clusters |
//! | `c.loss` | f32 | 1 |
//!
//! where c is 0, or 0, 1 and 2 where the medium is coloured. What they mean stands at [`Transfer`]. What is missing, of another size or
//! not finite is refused, and so is a file whose bytes do not have its checksum.

use std::collections::HashMap;
use std::fs;
use std::io::Write;
use std::path::Path;

use airlight_core::scene::LightBasis;
use airlight_core::transfer::{Channel, Origin, Shape, Transfer};
use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use xxhash_rust::xxh3::Xxh3;

use crate::FormatError;
use crate::output::write_atomically;

/// The version that is written and read.
pub const VERSION: u32 = 1;

const FORMAT: &str = "airlight transfer";
/// The shortest file and the longest one that is read: what a machine could hold at all.
const MAX_BYTES: u64 = 1 << 40;

/// The arrays of a channel.
const ARRAYS: [&str; 5] = ["matrices", "clusters", "weights", "errors", "loss"];

/// Writes a transfer.
///
/// # Errors
/// A file that cannot be written; nothing is left of it then.
pub fn write(path: &Path, transfer: &Transfer) -> Result<(), FormatError> {
    let shape = transfer.shape();
    let mut arrays: Vec<(String, Dtype, Vec<usize>, &[u8])> =
        vec![("rows".into(), Dtype::U32, vec![shape.rows.len()], bytemuck::cast_slice(&shape.rows))];
    let (rows, clusters, components) = (shape.rows.len(), shape.clusters as usize, shape.components as usize);
    let (moments, functions) = ((shape.bands * shape.bands) as usize, shape.basis.count() as usize);
    for (at, channel) in transfer.channels().iter().enumerate() {
        let mut add = |name: &str, dtype, shape: &[usize], bytes| {
            arrays.push((format!("{at}.{name}"), dtype, shape.to_vec(), bytes));
        };
        let matrices = [clusters, 1 + components, moments, functions];
        add(ARRAYS[0], Dtype::F32, &matrices, bytemuck::cast_slice(&channel.matrices));
        add(ARRAYS[1], Dtype::U32, &[rows], bytemuck::cast_slice(&channel.clusters));
        add(ARRAYS[2], Dtype::F32, &[rows, components], bytemuck::cast_slice(&channel.weights));
        add(ARRAYS[3], Dtype::F32, &[clusters], bytemuck::cast_slice(&channel.errors));
        add(ARRAYS[4], Dtype::F32, &[1], bytemuck::bytes_of(&channel.loss));
    }
    let mut checksum = Xxh3::new();
    arrays.iter().for_each(|(.., bytes)| checksum.update(bytes));
    let origin = transfer.origin();
    let hex = |hash: u128| format!("{hash:032x}");
    let texts: HashMap<String, String> = [
        ("format", FORMAT.to_owned()),
        ("version", VERSION.to_string()),
        ("cells", shape.cells.map(|n| n.to_string()).join(" ")),
        ("basis", basis_text(shape.basis)),
        ("bands", shape.bands.to_string()),
        ("lattice", hex(origin.lattice)),
        ("density", hex(origin.density)),
        ("optics", hex(origin.optics)),
        ("checksum", hex(checksum.digest128())),
    ]
    .into_iter()
    .map(|(key, text)| (key.to_owned(), text))
    .collect();
    let wrong = |error: safetensors::SafeTensorError| content(path, None, error.to_string());
    let mut views = Vec::new();
    for (name, dtype, shape, bytes) in &arrays {
        views.push((name, TensorView::new(*dtype, shape.clone(), bytes).map_err(wrong)?));
    }
    let bytes = safetensors::serialize(views, Some(texts)).map_err(wrong)?;
    write_atomically(path, |out| out.write_all(&bytes).map_err(FormatError::io(path)))
}

/// Reads a transfer.
///
/// # Errors
/// A file that cannot be read, is no transfer, is of another version, or is damaged, with what is wrong and where.
pub fn read(path: &Path) -> Result<Transfer, FormatError> {
    let length = fs::metadata(path).map_err(FormatError::io(path))?.len();
    if length > MAX_BYTES {
        return Err(content(path, None, format!("{length} bytes; a transfer has at most {MAX_BYTES}")));
    }
    let bytes = fs::read(path).map_err(FormatError::io(path))?;
    let wrong = |what: String| content(path, Some("header"), what);
    let (_, header) = SafeTensors::read_metadata(&bytes).map_err(|error| {
        wrong(format!("{error}; a transfer is a safetensors file as `airlight precompute` writes it"))
    })?;
    let texts = header.metadata().clone().unwrap_or_default();
    let text = |key: &str| texts.get(key).ok_or_else(|| wrong(format!("{key} is missing")));
    if texts.get("format").is_none_or(|format| format != FORMAT) {
        return Err(wrong(format!("this safetensors file is no transfer: its format is not \"{FORMAT}\"")));
    }
    let version = text("version")?;
    if *version != VERSION.to_string() {
        return Err(wrong(format!("version {version}; version {VERSION} is read: make the transfer again")));
    }
    let number = |key: &str, word: &str| {
        word.parse::<u32>().map_err(|_| wrong(format!("{key} = \"{word}\" is not a whole number")))
    };
    let cells: Vec<u32> = text("cells")?.split(' ').map(|word| number("cells", word)).collect::<Result<_, _>>()?;
    let cells: [u32; 3] = cells.try_into().map_err(|_| wrong("cells must be three numbers".into()))?;
    let basis = basis_of(text("basis")?).ok_or_else(|| {
        wrong(format!("basis = \"{}\"; it must be such as \"dsf 642\", \"srbf 642\" or \"sh 6\"", texts["basis"]))
    })?;
    let hash = |key: &str| {
        let text = text(key)?;
        u128::from_str_radix(text, 16).map_err(|_| wrong(format!("{key} = \"{text}\" is not a hash")))
    };
    let origin = Origin { lattice: hash("lattice")?, density: hash("density")?, optics: hash("optics")? };

    let tensors = SafeTensors::deserialize(&bytes).map_err(|error| wrong(error.to_string()))?;
    let mut checksum = Xxh3::new();
    let mut array = |name: &str, dtype: Dtype| {
        let of = |what: String| content(path, Some(name), what);
        let tensor = tensors.tensor(name).map_err(|_| of("the array is missing".into()))?;
        if tensor.dtype() != dtype {
            return Err(of(format!("values of {:?}; they must be of {dtype:?}", tensor.dtype())));
        }
        checksum.update(tensor.data());
        Ok((tensor.data(), tensor.shape().to_vec()))
    };
    let rows: Vec<u32> = bytemuck::pod_collect_to_vec(array("rows", Dtype::U32)?.0);
    let mut channels = Vec::new();
    let (mut clusters, mut components) = (0, 0);
    for at in 0..if tensors.tensor("1.matrices").is_ok() { 3 } else { 1 } {
        let mut of = |place: usize, dtype| array(&format!("{at}.{}", ARRAYS[place]), dtype);
        let (matrices, sizes) = of(0, Dtype::F32)?;
        let [of_clusters, of_units, ..] = sizes[..] else {
            return Err(content(path, Some("0.matrices"), format!("an array of {sizes:?}; it must have four sides")));
        };
        (clusters, components) = (of_clusters as u32, of_units.saturating_sub(1) as u32);
        channels.push(Channel {
            matrices: bytemuck::pod_collect_to_vec(matrices),
            clusters: bytemuck::pod_collect_to_vec(of(1, Dtype::U32)?.0),
            weights: bytemuck::pod_collect_to_vec(of(2, Dtype::F32)?.0),
            errors: bytemuck::pod_collect_to_vec(of(3, Dtype::F32)?.0),
            loss: bytemuck::pod_collect_to_vec(of(4, Dtype::F32)?.0).first().copied().unwrap_or(f32::NAN),
        });
    }
    if hash("checksum")? != checksum.digest128() {
        return Err(content(path, None, "the file is damaged: its bytes do not have its checksum".into()));
    }
    let shape = Shape { cells, rows, basis, bands: number("bands", text("bands")?)?, clusters, components };
    Transfer::new(shape, origin, channels).map_err(|error| content(path, None, error.to_string()))
}

/// A basis as the header says it.
pub fn basis_text(basis: LightBasis) -> String {
    match basis {
        LightBasis::Discrete { functions } => format!("dsf {functions}"),
        LightBasis::Radial { functions } => format!("srbf {functions}"),
        LightBasis::Harmonics { bands } => format!("sh {bands}"),
    }
}

fn basis_of(text: &str) -> Option<LightBasis> {
    let (kind, number) = text.split_once(' ')?;
    let number: u32 = number.parse().ok()?;
    let basis = match kind {
        "dsf" => LightBasis::Discrete { functions: number },
        "srbf" => LightBasis::Radial { functions: number },
        "sh" => LightBasis::Harmonics { bands: number },
        _ => return None,
    };
    basis.functions().is_ok().then_some(basis)
}

fn content(path: &Path, place: Option<&str>, what: String) -> FormatError {
    FormatError::Content { path: path.to_path_buf(), place: place.map(str::to_owned), what }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn transfer(channels: usize) -> Transfer {
        let shape = Shape {
            cells: [3, 2, 4],
            rows: vec![1, 2, 5, 9, 22],
            basis: LightBasis::Discrete { functions: 12 },
            bands: 2,
            clusters: 2,
            components: 1,
        };
        let channel = |c: usize| Channel {
            matrices: (0..2 * 2 * 4 * 12).map(|i| (i * (c + 1)) as f32 * 0.25).collect(),
            clusters: vec![0, 1, 1, 0, 1],
            weights: vec![0.5, -0.5, 1.0, 2.0, -3.0],
            errors: vec![0.01, 0.02],
            loss: 0.015,
        };
        let origin = Origin { lattice: 1, density: u128::MAX, optics: 3 << 100 };
        Transfer::new(shape, origin, (0..channels).map(channel).collect()).unwrap()
    }

    #[test]
    fn what_is_written_is_read() {
        let folder = tempfile::tempdir().unwrap();
        for channels in [1, 3] {
            let path = folder.path().join("a.transfer");
            let written = transfer(channels);
            write(&path, &written).unwrap();
            let found = read(&path).unwrap();
            assert_eq!(found.shape(), written.shape());
            assert_eq!(found.origin(), written.origin());
            assert_eq!(found.channels(), written.channels());
        }
    }

    #[test]
    fn any_flipped_byte_and_any_cut_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.transfer");
        write(&path, &transfer(1)).unwrap();
        let bytes = fs::read(&path).unwrap();
        let broken = folder.path().join("b.transfer");
        for at in (0..bytes.len()).step_by(7) {
            let mut flipped = bytes.clone();
            flipped[at] ^= 0x10;
            fs::write(&broken, &flipped).unwrap();
            // A byte of the header may fall on what says nothing, or say something that is as good.
            if let Ok(found) = read(&broken) {
                assert!(at < bytes.len() - 1000 && found.channels() == transfer(1).channels(), "byte {at}");
            }
        }
        for length in [0, 7, 8, 100, bytes.len() / 2, bytes.len() - 1] {
            fs::write(&broken, &bytes[..length]).unwrap();
            assert!(read(&broken).unwrap_err().to_string().contains("b.transfer"));
        }
        let mut flipped = bytes.clone();
        let last = bytes.len() - 5;
        flipped[last] ^= 1;
        fs::write(&broken, &flipped).unwrap();
        assert!(read(&broken).unwrap_err().to_string().ends_with("its bytes do not have its checksum"));
        // A header that claims more than there is.
        let mut claims = u64::MAX.to_le_bytes().to_vec();
        claims.extend(b"{}");
        fs::write(&broken, claims).unwrap();
        assert!(read(&broken).is_err());
    }

    #[test]
    fn another_version_is_refused_with_both() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.transfer");
        write(&path, &transfer(1)).unwrap();
        let text = String::from_utf8_lossy(&fs::read(&path).unwrap()).into_owned();
        assert!(text.contains("\"version\":\"1\""));
        let mut bytes = fs::read(&path).unwrap();
        let at = bytes.windows(13).position(|w| w == b"\"version\":\"1\"").unwrap();
        bytes[at + 11] = b'7';
        fs::write(&path, bytes).unwrap();
        let error = read(&path).unwrap_err().to_string();
        assert!(error.contains("version 7; version 1 is read"), "{error}");
        let name = |text: &str| basis_of(text).map(basis_text);
        assert_eq!(name("sh 6").as_deref(), Some("sh 6"));
        assert_eq!(name("dsf 641"), None);
    }
}
