//! `upsample` against its twin.

use airlight::device::{Buf, Usage};
use airlight::reference::{self, UpsampleInputs};
use airlight::stage::{FAR, March, Stage, Upsample, UpsampleParams};
use bytemuck::Zeroable;
use libtest_mimic::Failed;

use super::case;
use crate::bench::{Bench, cuts};
use crate::fixtures::{camera, noise, sky};
use crate::{Case, Record, Subject, check, tolerance};

/// One set of parameters.
#[derive(Clone, Copy)]
struct Set {
    name: &'static str,
    scale: u32,
    /// Columns and rows of the full picture.
    size: [u32; 2],
    samples: u32,
    surface: bool,
    normals: bool,
    environment: bool,
    /// Whether there is a film of half the scale near rims.
    rims: bool,
}

pub(crate) fn cases() -> Vec<Case> {
    let plain = Set {
        name: "full_size",
        scale: 1,
        size: [21, 13],
        samples: 1,
        surface: false,
        normals: false,
        environment: false,
        rims: false,
    };
    let sets = [
        plain,
        Set { name: "full_size_surfaces", surface: true, samples: 3, environment: true, ..plain },
        Set { name: "half_size", scale: 2, size: [43, 29], ..plain },
        Set { name: "half_size_sky", scale: 2, size: [42, 31], environment: true, ..plain },
        Set { name: "half_size_surfaces", scale: 2, size: [43, 29], surface: true, environment: true, ..plain },
        Set { name: "quarter_size", scale: 4, size: [47, 37], ..plain },
        Set { name: "quarter_size_surfaces", scale: 4, size: [46, 41], surface: true, ..plain },
        Set { name: "quarter_size_normals", scale: 4, size: [45, 39], surface: true, normals: true, ..plain },
        Set { name: "one_pixel_for_all", scale: 4, size: [3, 2], surface: true, environment: true, ..plain },
        Set { name: "quarter_size_rims", scale: 4, size: [45, 39], surface: true, normals: true, rims: true, ..plain },
        Set { name: "half_size_rims", scale: 2, size: [42, 31], surface: true, rims: true, ..plain },
    ];
    let made = |set: Set| {
        case("upsample", set.name, "film", &tolerance::STAGE, move |subject, record| one(subject, record, &set))
    };
    sets.into_iter().map(made).collect()
}

/// Distances of surfaces: three slanted planes behind each other, and nothing in places, with rims along no axis.
pub(super) fn distance(x: u32, y: u32) -> f32 {
    let (x, y) = (x as f32, y as f32);
    let slope = 1.0 + 0.003 * x - 0.002 * y;
    match ((x + 0.6 * y) / 11.0) as u32 % 4 {
        0 => 2.0 * slope,
        1 => 5.0 * slope,
        2 => f32::INFINITY,
        _ => 2.7 * slope,
    }
}

/// A small film of the medium alone: noise over a slope, with the surfaces' distances, and nothing stopped in places.
pub(super) fn medium(width: u32, height: u32, seed: u64, surface: impl Fn(u32, u32) -> f32) -> Vec<[f32; 4]> {
    let values = noise(seed, (7 * width * height) as usize);
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).zip(values.chunks_exact(7));
    pixels
        .flat_map(|((x, y), v)| {
            let far = surface(x, y).min(FAR);
            let clear = (x * 7 + y * 3) % 10 == 0;
            let (through, depth) = if clear { ([1.0; 3], f32::INFINITY) } else { ([0.3, 0.5, 0.7], 1.0 + v[6]) };
            let [r, g, b] = [0, 1, 2].map(|c| if clear { 1.0 } else { through[c] + 0.2 * v[3 + c] });
            [[v[0] + 0.05 * x as f32, v[1] + 0.03 * y as f32, v[2], far], [r, g, b, depth]]
        })
        .collect()
}

