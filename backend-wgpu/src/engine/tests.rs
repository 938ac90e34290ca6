//! What can be said of the kernels without a device.

use wgpu::TextureFormat;

use super::text;
use super::textures::Kind;
use crate::source::tests::module;

const FORMATS: [TextureFormat; 2] = [TextureFormat::Rgba16Float, TextureFormat::Rgba32Float];

#[test]
fn every_kernel_is_valid_for_every_pair_of_textures() {
    let kinds = [None, Some(Kind::Floats), Some(Kind::Depth)];
    for color in [None, Some(Kind::Floats)] {
        for depth in kinds {
            let found = module(&text::import([color, depth])).unwrap_or_else(|e| panic!("{color:?} {depth:?}: {e}"));
            let size: u32 = found.entry_points[0].workgroup_size.iter().product();
            assert_eq!((found.entry_points[0].name.as_str(), size), ("import_surface", text::UNITS));
        }
    }
    for beauty in FORMATS {
        for other in [None, Some(FORMATS[0]), Some(FORMATS[1])] {
            let found = module(&text::export([Some(beauty), other])).unwrap_or_else(|e| panic!("{other:?}: {e}"));
            let size: u32 = found.entry_points[0].workgroup_size.iter().product();
            assert_eq!((found.entry_points[0].name.as_str(), size), ("export_film", text::UNITS));
        }
    }
}
