//! Integrals of an environment: on spherical harmonics, on any basis, and over HEALPix pixels.
//!
//! All are of the bilinear function that [`Environment::radiance`] looks up, scale and rotation included. With
//! φ = π + rotation - 2πu the function is piecewise linear in φ and in θ = πv. Over the sphere's azimuth its Fourier
//! coefficients are known in closed form: a sum of triangles 2π/W wide to each side of the texels' centres, so the
//! texels' discrete transform times (2π/W)·sinc²(πm/W).

use std::f64::consts::PI;
use std::ops::Range;

use glam::DVec3;
use rayon::prelude::*;
use rustfft::FftPlanner;
use rustfft::num_complex::Complex;

use super::Environment;
use super::cells::{CellGrid, Cells, in_blocks, neighbour_row, row_weights};
use crate::basis::quadrature::gauss_legendre;
use crate::basis::{Basis, SphericalHarmonics, healpix};

/// Linear sRGB (Rec. 709) to luminance.
pub(super) const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// The largest side of the cells of [`Environment::moments`], radians: a twentieth of the reach of the narrowest functions,
/// those of 2562 directions. Where cells are thin, at the poles, that leaves 10⁻³ of an integral.
const FINE: f64 = 3.1e-3;

/// Adds up moments of parts of the sphere.
fn add(moments: &mut [[f64; 3]], more: &[[f64; 3]]) {
    let pairs = moments.as_flattened_mut().iter_mut().zip(more.as_flattened());
    pairs.for_each(|(sum, more)| *sum += more);
}

impl Environment {
    /// The coefficients ∫ L Y_lm dω, RGB, at index l(l+1)+m. Exact to rounding; O(W·H·bands).
    pub fn project_sh(&self, basis: &SphericalHarmonics) -> Vec<[f64; 3]> {
        let bands = basis.bands() as usize;
        let h = self.image().height as usize;
        let rows = self.azimuthal_moments(bands);
        // Nodes that make a trigonometric polynomial of degree `bands` exact over half a row and over a whole one.
        let rule = gauss_legendre(6 + (bands as f64 * PI / h as f64).ceil() as usize);
        let mut coefficients = vec![[0.0; 3]; basis.count()];
        let part = |pieces: Range<usize>| {
            let mut coefficients = vec![DVec3::ZERO; basis.count()];
            let mut values = vec![0.0; basis.count()];
            for piece in pieces {
                // From the centre of the row above to the centre of the row below; half as long at the poles.
                let (above, below) = (piece.saturating_sub(1), piece.min(h - 1));
                let start = (piece as f64 - 0.5).max(0.0);
                let end = (piece as f64 + 0.5).min(h as f64);
                for &(node, weight) in &rule {
                    let row = 0.5 * (start + end) + 0.5 * (end - start) * node;
                    let fraction = row - (piece as f64 - 0.5);
                    let (sin, cos) = (PI * row / h as f64).sin_cos();
                    let weight = weight * 0.5 * (end - start) * PI / h as f64 * sin;
                    // At φ = 0 the functions with m ≥ 0 are their own polar factor.
                    basis.eval(DVec3::new(0.0, cos, sin), &mut values);
                    for m in 0..bands {
                        let [even, odd] = [0, 1]
                            .map(|i| weight * rows[above * bands + m][i].lerp(rows[below * bands + m][i], fraction));
                        for l in m..bands {
                            let polar = values[l * (l + 1) + m];
                            coefficients[l * (l + 1) + m] += polar * even;
                            if m > 0 {
                                coefficients[l * (l + 1) - m] += polar * odd;
                            }
                        }
                    }
                }
            }
            coefficients.into_iter().map(|c| c.to_array()).collect::<Vec<_>>()
        };
        in_blocks(h + 1, part, |more| add(&mut coefficients, &more));
        coefficients.into_iter().map(|c| (DVec3::from(c) * self.scale.as_dvec3()).to_array()).collect()
    }

    /// ∫ L b_k dω for every function of a basis, RGB: cells of at most 0.18° with their exact flux, and the functions
    /// at their middles. Σ_k over functions that sum to 1 is the exact flux of the whole.
    pub fn moments(&self, basis: &dyn Basis) -> Vec<[f64; 3]> {
        let mut moments = vec![[0.0; 3]; basis.count()];
        let grid = CellGrid::new(self, FINE);
        let part = |rows: Range<usize>| {
            let mut moments = vec![[0.0; 3]; basis.count()];
            grid.for_each(rows, |_, direction, flux| {
                basis.each(direction, &mut |k, v| (0..3).for_each(|c| moments[k][c] += flux[c] * v));
            });
            moments
        };
        in_blocks(grid.rows(), part, |more| add(&mut moments, &more));
        moments
    }