fn one(subject: &Subject, record: &mut Record, set: &Set) -> Result<(), Failed> {
    let [full_width, full_height] = set.size;
    let camera = camera(full_width, full_height, set.samples);
    let mut params = UpsampleParams::zeroed();
    [params.forward, params.right, params.up] = camera.axes().map(|a| a.as_vec3().extend(0.0).to_array());
    (params.full_width, params.full_height) = (full_width, full_height);
    (params.scale, params.samples, params.normals_each) = (set.scale, set.samples, 2);
    params.surface_samples = set.samples;
    (params.width, params.height) = (full_width.div_ceil(set.scale), full_height.div_ceil(set.scale));
    let sky = sky();
    (params.environment, params.environment_dims) = ([1.5, 1.0, 0.5, 0.3], [5, 7, 4, 0]);
    (params.environment_width, params.environment_height) = (sky.image().width, sky.image().height);
    let mut texels: Vec<[f32; 4]> = sky.image().texels.iter().map(|t| [t[0], t[1], t[2], 0.0]).collect();
    texels.resize(5 * 7 * 4, [1e9; 4]);
    let stands = |n: u32, size: u32| (n * set.scale + set.scale / 2).min(size - 1);
    let far = |x: u32, y: u32| if set.surface { distance(x, y) } else { f32::INFINITY };
    let small = medium(params.width, params.height, 51, |x, y| far(stands(x, full_width), stands(y, full_height)));
    // Of the finer film what is marched ends within what is read and within what is not.
    let half = (set.scale / 2).max(1);
    let (fine_width, fine_height) = (full_width.div_ceil(half), full_height.div_ceil(half));
    let fine = medium(fine_width, fine_height, 53, |x, y| {
        let place = |n: u32, size: u32| (n * half + half / 2).min(size - 1);
        if (x + 2 * y) / 9 % 2 == 0 { far(place(x, full_width), place(y, full_height)) } else { March::UNMARCHED }
    });
    let pixels = || (0..full_height).flat_map(|y| (0..full_width).map(move |x| (x, y)));
    let colors = noise(52, (3 * full_width * full_height * set.samples) as usize);
    // Of a pixel's sub-pixel positions some see past the surface that the first one sees.
    let distances = pixels().flat_map(|(x, y)| {
        (0..set.samples).map(move |s| if s > 0 && (x + y + s) % 3 == 0 { f32::INFINITY } else { far(x, y) })
    });
    let surface: Vec<[f32; 4]> =
        distances.zip(colors.chunks_exact(3)).map(|(distance, c)| [c[0], c[1], c[2], distance]).collect();
    // Two walls, a third one that fits both in part, and none.
    let walls = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.6, 0.8, 0.0], [0.8, 0.0, 0.6, 0.0], [0.0; 4]];
    let facing = |x: u32, y: u32| walls[((x + y / 2) / 9 % 4) as usize];
    // Beside each what must not be read.
    let normals: Vec<[f32; 4]> = pixels().flat_map(|(x, y)| [facing(x, y), [0.6, -0.8, 0.0, 7.0]]).collect();
    let subpixels: Vec<f32> = camera.subpixels().iter().flat_map(|p| p.as_vec2().to_array()).collect();
    let inputs = UpsampleInputs {
        medium: &small,
        rims: set.rims.then_some(&fine[..]),
        surface: set.surface.then_some(&surface[..]),
        normals: set.normals.then_some(&normals[..]),
        environment: set.environment.then_some(&texels[..]),
        subpixels: &subpixels,
    };
    let expected = reference::upsample(&params, &inputs);
    let without = reference::upsample(&params, &UpsampleInputs { rims: None, ..inputs });
    let finer = expected.chunks_exact(8).zip(without.chunks_exact(8)).filter(|(a, b)| a != b).count();
    let enough = finer > 100 && finer + 100 < (full_width * full_height) as usize;
    check!(enough || !set.rims, "{finer} pixels are of the finer film: the case tries nothing");

    let mut bench = Bench::new(subject)?;
    let vectors = 2 * (full_width * full_height) as usize;
    let film: Buf<[f32; 4]> = bench.room(vectors, Usage::Output)?;
    let stage = Stage::Upsample(Upsample {
        params,
        medium: bench.buf(&small)?,
        rims: if set.rims { Some(bench.buf(&fine)?) } else { None },
        surface: if set.surface { Some(bench.buf(&surface)?) } else { None },
        normals: if set.normals { Some(bench.buf(&normals)?) } else { None },
        environment: if set.environment { Some(bench.colors([5, 7, 4], 1, &texels)?) } else { None },
        subpixels: bench.buf(&subpixels)?,
        film,
    });
    record.each(&cuts(), |record, &cut| {
        bench.run(record, &stage, cut)?;
        let found: Vec<[f32; 4]> = bench.read(film)?;
        hold(record, set.size, found.as_flattened(), &expected);
        check!(found.len() == vectors, "{} vectors", found.len());
        Ok(())
    })
}

/// Holds a film of eight values a pixel to the twin's.
pub(super) fn hold(record: &mut Record, size: [u32; 2], found: &[f32], expected: &[f64]) {
    let (found, expected) = (found.as_chunks::<8>().0, expected.as_chunks::<8>().0);
    let rgb = |p: &[f64; 8]| [p[0], p[1], p[2]];
    record.picture("radiance", size, found.iter().map(|p| [p[0], p[1], p[2]]), expected.iter().map(rgb));
    record.hold("fourth", found.iter().map(|p| p[3]), expected.iter().map(|p| p[3]));
    let through = |p: &[f32; 8]| [p[4], p[5], p[6]];
    record.hold("transmittance", found.iter().flat_map(through), expected.iter().flat_map(|p| [p[4], p[5], p[6]]));
    // Where next to nothing is stopped, the rounding of what is decides how depths are weighed.
    let solid = || found.iter().zip(expected).filter(|(_, e)| e[4] + e[5] + e[6] < 2.997);
    record.hold("depth", solid().map(|(f, _)| f[7]), solid().map(|(_, e)| e[7]));
}
