//! `inject`: the density of a medium that is described instead of sampled (Giroud and Biri 2011, section 4.2).
//!
//! Each sample (i, j, k) of the lattice has a *place*: `place_x`, `place_y` and `place_z` applied to (i, j, k, 1). By
//! [`inject_kind`]:
//!
//! - Gaussians: Σ c exp(-a² |place - b|²) over the list of the sample's bin; place and b in metres from the middle of
//!   the lattice. Bins are cubes of 2^shift bricks; `starts` and `list` are those of [`Bins`](crate::media::Bins).
//! - Height fog: `density` · exp(-max(place.y, 0)), place.y in falloffs above the base.
//! - Noise: `density` · max(0, 1 + `contrast` · n(place)), place in cells of the first octave, n the
//!   [`FractalNoise`](crate::media::FractalNoise).
//! - Detail: `base` in place of `density` in the same.
//!
//! No value exceeds [`LARGEST`](crate::media::LARGEST).
//!
//! The work axis is the bricks of 8³ samples, x fastest, the last ones reaching past the lattice; a group is a layer of
//! bricks along z. In passes, each takes a part of every list and adds to what the ones before left.

use glam::{DAffine3, DMat3, DVec3};

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::media::{Bins, FractalNoise, Gaussian, Gaussians, Lattice, Medium};
use crate::stage::grid::is_plain;
use crate::stage::{Kernel, require};

kernel_struct! {
    /// Parameters of `inject`.
    pub struct InjectParams {
        /// Samples along x, y, z; a constant of [`inject_kind`].
        dims: U32x4,
        /// Bricks along x, y, z; binary logarithm of the bricks along a bin's side.
        bricks: U32x4,
        /// Bins along x, y, z; 1 where the lattice's edges stand at right angles, else 0.
        bins: U32x4,
        /// Row of the map from index to place.
        place_x: F32x4,
        /// See `place_x`.
        place_y: F32x4,
        /// See `place_x`.
        place_z: F32x4,
        /// Density of fog or of noise.
        density: F32,
        /// Contrast of the noise.
        contrast: F32,
        /// Octaves of the noise.
        octaves: U32,
        /// Seed of the noise.
        seed: U32,
        /// First entry of every list that this pass takes.
        list_begin: U32,
        /// One past the last entry of every list that this pass takes.
        list_end: U32,
        /// Entries of the longest list.
        longest: U32,
        /// Unused.
        unused: U32,
    }
}

/// What `inject` makes.
pub mod inject_kind {
    /// A sum of Gaussians.
    pub const GAUSSIANS: u32 = 0;
    /// Fog over a level plane.
    pub const HEIGHT_FOG: u32 = 1;
    /// Noise.
    pub const NOISE: u32 = 2;
    /// A field times noise.
    pub const DETAIL: u32 = 3;
}

kernel_struct! {
    /// A Gaussian as kernels see it.
    pub struct BlobRecord {
        /// Centre, metres from the middle of the lattice; a², 1/m².
        center: F32x4,
        /// Amplitude c; unused.
        amplitude: F32x4,
    }
}

