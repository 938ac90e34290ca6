//! Volumes: OpenVDB, NRRD, NIfTI-1, MetaImage and Mitsuba's VOL, read into [`Grid`]s, and OpenVDB written.
//!
//! A file is known by its content first and by its ending second. Values are handed on as they are: whether they can
//! be densities is for the medium to judge. Every sample lies at the centre of its voxel, and the map that comes with
//! a grid takes integer indices there.
//!
//! | format | files | placement and units |
//! | --- | --- | --- |
//! | OpenVDB 220 to 224 | `.vdb` | the grid's transform, in metres |
//! | NRRD 1 to 5 | `.nrrd`, `.nhdr` and its data file | `space directions` and `space origin`, or `spacings` and `axis mins`; metres, unless `space units` (`units`) names another length |
//! | NIfTI-1 | `.nii`, `.nii.gz` | sform, else qform, else `pixdim`; `xyzt_units` to metres, millimetres where unknown |
//! | MetaImage | `.mhd` and its data file, `.mha` | `Offset`, `ElementSpacing`, `TransformMatrix`, in metres |
//! | VOL 3 | `.vol` | the box of its header, in metres |
//!
//! World axes are taken as the file has them: an NRRD's `space` (such as left-posterior-superior) and NIfTI's
//! right-anterior-superior are not turned to airlight's +Y up. Where a file says nothing of its place
//! ([`Volume::placed`]), a voxel is a cube of a metre and the box begins at the origin. A scene may lay the box
//! elsewhere with its `bounds`.

mod bytes;
mod dense;
mod fault;
mod inflate;
mod metaimage;
mod nifti;
mod nrrd;
mod sample;
mod text;
mod vdb;
mod vol;

use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

use airlight_core::media::{Grid, IndexBox, Lattice};
use glam::{DAffine3, DVec3};

use crate::error::FormatError;
use fault::Fault;
pub use vdb::{VdbWriteOptions, encode_vdb, write_vdb};

/// Bytes of a file in which the header of a dense format must end for [`inspect`].
const HEAD: u64 = 1 << 20;

/// A file format of volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Format {
    /// OpenVDB.
    Vdb,
    /// NRRD, with its data attached or not.
    Nrrd,
    /// NIfTI-1 in one file, in a gzip stream or not.
    Nifti,
    /// MetaImage.
    MetaImage,
    /// Mitsuba's grid volume.
    Vol,
}

impl Format {
    /// The format's name as its own field writes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vdb => "OpenVDB",
            Self::Nrrd => "NRRD",
            Self::Nifti => "NIfTI-1",
            Self::MetaImage => "MetaImage",
            Self::Vol => "Mitsuba VOL",
        }
    }
}

/// What a volume file holds.
#[derive(Clone, Debug)]
pub struct VolumeFile {
    /// The file.
    pub path: PathBuf,
    /// Its format.
    pub format: Format,
    /// The grids in it, in the file's order.
    pub grids: Vec<GridInfo>,
}

/// What is known of a grid without its values.
#[derive(Clone, Debug)]
pub struct GridInfo {
    /// The name to ask for it by. Of several grids of one name, `name[0]`, `name[1]` and so on.
    pub name: String,
    /// Type of a value as the file calls it: "float", "half", "vec3s", "i16".
    pub value_type: String,
    /// What the grid is for, where the file says it: "fog volume", "level set"; else empty.
    pub class: String,
    /// How the values are packed: "raw", "deflate", "text", "blosc + active mask".
    pub encoding: String,
    /// Whether [`read`] can read it, or why not.
    pub usable: Result<(), String>,
    /// The indices that the grid covers, where they can be known.
    pub bounds: Option<IndexBox>,
    /// Takes indices to voxel centres in metres, where that can be known.
    pub index_to_world: Option<DAffine3>,
    /// Voxels that a sparse grid marks as active, tiles included; none for dense formats.
    pub active_voxels: Option<u64>,
    /// Whether the file says where the grid lies.
    pub placed: bool,
}

impl GridInfo {
    /// The axis-aligned box in metres that holds the grid, where it can be known.
    pub fn world_bounds(&self) -> Option<(DVec3, DVec3)> {
        let (bounds, map) = (self.bounds?, self.index_to_world?);
        let from_first = map * DAffine3::from_translation(bounds.min.as_dvec3());
        Lattice::new(bounds.dims, from_first).ok().map(|lattice| lattice.world_bounds())
    }
}

