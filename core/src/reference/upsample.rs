//! Twin of the stage [`Upsample`](crate::stage::Upsample).

use glam::DVec3;

use super::lookup::xyz;
use super::sky::sky;
use crate::stage::{FAR, Upsample, UpsampleParams};

/// What the bindings of [`Upsample`] hold.
#[derive(Clone, Copy, Debug)]
pub struct UpsampleInputs<'a> {
    /// The small film, two vectors a pixel.
    pub medium: &'a [[f32; 4]],
    /// The same of half the scale, where rims are near.
    pub rims: Option<&'a [[f32; 4]]>,
    /// Surfaces behind the pixels.
    pub surface: Option<&'a [[f32; 4]]>,
    /// Normals of the surfaces.
    pub normals: Option<&'a [[f32; 4]]>,
    /// Texels of the environment.
    pub environment: Option<&'a [[f32; 4]]>,
    /// Sub-pixel positions.
    pub subpixels: &'a [f32],
}

/// What [`Upsample`] writes: eight values a pixel, as [`march`](super::march).
pub fn upsample(params: &UpsampleParams, inputs: &UpsampleInputs<'_>) -> Vec<f64> {
    let far = f64::from(FAR);
    let mut film = Vec::new();
    for y in 0..params.full_height {
        for x in 0..params.full_width {
            // The surface of a sub-pixel position.
            let each = params.surface_samples as usize;
            let pixel = (y * params.full_width + x) as usize;
            let surface = |s: usize| inputs.surface.map(|surface| surface[pixel * each + s % each]);
            let distance = surface(0).map_or(far, |s| f64::from(s[3]).min(far));
            let fine = inputs.rims.map(|film| Small { scale: params.scale / 2, film });
            let whole = Small { scale: params.scale, film: inputs.medium };
            let (mut taken, mut left) = (Vec::new(), 1.0);
            for small in fine.into_iter().chain([whole]) {
                let (marched, found) = around(params, inputs, &small, [x, y], distance);
                let weight: f64 = found.iter().map(|(_, w)| w).sum();
                let share = left * marched;
                taken.extend(found.into_iter().map(|(pixel, w)| (&small.film[2 * pixel..][..2], w * share / weight)));
                left -= share;
            }
            let weight: f64 = taken.iter().map(|(_, w)| w).sum();
            let (mut light, mut through) = (DVec3::ZERO, DVec3::ZERO);
            let (mut stopped, mut stopped_at) = (0.0, 0.0);
            for (pixel, w) in taken {
                light += xyz(pixel[0]) * w / weight;
                let (t, depth) = (pixel[1], f64::from(pixel[1][3]));
                through += xyz(t) * w / weight;
                if depth < far {
                    let share = w * (1.0 - xyz(t).element_sum() / 3.0).max(1e-9);
                    stopped += share;
                    stopped_at += share * depth;
                }
            }
            let color = light + through * behind(params, inputs, [x, y], &surface);
            film.extend([color.x, color.y, color.z, 1.0 - through.element_sum() / 3.0]);
            let depth = if stopped > 0.0 { stopped_at / stopped } else { f64::INFINITY };
            film.extend([through.x, through.y, through.z, depth]);
        }
    }
    film
}

/// A film smaller than the picture.
#[derive(Clone, Copy)]
struct Small<'a> {
    scale: u32,
    film: &'a [[f32; 4]],
}

/// The pixels of a small film that a pixel takes, with their weights; before them how much of the nearest was marched.
fn around(
    params: &UpsampleParams,
    inputs: &UpsampleInputs<'_>,
    Small { scale, film }: &Small<'_>,
    at: [u32; 2],
    distance: f64,
) -> (f64, Vec<(usize, f64)>) {
    let full = [params.full_width, params.full_height];
    let small = full.map(|side| side.div_ceil(*scale));
    let stands = |n: i64, a: usize| (n * i64::from(*scale) + i64::from(scale / 2)).min(i64::from(full[a]) - 1);
    // The last pixel of the small film that stands at or before this one, and its share of the way to the next.
    let axis = |a: usize| {
        let here = i64::from(at[a]);
        let first = (0..i64::from(small[a])).rev().find(|&n| stands(n, a) <= here).unwrap_or(0);
        let next = (first + 1).min(i64::from(small[a]) - 1);
        let way = stands(next, a) - stands(first, a);
        let share = if way > 0 { (here - stands(first, a)).max(0) as f64 / way as f64 } else { 0.0 };
        (first, next, share)
    };
    let ((x0, x1, fx), (y0, y1, fy)) = (axis(0), axis(1));
    let place = |x: i64, y: i64| (y * i64::from(small[0]) + x) as usize;
    let surface = |pixel: usize| f64::from(film[2 * pixel][3]);
    let normal = |x: i64, y: i64| {
        inputs.normals.map(|n| xyz(n[(y * i64::from(full[0]) + x) as usize * params.normals_each as usize]))
    };
    let corners =
        [(x0, y0, (1.0 - fx) * (1.0 - fy)), (x1, y0, fx * (1.0 - fy)), (x0, y1, (1.0 - fx) * fy), (x1, y1, fx * fy)];
    let (mut marched, mut taken) = (0.0, Vec::new());
    for (x, y, share) in corners {
        let pixel = place(x, y);
        if surface(pixel) < 0.0 {
            continue;
        }
        marched += share;
        let (near, distant) = (surface(pixel).min(distance), surface(pixel).max(distance));
        let mut weight = share * (2.0 - (1.0 - near / distant.max(1e-30)) / f64::from(Upsample::NEAR)).clamp(0.0, 1.0);
        let here = normal(at[0].into(), at[1].into());
        if let (Some(here), Some(there)) = (here, normal(stands(x, 0), stands(y, 1)))
            && here != DVec3::ZERO
            && there != DVec3::ZERO
        {
            let least = f64::from(Upsample::COSINE);
            weight *= ((here.dot(there) - least) / (1.0 - least)).clamp(0.0, 1.0);
        }
        taken.push((pixel, weight));
    }
    if marched == 0.0 {
        return (0.0, Vec::new());
    }
    if taken.iter().map(|(_, w)| w).sum::<f64>() >= f64::from(Upsample::FIT) {
        return (marched, taken);
    }
    let mut nearest = (f64::INFINITY, place(x0, y0));
    for dy in -1..3 {
        for dx in -1..3 {
            let pixel = place((x0 + dx).clamp(0, i64::from(small[0]) - 1), (y0 + dy).clamp(0, i64::from(small[1]) - 1));
            let apart = (1.0 / distance.max(1e-6) - 1.0 / surface(pixel).max(1e-6)).abs();
            if surface(pixel) >= 0.0 && apart < nearest.0 {
                nearest = (apart, pixel);
            }
        }
    }
    (marched, vec![(nearest.1, 1.0)])
}