impl BlobRecord {
    /// The records of a medium's Gaussians.
    pub fn of(medium: &Gaussians) -> Vec<Self> {
        let middle = medium.lattice().center();
        let record = |b: &Gaussian| Self {
            center: (b.center - middle).as_vec3().extend((b.a * b.a) as f32).to_array(),
            amplitude: [b.c as f32, 0.0, 0.0, 0.0],
        };
        medium.blobs().iter().map(record).collect()
    }
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Inject {
    /// Parameters.
    pub params: InjectParams,
    /// The field that noise multiplies.
    pub base: Option<Field>,
    /// The Gaussians.
    pub blobs: Option<Buf<BlobRecord>>,
    /// Where each bin's list begins, and the end of the last. Lists must lie within `list`, one behind the other.
    pub starts: Option<Buf<u32>>,
    /// Numbers of Gaussians, all below their number.
    pub list: Option<Buf<u32>>,
    /// The density, x fastest.
    pub out: Buf<f32>,
}

impl InjectParams {
    /// Of a lattice whose samples have the places that `place` takes their indices to.
    pub fn new(kind: u32, lattice: &Lattice, place: DAffine3) -> Self {
        let d = lattice.dims();
        let bricks = d.map(|n| n.div_ceil(Bins::BRICK));
        let row = |a: usize| place.matrix3.row(a).as_vec3().extend(place.translation[a] as f32).to_array();
        let mut params: Self = bytemuck::Zeroable::zeroed();
        params.dims = [d.x, d.y, d.z, kind];
        params.bricks = [bricks.x, bricks.y, bricks.z, 0];
        params.bins = [0, 0, 0, lattice.is_orthogonal().into()];
        [params.place_x, params.place_y, params.place_z] = [row(0), row(1), row(2)];
        params.list_end = u32::MAX;
        params
    }

    /// Places in metres from the middle of the lattice.
    pub fn centered(lattice: &Lattice) -> DAffine3 {
        DAffine3::from_translation(-lattice.center()) * lattice.index_to_world()
    }

    /// Places in falloffs above a base.
    pub fn above(lattice: &Lattice, base: f64, falloff: f64) -> DAffine3 {
        let up = DAffine3::from_translation(DVec3::new(0.0, -base, 0.0)) * lattice.index_to_world();
        DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(0.0, falloff, 0.0))) * up
    }

    /// Places in cells of the noise's first octave, less whole periods so that f32 holds them as well as it can.
    pub fn in_cells(lattice: &Lattice, noise: &FractalNoise) -> DAffine3 {
        let cells = DAffine3::from_scale(DVec3::splat(1.0 / noise.scale())) * lattice.index_to_world();
        let period = f64::from(FractalNoise::PERIOD);
        let whole = (cells.translation / period).floor() * period;
        DAffine3 { translation: cells.translation - whole, ..cells }
    }

    /// With the options of a noise.
    pub fn with_noise(self, noise: &FractalNoise) -> Self {
        let (octaves, seed, contrast) = (noise.octaves(), noise.seed(), noise.contrast() as f32);
        Self { octaves, seed, contrast, ..self }
    }

    /// With the layout of lists.
    pub fn with_bins(self, bins: &Bins) -> Self {
        let [x, y, z, _] = self.bricks;
        let d = bins.dims;
        let (bricks, sides) = ([x, y, z, bins.shift], [d.x, d.y, d.z, self.bins[3]]);
        Self { bricks, bins: sides, longest: bins.longest, ..self }
    }
}

impl Inject {
    /// Samples along each side of a brick.
    pub const BRICK: u32 = Bins::BRICK;

    /// Exponents from which on e^-q counts as 0. It is then below 4.2·10⁻¹³, less than what a Gaussian of 2²⁴ is cut
    /// off at, and a product of three such factors is still a number that f32 holds in full.
    pub const FAR: f32 = 28.5;

    /// Turns of loops that a kernel may take for one entry of a list, or one octave, at the most: itself, and each of a
    /// column of samples.
    const TURNS: u64 = 1 + Self::BRICK as u64;
}

impl Kernel for Inject {
    const NAME: &'static str = "inject";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        let [x, y, ..] = self.params.dims.map(u64::from);
        vec![
            Binding::sample("base", FieldFormat::Scalar, self.base),
            Binding::read("blobs", self.blobs),
            Binding::read("starts", self.starts),
            Binding::read("list", self.list),
            Binding::write("injected", Some(self.out)).in_parts::<f32>(x * y * u64::from(Self::BRICK)),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.bricks[..3].iter().product()
    }