    /// ∫ L b_k dω over each pixel of [`healpix`], RGB, laid out \[pixel\]\[function\].
    ///
    /// Texels are cut into cells of at most an eighth of a pixel's side. A cell counts with its exact flux and with
    /// the functions at its middle, so the sum over the pixels of a constant function is exact: no light is lost.
    pub fn pixel_moments(&self, nside: u32, basis: &dyn Basis) -> Vec<[f64; 3]> {
        let functions = basis.count();
        let mut moments = vec![[0.0; 3]; healpix::count(nside) * functions];
        let Some(cells) = Cells::new(self, nside) else { return moments };
        let part = |rows: Range<usize>| {
            let mut moments = vec![[0.0; 3]; healpix::count(nside) * functions];
            let mut values = vec![0.0; functions];
            cells.for_each(rows, |cell| {
                basis.eval(cell.direction, &mut values);
                for &(pixel, share) in cell.shares {
                    let flux = cell.flux * share;
                    for (moment, value) in moments[pixel * functions..].iter_mut().zip(&values) {
                        moment[0] += flux.x * value;
                        moment[1] += flux.y * value;
                        moment[2] += flux.z * value;
                    }
                }
            });
            moments
        };
        in_blocks(cells.grid.rows(), part, |more| add(&mut moments, &more));
        moments
    }

