//! Fractal gradient noise, as a medium of its own and as detail of a grid.

use std::sync::Arc;

use glam::{DVec3, UVec3};

use super::{
    DensitySource, GridMedium, LARGEST, Lattice, Medium, MediumError, OpticsField, OpticsFields, demand, demand_density,
};
use crate::Version;
use crate::random::{hash, scatter};

/// Fractal gradient noise (K. Perlin 1985, with the fade and the gradients of 2002).
///
/// An octave is a lattice of cells of edge `scale` / 2^o. Each corner has a gradient, one of the sixteen of Perlin's
/// improved noise by the lower four bits of [`hash`] over (x, y, z, seed of the octave), x, y, z the corner's indices
/// modulo [`FractalNoise::PERIOD`] · 2^o, and the seed of the octave [`FractalNoise::seed_of`]. The octave's value is
/// the sum over the eight corners of gradient · (point - corner), weighed with 6t⁵ - 15t⁴ + 10t³ along each axis. It
/// lies within ±1.04, is 0 at corners and has the mean 0. Octave o counts 2^-o times:
///
/// n(x) = Σ_o 2^-o octave_o(x / scale · 2^o).
///
/// n repeats after `scale` · [`FractalNoise::PERIOD`] metres along each axis of the world, and more octaves add finer
/// detail without a change of the coarse. What multiplies a density is the factor max(0, 1 + `contrast` · n).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FractalNoise {
    scale: f64,
    octaves: u32,
    seed: u32,
    contrast: f64,
}

impl FractalNoise {
    /// Cells of the first octave after which the noise repeats.
    pub const PERIOD: u32 = 256;
    /// The most octaves: the finest cell's index then still is a whole number in f32.
    pub const MAX_OCTAVES: u32 = 16;
    /// The largest contrast.
    pub const MAX_CONTRAST: f64 = 1e3;

    /// Noise whose largest features are `scale` metres wide.
    ///
    /// # Errors
    /// A scale that is not a finite number above 0, octaves out of 1 to [`FractalNoise::MAX_OCTAVES`], a contrast out
    /// of 0 to [`FractalNoise::MAX_CONTRAST`].
    pub fn new(scale: f64, octaves: u32, seed: u32, contrast: f64) -> Result<Self, MediumError> {
        demand("scale", scale, "a finite number above 0", scale.is_finite() && scale > 0.0)?;
        demand("octaves", octaves.into(), "from 1 to 16", (1..=Self::MAX_OCTAVES).contains(&octaves))?;
        demand("contrast", contrast, "from 0 to 1000", (0.0..=Self::MAX_CONTRAST).contains(&contrast))?;
        Ok(Self { scale, octaves, seed, contrast })
    }

    /// Width of the largest features, metres.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Number of octaves.
    pub fn octaves(&self) -> u32 {
        self.octaves
    }

    /// The seed.
    pub fn seed(&self) -> u32 {
        self.seed
    }

    /// The contrast.
    pub fn contrast(&self) -> f64 {
        self.contrast
    }

    /// Seed of the gradients of an octave: scatter(seed + (octave + 1) · 0x9e3779b9) modulo 2³².
    pub fn seed_of(seed: u32, octave: u32) -> u32 {
        scatter(seed.wrapping_add((octave + 1).wrapping_mul(0x9e37_79b9)))
    }

    /// n at a point given in cells of the first octave.
    pub fn value(&self, cells: DVec3) -> f64 {
        (0..self.octaves)
            .map(|o| {
                let fineness = f64::from(1u32 << o);
                octave(cells * fineness, Self::PERIOD << o, Self::seed_of(self.seed, o)) / fineness
            })
            .sum()
    }

    /// What multiplies a density at a point of the world: max(0, 1 + contrast · n).
    pub fn factor(&self, p: DVec3) -> f64 {
        (1.0 + self.contrast * self.value(p / self.scale)).max(0.0)
    }
}

/// One octave at `p` in cells, which repeats after `period` cells (a power of two).
fn octave(p: DVec3, period: u32, seed: u32) -> f64 {
    let low = p.floor();
    let t = p - low;
    // Positive before the cast, so that it wraps as the lattice does.
    let wrapped = low - (low / f64::from(period)).floor() * f64::from(period);
    let at = wrapped.to_array().map(|v| v as u32);
    let weight = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let mut sum = 0.0;
    for corner in 0..8u32 {
        let high = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let [x, y, z] = [0, 1, 2].map(|a| (at[a] + high[a]) % period);
        let share: f64 = (0..3).map(|a| if high[a] == 1 { weight(t[a]) } else { weight(1.0 - t[a]) }).product();
        let gradient = DVec3::from_array(GRADIENTS[(hash([x, y, z, seed]) & 15) as usize].map(f64::from));
        sum += share * gradient.dot(t - high.as_dvec3());
    }
    sum
}

