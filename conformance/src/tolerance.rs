//! Every tolerance of the suite, with its reason.
//!
//! `*_L2` are relative L2 errors; `*_PEAK` are largest errors as a share of the largest expected value.

use airlight::device::DeviceInfo;

/// A stage in f32 against its twin in f64. Places in index space are good to 2⁻²³ of some ten voxels, sums run over a
/// few hundred terms: about 10⁻⁶. A cancelled or contracted product on another device is of the same size.
pub const STAGE_L2: f64 = 1e-5;

/// As [`STAGE_L2`], for the worst value. A ray whose length is a whole number of steps to the last digit may take one
/// step more in f32 than in f64: that moves its samples and costs one pixel the error of the quadrature itself, a few
/// thousandths on the coarse grids here.
pub const STAGE_PEAK: f64 = 5e-3;

/// Means of up to a few hundred voxels in f32.
pub const MEAN_PEAK: f64 = 1e-5;

/// Pictures of a homogeneous medium without a shadow (Beer–Lambert, emission): nothing but f32 along some hundred
/// steps, where the steps themselves are exact.
pub const CLOSED_L2: f64 = 1e-5;

/// Single scattering in a homogeneous box, by steps of 1/64 of its shortest side. The midpoint rule is of second
/// order, (στ/64)²/24 per step, but the way to the light ends at a wall: half a step either way, at random, of a
/// column of some tens of steps. Over a picture that leaves about 10⁻³.
pub const LIT_BOX_L2: f64 = 2e-3;

/// A thin medium in a uniform environment: the first order in the depth of its own shadow that the closed form leaves
/// out, for an optical depth of 10⁻³ across.
pub const THIN_L2: f64 = 2e-3;

/// Contents that are equal but for the place of the directions in their pixels, at the centre or at the mean of the
/// light: with both at the centres they differ by 3·10⁻⁶, as they are by 2.4·10⁻⁴, and devices change nothing of that.
pub const CONTENT_L2: f64 = 5e-4;

/// Records in cells of half a voxel against brute force. The density is noise from voxel to voxel, so the error is
/// that of interpolation between cells and of second order: 3.2 % at cells of a voxel, 1.1 % at half. Finer
/// directions, environment and view steps move it by a tenth.
pub const BRUTE_HALF_VOXEL_L2: f64 = 1.5e-2;

/// As [`BRUTE_HALF_VOXEL_L2`], at less than a quarter of a voxel: 0.38 %.
pub const BRUTE_QUARTER_VOXEL_L2: f64 = 5e-3;

/// Direct lights against brute force, at a quarter of a voxel a step: the midpoint rule against exact columns.
pub const BRUTE_DIRECT_L2: f64 = 3e-3;

/// Transmittance against the reference pictures, relative to their RGB. Their own quadrature is exact to 10⁻⁸; ours
/// takes 16 sub-pixel positions instead of all of the pixel.
pub const PICTURE_TRANSMITTANCE_L2: f64 = 1e-3;

/// Lights and emission against the reference pictures (own error up to 6·10⁻⁵): sub-pixel positions and steps.
pub const PICTURE_DIRECT_L2: f64 = 5e-3;

/// Records of 40 cells against the reference pictures (own noise up to 0.5 %): interpolation between cells and the
/// number of directions.
pub const PICTURE_RECORDS_L2: f64 = 2e-2;

/// As [`PICTURE_RECORDS_L2`], with a phase function that six bands hold to gⁱ, g = 0.5: the first band left out weighs
/// 1.6 %.
pub const PICTURE_PHASE_L2: f64 = 3e-2;

/// Coefficients of the environment against the reference's, which were summed over an eight times finer grid in f64.
pub const ENVIRONMENT_COEFFICIENTS: f64 = 1e-4;

/// [`STAGE_L2`], widened for a device whose filter between texels has few bits.
pub fn stage_l2(info: &DeviceInfo) -> f64 {
    STAGE_L2 + 0.5f64.powi(info.filter_bits as i32)
}