fn behind(
    params: &UpsampleParams,
    inputs: &UpsampleInputs<'_>,
    at: [u32; 2],
    surface: &dyn Fn(usize) -> Option<[f32; 4]>,
) -> DVec3 {
    let toward = |s: &[f32]| {
        let a = 2.0 * (f64::from(at[0]) + f64::from(s[0])) / f64::from(params.full_width) - 1.0;
        let b = 1.0 - 2.0 * (f64::from(at[1]) + f64::from(s[1])) / f64::from(params.full_height);
        (xyz(params.forward) + a * xyz(params.right) + b * xyz(params.up)).normalize()
    };
    let size = [params.environment_width, params.environment_height];
    let mut sum = DVec3::ZERO;
    for (s, position) in inputs.subpixels[..2 * params.samples as usize].chunks_exact(2).enumerate() {
        sum += match (surface(s).filter(|s| s[3] < FAR), inputs.environment) {
            (Some(surface), _) => xyz(surface),
            (None, Some(texels)) => sky(size, params.environment, texels, toward(position)),
            (None, None) => DVec3::ZERO,
        };
    }
    sum / f64::from(params.samples)
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::stage::March;

    /// A film of 3 × 1 pixels for 12 × 1, whose radiance is the pixel's place and whose middle is before a near surface.
    fn film(middle: f32) -> (UpsampleParams, Vec<[f32; 4]>) {
        let mut params = UpsampleParams::zeroed();
        (params.width, params.height, params.full_width, params.full_height) = (3, 1, 12, 1);
        (params.scale, params.samples, params.surface_samples) = (4, 1, 1);
        let pixel = |place: f32, surface: f32| [[place, place, place, surface], [0.5, 0.5, 0.5, place]];
        let medium = [pixel(2.0, FAR), pixel(6.0, middle), pixel(10.0, FAR)];
        (params, medium.concat())
    }

    fn red(params: &UpsampleParams, medium: &[[f32; 4]], surface: Option<&[[f32; 4]]>) -> Vec<f64> {
        reds(params, medium, None, surface)
    }

    fn reds(
        params: &UpsampleParams,
        medium: &[[f32; 4]],
        rims: Option<&[[f32; 4]]>,
        surface: Option<&[[f32; 4]]>,
    ) -> Vec<f64> {
        let inputs = UpsampleInputs { medium, rims, surface, normals: None, environment: None, subpixels: &[0.5, 0.5] };
        upsample(params, &inputs).chunks_exact(8).map(|p| p[0]).collect()
    }

    #[test]
    fn what_is_linear_stays_linear() {
        let (params, medium) = film(FAR);
        let found = red(&params, &medium, None);
        // Before the first and behind the last centre it is constant.
        assert_eq!(found, [2.0, 2.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 10.0]);
    }

    #[test]
    fn edges_of_depth_are_kept() {
        let (params, medium) = film(3.0);
        let near = |x: usize| (4..8).contains(&x);
        let surface: Vec<[f32; 4]> =
            (0..12).map(|x| [0.0, 0.0, 0.0, if near(x) { 3.0 } else { f32::INFINITY }]).collect();
        let found = red(&params, &medium, Some(&surface));
        assert_eq!(found, [2.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 10.0, 10.0, 10.0, 10.0]);
    }

    #[test]
    fn where_a_rim_is_near_the_finer_film_serves() {
        let (params, medium) = film(FAR);
        // Of six pixels at 1, 3, … 11 those at 5, 7 and 9 were marched.
        let fine = |x: usize| {
            let value = 100.0 + (2 * x + 1) as f32;
            let surface = if (2..5).contains(&x) { FAR } else { March::UNMARCHED };
            [[value, value, value, surface], [0.5, 0.5, 0.5, value]]
        };
        let rims: Vec<_> = (0..6).flat_map(fine).collect();
        let found = reds(&params, &medium, Some(&rims), None);
        // At 4 and 10 one of two neighbours was.
        let half = |a: f64, b: f64| 0.5 * a + 0.5 * b;
        let (begins, ends) = (half(4.0, 105.0), half(10.0, 109.0));
        assert_eq!(found, [2.0, 2.0, 2.0, 3.0, begins, 105.0, 106.0, 107.0, 108.0, 109.0, ends, 10.0]);
    }
}
