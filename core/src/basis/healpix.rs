//! HEALPix: 12 n² pixels of equal area, in ring order.
//!
//! After Górski et al. 2005, "HEALPix: A Framework for High-Resolution Discretization and Fast Analysis of Data
//! Distributed on the Sphere", ApJ 622. Its θ and φ are those of our spherical harmonics: θ from +Y, φ from +Z toward
//! +X, so that its Cartesian (x, y, z) is our (z, x, y). Any n is possible in ring order, not only powers of two; a
//! set of n·s nests in the set of n. n = 0 is the empty set.

use std::f64::consts::PI;

use glam::DVec3;

use super::Basis;

/// Largest n in use: 49 152 directions.
pub const MAX_NSIDE: u32 = 64;

/// Number of pixels, 12 n².
pub const fn count(nside: u32) -> usize {
    12 * nside as usize * nside as usize
}

/// Solid angle of each pixel, 4π/(12 n²) sr.
pub fn weight(nside: u32) -> f64 {
    4.0 * PI / count(nside) as f64
}

/// Centres of the pixels, unit vectors in ring order: from +Y down, in each ring with growing φ.
pub fn directions(nside: u32) -> Vec<DVec3> {
    centers(nside).collect()
}

/// The pixel that holds the unit direction `d`. A direction on an edge falls to one of its neighbours.
/// n = 0 is taken as 1.
pub fn pixel(nside: u32, d: DVec3) -> usize {
    pixel_at(nside, d.y, d.x.hypot(d.z), d.x.atan2(d.z))
}

/// The pixel at height `y` = cos θ, `planar` = sin θ and azimuth `phi`.
pub(crate) fn pixel_at(nside: u32, y: f64, planar: f64, phi: f64) -> usize {
    let n = i64::from(nside.max(1));
    let scale = n as f64;
    let turns = phi / (2.0 * PI);
    let quarter = 4.0 * (turns - turns.floor());
    let index = if y.abs() <= 2.0 / 3.0 {
        // In the belt the pixels' edges are straight in (φ, cos θ): count the ones crossed in each diagonal sense.
        let (along, across) = (scale * (0.5 + quarter), scale * 0.75 * y);
        let (rising, falling) = ((along - across).floor() as i64, (along + across).floor() as i64);
        let ring = (n + 1 + rising - falling).clamp(1, 2 * n + 1);
        // Every second ring is shifted by half a pixel.
        let shift = (ring + 1) & 1;
        let column = ((rising + falling - n + shift + 1) >> 1).rem_euclid(4 * n);
        2 * n * (n - 1) + (ring - 1) * 4 * n + column
    } else {
        // 1 - |cos θ|, written without its cancellation at the poles.
        let from_pole = planar * planar / (1.0 + y.abs());
        let within = quarter - quarter.floor();
        let reach = scale * (3.0 * from_pole).sqrt();
        let (rising, falling) = ((within * reach).floor() as i64, ((1.0 - within) * reach).floor() as i64);
        let ring = (rising + falling + 1).clamp(1, n);
        let column = ((quarter * ring as f64).floor() as i64).rem_euclid(4 * ring);
        if y > 0.0 { 2 * ring * (ring - 1) + column } else { 12 * n * n - 2 * ring * (ring + 1) + column }
    };
    index as usize
}

fn centers(nside: u32) -> impl Iterator<Item = DVec3> {
    let n = f64::from(nside);
    (1..4 * nside).flat_map(move |ring| {
        // Rings of the southern cap mirror those of the northern one.
        let (from_pole, side) = if ring > 3 * nside { (4 * nside - ring, -1.0) } else { (ring, 1.0) };
        let row = f64::from(from_pole);
        let (columns, y, shift) = if from_pole < nside {
            (4 * from_pole, 1.0 - row * row / (3.0 * n * n), 0.5)
        } else {
            let shift = if (from_pole - nside).is_multiple_of(2) { 0.5 } else { 0.0 };
            (4 * nside, 4.0 / 3.0 - 2.0 * row / (3.0 * n), shift)
        };
        let planar = ((1.0 - y) * (1.0 + y)).sqrt();
        (0..columns).map(move |column| {
            let (sin, cos) = (2.0 * PI * (f64::from(column) + shift) / f64::from(columns)).sin_cos();
            DVec3::new(planar * sin, side * y, planar * cos)
        })
    })
}

/// ∫ b_k dω over each pixel, laid out \[pixel\]\[function\].
///
/// The midpoint rule on a finer set that nests in this one, so that the pixels' areas are exact. Its spacing of at
/// most 1/128 rad leaves 10⁻⁴ of a function of 10 bands.
pub fn pixel_integrals(nside: u32, basis: &dyn Basis) -> Vec<f64> {
    let functions = basis.count();
    let fine = nside * 128u32.div_ceil(nside.max(1)).max(4);
    let mut integrals = vec![0.0; count(nside) * functions];
    let mut values = vec![0.0; functions];
    for d in centers(fine) {
        basis.eval(d, &mut values);
        let start = pixel(nside, d) * functions;
        integrals[start..start + functions].iter_mut().zip(&values).for_each(|(sum, v)| *sum += v);
    }
    integrals.iter_mut().for_each(|sum| *sum *= weight(fine));
    integrals
}

/// Side of a square as large as a pixel, in radians.
pub(crate) fn side(nside: u32) -> f64 {
    (PI / 3.0).sqrt() / f64::from(nside)
}

#[cfg(test)]
mod tests {
    use super::super::{GRAM_TOLERANCE, SphericalHarmonics, gram_error};
    use super::*;

