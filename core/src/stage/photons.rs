//! `photons`: light that the medium scatters, left by photons on the cells of a coarse grid, for many lights at once.
//!
//! A photon stands for light from one direction ω of a set, all around the box. It enters there, flies along -ω, and is
//! scattered until it leaves, is absorbed, or is too faint: the path does not depend on what shines. Each of K lights b_k counts
//! it with b_k(ω), so that one path serves all of them, and the same photons can be flown again for other lights. What it
//! leaves in a cell, for the direction ω' from which it comes at that time (against its way), are the moments
//!
//! Φ\[cell\]\[k\]\[j\] += b_k(ω) · P(ω) · w · D · Y_j(ω'), j < bands²,
//!
//! with P the power that enters per unit of radiance (4π times the box's area as ω sees it), w the path's weight, which begins
//! as 1, and D what a deposit counts, by kind ([`photon_deposit`]): an estimate of the length that is flown within a cell of the
//! volume V, over V.
//!
//! - `TRACK`: ℓ/V in every cell that a flight crosses, ℓ metres of it.
//! - `COLLISION`: 1/σt where a flight ends in a collision, spread over the cells around.
//! - `ABSORPTION`: 1/σa where a photon is absorbed, spread the same; scatterings then leave w as it is and absorb by chance.
//!
//! What is spread over cells goes to those that have a row, in proportion to (c² - d²)³ (eq. 14 of Zhang, Dong, Ma 2013), d the way to
//! the cell's centre in cells, as far as `radius` c, all of it over V: nothing is lost at walls or in empty cells. The first
//! flight leaves nothing: light that has not been scattered is known without photons. A scattering multiplies w by the albedo of its
//! place (scattering over extinction), and where w is below [`Photons::WEAK`] the photon goes on by chance.
//!
//! After N photons the moments of scattered radiance are φ = Φ/N. Where N is a multiple of the set's directions, every direction has its
//! share; directions of one set have equal solid angles (those of HEALPix).
//!
//! Free flights are drawn against a majorant as [`Path`](super::Path)'s. Random numbers are the hash of (photon, seed, number of the
//! draw). A photon's number is its round times `directions` plus the number of its direction: it does not depend on how many
//! directions are listed.
//!
//! **Fixed point.** `deposits` holds `scale` · Φ as integers, to which is added atomically, so that no order changes them. A value is
//! rounded down after a random number within 0 to 1 was added to it, the same for all that a flight leaves in a cell: right in the
//! mean, and independent of which lights are listed. Sums that leave an i32 are counted in `counters`
//! ([`photon_counter::OVERFLOWS`]), and then nothing of `deposits` holds. `deposits` and `counters` are added to: whoever runs the stage for
//! the first time gives them as zeros ([`Plan::kept`](crate::exec::Plan::kept) does).
//!
//! The work axis is the listed directions, round by round.

use glam::UVec3;

use crate::basis::SphericalHarmonics;
use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::media::Lattice;
use crate::stage::grid::{covers, is_medium};
use crate::stage::{GridParams, Kernel, PhaseParams, require};

