//! The files of the truth, which are part of the program.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use airlight::light::Image;
use airlight_formats::FormatError;
use airlight_formats::image::parse_exr_channels;
use libtest_mimic::Failed;

/// A file of the truth.
pub(crate) struct File {
    /// For messages.
    pub(crate) path: PathBuf,
    pub(crate) bytes: Cow<'static, [u8]>,
}

/// Files of `data/reference` by their names there.
macro_rules! embedded {
    ($($name:literal),* $(,)?) => {
        &[$(($name, include_bytes!(concat!("../data/reference/", $name)))),*]
    };
}

const FILES: &[(&str, &[u8])] = embedded![
    "blobs.json",
    "density.nrrd",
    "env.exr",
    "sh_env.json",
    "blobs.json",
    "images/blobs_point_single.exr",
    "images/dir_hg0.7_single.exr",
    "images/dir_multi.exr",
    "images/dir_single.exr",
    "images/dir_single_chromatic.exr",
    "images/emission_only.exr",
    "images/env_hg0.5_multi.exr",
    "images/env_hg0.5_single.exr",
    "images/env_multi.exr",
    "images/env_single.exr",
    "images/env_single_sh2.exr",
    "images/env_single_sh3.exr",
    "images/env_single_sh4.exr",
    "images/env_single_sh6.exr",
    "images/point_single.exr",
    "images/spot_single.exr",
    "images/transmittance.exr",
    "images/transmittance_chromatic.exr",
];

/// A file of `data/reference`: of the folder that `AIRLIGHT_CONFORMANCE_DATA` names, else the one built in.
pub(crate) fn file(name: &str) -> Result<File, FormatError> {
    if let Some(folder) = std::env::var_os("AIRLIGHT_CONFORMANCE_DATA") {
        let path = Path::new(&folder).join("reference").join(name);
        let bytes = std::fs::read(&path).map_err(FormatError::io(&path))?;
        return Ok(File { path, bytes: bytes.into() });
    }
    let path = PathBuf::from(name);
    match FILES.iter().find(|(known, _)| *known == name) {
        Some((_, bytes)) => Ok(File { path, bytes: Cow::Borrowed(bytes) }),
        None => Err(FormatError::unsupported(path, "is no file of the truth")),
    }
}

/// RGB of a file, and alpha where there is one.
pub(crate) fn picture(name: &str) -> Result<(Image, Option<Vec<f32>>), Failed> {
    let File { path, bytes } = file(name)?;
    let exr = parse_exr_channels(&path, &bytes)?;
    let channel = |c: &str| exr.channel(c).ok_or_else(|| Failed::from(format!("{name} has no channel {c}")));
    let [r, g, b] = [channel("R")?, channel("G")?, channel("B")?];
    let texels = (0..r.len()).map(|i| [r[i], g[i], b[i]]).collect();
    let alpha = exr.channel("A").map(<[f32]>::to_vec);
    Ok((Image { width: exr.width, height: exr.height, texels }, alpha))
}