    /// For each pixel of [`healpix`] the luminance-weighted mean direction of the light in it, a unit vector; the
    /// pixel's centre where it is dark. A sun smaller than a pixel is found where it stands.
    pub fn pixel_centroids(&self, nside: u32) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; healpix::count(nside)];
        let centers = healpix::directions(nside);
        let Some(cells) = Cells::new(self, nside) else { return centers };
        let part = |rows: Range<usize>| {
            let mut sums = vec![DVec3::ZERO; healpix::count(nside)];
            cells.for_each(rows, |cell| {
                let luminance = cell.flux.dot(LUMINANCE);
                for &(pixel, share) in cell.shares {
                    sums[pixel] += cell.direction * (luminance * share);
                }
            });
            sums
        };
        in_blocks(cells.grid.rows(), part, |more| {
            sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
        });
        sums.iter().zip(centers).map(|(sum, center)| sum.try_normalize().unwrap_or(center)).collect()
    }

    /// ∫ L dω / 4π, W m⁻² sr⁻¹.
    pub fn mean_radiance(&self) -> DVec3 {
        let h = self.image().height as usize;
        let rows = self.azimuthal_moments(1);
        let mut mean = DVec3::ZERO;
        for row in 0..h {
            for (i, weight) in row_weights(h, 1, row).into_iter().enumerate() {
                mean += weight * rows[neighbour_row(row, i, h)][0];
            }
        }
        // Both factors hold the 2π of the azimuth.
        mean / (8.0 * PI * PI) * self.scale.as_dvec3()
    }

    /// The largest radiance of each channel, W m⁻² sr⁻¹.
    pub fn max_radiance(&self) -> DVec3 {
        let largest = self.image().texels.iter().fold([0f32; 3], |m, t| [0, 1, 2].map(|i| m[i].max(t[i])));
        DVec3::from(largest.map(f64::from)) * self.scale.as_dvec3()
    }

    /// φ where u = 0.
    pub(super) fn azimuth_of_seam(&self) -> f64 {
        PI + self.rotation.to_radians()
    }

    /// \[row\]\[m\]: ∫ L cos mφ dφ and ∫ L sin mφ dφ along the row's centre, before scale.
    fn azimuthal_moments(&self, orders: usize) -> Vec<[DVec3; 2]> {
        let image = self.image();
        let w = image.width as usize;
        // A turn of the sphere, to the middle of the first texel, turns every order by a multiple of its angle.
        let first = self.azimuth_of_seam() - PI / w as f64;
        let factors: Vec<Complex<f64>> = (0..orders)
            .map(|m| {
                let x = PI * m as f64 / w as f64;
                let sinc = if m == 0 { 1.0 } else { x.sin() / x };
                Complex::from_polar(2.0 * PI / w as f64 * sinc * sinc, m as f64 * first)
            })
            .collect();
        let transform = FftPlanner::new().plan_fft_forward(w);
        let mut moments = vec![[DVec3::ZERO; 2]; image.height as usize * orders];
        let rows = moments.par_chunks_exact_mut(orders).zip(image.texels.par_chunks_exact(w));
        rows.for_each_init(
            || (vec![Complex::default(); w], vec![Complex::default(); transform.get_inplace_scratch_len()]),
            |(values, scratch), (row, texels)| {
                for c in 0..3 {
                    values.iter_mut().zip(texels).for_each(|(value, texel)| *value = f64::from(texel[c]).into());
                    transform.process_with_scratch(values, scratch);
                    for ((moment, factor), m) in row.iter_mut().zip(&factors).zip(0..) {
                        let found = factor * values[m % w];
                        (moment[0][c], moment[1][c]) = (found.re, found.im);
                    }
                }
            },
        );
        moments
    }

    /// Visits cells of at most `size` radians that are not dark: the direction in the middle of each, and the exact
    /// integral of the radiance over it, W m⁻².
    pub(super) fn for_each_flux(&self, size: f64, mut visit: impl FnMut(DVec3, DVec3)) {
        let grid = CellGrid::new(self, size);
        grid.for_each(0..grid.rows(), |_, direction, flux| visit(direction, flux));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Image;
    use glam::{DMat3, Vec3};

    fn noise(i: usize, seed: f64) -> f32 {
        ((i as f64 * 12.9898 + seed).sin() * 43758.5453).fract().abs() as f32
    }

    /// Asymmetric, no relation between the axes, a bright texel.
    fn picture(width: u32, height: u32) -> Environment {
        let count = (width * height) as usize;
        let mut texels: Vec<[f32; 3]> = (0..count).map(|i| [noise(i, 0.1), noise(i, 1.7), noise(i, 4.2)]).collect();
        texels[count / 3] = [9.0, 7.0, 5.0];
        let mut environment = Environment::new(Image { width, height, texels }).unwrap();
        environment.scale = Vec3::new(1.5, 1.0, 0.25);
        environment.rotation = 37.0;
        environment
    }

    fn harmonics(bands: u32) -> SphericalHarmonics {
        SphericalHarmonics::new(bands).unwrap()
    }

    fn largest(values: &[[f64; 3]]) -> f64 {
        values.iter().flatten().fold(0.0, |m, v| m.max(v.abs()))
    }

    /// Sums `radiance` itself on a fine grid.
    fn brute_force(environment: &Environment, bands: u32, columns: u32, rows: u32) -> Vec<DVec3> {
        let basis = harmonics(bands);
        let mut sums = vec![DVec3::ZERO; basis.count()];
        let mut values = vec![0.0; basis.count()];
        for j in 0..rows {
            let theta = PI * (f64::from(j) + 0.5) / f64::from(rows);
            let weight = theta.sin() * 2.0 * PI * PI / f64::from(columns) / f64::from(rows);
            for i in 0..columns {
                let (sin, cos) = (2.0 * PI * (f64::from(i) + 0.5) / f64::from(columns)).sin_cos();
                let d = DVec3::new(theta.sin() * sin, theta.cos(), theta.sin() * cos);
                basis.eval(d, &mut values);
                let radiance = environment.radiance(d) * weight;
                sums.iter_mut().zip(&values).for_each(|(sum, v)| *sum += radiance * *v);
            }
        }
        sums
    }

    #[test]
    fn projection_integrates_what_is_looked_up() {
        for (w, h) in [(7, 5), (1, 4), (3, 1), (16, 9)] {
            let environment = picture(w, h);
            let found = environment.project_sh(&harmonics(5));
            let expected = brute_force(&environment, 5, 1200, 700);
            let size = largest(&found);
            for (k, (found, expected)) in found.iter().zip(&expected).enumerate() {
                let error = (DVec3::from(*found) - *expected).abs().max_element();
                // The midpoint sum's own error: curvature l² and kinks at steps of 1/200 rad.
                assert!(error < 3e-5 * size, "{w} × {h}, function {k}: {found:?} {expected}");
            }
            let mean = environment.mean_radiance();
            let constant = DVec3::from(found[0]) / (4.0 * PI).sqrt();
            assert!((mean - constant).length() < 1e-13 * mean.length(), "{mean} {constant}");
        }
    }

    #[test]
    fn sums_do_not_depend_on_threads() {
        let (environment, basis) = (picture(90, 45), harmonics(4));
        let all = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let moments = [environment.moments(&basis), environment.pixel_moments(2, &basis)];
                (environment.project_sh(&basis), moments, environment.pixel_centroids(4))
            })
        };
        let one = all(1);
        for threads in [2, 3, 40] {
            assert_eq!(all(threads), one, "{threads} threads");
        }
    }

    #[test]
    fn turning_the_environment_turns_its_coefficients() {
        let basis = harmonics(10);
        let turned = picture(32, 17);
        let mut plain = turned.clone();
        plain.rotation = 0.0;
        let expected =
            basis.rotate(&plain.project_sh(&basis), DMat3::from_rotation_y(turned.rotation.to_radians())).unwrap();
        for (found, expected) in turned.project_sh(&basis).iter().zip(&expected) {
            let error = (DVec3::from(*found) - DVec3::from(*expected)).length();
            assert!(error < 1e-12, "{found:?} {expected:?}");
        }
    }

    #[test]
    fn a_uniform_environment_is_its_first_coefficient() {
        let mut environment = Environment::uniform(Vec3::new(2.0, 1.0, 0.5)).unwrap();
        environment.rotation = -11.0;
        for (k, c) in environment.project_sh(&harmonics(26)).iter().enumerate() {
            let expected = if k == 0 { (4.0 * PI).sqrt() } else { 0.0 };
            assert!((c[0] - 2.0 * expected).abs() < 1e-12 && (c[2] - 0.5 * expected).abs() < 1e-12, "{k}: {c:?}");
        }
        assert!((environment.mean_radiance() - DVec3::new(2.0, 1.0, 0.5)).length() < 1e-14);
        assert_eq!(environment.max_radiance(), DVec3::new(2.0, 1.0, 0.5));
        for nside in [1, 2, 4, 8] {
            for (i, moment) in environment.pixel_moments(nside, &harmonics(1)).iter().enumerate() {
                let mean = moment[1] * (4.0 * PI).sqrt() / healpix::weight(nside);
                // What LOOKUPS_PER_SIDE leaves of a pixel's area.
                assert!((mean - 1.0).abs() < 3e-3, "nside {nside}, pixel {i}: {mean}");
            }
        }
    }

    #[test]
    fn moments_add_up_to_the_projection() {
        for (environment, nside, bands) in [
            (picture(7, 5), 2, 3),
            (picture(60, 31), 4, 6),
            (picture(256, 128), 8, 6),
            (picture(31, 16), 8, 10),
            (picture(300, 141), 2, 3),
        ] {
            let basis = harmonics(bands);
            let moments = environment.pixel_moments(nside, &basis);
            let expected = environment.project_sh(&basis);
            let functions = basis.count();
            assert_eq!(moments.len(), healpix::count(nside) * functions);
            for k in 0..functions {
                let sum: DVec3 = moments.iter().skip(k).step_by(functions).map(|&m| DVec3::from(m)).sum();
                let error = (sum - DVec3::from(expected[k])).abs().max_element();
                // Functions at the cells' middles: (l/(8 nside))²/24, and nothing at all for the constant.
                let tolerance = if k == 0 { 1e-12 } else { 1e-3 };
                assert!(error < tolerance * largest(&expected), "nside {nside}, function {k}: {error}");
            }
        }
    }

    #[test]
    fn a_pixel_gets_the_light_in_it() {
        let environment = picture(40, 23);
        let nside = 2;
        let moments = environment.pixel_moments(nside, &harmonics(1));
        let mut expected = vec![DVec3::ZERO; healpix::count(nside)];
        let fine = healpix::directions(healpix::MAX_NSIDE);
        for &d in &fine {
            expected[healpix::pixel(nside, d)] += environment.radiance(d) * healpix::weight(healpix::MAX_NSIDE);
        }
        for (i, (found, expected)) in moments.iter().zip(&expected).enumerate() {
            let found = DVec3::from(*found) * (4.0 * PI).sqrt();
            // The midpoint sum with 1024 points a pixel, a texel as wide as ten of them.
            assert!((found - *expected).length() < 0.01 * expected.length(), "pixel {i}: {found} {expected}");
        }
    }

    #[test]
    fn a_small_sun_is_found_where_it_stands() {
        let (width, height) = (256, 128);
        let mut texels = vec![[0f32; 3]; (width * height) as usize];
        let (column, row) = (75, 33);
        texels[row * width as usize + column] = [1000.0, 900.0, 700.0];
        let mut environment = Environment::new(Image { width, height, texels }).unwrap();
        environment.rotation = 20.0;
        let theta = PI * (row as f64 + 0.5) / f64::from(height);
        let phi = PI + 20f64.to_radians() - 2.0 * PI * (column as f64 + 0.5) / f64::from(width);
        let sun = DVec3::new(theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos());
        assert!((environment.radiance(sun).x - 1000.0).abs() < 1e-6);
        let centroids = environment.pixel_centroids(4);
        let centers = healpix::directions(4);
        let home = healpix::pixel(4, sun);
        // A tenth of a texel; the pixel's centre is several away.
        assert!(centroids[home].angle_between(sun) < 0.1 * PI / f64::from(height));
        assert!(centers[home].angle_between(sun) > 2.0 * PI / f64::from(height));
        let moved = centroids.iter().zip(&centers).filter(|(a, b)| a.angle_between(**b) > 1e-9).count();
        assert_eq!(moved, 1, "dark pixels keep their centres");
    }

    #[test]
    fn largest_radiance_is_scaled() {
        assert_eq!(picture(7, 5).max_radiance(), DVec3::new(13.5, 7.0, 1.25));
    }
}
