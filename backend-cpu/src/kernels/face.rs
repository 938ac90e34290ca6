//! Faces of the maps of lights, as `airlight_core::stage::shadow` lays them out.

use airlight_core::stage::LightRecord;

/// A face.
pub(crate) struct Face {
    /// Unit, away from the light.
    pub(crate) forward: [f32; 3],
    pub(crate) right: [f32; 3],
    pub(crate) up: [f32; 3],
    /// At distance 1; of a directional light's at every distance, metres.
    pub(crate) half_width: f32,
}

/// Face `n` of a light's map.
#[inline(always)]
pub(crate) fn face(light: &LightRecord, n: usize, extent: f32) -> Face {
    let [x, y, z, w] = light.position;
    if w == 0.0 || light.cone[3] > 0.0 {
        let forward = if w == 0.0 { [-x, -y, -z] } else { [light.axis[0], light.axis[1], light.axis[2]] };
        // As the frame across a ray.
        let [x, y, z] = forward;
        let s = if z >= 0.0 { 1.0 } else { -1.0 };
        let a = -1.0 / (s + z);
        let b = x * y * a;
        let (right, up) = ([1.0 + s * x * x * a, s * b, -(s * x)], [b, s + y * y * a, -y]);
        return Face { forward, right, up, half_width: if w == 0.0 { extent } else { light.cone[3] } };
    }
    let a = n / 2;
    let (mut forward, mut right, mut up) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    forward[a] = if n % 2 == 1 { -1.0 } else { 1.0 };
    right[(a + 1) % 3] = 1.0;
    up[(a + 2) % 3] = 1.0;
    Face { forward, right, up, half_width: 1.0 }
}

/// The face of six that a direction falls on.
#[inline(always)]
pub(crate) fn side_of(v: [f32; 3]) -> usize {
    let w = [v[0].abs(), v[1].abs(), v[2].abs()];
    let a = if w[0] >= w[1] && w[0] >= w[2] {
        0
    } else if w[1] >= w[2] {
        1
    } else {
        2
    };
    2 * a + usize::from(v[a] < 0.0)
}
