//! `path`: unbiased paths of light through medium, lights, environment and surfaces.
//!
//! A pixel's sample is one path from a random place of the pixel. Free flights are drawn against a *majorant*, a rate μ (1/m)
//! that is constant in each cell of `majorant` and nowhere below the extinction: max ρ over all voxels that a lookup within the
//! cell touches, times the largest of the three extinctions, and at least `least` where that is not zero. A ray is walked from
//! cell to cell; in each a distance is drawn anew until it stays within, and there lies a *tentative collision*.
//!
//! - The ray from the eye goes on to its end (ratio tracking): at each collision its T_c is multiplied by 1 - σt_c/μ. It
//!   gives the film's T and depth, emission Σ T j/μ, what stands behind times T, and one place to scatter at: of the
//!   collisions, each with the weight Σ_c T_c σs_c/μ, and the surface at its end with Σ_c T_c, one in proportion to the weights.
//! - At a place to scatter, one light or the environment is chosen by `choices`, and what comes from it is estimated by ratio
//!   tracking toward it. The environment is drawn from a table over its texels, and weighed with the balance heuristic
//!   against the direction in which the path goes on, which is drawn from the phase function or the material.
//! - From there on, flights end at a collision (delta tracking) with the probability Σ β_c σt_c / (μ Σ β_c), β the path's
//!   weight. β is divided by the probability of what happened, so that it is the ratio of a channel's own probability of the
//!   path to that of the mean of all channels: spectral multiple importance sampling, and β_c is bounded by three.
//! - Weights below [`Path::FAINT`] (T) and [`Path::WEAK`] (β) are put to Russian roulette, and so is everything after
//!   [`Path::LONG`] scatterings, with the chance of one in as many.
//!
//! Random numbers are the hash of (pixel, sample, picture, number of the draw): [`random`](crate::random).
//!
//! A dispatch takes `turns` turns of each pixel at the most: a turn is the way to a collision or to a cell's wall, the end of a
//! walk, or a scattering; or some of these that follow each other. `paths` keeps what is on its way, `sums` what has come: nothing is cut off, and how often the stage is
//! run, and with how many turns, changes no bit. It is run until every pixel has `samples` samples.
//!
//! `sums` is three vectors a pixel: Σ L and the number of samples; Σ T and Σ of the squares of L's mean over the channels; Σ of light
//! stopped and the same weighed with its distance; unused. The film is the means, as [`March`](super::March)'s. All zeros
//! are a pixel before its first sample.
//!
//! The work axis is the pixels, row by row.

use crate::device::{Binding, Buf, Field, FieldFormat};
use crate::kernel_struct;
use crate::stage::grid::{covers, is_color, is_medium};
use crate::stage::trace::holds;
use crate::stage::upsample::is_sky;
use crate::stage::{Kernel, LightRecord, MeshRecord, PhaseParams, require};

