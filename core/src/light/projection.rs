//! Integrals of an environment: on spherical harmonics, on any basis, and over HEALPix pixels.
//!
//! All are of the bilinear function that [`Environment::radiance`] looks up, scale and rotation included. With
//! φ = π + rotation - 2πu the function is piecewise linear in φ and in θ = πv. Over the sphere's azimuth its Fourier
//! coefficients are known in closed form: a sum of triangles 2π/W wide to each side of the texels' centres, so the
//! texels' discrete transform times (2π/W)·sinc²(πm/W).

use std::f64::consts::PI;

use glam::DVec3;

use super::Environment;
use crate::basis::quadrature::gauss_legendre;
use crate::basis::{Basis, SphericalHarmonics, healpix};

/// Linear sRGB (Rec. 709) to luminance.
pub(super) const LUMINANCE: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// Cells of the sub-sampling along a pixel's side, at least: 64 a pixel.
const CELLS_PER_SIDE: f64 = 8.0;

/// Look-ups along a pixel's side that share out the cells on its edge. With the tips of pixels that reach between two
/// corners of a cell, which are given to its neighbour, this leaves up to 0.3 % of a pixel's area (n ≤ 8).
const LOOKUPS_PER_SIDE: f64 = 64.0;

/// The largest side of the cells of [`Environment::moments`], radians: a twentieth of the reach of the narrowest functions,
/// those of 2562 directions. Where cells are thin, at the poles, that leaves 10⁻³ of an integral.
const FINE: f64 = 3.1e-3;

/// A piece of the sphere that lies within one texel.
struct Cell<'a> {
    direction: DVec3,
    /// Exact integral of the radiance over the cell, W m⁻².
    flux: DVec3,
    /// Pixels that the cell touches, and how much of it each holds; sums to 1.
    shares: &'a [(usize, f64)],
}

