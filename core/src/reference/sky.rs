//! The environment as it is seen behind the medium.

use std::f64::consts::PI;

use glam::DVec3;

use super::lookup::xyz;

/// The radiance from `d` of an environment of `size` texels, times `tint` and turned by its fourth value.
pub(super) fn sky(size: [u32; 2], tint: [f32; 4], texels: &[[f32; 4]], d: DVec3) -> DVec3 {
    let (width, height) = (i64::from(size[0]), i64::from(size[1]));
    let turns = d.x.atan2(-d.z) / (2.0 * PI) + f64::from(tint[3]);
    let x = turns.rem_euclid(1.0) * width as f64 - 0.5;
    let y = d.y.clamp(-1.0, 1.0).acos() / PI * height as f64 - 0.5;
    let mut sum = DVec3::ZERO;
    for (right, below) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let column = (x.floor() as i64 + right).rem_euclid(width);
        let row = (y.floor() as i64 + below).clamp(0, height - 1);
        let across = if right == 1 { x - x.floor() } else { 1.0 - (x - x.floor()) };
        let down = if below == 1 { y - y.floor() } else { 1.0 - (y - y.floor()) };
        sum += xyz(texels[(row * width + column) as usize]) * (across * down);
    }
    sum * xyz(tint)
}