kernel_struct! {
    /// Parameters of `path`.
    pub struct PathParams {
        /// Samples of the density along x, y, z; unused.
        dims: U32x4,
        /// Row of the linear map from metres to voxels.
        index_x: F32x4,
        /// See `index_x`.
        index_y: F32x4,
        /// See `index_x`.
        index_z: F32x4,
        /// The eye in index space; unused.
        eye: F32x4,
        /// The eye from the mesh's origin; the mesh's extent: metres.
        mesh_eye: F32x4,
        /// Axis f of the camera, as [`March`](super::March)'s.
        forward: F32x4,
        /// Axis r, times the half width of the picture at distance 1.
        right: F32x4,
        /// Axis u, times the half height.
        up: F32x4,
        /// Extinction per unit of density, 1/m, RGB; unused.
        extinction: F32x4,
        /// Albedo, RGB; unused.
        albedo: F32x4,
        /// Emission per unit of emission density, W m⁻³ sr⁻¹, RGB; unused.
        emission: F32x4,
        /// Parameters of the phase function.
        phase: F32x4,
        /// Multiplies the environment, RGB; its rotation in turns.
        environment: F32x4,
        /// Texels of the environment's field along x, y, z; unused.
        environment_dims: U32x4,
        /// Cells of the majorant along x, y, z; voxels of a cell's side.
        majorant_cells: U32x4,
        /// Columns of the picture.
        width: U32,
        /// Rows of the picture.
        height: U32,
        /// Samples that every pixel shall have.
        samples: U32,
        /// Turns of each pixel at the most.
        turns: U32,
        /// Scatterings of a path at the most.
        max_depth: U32,
        /// Number of the picture within a sequence.
        frame: U32,
        /// 1 to begin anew, whatever `sums` holds.
        fresh: U32,
        /// 1 where the environment is seen behind everything.
        visible: U32,
        /// Lights.
        lights: U32,
        /// What is chosen from at a place to scatter: the lights, then the environment where there is one.
        choices: U32,
        /// Boxes of the mesh; 0 without one.
        nodes: U32,
        /// Kind of the phase function.
        phase_kind: U32,
        /// Where the phase function's table begins in `tables`.
        phase_at: U32,
        /// Entries of the phase function's table.
        phase_size: U32,
        /// Where the choice among the pieces between those begins in `tables`.
        bends_at: U32,
        /// Where the choice among lights and environment begins in `tables`.
        choices_at: U32,
        /// Where the materials begin in `tables`: diffuse RGB and the exponent, specular RGB and an unused value.
        materials_at: U32,
        /// Where the choice among the cells of the environment begins in `tables`.
        sky_at: U32,
        /// Where the cosines at the edges of its rows begin in `tables`.
        edges_at: U32,
        /// Columns of its cells.
        sky_columns: U32,
        /// Rows of its cells.
        sky_rows: U32,
        /// Columns of the environment.
        environment_width: U32,
        /// Rows of the environment.
        environment_height: U32,
        /// Floor of r² in 1/r², m².
        light_floor: F32,
        /// The largest of the three extinctions.
        densest: F32,
        /// The least majorant where anything is, 1/m.
        least: F32,
        /// Lights that are spots: kernels that run both sides of conditions leave cones out where there is none.
        spots: U32,
        /// Unused.
        unused: U32,
    }
}

kernel_struct! {
    /// A path on its way. Places are metres from the eye.
    pub struct PathRecord {
        /// Where its ray begins; metres along it.
        place: F32x4,
        /// Unit direction of the ray; where it ends, metres.
        way: F32x4,
        /// Direction in which it goes on after a light was looked at; the probability of that, 1/sr.
        next: F32x4,
        /// β; while the eye's ray is walked, β of the chosen place over the sum of all weights, and that sum.
        weight: F32x4,
        /// L so far; metres to the chosen place, negative for that on a surface.
        light: F32x4,
        /// What comes from the light that is looked at, but for T; light stopped.
        pending: F32x4,
        /// T of the walk; light stopped weighed with its distance.
        ratio: F32x4,
        /// T of the eye's ray; metres to the surface, [`FAR`](super::FAR) without one.
        through: F32x4,
        /// Cell of the majorant along x, y, z; 1 where the walk has ended.
        cell: U32x4,
        /// A constant of [`path_mode`]; draws; scatterings; the surface's triangle.
        count: U32x4,
    }
}

/// What a path is about.
pub mod path_mode {
    /// Nothing: a new one may begin.
    pub const IDLE: u32 = 0;
    /// The eye's ray is walked.
    pub const VIEW: u32 = 1;
    /// A light is looked at.
    pub const SHADOW: u32 = 2;
    /// It is about to go on.
    pub const DEPART: u32 = 3;
    /// It is on its way to where it scatters next.
    pub const FLIGHT: u32 = 4;
}

/// The stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    /// Parameters.
    pub params: PathParams,
    /// Density ρ.
    pub density: Field,
    /// The density that scatters, ρs, RGB; unused; where it is not ρ.
    pub scattering: Option<Field>,
    /// The density that the eye's ray sees scatter, RGB; unused; where it is not ρs: of the weights of its places to scatter at.
    pub seen: Option<Field>,
    /// Emission density ρe, where it is not ρ.
    pub emission: Option<Field>,
    /// Emission density with a colour, RGB; unused; in place of ρe.
    pub emission_color: Option<Field>,
    /// Texels of the environment, as [`March::environment`](super::March::environment).
    pub environment: Option<Field>,
    /// Mean and maximum of each cell, from `reduce`, over ρ and ρe.
    pub majorant: Buf<[f32; 2]>,
    /// Lights, from the eye.
    pub lights: Option<Buf<LightRecord>>,
    /// Tables. A *choice* is three values for each of its n items, to be chosen in proportion to weights (the alias method of
    /// Walker 1977): the item at place ⌊n ξ⌋ is taken where ξ' is less than its first value, else that whose number is the second;
    /// the third is what the item's choice goes by: a probability, or one per steradian.
    pub tables: Buf<f32>,
    /// Boxes and triangles.
    pub mesh: Option<Buf<MeshRecord>>,
    /// What stands behind each pixel, as [`March::surface`](super::March::surface) of one sample.
    pub background: Option<Buf<[f32; 4]>>,
    /// Three vectors a pixel.
    pub sums: Buf<[f32; 4]>,
    /// What is on its way.
    pub paths: Buf<PathRecord>,
    /// Two vectors a pixel.
    pub film: Buf<[f32; 4]>,
}