/// One grid of a file.
#[derive(Clone, Debug)]
pub struct Volume {
    /// The grid's name; "density" in formats without names.
    pub name: String,
    /// Values and the map from index to world.
    pub grid: Grid,
    /// Whether the file says where the grid lies; if not, a voxel is a metre and the box begins at the origin.
    pub placed: bool,
}

/// Gets the bytes of a data file by the name that a header has for it.
pub type Open<'a> = &'a dyn Fn(&str) -> Result<Vec<u8>, FormatError>;

/// Reads what a file holds, without values. The active bounds of .vdb grids are taken from the trees' masks.
///
/// # Errors
/// A file that cannot be opened, is of no format that is read, or whose header is wrong. A wrong grid among others in
/// a .vdb is no error but told by its [`GridInfo::usable`].
pub fn inspect(path: impl AsRef<Path>) -> Result<VolumeFile, FormatError> {
    let path = path.as_ref();
    let head = open(path, Some(HEAD))?;
    let format = detect(path, &head)?;
    let grids = match format {
        Format::Vdb => vdb::inspect(&open(path, None)?),
        Format::Nrrd => nrrd::header(&head).map(|h| vec![h.info()]),
        Format::Nifti => nifti::header(&head).map(|h| vec![h.info()]),
        Format::MetaImage => metaimage::header(&head).map(|h| vec![h.info()]),
        Format::Vol => vol::header(&head).map(|h| vec![h.info()]),
    }
    .map_err(|fault| fault.of(path))?;
    Ok(VolumeFile { path: path.into(), format, grids })
}

/// Reads one grid of a file: the one named `grid`; without a name "density" if that is there and usable, else the
/// only usable one.
///
/// # Errors
/// A file that cannot be opened, is of no format that is read, is damaged, or does not hold the grid; several usable
/// grids and no name (the error lists them).
pub fn read(path: impl AsRef<Path>, grid: Option<&str>) -> Result<Volume, FormatError> {
    let path = path.as_ref();
    let bytes = open(path, None)?;
    let format = detect(path, &bytes)?;
    let beside = |name: &str| open(&path.parent().unwrap_or(Path::new("")).join(name), None);
    parse(format, path, &bytes, grid, &beside)
}

/// As [`read`], of a file in memory: `path` is only for messages, and a data file is asked of `open`.
///
/// # Errors
/// As [`read`].
pub fn parse(
    format: Format,
    path: &Path,
    bytes: &[u8],
    grid: Option<&str>,
    open: Open<'_>,
) -> Result<Volume, FormatError> {
    match format {
        Format::Vdb => vdb::read(bytes, grid),
        Format::Nrrd => nrrd::header(bytes).and_then(|h| h.load(bytes, grid, open)),
        Format::Nifti => nifti::header(bytes).and_then(|h| h.load(bytes, grid, open)),
        Format::MetaImage => metaimage::header(bytes).and_then(|h| h.load(bytes, grid, open)),
        Format::Vol => vol::header(bytes).and_then(|h| h.load(bytes, grid, open)),
    }
    .map_err(|fault| fault.of(path))
}