    #[test]
    fn centers_are_unit_and_map_to_themselves() {
        for n in [1, 2, 3, 4, 5, 8, 13, 16, 37, MAX_NSIDE] {
            let set = directions(n);
            assert_eq!(set.len(), count(n));
            for (i, &d) in set.iter().enumerate() {
                assert!((d.length() - 1.0).abs() < 1e-14);
                assert_eq!(pixel(n, d), i, "nside {n}: {d}");
            }
            let sum: DVec3 = set.iter().sum();
            assert!(sum.length() < 1e-9, "nside {n}: {sum}");
        }
    }

    #[test]
    fn rings_stand_where_the_paper_puts_them() {
        // The twelve base pixels: cos θ = 2/3 at φ = 45°, 0 at φ = 0°, -2/3 at 45°; φ from +Z toward +X.
        let set = directions(1);
        let side = 5f64.sqrt() / 3.0 * 0.5f64.sqrt();
        for (i, expected) in [
            (0, DVec3::new(side, 2.0 / 3.0, side)),
            (1, DVec3::new(side, 2.0 / 3.0, -side)),
            (4, DVec3::Z),
            (5, DVec3::X),
            (8, DVec3::new(side, -2.0 / 3.0, side)),
        ] {
            assert!((set[i] - expected).length() < 1e-14, "{i}: {} {expected}", set[i]);
        }
    }

    #[test]
    fn pixels_have_equal_area_and_finer_sets_nest() {
        for (n, refine) in [(1, 8), (2, 3), (3, 5), (4, 16), (8, 7)] {
            let mut members = vec![0; count(n)];
            centers(n * refine).for_each(|d| members[pixel(n, d)] += 1);
            let expected = (refine * refine) as usize;
            assert!(members.iter().all(|&m| m == expected), "nside {n} refined by {refine}: {members:?}");
        }
        // Independent of the module's own centres: points of equal area on a spiral.
        let (n, points) = (4, 1_000_000u32);
        let mut members = vec![0u32; count(n)];
        for i in 0..points {
            let y = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(points);
            let (sin, cos) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
            let planar = (1.0 - y * y).sqrt();
            members[pixel(n, DVec3::new(planar * sin, y, planar * cos))] += 1;
        }
        let mean = f64::from(points) / count(n) as f64;
        // The spiral's points near an edge: about the square root of the 280 along the perimeter of 5200.
        assert!(members.iter().all(|&m| (f64::from(m) / mean - 1.0).abs() < 0.005), "{members:?}");
    }

    #[test]
    fn any_direction_has_a_pixel_near_by() {
        for n in [1, 2, 3, 7, 64] {
            let set = directions(n);
            // The most distant corner: of the pixels at cos θ = 2/3 beside a base pixel's edge, one ring up.
            let ring = 1.0 - 1.0 / f64::from(n);
            let up = 1.0 - ring * ring / 3.0;
            let (sin, cos) = (PI / 4.0 / f64::from(n)).sin_cos();
            let corner = DVec3::new(0.0, up, (1.0 - up * up).sqrt());
            let reach = corner.angle_between(DVec3::new(5f64.sqrt() / 3.0 * sin, 2.0 / 3.0, 5f64.sqrt() / 3.0 * cos));
            for i in 0..20_000 {
                let i = f64::from(i);
                let d = DVec3::new((1.3 * i).sin(), (2.1 * i + 0.4).sin(), (0.7 * i).cos()).normalize();
                let angle = set[pixel(n, d)].angle_between(d);
                assert!(angle < reach + 1e-9, "nside {n}: {d} is {angle} from its centre, {reach} at most");
            }
            for d in [DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X, DVec3::ZERO, DVec3::NAN] {
                assert!(pixel(n, d) < count(n));
            }
        }
    }

    #[test]
    fn direction_sets_resolve_the_bands_they_are_meant_for() {
        let error = |n: u32, bands| {
            let basis = SphericalHarmonics::new(bands).unwrap();
            gram_error(&basis, &directions(n), &vec![weight(n); count(n)])
        };
        for (n, bands) in [(2, 3), (4, 6), (8, 10)] {
            let found = error(n, bands);
            assert!(found < GRAM_TOLERANCE, "nside {n}, {bands} bands: {found}");
        }
        assert!(error(1, 3) > GRAM_TOLERANCE, "12 directions cannot hold 3 bands");
    }

    #[test]
    fn integrals_over_pixels() {
        let basis = SphericalHarmonics::new(4).unwrap();
        let functions = basis.count();
        for n in [1, 3, 4] {
            let integrals = pixel_integrals(n, &basis);
            for (k, expected) in basis.integrals().into_iter().enumerate() {
                let sum: f64 = integrals.iter().skip(k).step_by(functions).sum();
                // The midpoint rule at 1/128 rad: (3/128)²/24.
                assert!((sum - expected).abs() < 5e-5, "nside {n}, function {k}: {sum} {expected}");
            }
            let mut values = vec![0.0; functions];
            for (i, d) in directions(n).into_iter().enumerate() {
                let constant = integrals[i * functions] / (weight(n) / (4.0 * PI).sqrt());
                assert!((constant - 1.0).abs() < 1e-12, "the pixels' areas are exact: {constant}");
                if n == 4 {
                    basis.eval(d, &mut values);
                    let mean = integrals[i * functions + 2] / weight(n);
                    // Curvature over a pixel of 0.26 rad: (0.26)²/24 · 2.
                    assert!((mean - values[2]).abs() < 6e-3, "pixel {i}: {mean} {}", values[2]);
                }
            }
        }
    }
}
