//! Columns of sums of Gaussians against the reference set's segments and against quadrature.

use airlight_core::glam::DVec3;
use airlight_core::media::Gaussian;
use airlight_core::reference::closed::gaussians_column;
use serde_json::Value;

fn vector(v: &Value) -> DVec3 {
    DVec3::from_array([0, 1, 2].map(|a| v[a].as_f64().unwrap()))
}

/// The Gaussians, their extinction, and the segments with their optical depths.
fn reference() -> (Vec<Gaussian>, f64, Vec<(DVec3, DVec3, f64)>) {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../conformance/data/reference/blobs.json");
    let text = std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{path}: {e}"));
    let all: Value = serde_json::from_str(&text).unwrap();
    let medium = &all["medium"];
    let number = |key: &str, i: usize| medium[key][i].as_f64().unwrap();
    let blob = |i| Gaussian { center: vector(&medium["b"][i]), a: number("a", i), c: number("c", i) };
    let blobs = (0..medium["a"].as_array().unwrap().len()).map(blob).collect();
    let segment = |s: &Value| (vector(&s["start"]), vector(&s["end"]), s["optical_depth"].as_f64().unwrap());
    let segments = all["segments"].as_array().unwrap().iter().map(segment).collect();
    (blobs, medium["extinction_scale"].as_f64().unwrap(), segments)
}

#[test]
fn optical_depths_are_the_reference_s() {
    let (blobs, extinction, segments) = reference();
    assert_eq!((blobs.len(), segments.len()), (40, 64));
    for (start, end, expected) in segments {
        let found = extinction * gaussians_column(&blobs, start, end);
        // The reference is a difference of two erf, which is good to the last digit of erf and not of the difference:
        // on its short segments, of 10⁻⁷ to 10⁻¹ widths, that is its own share of the error.
        let lost = 8.0 * f64::EPSILON * extinction * blobs.iter().map(|b| b.c / b.a).sum::<f64>();
        let short = start.distance(end) < 1e-2;
        let tolerance = 1e-12 * expected + if short { lost } else { 0.0 };
        assert!((found - expected).abs() <= tolerance, "{start} to {end}: {found:e} {expected:e}");
    }
}

/// Adaptive Simpson quadrature to `tolerance`.
fn adaptive(f: &dyn Fn(f64) -> f64, a: f64, b: f64, tolerance: f64, depth: u32) -> f64 {
    let simpson = |a: f64, b: f64| (b - a) / 6.0 * (f(a) + 4.0 * f(0.5 * (a + b)) + f(b));
    let middle = 0.5 * (a + b);
    let (whole, halves) = (simpson(a, b), simpson(a, middle) + simpson(middle, b));
    if depth == 0 || (depth < 40 && (halves - whole).abs() <= 15.0 * tolerance) {
        return halves + (halves - whole) / 15.0;
    }
    adaptive(f, a, middle, 0.5 * tolerance, depth - 1) + adaptive(f, middle, b, 0.5 * tolerance, depth - 1)
}

#[test]
fn columns_are_what_quadrature_finds() {
    let (blobs, _, segments) = reference();
    for (start, end, _) in segments {
        let length = start.distance(end);
        let density = |t: f64| {
            let p = start.lerp(end, t);
            length * blobs.iter().map(|b| b.at(p)).sum::<f64>()
        };
        let found = gaussians_column(&blobs, start, end);
        // Begun in 32 parts, so that no Gaussian falls between the points of the first try.
        let parts = (0..32).map(|i| (f64::from(i) / 32.0, f64::from(i + 1) / 32.0));
        let expected: f64 = parts.map(|(a, b)| adaptive(&density, a, b, 1e-13 * found / 32.0, 45)).sum();
        assert!((found - expected).abs() <= 1e-11 * expected, "{start} to {end}: {found:e} {expected:e}");
    }
}