impl Path {
    /// Turns of a dispatch, unless a device allows fewer.
    pub const TURNS: u32 = 1 << 13;
    /// T below which a walk goes on by chance.
    pub const FAINT: f32 = 1.0 / 64.0;
    /// β below which a path goes on by chance.
    pub const WEAK: f32 = 0.25;
    /// Scatterings after which every path ends by chance.
    pub const LONG: u32 = 256;
    /// Values of an item of a choice.
    pub const CHOICE: u32 = 3;

    /// Loop turns of a turn, at the most: its own, and two rays through the mesh.
    fn turns(&self) -> u64 {
        let nodes = self.params.nodes;
        1 + self.mesh.map_or(0, |mesh| 2 * MeshRecord::turns(nodes.into(), nodes, mesh.len))
    }
}

impl Kernel for Path {
    const NAME: &'static str = "path";

    fn params(&self) -> &[u8] {
        bytemuck::bytes_of(&self.params)
    }

    fn bindings(&self) -> Vec<Binding> {
        vec![
            Binding::sample("density", FieldFormat::Scalar, Some(self.density)),
            Binding::sample("scattering", FieldFormat::Rgba, self.scattering),
            Binding::sample("seen_scattering", FieldFormat::Rgba, self.seen),
            Binding::sample("emission_density", FieldFormat::Scalar, self.emission),
            Binding::sample("emission_color", FieldFormat::Rgba, self.emission_color),
            Binding::sample("environment", FieldFormat::Rgba, self.environment),
            Binding::read("majorant", Some(self.majorant)),
            Binding::read("lights", self.lights),
            Binding::read("tables", Some(self.tables)),
            Binding::read("mesh", self.mesh),
            Binding::read("background", self.background).in_parts::<[f32; 4]>(1),
            Binding::write("sums", Some(self.sums)).in_parts::<[f32; 4]>(3),
            Binding::write("paths", Some(self.paths)).in_parts::<PathRecord>(1),
            Binding::write("film", Some(self.film)).in_parts::<[f32; 4]>(2),
        ]
    }

    fn axis(&self) -> u32 {
        self.params.width.checked_mul(self.params.height).unwrap_or(0)
    }

    fn validate(&self) -> Result<(), String> {
        let p = &self.params;
        is_medium(&self.density, self.scattering, self.emission, self.emission_color, p.dims)?;
        require!(self.seen.is_none_or(|f| is_color(&f, p.dims)), "what the eye sees scatter differs from the density");
        let pixels = u64::from(self.axis());
        require!(pixels > 0, "a picture of {} × {}, none or too large", p.width, p.height);
        require!(
            self.film.len >= 2 * pixels && self.sums.len >= 3 * pixels && self.paths.len >= pixels,
            "film, sums or paths of fewer than {pixels} pixels"
        );
        require!(self.background.is_none_or(|b| b.len >= pixels), "a background of fewer than {pixels} pixels");
        require!(p.turns > 0 && p.samples > 0, "{} samples in {} turns", p.samples, p.turns);
        covers("majorant", self.majorant, p.majorant_cells, p.dims)?;
        require!(
            p.lights == 0 || self.lights.is_some_and(|b| b.len >= p.lights.into()),
            "fewer than {} lights",
            p.lights
        );
        let known = p.lights + u32::from(self.environment.is_some());
        require!(p.choices == known, "{} to choose from of {known}", p.choices);
        let of = |at: u32, count: u32| u64::from(at) + u64::from(count);
        let choice = |at: u32, items: u64| u64::from(at) + u64::from(Self::CHOICE) * items;
        let mut table = choice(p.choices_at, p.choices.into());
        if let Some(environment) = self.environment {
            is_sky(&environment, p.environment_dims, [p.environment_width, p.environment_height])?;
            require!(p.sky_columns > 0 && p.sky_rows > 0, "an environment in {} × {}", p.sky_columns, p.sky_rows);
            let cells = u64::from(p.sky_columns) * u64::from(p.sky_rows);
            table = table.max(choice(p.sky_at, cells)).max(of(p.edges_at, p.sky_rows) + 1);
        }
        if p.phase_kind == PhaseParams::TABLE {
            require!(p.phase_size >= 2, "a phase table of {} entries", p.phase_size);
            table = table.max(of(p.phase_at, p.phase_size)).max(choice(p.bends_at, u64::from(p.phase_size) - 1));
        }
        require!(self.tables.len >= table, "tables of {} values for {table}", self.tables.len);
        match self.mesh {
            // Triangles say themselves which material is theirs: the plan that made both sees to it.
            Some(mesh) => {
                require!(u64::from(p.materials_at) + 8 <= self.tables.len, "tables without materials");
                holds(mesh, p.nodes)
            }
            None => {
                require!(p.nodes == 0, "{} boxes of no mesh", p.nodes);
                Ok(())
            }
        }
    }