    fn group(&self) -> u32 {
        self.params.bricks[0] * self.params.bricks[1]
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        let [x, y, z, kind] = p.dims;
        let count = u64::from(x) * u64::from(y);
        require!(count.checked_mul(z.into()).is_some_and(|n| n > 0), "{:?} samples", &p.dims[..3]);
        // Kernels index the samples of a layer of bricks with 32 bits.
        let layer = count.checked_mul(Self::BRICK.into()).is_some_and(|n| n <= u32::MAX.into());
        require!(layer, "layers of {x} × {y} × {} samples", Self::BRICK);
        let bricks = [0, 1, 2].map(|a| p.dims[a].div_ceil(Self::BRICK));
        require!(p.bricks[..3] == bricks, "{:?} bricks over {:?} samples", p.bricks, p.dims);
        let axis = bricks.iter().try_fold(1u32, |n, &b| n.checked_mul(b));
        require!(axis.is_some(), "{bricks:?} bricks are more than 32 bits count");
        require!(count * u64::from(z) <= self.out.len, "{} samples into {} places", count * u64::from(z), self.out.len);
        let rows = [p.place_x, p.place_y, p.place_z];
        require!(rows.as_flattened().iter().all(|v| v.is_finite()), "places {rows:?}");
        match kind {
            inject_kind::GAUSSIANS => {
                let shift = p.bricks[3];
                require!(shift < 32, "bins of 2^{shift} bricks");
                let bins = bricks.map(|n| ((n - 1) >> shift) + 1);
                require!(p.bins[..3] == bins, "{:?} bins over {bricks:?} bricks", p.bins);
                let lists: u64 = bins.iter().map(|&n| u64::from(n)).product();
                let starts = self.starts.map_or(0, |b| b.len);
                require!(starts > lists, "{starts} starts of {lists} lists");
                require!(self.list.is_some() && self.blobs.is_some(), "no lists or no Gaussians");
                require!(p.list_begin < p.list_end, "entries {} to {}", p.list_begin, p.list_end);
            }
            inject_kind::HEIGHT_FOG => {}
            inject_kind::NOISE | inject_kind::DETAIL => {
                let most = FractalNoise::MAX_OCTAVES;
                require!((1..=most).contains(&p.octaves), "{} octaves; 1 to {most}", p.octaves);
                if kind == inject_kind::DETAIL {
                    require!(self.base.is_some_and(|f| is_plain(&f, p.dims)), "no base of {:?} samples", p.dims);
                }
            }
            other => return Err(format!("kind {other}")),
        }
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let p = &self.params;
        if p.dims[3] != inject_kind::GAUSSIANS {
            let needed = Self::TURNS * (u64::from(p.octaves) + 1);
            require!(needed <= turns, "{} octaves take {needed} turns of loops, and {turns} are allowed", p.octaves);
            return Ok(vec![self.clone()]);
        }
        // What the passes before left and what this one leaves take two columns more.
        let entries = (turns / Self::TURNS).saturating_sub(2).min(p.longest.max(1).into()) as u32;
        require!(entries > 0, "one Gaussian takes {} turns of loops, and {turns} are allowed", 3 * Self::TURNS);
        let pass = |begin: u32| {
            let (mut pass, end) = (self.clone(), begin.saturating_add(entries));
            (pass.params.list_begin, pass.params.list_end) = (begin, if end >= p.longest { u32::MAX } else { end });
            pass
        };
        Ok((0..p.longest.max(1)).step_by(entries as usize).map(pass).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::{FieldSpec, ResourceId};
    use glam::UVec3;

    fn gaussians() -> Inject {
        let lattice = Lattice::in_box(UVec3::new(20, 9, 17), DVec3::ZERO, DVec3::ONE).unwrap();
        let blob = Gaussian { center: DVec3::splat(0.5), a: 2.0, c: 1.0 };
        let medium = Gaussians::new(vec![blob; 100], lattice).unwrap();
        let bins = medium.bins();
        let buf = |id, len: usize| Some(Buf::new(ResourceId(id), len as u64));
        Inject {
            params: InjectParams::new(0, medium.lattice(), InjectParams::centered(medium.lattice())).with_bins(bins),
            base: None,
            blobs: Some(Buf::new(ResourceId(1), 100)),
            starts: buf(2, bins.starts.len()),
            list: buf(3, bins.list.len()),
            out: Buf::new(ResourceId(4), 20 * 9 * 17),
        }
    }

    #[test]
    fn passes_cover_every_list_once_and_keep_to_the_turns() {
        let stage = gaussians();
        assert_eq!(stage.validate(), Ok(()));
        for turns in [27, 36, 100, 917, 918, 1000, u64::MAX] {
            let passes = stage.passes(turns).unwrap();
            let mut next = 0;
            for pass in &passes {
                assert_eq!(pass.validate(), Ok(()));
                assert_eq!(pass.params.list_begin, next);
                let end = pass.params.list_end.min(100);
                assert!(u64::from(end - next) * 9 + 16 <= turns || turns == u64::MAX, "{turns}");
                next = pass.params.list_end;
            }
            assert_eq!((next, passes.len() == 1), (u32::MAX, turns >= 918));
        }
        assert!(stage.passes(26).is_err());
        let mut empty = stage.clone();
        empty.params.longest = 0;
        assert_eq!(empty.passes(27).unwrap().len(), 1);
    }

    #[test]
    fn what_kernels_would_index_out_of_bounds_is_refused() {
        let wrong: [fn(&mut Inject); 12] = [
            |s| s.params.dims[2] = 18,
            |s| s.params.dims[3] = 4,
            |s| s.params.dims[0] = 0,
            |s| s.params.bricks[1] = 1,
            |s| s.params.bricks[3] = 40,
            |s| s.params.bins[2] = 2,
            |s| s.params.place_y[3] = f32::NAN,
            |s| s.params.list_begin = u32::MAX,
            |s| s.starts = Some(Buf::new(ResourceId(2), 18)),
            |s| s.blobs = None,
            |s| s.out.len -= 1,
            |s| s.params.dims[3] = inject_kind::DETAIL,
        ];
        for (n, wrong) in wrong.iter().enumerate() {
            let mut stage = gaussians();
            wrong(&mut stage);
            assert!(stage.validate().is_err(), "{n}");
        }
        let mut stage = gaussians();
        (stage.params.dims[3], stage.params.octaves) = (inject_kind::DETAIL, 16);
        stage.base = Some(Field { id: ResourceId(9), spec: FieldSpec::dense([20, 9, 17], 1, FieldFormat::Scalar) });
        assert_eq!(stage.validate(), Ok(()));
        assert!(stage.passes(152).is_err() && stage.passes(153).is_ok());
    }

    #[test]
    fn places_are_what_they_are_called() {
        let lattice = Lattice::in_box(UVec3::new(4, 2, 6), DVec3::new(100.0, -7.0, 3.0), DVec3::new(102.0, -6.0, 6.0));
        let lattice = lattice.unwrap();
        let at = |map: DAffine3| map.transform_point3(DVec3::new(3.0, 1.0, 0.0));
        assert!((at(InjectParams::centered(&lattice)) - DVec3::new(0.75, 0.25, -1.25)).length() < 1e-12);
        // The sample stands at y = -6.25.
        assert!((at(InjectParams::above(&lattice, -8.0, 4.0)) - DVec3::new(0.0, 7.0, 0.0)).length() < 1e-12);
        let noise = FractalNoise::new(0.1, 1, 0, 1.0).unwrap();
        let p = at(InjectParams::in_cells(&lattice, &noise));
        // 101.75 m are 1017.5 cells, less three periods; -6.25 m are -62.5, and one period more.
        assert!((p - DVec3::new(249.5, 193.5, 32.5)).length() < 1e-9, "{p}");
    }
}
