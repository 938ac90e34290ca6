//! Every tolerance of the suite, with its reason.

use airlight::device::DeviceInfo;

/// How far found values may be from expected ones, and why that far.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerance {
    /// What results and reports call it.
    pub name: &'static str,
    /// The largest relative L2 error.
    pub relative_l2: f64,
    /// The largest error of one value as a share of the largest expected value; infinite where none is asked for.
    pub peak: f64,
    /// Which roundings, or which order of quadrature, it leaves room for.
    pub reason: &'static str,
}

impl Tolerance {
    /// The same with `more` added to the relative L2 error.
    pub fn plus(self, more: f64) -> Self {
        Self { relative_l2: self.relative_l2 + more, ..self }
    }

    /// The same, widened for a device whose filter between texels has few bits.
    pub fn filtered(self, info: &DeviceInfo) -> Self {
        self.plus(0.5f64.powi(info.filter_bits as i32))
    }
}

/// Makes the constants and [`ALL`].
macro_rules! tolerances {
    ($($(#[$doc:meta])* $id:ident { $l2:expr, $peak:expr, $reason:expr })*) => {
        $($(#[$doc])* pub const $id: Tolerance =
            Tolerance { name: stringify!($id), relative_l2: $l2, peak: $peak, reason: $reason };)*

        /// Every tolerance.
        pub const ALL: &[&Tolerance] = &[$(&$id),*];
    };
}

tolerances! {
    /// What is copied, picked or counted.
    EXACT { 0.0, 0.0, "Nothing is computed: values are copied, picked or counted." }

    /// A stage in f32 against its twin in f64.
    STAGE { 1e-5, 5e-3,
        "f32 against f64: places in index space are good to 2⁻²³ of some ten voxels and sums run over a few hundred \
         terms, about 10⁻⁶; a cancelled or contracted product is of the same size. Worst value: a ray whose length is \
         a whole number of steps to the last digit may take one step more in f32, which moves its samples and costs \
         one pixel the error of the quadrature itself, a few thousandths on the coarse grids here." }

    /// Light that goes through matrices, and is put together from them.
    MATRICES { 1e-5, 1e-5,
        "Sums of up to 2562 products of either sign in f32, one after another: n roundings of 2⁻²⁵ at random are √n · 3·10⁻⁸ of \
         the sum of squares, 2·10⁻⁶. Directions to an eye some ten cells away are good to 10⁻⁷, which ten bands make 10⁻⁶." }

    /// Paths that take the same decisions as their twins.
    PATHS { 2e-4, 1e-2,
        "Places are good to 2⁻²³ of some ten voxels and of some metres. A scattering turns what is off in a direction into a \
         place, a density and a cosine: of up to two scatterings and a light beside them 10⁻⁵ is left, more on a glossy wall and \
         where a light falls off. What parts by more than 5·10⁻⁴ counts as another path." }

    /// Light that photons leave that take the same decisions as their twins.
    PHOTONS { 2e-4, 2e-3,
        "Values are integers of some hundred to some ten thousand, rounded by the same draws: places and directions after up to four \
         scatterings are off by 10⁻⁵, which moves lengths within cells by as much and a few integers by one." }

    /// Light that a hundred thousand photons leave, against integrals or other photons.
    PHOTON_NOISE { 0.025, 0.05,
        "A cell is crossed by some ten thousand of a hundred thousand photons, whose lengths within it differ by as much as \
         their mean, and so do moments of a sign with what cancels: 1 to 2 %. Integrals over points and directions add a few thousandths." }

    /// Where rays meet triangles.
    HITS { 1e-5, 1e-4,
        "Places of corners and of the eye, good to 2⁻²⁴ of some metres, a dot product of three terms, and a quotient of \
         areas: 10⁻⁶, and at most ten times that where a triangle is seen at a slant." }

    /// As [`HITS`], from more than a kilometre away.
    HITS_FAR { 5e-4, 5e-3,
        "Directions are good to 2⁻²⁴, which 1.6 km make 10⁻⁴ m on a ball of 0.22 m: normals turn by 5·10⁻⁴, more toward \
         its rim." }

    /// As [`STAGE`], of light as of surfaces on a device that may round a product and a sum as one.
    CONTRACTED_NORMALS { 5e-5, 5e-3,
        "A normal is a difference of six densities, which are good to 2⁻²³ of themselves: down to a change of 10⁻⁵ of the \
         density it has a direction, good to a hundredth where it is least. Few samples of a picture lie where it is so level: \
         6·10⁻⁶ of a picture where each operation rounds once, and 2·10⁻⁵ as measured where products and sums are rounded as one." }

    /// As [`STAGE`], of means.
    MEAN { 1e-5, 1e-5, "Means of up to a few hundred voxels in f32." }

    /// What the values of a grid mean.
    CLASSIFY { 1e-5, 1e-5,
        "f32 against f64: places between points are quotients of differences of some hundreds, good to 10⁻⁶ where 256 points stand \
         every 16 and values are good to 10⁻⁴, and products of three numbers." }

    /// Density that is made on the device, against its twin.
    INJECT { 1e-5, 1e-5,
        "f32 against f64: places are good to 2⁻²⁴ of half a metre, which Gaussians of up to 40/m and fog of 7 falloffs a \
         metre turn into 2·10⁻⁶, and sums run over up to a thousand terms." }

    /// As [`INJECT`], of noise.
    INJECT_NOISE { 1e-4, 1e-3,
        "Places are up to 256 cells, good to 1.5·10⁻⁵ of one after each of three sums; each of five octaves changes by \
         about one a cell, at the steepest by three, and the contrast of three is as much again: 6·10⁻⁵ of values about one, \
         and at the worst 10⁻³." }

    /// Whole pictures against the processor's.
    FRAME { 1e-5, f64::INFINITY,
        "Devices decide alike and compute in 32-bit floats: they differ by units in the last place (6·10⁻⁸ each) in \
         exp, in angles and in contraction, 5·10⁻⁷ as measured. Twenty times that leaves room for drivers whose exp and \
         division are only as good as WGSL and OpenCL ask, and is far below what a mistake of placement costs on these \
         scenes (a step or a cell off by one: per cents)." }

    /// As [`FRAME`], of records that are not interpolated.
    FRAME_NEAREST { 1e-3, f64::INFINITY,
        "A sample within a rounding of the border of two cells takes either one's radiance, which differ by some tens of \
         per cents: that moves one pixel by the share of one of its steps, 2·10⁻⁴ of the picture as measured." }

    /// The same picture by kernels of two builds, on a device that may round a product and a sum as one or whose texture units
    /// interpolate.
    CONTRACTED { 1e-6, 1e-5,
        "One build rounds once where another rounds twice: that moves places by 2⁻²⁴ of up to a hundred voxels in a few \
         samples, and pictures by 10⁻⁸ as measured." }

    /// The same picture with other texels where they weigh nothing, by texture units.
    WEIGHTLESS { 1e-6, 1e-5,
        "A texture unit is told places as shares of the texture, so that a texel one away may weigh a last bit in place of nothing: \
         single values of a picture differ in their last bit as measured." }

    /// Pictures of a homogeneous medium without a shadow (Beer–Lambert, emission).
    CLOSED { 1e-5, 1e-5, "Nothing but f32 along some hundred steps, where the steps themselves are exact." }

    /// A surface that a light of closed form lights through homogeneous fog.
    LAMP { 2e-5, 1e-4,
        "f32 along two ways of some metres: places are good to 10⁻⁶ m, which 1/r² within half a metre of the lamp doubles, and a \
         lobe of exponent 7 makes sevenfold." }

    /// Single scattering beside a shadow whose edges fall between steps.
    SHADOW_EDGE { 1e-2, f64::INFINITY,
        "A ray's lit parts end between its samples, up to half a step off at each edge: steps of 0.05 of 1/64 of the box \
         are 2 mm of ways of some metres, 0.1 %. Texels of a map of 256 across a plate of 1.4 m are 6 mm, and their ramp is \
         centred on the edge: less than 1 % of a ray's light at a slant." }

    /// A room with a medium and a lamp inside against brute force.
    CORNELL_BOX { 1e-4, f64::INFINITY,
        "Each ray takes 400 steps, of which one is cut at each edge of a shadow: at most half a step's light is too \
         much or too little, 10⁻³ of what the medium sends along a ray, of either sign from pixel to pixel, 2·10⁻⁵ of \
         the picture as measured. Places at the walls are good to 10⁻⁶ m." }

    /// Single scattering in a homogeneous box, by steps of 1/64 of its shortest side.
    LIT_BOX { 2e-3, f64::INFINITY,
        "The midpoint rule is of second order, (στ/64)²/24 per step, but the way to the light ends at a wall: half a \
         step either way, at random, of a column of some tens of steps. Over a picture that leaves about 10⁻³." }

    /// A thin medium in a uniform environment.
    THIN { 2e-3, f64::INFINITY,
        "The first order in the depth of the medium's own shadow, which the closed form leaves out, for an optical \
         depth of 10⁻³ across. Toward the eye, in addition, the phase function taken at the directions and not \
         integrated over their pixels." }

    /// Contents that are equal but for the place of the directions in their pixels.
    CONTENT { 5e-4, 5e-4,
        "Directions stand at the centre of their pixels or at the mean of the light: with both at the centres the \
         contents differ by 3·10⁻⁶, as they are by 2.4·10⁻⁴, and devices change nothing of that." }

    /// Records in cells of half a voxel against brute force.
    BRUTE_HALF_VOXEL { 1.5e-2, f64::INFINITY,
        "Interpolation between cells, of second order, of a density that is noise from voxel to voxel: 3.2 % at cells \
         of a voxel, 1.1 % at half. Finer directions, environment and view steps move it by a tenth." }

    /// As [`BRUTE_HALF_VOXEL`], in cells of less than a quarter of a voxel.
    BRUTE_QUARTER_VOXEL { 5e-3, f64::INFINITY,
        "Interpolation between cells of less than a quarter of a voxel: 0.38 %." }

    /// Direct lights against brute force.
    BRUTE_DIRECT { 3e-3, f64::INFINITY, "The midpoint rule at a quarter of a voxel a step, against exact columns." }

    /// Transmittance against the reference pictures, relative to their RGB.
    PICTURE_TRANSMITTANCE { 1e-3, f64::INFINITY,
        "The pictures' own quadrature is exact to 10⁻⁸; ours takes 16 sub-pixel positions instead of all of the pixel." }

    /// Lights and emission against the reference pictures.
    PICTURE_DIRECT { 5e-3, f64::INFINITY,
        "Sub-pixel positions and steps; the pictures' own error is up to 6·10⁻⁵." }

    /// Lights with propagated shadows against the reference pictures.
    PICTURE_OPACITY { 5e-3, f64::INFINITY,
        "Interpolation between cells of 64 or 96 along the longest side of 72 voxels, in the field and on the way to it: \
         0.07 to 0.19 %." }

    /// Propagated shadows against marched ones, in 64 cells along the longest side of 72 voxels.
    PROPAGATED { 5e-3, f64::INFINITY,
        "Interpolation between cells of a little more than a voxel, and the midpoint rule at a step of a voxel in the march \
         toward the light." }

    /// Lights with propagated shadows against brute force, in cells of half a voxel.
    BRUTE_OPACITY { 1e-2, f64::INFINITY,
        "Interpolation between cells of half a voxel, of a density that is noise from voxel to voxel: 0.5 %." }

    /// Columns by short characteristics, in cells of a voxel, against the closed form of a sum of Gaussians.
    COLUMNS { 1e-2, f64::INFINITY,
        "Interpolation between cells, once for each plane that the way crosses, and between voxels: 0.2 to 0.96 %, the \
         most toward lights outside, as more planes are crossed." }

    /// Columns of Gaussians in closed form against the reference's.
    CLOSED_COLUMNS { 1e-12, 1e-12, "f64 on both sides, sums of forty differences of error functions." }

    /// Records of 40 cells against the reference pictures.
    PICTURE_RECORDS { 2e-2, f64::INFINITY,
        "Interpolation between cells and the number of directions; the pictures' own noise is up to 0.5 %." }

    /// As [`PICTURE_RECORDS`], with a phase function that six bands hold to gⁱ, g = 0.5.
    PICTURE_PHASE { 3e-2, f64::INFINITY,
        "Interpolation between cells and the number of directions; the first band left out weighs 1.6 %." }

    /// A furnace of radiance 1, over grids of as many cells in every estimator.
    FURNACE { 1e-2, f64::INFINITY,
        "First and further orders are swept over one grid and add up to 1 there; left is what convergence to 10⁻³ leaves of \
         light that is scattered dozens of times, and what interpolation of the march's own extinction between steps costs." }

    /// Light sent one way and back.
    RECIPROCITY { 2e-2, f64::INFINITY,
        "Sweeps interpolate against the light, which is not the same the other way round, and moments of three bands blur \
         directions alike both ways." }

    /// All orders, counted and converged.
    CONVERGED { 2e-3, f64::INFINITY,
        "What a tolerance of 10⁻⁴ leaves where a further order is up to nine tenths of the one before: ten times that." }

    /// Records by sweeps against records by marches, at the same cells along the same directions.
    SWEPT { 1.5e-2, f64::INFINITY,
        "Transmittance is interpolated once for each plane of cells that a direction crosses, and means over cells of more \
         than a voxel stand for the density." }

    /// All orders of a light against the path traced reference, over blocks of 8 × 8 pixels.
    MULTIPLE_LIGHT { 1.5e-2, f64::INFINITY,
        "48 directions and cells of nearly two voxels carry what is scattered, 0.8 % for a plain prototype; the reference's own \
         noise over blocks is 0.3 %." }

    /// As [`MULTIPLE_LIGHT`], of an environment.
    MULTIPLE_SKY { 2.5e-2, f64::INFINITY,
        "48 directions carry the environment's light too, whose sun is smaller than a pixel of theirs: 1.1 to 2.5 % for a plain \
         prototype." }

    /// As [`MULTIPLE_SKY`], with a phase function of g = 0.5.
    MULTIPLE_FORWARD { 4e-2, f64::INFINITY,
        "Three bands hold an eighth of the phase function's peak as light that goes on; the rest as [`MULTIPLE_SKY`]." }

    /// Unscattered light of a transfer against the reference's, which has the same four bands.
    TRANSFER_DIRECT { 1e-2, f64::INFINITY,
        "What is asked of single scattering. Cells of 1.2 voxels are interpolated, which costs half a percent; sweeps \
         blur light across its direction by as much." }

    /// All orders of a transfer against the reference's, in few bands and on a coarse grid.
    TRANSFER_SKY { 2.5e-2, f64::INFINITY,
        "Six bands hold the sky but for half a percent of its picture. Cells of three voxels cost up to two percent at the rim \
         of the cloud; the published figures are of finer grids and more functions (docs/transfers.md)." }

    /// Photons against ordinates.
    TRANSFER_PHOTONS { 2.5e-2, f64::INFINITY,
        "Noise of some thousand photons a cell is under a percent; the rest is what cells of a voxel of rough noise cost either, \
         which falls from 3 % at cells of 1.4 voxels to under 1.5 % at half of one." }

    /// Clusters against all matrices.
    TRANSFER_COMPRESSED { 1e-2, f64::INFINITY, "What is asked of 128 clusters on a large grid; here there are as many rows a cluster." }

    /// Toward the eye from each cell against along each ray.
    TRANSFER_VIEWS { 1e-2, f64::INFINITY,
        "A cell is a twelfth of a box that fills a third of the picture: directions within it differ by a degree, and so do functions \
         of three bands." }

    /// Coefficients of the environment against the reference's; the largest is of the order of one.
    ENVIRONMENT_COEFFICIENTS { 1e-4, 1e-4,
        "The reference's were summed over an eight times finer grid in f64." }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_named_once_and_says_why() {
        for (i, t) in ALL.iter().enumerate() {
            assert!(t.reason.ends_with('.') && t.relative_l2 >= 0.0 && t.peak >= 0.0, "{t:?}");
            assert!(ALL[..i].iter().all(|other| other.name != t.name), "{} stands twice", t.name);
        }
    }
}