/// The middles of a cube's edges; four of them twice.
const GRADIENTS: [[i8; 3]; 16] = [
    [1, 1, 0],
    [-1, 1, 0],
    [1, -1, 0],
    [-1, -1, 0],
    [1, 0, 1],
    [-1, 0, 1],
    [1, 0, -1],
    [-1, 0, -1],
    [0, 1, 1],
    [0, -1, 1],
    [0, 1, -1],
    [0, -1, -1],
    [1, 1, 0],
    [0, -1, 1],
    [-1, 1, 0],
    [0, -1, -1],
];

/// A box of noise: ρ = `density` · max(0, 1 + contrast · n), whose mean is about `density` up to a contrast of 2.
#[derive(Clone, Debug)]
pub struct Noise {
    lattice: Lattice,
    density: f64,
    noise: FractalNoise,
    version: Version,
}

impl Noise {
    /// Noise on `lattice`.
    ///
    /// # Errors
    /// A density that is negative or above [`LARGEST`].
    pub fn new(density: f64, noise: FractalNoise, lattice: Lattice) -> Result<Self, MediumError> {
        demand_density("density", density)?;
        Ok(Self { lattice, density, noise, version: Version::fresh() })
    }

    /// The density where n is 0.
    pub fn density(&self) -> f64 {
        self.density
    }

    /// The noise.
    pub fn noise(&self) -> &FractalNoise {
        &self.noise
    }
}

impl Medium for Noise {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        let most = f64::from(LARGEST);
        self.lattice.fill_slice(k, out, |p, _| (self.density * self.noise.factor(p)).min(most));
    }

    fn source(&self) -> DensitySource<'_> {
        DensitySource::Noise(self)
    }
}

/// A grid whose density is multiplied by noise for detail: ρ = ρ_grid · max(0, 1 + contrast · n). Where the grid is
/// empty it stays empty. What scatters and what absorbs are multiplied alike; a grid of emission is left as it is.
#[derive(Clone, Debug)]
pub struct Detailed {
    grid: Arc<GridMedium>,
    noise: FractalNoise,
    version: Version,
}

impl Detailed {
    /// `grid` with detail.
    pub fn new(grid: Arc<GridMedium>, noise: FractalNoise) -> Self {
        Self { grid, noise, version: Version::fresh() }
    }

    /// The grid without detail.
    pub fn grid(&self) -> &GridMedium {
        &self.grid
    }

    /// The noise.
    pub fn noise(&self) -> &FractalNoise {
        &self.noise
    }

    /// A field of the grid, multiplied as the density is.
    fn detailed<'a>(&'a self, field: OpticsField<'a>) -> OpticsField<'a> {
        OpticsField::new(self.version, move |k, out| {
            field.slice(k, out);
            let dims = self.lattice().dims();
            let mut factor = vec![0.0f32; dims.x as usize * dims.y as usize];
            self.lattice().fill_slice(k, &mut factor, |p, _| self.noise.factor(p));
            let values = out.len() / factor.len();
            for (voxel, factor) in out.chunks_exact_mut(values).zip(factor) {
                voxel.iter_mut().for_each(|v| *v = (*v * factor).min(LARGEST));
            }
        })
    }
}

impl Medium for Detailed {
    fn lattice(&self) -> &Lattice {
        self.grid.lattice()
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        self.grid.density_slice(k, out);
        let most = f64::from(LARGEST);
        self.lattice().fill_slice(k, out, |p, grid| {
            if grid == 0.0 { 0.0 } else { (f64::from(grid) * self.noise.factor(p)).min(most) }
        });
    }