impl Environment {
    /// The coefficients ∫ L Y_lm dω, RGB, at index l(l+1)+m. Exact to rounding; O(W·H·bands).
    pub fn project_sh(&self, basis: &SphericalHarmonics) -> Vec<[f64; 3]> {
        let bands = basis.bands() as usize;
        let h = self.image().height as usize;
        let rows = self.azimuthal_moments(bands);
        // Nodes that make a trigonometric polynomial of degree `bands` exact over half a row and over a whole one.
        let rule = gauss_legendre(6 + (bands as f64 * PI / h as f64).ceil() as usize);
        let mut coefficients = vec![DVec3::ZERO; basis.count()];
        let mut values = vec![0.0; basis.count()];
        for piece in 0..=h {
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
                    let [even, odd] =
                        [0, 1].map(|i| weight * rows[above * bands + m][i].lerp(rows[below * bands + m][i], fraction));
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
        coefficients.into_iter().map(|c| (c * self.scale.as_dvec3()).to_array()).collect()
    }

    /// ∫ L b_k dω for every function of a basis, RGB: cells of at most 0.18° with their exact flux, and the functions
    /// at their middles. Σ_k over functions that sum to 1 is the exact flux of the whole.
    pub fn moments(&self, basis: &dyn Basis) -> Vec<[f64; 3]> {
        let mut moments = vec![[0.0; 3]; basis.count()];
        self.for_each_flux(FINE, |direction, flux| {
            basis.each(direction, &mut |k, v| (0..3).for_each(|c| moments[k][c] += flux[c] * v));
        });
        moments
    }

    /// ∫ L b_k dω over each pixel of [`healpix`], RGB, laid out \[pixel\]\[function\].
    ///
    /// Texels are cut into cells of at most an eighth of a pixel's side. A cell counts with its exact flux and with
    /// the functions at its middle, so the sum over the pixels of a constant function is exact: no light is lost.
    pub fn pixel_moments(&self, nside: u32, basis: &dyn Basis) -> Vec<[f64; 3]> {
        let functions = basis.count();
        let mut moments = vec![[0.0; 3]; healpix::count(nside) * functions];
        let mut values = vec![0.0; functions];
        self.for_each_cell(nside, |cell| {
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
    }

    /// For each pixel of [`healpix`] the luminance-weighted mean direction of the light in it, a unit vector; the
    /// pixel's centre where it is dark. A sun smaller than a pixel is found where it stands.
    pub fn pixel_centroids(&self, nside: u32) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; healpix::count(nside)];
        self.for_each_cell(nside, |cell| {
            let luminance = cell.flux.dot(LUMINANCE);
            for &(pixel, share) in cell.shares {
                sums[pixel] += cell.direction * (luminance * share);
            }
        });
        let centers = healpix::directions(nside);
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
    fn azimuth_of_seam(&self) -> f64 {
        PI + self.rotation.to_radians()
    }

    /// \[row\]\[m\]: ∫ L cos mφ dφ and ∫ L sin mφ dφ along the row's centre, before scale.
    fn azimuthal_moments(&self, orders: usize) -> Vec<[DVec3; 2]> {
        let image = self.image();
        let w = image.width as usize;
        let phase: Vec<(f64, f64)> =
            (0..w).map(|a| (self.azimuth_of_seam() - 2.0 * PI * (a as f64 + 0.5) / w as f64).sin_cos()).collect();
        let mut moments = vec![[DVec3::ZERO; 2]; image.height as usize * orders];
        for (row, texels) in moments.chunks_exact_mut(orders).zip(image.texels.chunks_exact(w)) {
            for (texel, &(sin, cos)) in texels.iter().zip(&phase) {
                let value = DVec3::from(texel.map(f64::from));
                let (mut c, mut s) = (1.0, 0.0);
                for moment in row.iter_mut() {
                    moment[0] += value * c;
                    moment[1] += value * s;
                    (c, s) = (c * cos - s * sin, s * cos + c * sin);
                }
            }
            for (m, moment) in row.iter_mut().enumerate() {
                let x = PI * m as f64 / w as f64;
                let sinc = if m == 0 { 1.0 } else { x.sin() / x };
                let factor = 2.0 * PI / w as f64 * sinc * sinc;
                *moment = moment.map(|v| v * factor);
            }
        }
        moments
    }

    /// Cuts the sphere into cells and visits those that are not dark.
    fn for_each_cell(&self, nside: u32, mut visit: impl FnMut(&Cell<'_>)) {
        if nside == 0 {
            return;
        }
        let side = healpix::side(nside);
        let grid = CellGrid::new(self, side / CELLS_PER_SIDE);
        let refine = (grid.width.max(grid.height) / (side / LOOKUPS_PER_SIDE)).ceil() as usize;
        let phi = |column: f64| grid.azimuth(column);
        // The pixels at the cells' corners, on the upper and the lower edge of a row of cells.
        let edge = |row: usize| -> Vec<usize> {
            let (sin, cos) = (grid.height * row as f64).sin_cos();
            (0..=grid.columns).map(|c| healpix::pixel_at(nside, cos, sin, phi(c as f64))).collect()
        };
        let mut edges = (0, edge(0), edge(1));
        let mut shares = Vec::new();
        grid.for_each(|[row, column], direction, flux| {
            if edges.0 != row {
                let upper = if edges.0 + 1 == row { std::mem::take(&mut edges.2) } else { edge(row) };
                edges = (row, upper, edge(row + 1));
            }
            let (_, upper, lower) = &edges;
            let corners = [upper[column], upper[column + 1], lower[column], lower[column + 1]];
            shares.clear();
            if corners.iter().all(|&c| c == corners[0]) {
                shares.push((corners[0], 1.0));
            } else {
                share_out(nside, [row, column], refine, grid.height, phi, &mut shares);
            }
            visit(&Cell { direction, flux, shares: &shares });
        });
    }

    /// Visits cells of at most `size` radians that are not dark: the direction in the middle of each, and the exact
    /// integral of the radiance over it, W m⁻².
    pub(super) fn for_each_flux(&self, size: f64, mut visit: impl FnMut(DVec3, DVec3)) {
        CellGrid::new(self, size).for_each(|_, direction, flux| visit(direction, flux));
    }
}

/// The sphere in cells, each of which lies within one texel.
struct CellGrid<'a> {
    environment: &'a Environment,
    /// Cells of a texel along each axis.
    cuts: [usize; 2],
    columns: usize,
    /// Radians of azimuth, and from pole to pole.
    width: f64,
    height: f64,
}

impl<'a> CellGrid<'a> {
    /// Cells of at most `size` radians a side.
    fn new(environment: &'a Environment, size: f64) -> Self {
        let (w, h) = (environment.image().width as usize, environment.image().height as usize);
        let cuts = [2.0 * PI / w as f64, PI / h as f64].map(|texel| (texel / size).ceil().max(1.0) as usize);
        let (columns, rows) = (w * cuts[0], h * cuts[1]);
        Self { environment, cuts, columns, width: 2.0 * PI / columns as f64, height: PI / rows as f64 }
    }

    /// φ at a place along a row, in cells.
    fn azimuth(&self, column: f64) -> f64 {
        self.environment.azimuth_of_seam() - self.width * column
    }

    /// Visits the cells that are not dark, row by row: row and column, the middle, the flux.
    fn for_each(&self, mut visit: impl FnMut([usize; 2], DVec3, DVec3)) {
        let image = self.environment.image();
        let (w, h) = (image.width as usize, image.height as usize);
        let [cuts_u, cuts_v] = self.cuts;
        let middles: Vec<(f64, f64)> = (0..self.columns).map(|c| self.azimuth(c as f64 + 0.5).sin_cos()).collect();
        let hats: Vec<[f64; 3]> = (0..cuts_u).map(|q| hat_means(cuts_u, q)).collect();
        let mut blended = vec![DVec3::ZERO; w];
        let scale = self.environment.scale.as_dvec3() / self.columns as f64;
        for row in 0..h * cuts_v {
            let weights = row_weights(h, cuts_v, row);
            let lines = [0, 1, 2].map(|i| &image.texels[neighbour_row(row / cuts_v, i, h) * w..][..w]);
            for (a, value) in blended.iter_mut().enumerate() {
                let line = |i: usize| weights[i] * DVec3::from(lines[i][a].map(f64::from));
                *value = (line(0) + line(1) + line(2)) * scale;
            }
            // The mean of cos θ over the cell, which divides its area in halves.
            let y = 0.5 * ((self.height * row as f64).cos() + (self.height * (row + 1) as f64).cos());
            let planar = ((1.0 - y) * (1.0 + y)).sqrt();
            for a in 0..w {
                let near = [blended[(a + w - 1) % w], blended[a], blended[(a + 1) % w]];
                for (q, hat) in hats.iter().enumerate() {
                    let flux = hat[0] * near[0] + hat[1] * near[1] + hat[2] * near[2];
                    if flux == DVec3::ZERO {
                        continue;
                    }
                    let column = a * cuts_u + q;
                    let (sin, cos) = middles[column];
                    visit([row, column], DVec3::new(planar * sin, y, planar * cos), flux);
                }
            }
        }
    }
}

/// Which pixels hold how much of the cell at \[row, column\], by `refine` squared look-ups.
fn share_out(
    nside: u32,
    [row, column]: [usize; 2],
    refine: usize,
    height: f64,
    phi: impl Fn(f64) -> f64,
    shares: &mut Vec<(usize, f64)>,
) {
    let at = |i: usize| (i as f64 + 0.5) / refine as f64;
    let total: f64 = (0..refine).map(|i| (height * (row as f64 + at(i))).sin()).sum();
    for i in 0..refine {
        let (sin, cos) = (height * (row as f64 + at(i))).sin_cos();
        let share = sin / (total * refine as f64);
        for j in 0..refine {
            let pixel = healpix::pixel_at(nside, cos, sin, phi(column as f64 + at(j)));
            match shares.iter_mut().find(|(p, _)| *p == pixel) {
                Some((_, sum)) => *sum += share,
                None => shares.push((pixel, share)),
            }
        }
    }
}

/// The row above, the row itself, the row below (i = 0, 1, 2), clamped.
fn neighbour_row(row: usize, i: usize, h: usize) -> usize {
    (row + i).saturating_sub(1).min(h - 1)
}

/// Mean, over the q-th of `cuts` equal parts of a texel, of the three linear interpolation weights.
fn hat_means(cuts: usize, q: usize) -> [f64; 3] {
    let [before, after] = sides_of_center(cuts, q).map(|(start, end)| {
        // ∫ |t| dt over a part on one side of the centre.
        0.5 * (end * end - start * start).abs() * cuts as f64
    });
    [before, 1.0 - before - after, after]
}

/// Solid-angle integrals 2π ∫ hat sin θ dθ of the three rows' interpolation weights, over row `row` of `cuts`·`h`.
fn row_weights(h: usize, cuts: usize, row: usize) -> [f64; 3] {
    let (texel, q) = (row / cuts, row % cuts);
    let mut weights = [0.0; 3];
    for (side, (start, end)) in sides_of_center(cuts, q).into_iter().enumerate() {
        if end <= start {
            continue;
        }
        // A part is at most π/2 long, where the rule integrates t·sin θ to rounding.
        for (node, weight) in gauss_legendre(10) {
            let t = 0.5 * (start + end) + 0.5 * (end - start) * node;
            let theta = PI * (texel as f64 + 0.5 + t) / h as f64;
            let weight = weight * 0.5 * (end - start) * 2.0 * PI * PI / h as f64 * theta.sin();
            weights[1] += weight * (1.0 - t.abs());
            weights[2 * side] += weight * t.abs();
        }
    }
    weights
}

/// The q-th of `cuts` equal parts of a texel that reaches from -½ to ½, cut at its centre: what lies before, what
/// lies after. Either may be empty.
fn sides_of_center(cuts: usize, q: usize) -> [(f64, f64); 2] {
    let (start, end) = (q as f64 / cuts as f64 - 0.5, (q + 1) as f64 / cuts as f64 - 0.5);
    [(start.min(0.0), end.min(0.0)), (start.max(0.0), end.max(0.0))]
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