/// The format of a file that begins with `bytes`.
///
/// # Errors
/// An empty file; a format that is not read.
pub fn detect(path: &Path, bytes: &[u8]) -> Result<Format, FormatError> {
    if bytes.is_empty() {
        return Err(FormatError::content(path, None, "the file is empty"));
    }
    if bytes.starts_with(b"version https://git-lfs") {
        return Err(FormatError::content(path, None, "this is a Git LFS pointer; fetch the file itself: git lfs pull"));
    }
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let by_content = [
        (vdb::is_vdb(bytes), Format::Vdb),
        (nrrd::is_nrrd(bytes), Format::Nrrd),
        (nifti::is_nifti(bytes), Format::Nifti),
        (vol::is_vol(bytes), Format::Vol),
        (metaimage::is_metaimage(bytes), Format::MetaImage),
    ];
    if let Some((_, format)) = by_content.iter().find(|(is, _)| *is) {
        return Ok(*format);
    }
    let not = |name: &str, magic: &str| {
        Err(FormatError::content(path, None, format!("not {name}: such a file begins with {magic}")))
    };
    match ending.as_str() {
        "vdb" => not("an OpenVDB file", "the bytes 20 42 44 56 00 00 00 00 (' BDV')"),
        "nrrd" | "nhdr" => not("an NRRD file", "'NRRD000' and a version from 1 to 5"),
        "nii" => not("a NIfTI-1 file", "its header's size, 348, as 32 bits"),
        // Its stream is damaged, or holds something else: the reader says which.
        "gz" if inflate::is_gzip(bytes) && path.to_string_lossy().to_lowercase().ends_with(".nii.gz") => {
            Ok(Format::Nifti)
        }
        "gz" if inflate::is_gzip(bytes) => Err(FormatError::unsupported(
            path,
            "a gzip stream that holds no NIfTI-1 file; of compressed volumes airlight reads .nii.gz (and .nrrd, .mhd \
             and .vdb, which compress inside)",
        )),
        "vol" => not("a Mitsuba volume", "'VOL' and the version 3"),
        "mhd" | "mha" => not("a MetaImage header", "'ObjectType = Image' or 'NDims = 3'"),
        "raw" | "zraw" => Err(FormatError::unsupported(path, raw_advice(path))),
        _ => Err(FormatError::unsupported(
            path,
            "not a volume that airlight reads: .vdb, .nrrd, .nhdr, .nii, .nii.gz, .mhd, .mha or .vol",
        )),
    }
}

/// What to do with a file of bare values.
fn raw_advice(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let header = Path::new(&name).with_extension("mhd");
    format!(
        "bare values do not say their size or type; write a header beside them, for instance {}, and give that:\n\
         ObjectType = Image\nNDims = 3\nDimSize = 256 128 64\nElementType = MET_FLOAT\nElementByteOrderMSB = False\n\
         ElementSpacing = 0.01 0.01 0.01\nOffset = 0 0 0\nElementDataFile = {name}",
        header.display()
    )
}

/// The first `limit` bytes of the file at `path`, or all of them.
fn open(path: &Path, limit: Option<u64>) -> Result<Vec<u8>, FormatError> {
    let kind = fs::metadata(path).map_err(FormatError::io(path))?;
    if kind.is_dir() {
        return Err(FormatError::unsupported(path, "a folder; a volume is a file"));
    }
    if !kind.is_file() {
        return Err(FormatError::unsupported(path, "not a regular file; a volume is read from one"));
    }
    let wanted = limit.unwrap_or(u64::MAX).min(kind.len());
    let mut bytes = fault::room(usize::try_from(wanted).unwrap_or(usize::MAX)).map_err(|fault| fault.of(path))?;
    let file = File::open(path).map_err(FormatError::io(path))?;
    file.take(wanted).read_to_end(&mut bytes).map_err(FormatError::io(path))?;
    Ok(bytes)
}

/// The place in `grids` of the one that [`read`] is to read.
fn choose(grids: &[GridInfo], wanted: Option<&str>) -> Result<usize, Fault> {
    let usable: Vec<usize> = (0..grids.len()).filter(|i| grids[*i].usable.is_ok()).collect();
    let list = || {
        let names: Vec<String> = usable.iter().map(|i| format!("'{}'", grids[*i].name)).collect();
        match names.len() {
            0 => "no grid of the file can be used".to_string(),
            1 => format!("the grid that can be used is {}", names[0]),
            _ => format!("the grids that can be used are {}", names.join(", ")),
        }
    };
    let refused = |grid: &GridInfo| match &grid.usable {
        Ok(()) => String::new(),
        Err(why) => format!("grid '{}' {why}", grid.name),
    };
    if let Some(name) = wanted {
        let Some(i) = grids.iter().position(|grid| grid.name == name) else {
            return Err(Fault::new(format!("there is no grid '{name}'; {}", list())));
        };
        if grids[i].usable.is_err() {
            return Err(Fault::Unsupported(format!("{}; {}", refused(&grids[i]), list())));
        }
        return Ok(i);
    }
    if let Some(i) = usable.iter().find(|i| grids[**i].name == "density") {
        return Ok(*i);
    }
    match usable[..] {
        [only] => Ok(only),
        [] if grids.is_empty() => Err(Fault::new("the file holds no grid")),
        [] => {
            let why: Vec<String> = grids.iter().map(refused).collect();
            Err(Fault::Unsupported(format!("no grid of the file can be used: {}", why.join("; "))))
        }
        _ => Err(Fault::new(format!("which grid? {}, and none of them is named 'density'", list()))),
    }
}
