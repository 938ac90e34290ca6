//! Twin of the stage [`Sweep`](crate::stage::Sweep): each direction by recursion from its definition, without planes.

use crate::stage::{SweepDirection, SweepParams};

/// What the bindings of [`Sweep`](crate::stage::Sweep) hold.
#[derive(Clone, Copy, Debug)]
pub struct SweepInputs<'a> {
    /// What the cells do to light, laid out \[extinction, albedo, emission\]\[RGB\]\[cell\].
    pub optics: &'a [f32],
    /// The directions.
    pub directions: &'a [SweepDirection],
    /// Moments of the radiance that is scattered; empty for none.
    pub sources: &'a [f32],
    /// What they weigh toward each direction.
    pub source_weights: &'a [f32],
    /// W, laid out \[direction\]\[coefficient\]\[channel\].
    pub weights: &'a [f32],
    /// Which neighbours of a cell lie behind surfaces; empty for none.
    pub obstructed: &'a [u32],
}

/// What [`Sweep`](crate::stage::Sweep) writes as moments.
pub fn sweep(params: &SweepParams, inputs: &SweepInputs<'_>) -> Vec<f64> {
    let (cells, k, channels) =
        (params.count() as usize, params.coefficients as usize, params.moment_channels() as usize);
    let weight_channels = params.weight_channels as usize;
    let mut out = vec![0.0; cells * k * channels];
    for i in 0..params.directions as usize {
        let radiance = radiance(params, inputs, i);
        for cell in 0..cells {
            for (k, c) in (0..k).flat_map(|k| (0..channels).map(move |c| (k, c))) {
                let light = radiance[c.min(params.channels as usize - 1)][cell];
                let weight = (i * params.coefficients as usize + k) * weight_channels + c.min(weight_channels - 1);
                let place = match params.planar {
                    1 => (k * channels + c) * cells + cell,
                    _ => (cell * params.coefficients as usize + k) * channels + c,
                };
                out[place] += light * f64::from(inputs.weights[weight]);
            }
        }
    }
    out
}

/// The radiance of direction `i`, laid out \[channel\]\[cell\].
fn radiance(params: &SweepParams, inputs: &SweepInputs<'_>, i: usize) -> Vec<Vec<f64>> {
    let cells = params.count() as usize;
    let channels = 0..params.channels as usize;
    channels
        .map(|channel| {
            let mut way = Way { params, inputs, i, channel, known: vec![None; cells] };
            let [nx, ny, _, _] = params.cells.map(i64::from);
            (0..cells as i64).map(|n| way.radiance([n % nx, n / nx % ny, n / nx / ny])).collect()
        })
        .collect()
}

/// One direction and channel.
struct Way<'a> {
    params: &'a SweepParams,
    inputs: &'a SweepInputs<'a>,
    i: usize,
    channel: usize,
    /// Radiance that is known already.
    known: Vec<Option<f64>>,
}

