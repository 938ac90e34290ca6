//! What can be said of the kernels without a device.

use wgpu::TextureFormat;

use super::text;
use super::textures::Kind;
use crate::source::Text;
use crate::source::tests::module;

const FORMATS: [TextureFormat; 2] = [TextureFormat::Rgba16Float, TextureFormat::Rgba32Float];

/// Every kernel, for every pair of textures.
pub(crate) fn kernels() -> Vec<Text> {
    let kinds = [None, Some(Kind::Floats), Some(Kind::Depth)];
    let color = [None, Some(Kind::Floats)];
    let import = color.into_iter().flat_map(|color| kinds.map(|depth| text::import([color, depth])));
    let formats = [None, Some(FORMATS[0]), Some(FORMATS[1])];
    let export = FORMATS.into_iter().flat_map(|beauty| formats.map(|other| text::export([Some(beauty), other])));
    import.chain(export).collect()
}

#[test]
fn every_kernel_is_valid_for_every_pair_of_textures() {
    for text in kernels() {
        let found = module(&text).unwrap_or_else(|error| panic!("{error}"));
        let size: u32 = found.entry_points[0].workgroup_size.iter().product();
        assert_eq!(size, text::UNITS);
    }
}
