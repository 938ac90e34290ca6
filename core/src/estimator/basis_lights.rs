//! Lights of a basis carried through a medium, a few at a time: what a transfer is made of.

use super::ordinates::Carried;
use super::scatter::Scattering;
use super::{MediumFields, Y0};
use crate::Version;
use crate::basis::{Basis, SphericalHarmonics, healpix};
use crate::device::Buf;
use crate::exec::{Part, Plan};
use crate::scene::{Orders, Scene, Sweeps};

/// Lights that are carried at once: one in each channel of a grey medium.
pub(crate) const TOGETHER: usize = 3;

/// Points along a pixel's side over which products of functions are summed.
const POINTS: u32 = 4;

/// Where the functions of a basis shine from, cut into the pixels of [`healpix`].
pub(crate) struct BasisLights {
    version: Version,
    nside: u32,
    coefficients: usize,
    /// Of each function the pixels that it reaches, rising.
    pixels: Vec<Vec<u32>>,
    /// ∫ b_k Y_j dω over each of them, laid out \[pixel\]\[j\].
    integrals: Vec<Vec<f32>>,
}

/// What is carried at once.
pub(crate) struct Batch {
    /// Its number among those of the same lights.
    pub(crate) number: usize,
    /// The function of each channel; the same in all where the medium has colours.
    pub(crate) functions: [Option<usize>; TOGETHER],
}

impl BasisLights {
    /// Those of `basis` over 12·`nside`² pixels, for moments of so many bands.
    pub(crate) fn new(basis: &dyn Basis, nside: u32, harmonics: &SphericalHarmonics) -> Self {
        let fine = POINTS * nside;
        let points = healpix::directions(fine);
        let mut order: Vec<(u32, u32)> =
            (0u32..).zip(&points).map(|(at, &d)| (healpix::pixel(nside, d) as u32, at)).collect();
        order.sort_unstable();
        let coefficients = harmonics.count();
        let mut values = vec![0.0; coefficients];
        let (mut pixels, mut integrals) = (vec![Vec::new(); basis.count()], vec![Vec::new(); basis.count()]);
        for (pixel, at) in order {
            let d = points[at as usize];
            harmonics.eval(d, &mut values);
            basis.each(d, &mut |k, value| {
                let (pixels, integrals): (&mut Vec<u32>, &mut Vec<f32>) = (&mut pixels[k], &mut integrals[k]);
                if pixels.last() != Some(&pixel) {
                    pixels.push(pixel);
                    integrals.resize(pixels.len() * coefficients, 0.0);
                }
                let first = (pixels.len() - 1) * coefficients;
                let weight = value * healpix::weight(fine);
                integrals[first..].iter_mut().zip(&values).for_each(|(sum, y)| *sum += (weight * y) as f32);
            });
        }
        Self { version: Version::fresh(), nside, coefficients, pixels, integrals }
    }

    /// Bytes that such lights take at the most.
    pub(crate) fn bytes(functions: u64, nside: u32, coefficients: u64, local: bool) -> u64 {
        let pixels = healpix::count(nside) as u64;
        // A discrete function reaches some fifteen of four pixels a function, and those at their edges.
        let reached = if local { 16 * pixels } else { functions * pixels };
        reached.saturating_mul(4 * (coefficients + 1)) + healpix::count(POINTS * nside) as u64 * 32
    }

    /// Functions that shine from a pixel, in the mean.
    pub(crate) fn overlap(&self) -> f64 {
        let reached: usize = self.pixels.iter().map(Vec::len).sum();
        reached as f64 / healpix::count(self.nside) as f64
    }

    /// The most functions that shine from one pixel.
    pub(crate) fn most_overlap(&self) -> u32 {
        let mut counts = vec![0; healpix::count(self.nside)];
        self.pixels.iter().flatten().for_each(|&pixel| counts[pixel as usize] += 1);
        counts.into_iter().max().unwrap_or(0)
    }

    /// Of each pixel the functions of a range, numbered from its start, and their means over the pixel.
    pub(crate) fn by_pixel(&self, functions: std::ops::Range<u32>) -> Vec<Vec<(u32, f64)>> {
        let mut found = vec![Vec::new(); healpix::count(self.nside)];
        let whole = Y0 * healpix::weight(self.nside);
        for (light, k) in (0..).zip(functions) {
            let integrals = self.integrals[k as usize].iter().step_by(self.coefficients);
            for (&pixel, &integral) in self.pixels[k as usize].iter().zip(integrals) {
                found[pixel as usize].push((light, f64::from(integral) / whole));
            }
        }
        found
    }

    /// Pixels that any function of a batch reaches, and the weights of their light, laid out \[pixel\]\[j\]\[channel\].
    fn batch(&self, batch: &Batch) -> (Vec<u32>, Vec<f32>) {
        let of = |k: &usize| self.pixels[*k].iter().copied();
        let mut pixels: Vec<u32> = batch.functions.iter().flatten().flat_map(of).collect();
        pixels.sort_unstable();
        pixels.dedup();
        if pixels.is_empty() {
            // Functions that shine from nowhere: a sweep needs a direction.
            pixels.push(0);
        }
        let mut weights = vec![0.0; pixels.len() * self.coefficients * TOGETHER];
        for (channel, k) in batch.functions.iter().enumerate() {
            let Some(k) = k else { continue };
            for (pixel, integrals) in self.pixels[*k].iter().zip(self.integrals[*k].chunks_exact(self.coefficients)) {
                let Ok(at) = pixels.binary_search(pixel) else { continue };
                for (j, value) in integrals.iter().enumerate() {
                    weights[(at * self.coefficients + j) * TOGETHER + channel] = *value;
                }
            }
        }
        (pixels, weights)
    }

    /// Plans the moments of a batch's light at the cells, in planes \[j\]\[channel\]\[cell\]: as it comes in where `orders` is one,
    /// else with what is scattered.
    pub(crate) fn carry<'a>(
        &'a self,
        scene: &'a Scene,
        medium: &MediumFields,
        options: Sweeps,
        batch: &Batch,
        plan: &mut Plan<'a>,
    ) -> Buf<f32> {
        let setup = Scattering::new(options, scene, medium, TOGETHER as u32);
        let direct = options.orders == Orders::Count(1);
        // What goes on as if it had not been scattered counts with light that was not.
        let forward = if direct { 0.0 } else { setup.forward };
        let optics = setup.ordinates.coarsen("transfer cells", forward, plan);
        let (pixels, weights) = self.batch(batch);
        let content = (self.version, batch.number);
        let nside = self.nside;
        let count = pixels.len() as u32;
        let make = move || {
            let all = healpix::directions(nside);
            pixels.iter().map(|&pixel| all[pixel as usize]).collect()
        };
        let directions = setup.ordinates.directions("basis directions", count, &content, make, plan);
        let grey = setup.grey(forward);
        let of = Carried {
            optics,
            directions,
            channels: if grey { 1 } else { TOGETHER as u32 },
            grey,
            boundary: 1.0,
            emits: false,
            sources: None,
            weights: (plan.table("basis weights", weights), TOGETHER as u32),
            coefficients: setup.coefficients(),
            planar: true,
        };
        let unscattered = setup.swept("basis light", of, plan);
        if direct {
            return unscattered;
        }
        setup.solve(optics, vec![Part { light: unscattered, source: 1.0, out: 1.0 }], plan)
    }
}