kernel_struct! {
    /// Parameters of `photons`.
    pub struct PhotonParams {
        /// Samples of the density along x, y, z; unused.
        dims: U32x4,
        /// Row of the linear map from metres to voxels.
        index_x: F32x4,
        /// See `index_x`.
        index_y: F32x4,
        /// See `index_x`.
        index_z: F32x4,
        /// Parameters of the phase function.
        phase: F32x4,
        /// Cells of the majorant along x, y, z; voxels of a cell's side.
        majorant_cells: U32x4,
        /// Cells along x, y, z that light is left on; together they fill the box; unused.
        cells: U32x4,
        /// Directions of the set.
        directions: U32,
        /// Directions that are listed.
        listed: U32,
        /// First round.
        round: U32,
        /// Rounds: photons of each listed direction.
        rounds: U32,
        /// Another seed gives other photons.
        seed: U32,
        /// Turns of a photon at the most: ways to a collision or to a wall of the majorant's cells.
        turns: U32,
        /// Scatterings of a photon at the most.
        max_depth: U32,
        /// Scatterings before the first flight that leaves light, at least 1.
        begin: U32,
        /// Scatterings before the first flight beyond those that leave light, at most `max_depth` + 1.
        end: U32,
        /// Lights.
        lights: U32,
        /// The most weights of a direction.
        weights: U32,
        /// Bands of the moments.
        bands: U32,
        /// Rows of `deposits`.
        rows: U32,
        /// A constant of [`photon_deposit`].
        deposit: U32,
        /// The channel of `scattering`.
        channel: U32,
        /// Kind of the phase function.
        phase_kind: U32,
        /// Where the phase function's table begins in `tables`.
        phase_at: U32,
        /// Entries of the phase function's table.
        phase_size: U32,
        /// Where the choice among the pieces between those begins in `tables`.
        bends_at: U32,
        /// Extinction per unit of density, 1/m.
        densest: F32,
        /// The least majorant where anything is, 1/m.
        least: F32,
        /// Albedo: scattering per extinction, or per `scattering` times `densest`.
        albedo: F32,
        /// Volume of a cell of those that light is left on, m³.
        volume: F32,
        /// Cells from a collision to the farthest that gets something of it.
        radius: F32,
        /// Units of `deposits` per unit of Φ.
        scale: F32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

kernel_struct! {
    /// A direction of light.
    pub struct PhotonDirection {
        /// Unit vector toward the source; the power P that enters per unit of radiance, m² sr.
        toward: F32x4,
        /// The part of it that enters by a wall across x.
        first: F32,
        /// The part that enters by a wall across x or y.
        second: F32,
        /// Its number in the set.
        number: U32,
        /// Where its weights begin.
        weights: U32,
        /// Its weights.
        count: U32,
        /// Unused.
        unused_0: U32,
        /// Unused.
        unused_1: U32,
        /// Unused.
        unused_2: U32,
    }
}

/// What photons leave, and where.
pub mod photon_deposit {
    /// Along every flight.
    pub const TRACK: u32 = 0;
    /// At every collision.
    pub const COLLISION: u32 = 1;
    /// Where they are absorbed.
    pub const ABSORPTION: u32 = 2;
}

/// Places in [`Photons::counters`].
pub mod photon_counter {
    /// Photons that set out.
    pub const PHOTONS: u32 = 0;
    /// Flights that left light.
    pub const DEPOSITS: u32 = 1;
    /// Photons that would have gone on after `max_depth` scatterings or `turns` turns.
    pub const TRUNCATED: u32 = 2;
    /// Deposits of which no cell has a row: along a whole flight, or around a collision.
    pub const LOST: u32 = 3;
    /// Sums and values that an i32 does not hold. Any other number than 0 says that `deposits` are wrong; the number itself
    /// depends on the order of adding.
    pub const OVERFLOWS: u32 = 4;
    /// Counters.
    pub const COUNT: u32 = 5;
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Photons {
    /// Parameters.
    pub params: PhotonParams,
    /// Density ρ.
    pub density: Field,
    /// The density that scatters, ρs, RGB; unused; where it is not ρ.
    pub scattering: Option<Field>,
    /// Mean and maximum of each cell, from `reduce`, over ρ.
    pub majorant: Buf<[f32; 2]>,
    /// Recurrences of the harmonics
    /// ([`recurrence_table`](crate::basis::recurrence_table)), then the phase function's tables as
    /// [`Path::tables`](super::Path::tables)'.
    pub tables: Buf<f32>,
    /// The listed directions.
    pub directions: Buf<PhotonDirection>,
    /// For each listed direction its weights: the number of a light, and b_k(ω).
    pub weights: Buf<[f32; 2]>,
    /// For each cell, x fastest, the number of its row plus 1; 0 for none.
    pub rows: Buf<u32>,
    /// `scale` · Φ, laid out \[row\]\[light\]\[j\].
    pub deposits: Buf<i32>,
    /// Counts of [`photon_counter`], as u32.
    pub counters: Buf<i32>,
}

impl PhotonParams {
    /// Of a medium's lattice, with `cells` to leave light on, all else zero but the ordinary values of `turns`, `radius`,
    /// `begin`, and `end` and `max_depth` for so many scatterings.
    pub fn new(lattice: &Lattice, cells: UVec3, max_depth: u32) -> Self {
        let grid = GridParams::new(lattice);
        let [index_x, index_y, index_z] = grid.index;
        let voxel = lattice.index_to_world().matrix3.determinant().abs();
        let volume = voxel * lattice.dims().as_dvec3().element_product() / cells.as_dvec3().element_product();
        Self {
            dims: grid.dims,
            index_x,
            index_y,
            index_z,
            cells: cells.extend(0).to_array(),
            turns: Photons::TURNS,
            max_depth,
            begin: 1,
            end: max_depth.saturating_add(1),
            volume: volume as f32,
            radius: Photons::RADIUS,
            ..bytemuck::Zeroable::zeroed()
        }
    }

    /// Moments of a light in a cell.
    pub fn coefficients(&self) -> u32 {
        self.bands * self.bands
    }

    /// Values of `deposits`.
    pub fn deposits(&self) -> u64 {
        u64::from(self.rows).saturating_mul(self.lights.into()).saturating_mul(self.coefficients().into())
    }
}

impl Photons {
    /// Turns of a photon, ordinarily.
    pub const TURNS: u32 = 1 << 13;
    /// Weight below which a photon goes on by chance.
    pub const WEAK: f32 = 0.25;
    /// Cells from a collision to the farthest that gets something of it, ordinarily.
    pub const RADIUS: f32 = 4.0;
    /// The same at the most.
    pub const FARTHEST: f32 = 16.0;
    /// Flights that a kernel keeps before it leaves their light.
    pub const EVENTS: u32 = 8;
    /// Moments that one turn of a loop leaves.
    pub const STRIDE: u32 = 4;

    /// Units of `deposits` for lights that nowhere exceed `peak` and are flown with `photons` photons: moments do not exceed √4π
    /// `peak` where nothing shines by itself, and there is room for two hundred times as much as that in one cell.
    pub fn scale(peak: f64, photons: u64) -> f32 {
        let most = (4.0 * std::f64::consts::PI).sqrt() * peak * photons as f64;
        (f64::from(i32::MAX) / (200.0 * most)) as f32
    }

    /// Loop turns to leave the light of a flight, at the most.
    fn turns(&self) -> u64 {
        let p = &self.params;
        let each = 1 + u64::from(p.weights) * (1 + u64::from(p.coefficients().div_ceil(Self::STRIDE)));
        // Kernels may run the inner loop of harmonics over all bands, so that drivers unroll it.
        let harmonics = u64::from(p.bands * (p.bands + 1));
        let cells = if p.deposit == photon_deposit::TRACK {
            // A flight crosses the walls of each axis once.
            p.cells[..3].iter().map(|&n| u64::from(n)).sum::<u64>() + 3
        } else {
            let side = 2 * u64::from(p.radius.ceil() as u32) + 1;
            side * side * side
        };
        let sums = if p.deposit == photon_deposit::TRACK { 0 } else { cells };
        1 + harmonics + sums + cells * each
    }
}

impl Kernel for Photons {
    const NAME: &'static str = "photons";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::sample("scattering", FieldFormat::Rgba, self.scattering),
            Binding::read("majorant", Some(self.majorant)),
            Binding::read("tables", Some(self.tables)),
            Binding::read("directions", Some(self.directions)),
            Binding::read("weights", Some(self.weights)),
            Binding::read("rows", Some(self.rows)),
            Binding::write("deposits", Some(self.deposits)),
            Binding::write("counters", Some(self.counters)),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.listed.checked_mul(self.params.rounds).unwrap_or(0)
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_medium(&self.density, self.scattering, None, None, p.dims)?;
        covers("majorant", self.majorant, p.majorant_cells, p.dims)?;
        require!(p.channel < 3, "channel {} of 3", p.channel);
        require!(
            (1..=p.directions).contains(&p.listed) && self.directions.len >= p.listed.into(),
            "{} listed of {} directions, {} of them given",
            p.listed,
            p.directions,
            self.directions.len
        );
        let photons = (u64::from(p.round) + u64::from(p.rounds)).saturating_mul(p.directions.into());
        require!(
            self.axis() > 0 && photons <= u32::MAX.into(),
            "{} rounds from {} on of {} directions: no photons, or too many",
            p.rounds,
            p.round,
            p.directions
        );
        require!(p.max_depth > 0 && p.turns > 0, "photons of {} scatterings in {} turns", p.max_depth, p.turns);
        require!(
            p.begin > 0 && p.begin < p.end && p.end - 1 <= p.max_depth,
            "light of the flights after {} to {} scatterings of {}",
            p.begin,
            p.end,
            p.max_depth
        );
        let [x, y, z, _] = p.cells;
        let cells =
            [x, y, z].iter().try_fold(1u32, |n, &c| n.checked_mul(c)).filter(|&n| n > 0 && n <= i32::MAX as u32);
        require!(
            cells.is_some_and(|n| self.rows.len >= n.into()),
            "rows of {} cells, not of {:?}",
            self.rows.len,
            [x, y, z]
        );
        require!(
            (1..=SphericalHarmonics::DEVICE_BANDS).contains(&p.bands),
            "{} bands of moments; devices have up to {}",
            p.bands,
            SphericalHarmonics::DEVICE_BANDS
        );
        // Tables hold the numbers of lights as floats.
        require!(p.rows > 0 && (1..=1 << 24).contains(&p.lights), "{} rows of {} lights", p.rows, p.lights);
        require!(
            self.deposits.len >= p.deposits() && p.deposits() <= u32::MAX.into(),
            "{} deposits for {} rows of {} lights in {} bands",
            self.deposits.len,
            p.rows,
            p.lights,
            p.bands
        );
        require!(self.counters.len >= photon_counter::COUNT.into(), "{} counters", self.counters.len);
        require!(self.weights.len > 0 && p.weights <= p.lights, "{} weights of {} lights", p.weights, p.lights);
        require!(p.deposit <= photon_deposit::ABSORPTION, "no kind of deposit is {}", p.deposit);
        require!((0.0..=1.0).contains(&p.albedo), "an albedo of {}", p.albedo);
        require!(
            p.deposit != photon_deposit::ABSORPTION || p.albedo < 1.0,
            "an albedo of 1, and light is left where photons are absorbed"
        );
        let plain = |v: f32| v > 0.0 && v.is_finite();
        require!(
            plain(p.densest) && plain(p.volume) && plain(p.scale),
            "an extinction of {} /m, cells of {} m³, a scale of {}",
            p.densest,
            p.volume,
            p.scale
        );
        require!(p.radius >= 1.0 && p.radius <= Self::FARTHEST, "a radius of {} cells", p.radius);
        let mut table = u64::from(p.bands * (p.bands + 1));
        if p.phase_kind == PhaseParams::TABLE {
            require!(p.phase_size >= 2, "a phase table of {} entries", p.phase_size);
            let size = u64::from(p.phase_size);
            table = table.max(u64::from(p.phase_at) + size);
            table = table.max(u64::from(p.bends_at) + u64::from(super::Path::CHOICE) * (size - 1));
        }
        require!(self.tables.len >= table, "tables of {} values for {table}", self.tables.len);
        Ok(())
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let (p, each) = (&self.params, self.turns());
        // Photons that run abreast are followed one after another for some flights, whose light they then leave together.
        let (events, traced) = (u64::from(Self::EVENTS), u64::from(p.turns) + 4);
        let group = events.saturating_mul(each).saturating_add(traced);
        let some = events * (turns / group) + (turns % group).saturating_sub(traced) / each;
        require!(
            some > 0,
            "the light of a flight takes up to {each} turns of loops and its photon up to {traced}, and {turns} are allowed: \
             fewer lights, cells or bands at a time, a smaller radius or fewer turns of a photon need less"
        );
        let some = some.min((p.end - p.begin).into()) as u32;
        let pass = |begin: u32| {
            let mut pass = self.clone();
            (pass.params.begin, pass.params.end) = (begin, begin.saturating_add(some).min(p.end));
            pass
        };
        Ok((p.begin..p.end).step_by(some as usize).map(pass).collect())
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::basis::healpix;
    use crate::device::{FieldSpec, ResourceId};
    use crate::media::Phase;
    use crate::stage::{PhotonTable, photon_tables};

    fn photons(deposit: u32) -> Photons {
        let lattice = Lattice::in_box(UVec3::new(9, 6, 10), DVec3::ZERO, DVec3::new(1.8, 1.2, 2.0)).unwrap();
        let mut params = PhotonParams::new(&lattice, UVec3::new(4, 3, 5), 40);
        let table = PhotonTable::new(&lattice, &healpix::directions(1), 2, |i, _, out| {
            out.extend([(0, 1.0), (1, i as f64)]);
        });
        table.place(&mut params);
        let tables = photon_tables(2, &Phase::Isotropic, &mut params);
        params.majorant_cells = [2, 1, 2, 8];
        (params.rounds, params.lights, params.rows, params.deposit) = (3, 2, 60, deposit);
        (params.turns, params.densest, params.albedo, params.scale) = (100, 2.0, 0.5, 10.0);
        let spec = FieldSpec::dense([9, 6, 10], 1, FieldFormat::Scalar);
        Photons {
            params,
            density: Field { id: ResourceId(0), spec },
            scattering: None,
            majorant: Buf::new(ResourceId(1), 4),
            tables: Buf::new(ResourceId(2), tables.len() as u64),
            directions: Buf::new(ResourceId(3), table.directions.len() as u64),
            weights: Buf::new(ResourceId(4), table.weights.len() as u64),
            rows: Buf::new(ResourceId(5), 60),
            deposits: Buf::new(ResourceId(6), params.deposits()),
            counters: Buf::new(ResourceId(7), photon_counter::COUNT.into()),
        }
    }

    #[test]
    fn passes_take_every_flight_once() {
        for deposit in [photon_deposit::TRACK, photon_deposit::COLLISION] {
            let stage = photons(deposit);
            for some in [1u64, 3, 8, 19, 100] {
                let turns = 104 * some.div_ceil(8) + some * stage.turns();
                let passes = stage.passes(turns).unwrap();
                let mut begin = 1;
                for pass in &passes {
                    assert_eq!((pass.validate(), pass.params.begin), (Ok(()), begin));
                    begin = pass.params.end;
                    assert!(u64::from(pass.params.end - pass.params.begin) <= some);
                }
                assert_eq!((begin, passes.len() as u64), (41, 40u64.div_ceil(some)));
            }
            assert!(stage.passes(104 + stage.turns() - 1).unwrap_err().contains("a smaller radius"));
            assert_eq!(stage.passes(u64::MAX).unwrap().len(), 1);
        }
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let wrong = |change: fn(&mut Photons)| {
            let mut photons = photons(photon_deposit::TRACK);
            change(&mut photons);
            photons.validate().is_err()
        };
        assert!(!wrong(|_| ()));
        assert!(wrong(|s| s.params.listed = 13));
        assert!(wrong(|s| s.params.rounds = 0));
        assert!(wrong(|s| s.params.round = u32::MAX / 12));
        assert!(wrong(|s| s.params.begin = 0));
        assert!(wrong(|s| s.params.end = 42));
        assert!(wrong(|s| s.params.cells[0] = 5));
        assert!(wrong(|s| s.params.bands = 11));
        assert!(wrong(|s| s.params.rows = 61));
        assert!(wrong(|s| s.params.weights = 3));
        assert!(wrong(|s| s.params.albedo = f32::NAN));
        assert!(wrong(|s| s.params.scale = 0.0));
        assert!(wrong(|s| s.params.radius = 17.0));
        assert!(wrong(|s| s.params.channel = 3));
        assert!(wrong(|s| s.params.phase_kind = PhaseParams::TABLE));
        assert!(wrong(|s| s.counters = Buf::new(ResourceId(7), 4)));
        assert!(wrong(|s| (s.params.deposit, s.params.albedo) = (photon_deposit::ABSORPTION, 1.0)));
    }

    #[test]
    fn scales_leave_room() {
        let scale = f64::from(Photons::scale(2.0, 1000));
        let uniform = (4.0 * std::f64::consts::PI).sqrt() * 2.0 * 1000.0 * scale;
        assert!((uniform * 200.0 / f64::from(i32::MAX) - 1.0).abs() < 1e-6);
    }
}