    fn source(&self) -> DensitySource<'_> {
        DensitySource::Detailed(self)
    }

    fn optics_fields(&self) -> OpticsFields<'_> {
        let fields = self.grid.optics_fields();
        let detailed = |field: Option<_>| field.map(|field| self.detailed(field));
        let (scattering, seen) = (detailed(fields.scattering), detailed(fields.seen));
        if self.grid.has_emission() {
            return OpticsFields { scattering, seen, ..fields };
        }
        let (emission, emission_color) = (detailed(fields.emission), detailed(fields.emission_color));
        OpticsFields { scattering, emission, emission_color, seen }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;

    use crate::media::Grid;

    fn noise(octaves: u32, seed: u32) -> FractalNoise {
        FractalNoise::new(0.3, octaves, seed, 2.0).unwrap()
    }

    /// Points without a pattern.
    fn points(n: u32) -> impl Iterator<Item = DVec3> {
        (0..n).map(|i| each(|a| 9.0 * f64::from(crate::random::unit(hash([i, a, 5])))))
    }

    fn each(f: impl Fn(u32) -> f64) -> DVec3 {
        DVec3::new(f(0), f(1), f(2))
    }

    #[test]
    fn noise_repeats_after_its_period_and_not_before() {
        let noise = noise(3, 11);
        let period = f64::from(FractalNoise::PERIOD);
        let mut apart = 0;
        for p in points(50) {
            for shift in [DVec3::X, DVec3::Y, -DVec3::Z] {
                // Adding the period rounds the place by 2⁻⁴⁴.
                assert!((noise.value(p) - noise.value(p + shift * period)).abs() < 1e-11);
                apart += u32::from((noise.value(p) - noise.value(p + shift * period / 2.0)).abs() > 1e-3);
            }
        }
        assert!(apart > 140, "{apart} of 150 differ after half a period");
    }

    #[test]
    fn an_octave_is_smooth_bounded_and_balanced() {
        let one = noise(1, 3);
        let (mut sum, mut most) = (0.0, 0.0f64);
        let n = 20_000;
        for p in points(n) {
            let v = one.value(p);
            sum += v;
            most = most.max(v.abs());
            // The steepest slope of an octave is below 4 a cell.
            assert!((one.value(p + DVec3::splat(1e-6)) - v).abs() < 7e-6);
        }
        assert!(most > 0.7 && most < 1.04, "{most}");
        // Standard deviation 0.26 over some 500 cells that do not depend on each other.
        assert!((sum / f64::from(n)).abs() < 0.04, "{}", sum / f64::from(n));
        for corner in [DVec3::ZERO, DVec3::new(3.0, -2.0, 7.0)] {
            assert_eq!(one.value(corner), 0.0);
        }
        // The slope at a corner is its gradient.
        let h = 1e-6;
        let slope = each(|a| one.value(DVec3::AXES[a as usize] * h) / h);
        let gradient = GRADIENTS[(hash([0, 0, 0, FractalNoise::seed_of(3, 0)]) & 15) as usize];
        assert!((slope - DVec3::from_array(gradient.map(f64::from))).length() < 1e-4, "{slope} {gradient:?}");
    }

    #[test]
    fn octaves_add_and_seeds_differ() {
        for p in points(20) {
            let finer = noise(2, 7).value(p) - noise(1, 7).value(p);
            let second = octave(p * 2.0, 2 * FractalNoise::PERIOD, FractalNoise::seed_of(7, 1));
            assert!((finer - second / 2.0).abs() < 1e-14);
            assert!(noise(1, 7).value(p) != noise(1, 8).value(p));
        }
    }

    #[test]
    fn density_is_never_negative_and_detail_keeps_what_is_empty() {
        let lattice = Lattice::of_cells(12, DVec3::ZERO, DVec3::new(1.0, 2.0, 3.0)).unwrap();
        let medium = Noise::new(3.0, FractalNoise::new(0.4, 4, 1, 8.0).unwrap(), lattice.clone()).unwrap();
        let dims = lattice.dims();
        let mut slice = vec![0.0; (dims.x * dims.y) as usize];
        let (mut empty, mut full) = (0, 0);
        for k in 0..dims.z {
            medium.density_slice(k, &mut slice);
            assert!(slice.iter().all(|v| *v >= 0.0));
            empty += slice.iter().filter(|v| **v == 0.0).count();
            full += slice.iter().filter(|v| **v > 3.0).count();
        }
        assert!(empty > 20 && full > 20, "{empty} {full}");

        let values = (0..24).map(|i| if i % 3 == 0 { 0.0 } else { 2.0 }).collect();
        let grid = Grid::dense(UVec3::new(2, 3, 4), DAffine3::from_scale(DVec3::splat(0.7)), values).unwrap();
        let grid = Arc::new(GridMedium::new(Arc::new(grid), None).unwrap());
        let noise = FractalNoise::new(0.4, 4, 1, 1.0).unwrap();
        let detailed = Detailed::new(grid.clone(), noise);
        let mut slice = vec![0.0; 6];
        detailed.density_slice(1, &mut slice);
        for (n, &found) in slice.iter().enumerate() {
            let p = DVec3::new((n % 2) as f64, (n / 2) as f64, 1.0) * 0.7;
            let expected = if (n + 6) % 3 == 0 { 0.0 } else { 2.0 * noise.factor(p) };
            assert!((f64::from(found) - expected).abs() < 1e-6, "{n}: {found} {expected}");
        }
    }

    #[test]
    fn numbers_out_of_range_are_named() {
        for (scale, octaves, contrast, what) in [
            (0.0, 1, 1.0, "scale"),
            (f64::NAN, 1, 1.0, "scale"),
            (1.0, 0, 1.0, "octaves"),
            (1.0, 17, 1.0, "octaves"),
            (1.0, 1, -0.1, "contrast"),
        ] {
            let error = FractalNoise::new(scale, octaves, 0, contrast).unwrap_err();
            assert!(error.to_string().starts_with(what), "{error}");
        }
    }
}