impl Way<'_> {
    fn inside(&self, at: [i64; 3]) -> bool {
        (0..3).all(|a| (0..i64::from(self.params.cells[a])).contains(&at[a]))
    }

    fn index(&self, [x, y, z]: [i64; 3]) -> usize {
        let [nx, ny, _, _] = self.params.cells.map(i64::from);
        ((z * ny + y) * nx + x) as usize
    }

    /// Extinction (0), albedo (1) or emission (2) of a cell; zero beyond the box.
    fn optics(&self, which: usize, channel: usize, at: [i64; 3]) -> f64 {
        let place = (3 * which + channel) * self.params.count() as usize;
        if self.inside(at) { self.inputs.optics[place + self.index(at)].into() } else { 0.0 }
    }

    /// The source function of a cell.
    fn source(&self, at: [i64; 3]) -> f64 {
        let (cells, channels) = (self.params.count() as usize, self.params.channels as usize);
        let count = self.params.source_coefficients as usize;
        let sent = |k: usize| {
            let moment = self.inputs.sources[(k * channels + self.channel) * cells + self.index(at)];
            f64::from(self.inputs.source_weights[self.i * count + k]) * f64::from(moment)
        };
        self.optics(1, self.channel, at) * (0..count).map(sent).sum::<f64>()
    }

    /// The cells around Y with their weights.
    fn around(&self, at: [i64; 3]) -> [([i64; 3], f64); 4] {
        let way = &self.inputs.directions[self.i];
        let axis = way.axis as usize;
        let [b, c] = SweepDirection::others(axis);
        let hop = |a: usize| if way.down >> a & 1 == 1 { -1 } else { 1 };
        let (f, g) = (f64::from(way.first), f64::from(way.second));
        [(0, 0, (1.0 - f) * (1.0 - g)), (1, 0, f * (1.0 - g)), (0, 1, (1.0 - f) * g), (1, 1, f * g)].map(
            |(j, k, weight)| {
                let mut to = at;
                to[axis] += hop(axis);
                to[b] += j * hop(b);
                to[c] += k * hop(c);
                (to, weight)
            },
        )
    }

    /// Whether a surface stands between a cell and a neighbour.
    fn obstructed(&self, at: [i64; 3], to: [i64; 3]) -> bool {
        let [x, y, z] = [0, 1, 2].map(|a| to[a] - at[a] + 1);
        !self.inputs.obstructed.is_empty() && self.inputs.obstructed[self.index(at)] >> (z * 9 + y * 3 + x) & 1 == 1
    }

    /// The cell of the plane before that is nearest to one of its neighbours, or X where there is no such plane.
    fn nearest(&self, to: [i64; 3], at: [i64; 3]) -> [i64; 3] {
        let axis = self.inputs.directions[self.i].axis as usize;
        let inside = [0, 1, 2].map(|a| to[a].clamp(0, i64::from(self.params.cells[a]) - 1));
        if inside[axis] == to[axis] { inside } else { at }
    }

    fn radiance(&mut self, at: [i64; 3]) -> f64 {
        let index = self.index(at);
        if let Some(known) = self.known[index] {
            return known;
        }
        let around = self.around(at);
        let (mut extinction, mut emission, mut source, mut arriving) = (0.0, 0.0, 0.0, 0.0);
        let first = if self.params.grey == 1 { 0 } else { self.channel };
        for (to, weight) in around {
            if self.obstructed(at, to) {
                extinction += weight * self.optics(0, first, at);
                emission += weight * self.optics(2, self.channel, at);
                source += weight * self.source(at);
                continue;
            }
            extinction += weight * self.optics(0, first, to);
            emission += weight * self.optics(2, self.channel, to);
            source += weight * self.source(self.nearest(to, at));
            arriving += weight * if self.inside(to) { self.radiance(to) } else { self.params.boundary.into() };
        }
        let length = f64::from(self.inputs.directions[self.i].length);
        let tau = 0.5 * (self.optics(0, first, at) + extinction) * length;
        let here = self.source(at);
        // ∫ e^-s ds and ∫ s e^-s ds / τ over 0 to τ, by their series where a difference would cancel.
        let (whole, upwind) = if tau < 1e-3 {
            (tau - tau * tau / 2.0 + tau.powi(3) / 6.0, tau / 2.0 - tau * tau / 3.0 + tau.powi(3) / 8.0)
        } else {
            (1.0 - (-tau).exp(), (1.0 - (-tau).exp() * (1.0 + tau)) / tau)
        };
        let mean = if tau > 0.0 { whole / tau } else { 1.0 };
        let mut light = (-tau).exp() * arriving + here * (whole - upwind) + source * upwind;
        if self.params.emits == 1 {
            light += length * mean * 0.5 * (self.optics(2, self.channel, at) + emission);
        }
        self.known[index] = Some(light);
        light
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::basis::healpix;
    use crate::media::Lattice;
    use bytemuck::Zeroable;
    use glam::{DAffine3, DMat3, DVec3, UVec3};

    const CELLS: [u32; 3] = [4, 3, 6];

    fn directions() -> Vec<SweepDirection> {
        let linear = DMat3::from_cols(DVec3::X, DVec3::new(0.35, 1.0, 0.1), DVec3::new(-0.2, 0.25, 1.0)) * 0.1;
        let lattice = Lattice::new(UVec3::new(7, 5, 11), DAffine3::from_mat3(linear)).unwrap();
        healpix::directions(2).into_iter().map(|d| SweepDirection::new(d, &lattice, CELLS)).collect()
    }

    fn params() -> SweepParams {
        let mut params = SweepParams::zeroed();
        params.cells = [4, 3, 6, 6];
        (params.directions, params.batch, params.plane) = (48, 48, 24);
        (params.channels, params.weight_channels, params.coefficients) = (1, 1, 1);
        (params.grey, params.planar) = (1, 1);
        params
    }

    fn optics(extinction: impl Fn(usize) -> f32, albedo: f32) -> Vec<f32> {
        let plane = |value: &dyn Fn(usize) -> f32| (0..3 * 72).map(|n| value(n % 72)).collect::<Vec<_>>();
        [plane(&extinction), plane(&|_| albedo), plane(&|_| 0.0)].concat()
    }

    /// What comes in, and what a source of 1 sends, make 1 together: in rough media and at walls.
    #[test]
    fn a_white_furnace_is_white() {
        let directions = directions();
        let optics = optics(|n| if n % 5 == 1 { 0.0 } else { 30.0 * (0.7 * n as f32).sin().abs() }, 1.0);
        let weights = vec![1.0 / 48.0; 48];
        let (sources, source_weights) = (vec![1.0; 72], vec![1.0; 48]);
        let inputs = SweepInputs {
            optics: &optics,
            directions: &directions,
            sources: &sources,
            source_weights: &source_weights,
            weights: &weights,
            obstructed: &[],
        };
        let arriving = sweep(&SweepParams { boundary: 1.0, ..params() }, &inputs);
        let sent = sweep(&SweepParams { source_coefficients: 1, ..params() }, &inputs);
        for (arriving, sent) in arriving.iter().zip(&sent) {
            assert!((arriving + sent - 1.0).abs() < 1e-6, "{arriving} {sent}");
            assert!(*arriving > 1e-3 && *sent > 0.1, "{arriving} {sent}");
        }
    }
}