    fn passes(&self, turns: u64) -> Result<Vec<Self>, String> {
        let each = self.turns();
        let some = turns / each;
        require!(
            some > 0,
            "a turn of a path takes up to {each} turns of loops, and {turns} are allowed: fewer triangles need less"
        );
        let pass = |begin: u64| {
            let mut pass = self.clone();
            pass.params.turns = some.min(u64::from(self.params.turns) - begin) as u32;
            pass.params.fresh &= u32::from(begin == 0);
            pass
        };
        let begins = (0..self.params.turns.into()).step_by(usize::try_from(some).unwrap_or(usize::MAX));
        Ok(begins.map(pass).collect())
    }
}

#[cfg(test)]
mod tests {
    use bytemuck::Zeroable;

    use super::*;
    use crate::device::{FieldSpec, ResourceId};

    fn path() -> Path {
        let mut params = PathParams::zeroed();
        params.dims = [9, 6, 10, 0];
        params.majorant_cells = [2, 1, 2, 8];
        (params.width, params.height, params.samples, params.turns, params.fresh) = (3, 2, 4, 1000, 1);
        let spec = FieldSpec::dense([9, 6, 10], 1, FieldFormat::Scalar);
        Path {
            params,
            density: Field { id: ResourceId(0), spec },
            scattering: None,
            seen: None,
            emission: None,
            emission_color: None,
            environment: None,
            majorant: Buf::new(ResourceId(1), 4),
            lights: None,
            tables: Buf::new(ResourceId(2), 1),
            mesh: None,
            background: None,
            sums: Buf::new(ResourceId(3), 18),
            paths: Buf::new(ResourceId(4), 6),
            film: Buf::new(ResourceId(5), 12),
        }
    }

    #[test]
    fn passes_take_all_turns_and_begin_once() {
        for turns in [1, 7, 999, 1000, 5000] {
            let passes = path().passes(turns).unwrap();
            assert_eq!(passes.iter().map(|pass| pass.params.turns).sum::<u32>(), 1000);
            assert!(passes.iter().all(|pass| pass.validate() == Ok(()) && u64::from(pass.params.turns) <= turns));
            assert_eq!(passes.iter().map(|pass| pass.params.fresh).collect::<Vec<_>>().iter().sum::<u32>(), 1);
        }
    }

    #[test]
    fn a_turn_that_may_go_through_a_whole_mesh_is_counted_so() {
        let mut path = path();
        (path.mesh, path.params.nodes) = (Some(Buf::new(ResourceId(6), 2 * 3 + 6 * 5)), 3);
        path.tables = Buf::new(ResourceId(2), 8);
        assert_eq!(path.validate(), Ok(()));
        assert_eq!(path.turns(), 1 + 2 * (3 + 5));
        assert!(path.passes(16).unwrap_err().contains("fewer triangles"));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let wrong = |change: fn(&mut Path)| {
            let mut path = path();
            change(&mut path);
            path.validate().is_err()
        };
        assert!(!wrong(|_| ()));
        assert!(wrong(|p| p.params.lights = 1));
        assert!(wrong(|p| p.params.choices = 1));
        assert!(wrong(|p| p.params.turns = 0));
        assert!(wrong(|p| p.params.majorant_cells[2] = 1));
        assert!(wrong(|p| p.params.nodes = 1));
        assert!(wrong(|p| p.params.phase_kind = PhaseParams::TABLE));
        assert!(wrong(|p| p.sums = Buf::new(ResourceId(3), 17)));
    }
}
