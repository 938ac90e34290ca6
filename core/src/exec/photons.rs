//! Photons for the lights of a basis, many lights at a time.

use super::error::{ExecError, RenderError};
use super::executor::Hooks;
use super::plan::Plan;
use super::precompute::{Survey, cancelled, report};
use super::renderer::{Renderer, plan_occupancy, upload_medium};
use crate::Version;
use crate::basis::healpix;
use crate::device::Buf;
use crate::estimator::BasisLights;
use crate::scene::{Deposit, Orders, Precompute, Scene};
use crate::stage::{PhotonParams, PhotonTable, Photons, Stage, photon_counter, photon_deposit, photon_tables};
use crate::transfer::{Matrices, TransferError, places};

/// Bytes of the deposits of one flight, which sets how many lights photons carry at a time.
pub(super) const DEPOSITS: u64 = 256 << 20;
/// Photons that set out between two looks at progress and cancellation.
const LOOK: u64 = 1 << 21;
/// How often deposits are counted anew, in coarser units, where integers did not hold them.
const TRIES: u32 = 3;
/// The most scatterings of a photon.
const MAX_DEPTH: u32 = 4096;

/// What photons did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flown {
    /// Photons of all channels. Each serves every light that shines from its direction.
    pub photons: u64,
    /// Those that were not followed to their end.
    pub truncated: u64,
}

/// Photons of one channel.
struct Flight<'a> {
    scene: &'a Scene,
    survey: &'a Survey,
    channel: usize,
    deposit: Deposit,
    radius: f32,
    max_depth: u32,
    /// Directions of the set.
    nside: u32,
    /// Rounds of the set.
    rounds: u32,
}

/// Lights that photons carry together.
struct Load {
    table: PhotonTable,
    first: u32,
    lights: u32,
    scale: f32,
    /// Identity of what is counted: another is counted from nothing.
    version: Version,
}

impl Renderer {
    /// Adds the scattered light of every function, channel by channel.
    pub(super) fn fly_all(
        &mut self,
        scene: &Scene,
        options: &Precompute,
        (count, deposit, radius): (f64, Deposit, f32),
        survey: &Survey,
        lights: &BasisLights,
        channels: &mut [Matrices],
        hooks: &mut Hooks<'_>,
    ) -> Result<Flown, RenderError> {
        let mut flown = Flown::default();
        let Some(depth) = depth(scene, options.orders) else { return Ok(flown) };
        if survey.rows.is_empty() {
            return Ok(flown);
        }
        let [x, y, z] = survey.cells.map(u64::from);
        // Photons serve all functions that shine from where they come.
        let boundary = 2 * (x * y + y * z + z * x);
        let asked = count * boundary as f64 * f64::from(survey.functions) / lights.overlap();
        let nside = options.basis.nside();
        let directions = healpix::count(nside) as f64;
        let rounds = (asked / directions).ceil().clamp(1.0, (f64::from(u32::MAX) / directions).floor()) as u32;
        let most = self.most_lights(survey, lights);
        let batches = survey.functions.div_ceil(most);
        let each = survey.functions.div_ceil(batches);
        let passes = batches * survey.channels;
        for (channel, matrices) in channels.iter_mut().enumerate() {
            let flight = Flight { scene, survey, channel, deposit, radius, max_depth: depth, nside, rounds };
            if flight.albedo() == 0.0 || flight.extinction() == 0.0 {
                continue;
            }
            flown.photons += u64::from(rounds) * healpix::count(nside) as u64;
            for batch in 0..batches {
                let first = batch * each;
                let some = each.min(survey.functions - first);
                let pass = channel as u32 * batches + batch;
                let place = |done: f32| (pass as f32 + done) / passes as f32;
                let truncated = self.fly(&flight, lights, first..first + some, place, matrices, hooks)?;
                // Every batch flies the same photons.
                flown.truncated += if batch == 0 { truncated } else { 0 };
            }
        }
        Ok(flown)
    }

    /// How many lights photons carry at a time.
    fn most_lights(&self, survey: &Survey, lights: &BasisLights) -> u32 {
        let limits = self.executor.device().info().limits;
        let moments = survey.bands * survey.bands;
        let each = survey.rows.len() as u64 * u64::from(moments) * 4;
        let room = (DEPOSITS.min(limits.binding_bytes) / each).clamp(1, survey.functions.into()) as u32;
        let Some(turns) = limits.loop_turns else { return room };
        // A flight leaves its light within a bounded number of turns: in every cell that it crosses, for every light.
        let crossed = survey.cells.iter().sum::<u32>() + 3;
        let loads = (turns / 4 / crossed).saturating_sub(1) / (1 + moments.div_ceil(Photons::STRIDE));
        if loads >= lights.most_overlap() { room } else { room.min(loads.max(1)) }
    }

    /// Flies the photons of some lights and adds what they leave. How many were not followed to their end.
    fn fly(
        &mut self,
        flight: &Flight<'_>,
        lights: &BasisLights,
        functions: std::ops::Range<u32>,
        place: impl Fn(f32) -> f32,
        matrices: &mut Matrices,
        hooks: &mut Hooks<'_>,
    ) -> Result<u64, RenderError> {
        let set = healpix::directions(flight.nside);
        let lattice = flight.scene.medium.lattice();
        let mut peak = 0.0f64;
        let weights = lights.by_pixel(functions.clone());
        let table = PhotonTable::new(lattice, &set, functions.len() as u32, |number, _, out| {
            for &(light, value) in &weights[number] {
                peak = peak.max(value.abs());
                out.push((light, value));
            }
        });
        if table.directions.is_empty() {
            return Ok(0);
        }
        let photons = u64::from(flight.rounds) * set.len() as u64;
        let scale = Photons::scale(peak, photons);
        let (first, lights) = (functions.start, functions.len() as u32);
        let mut load = Load { table, first, lights, scale, version: Version::fresh() };
        for _ in 0..TRIES {
            let (deposits, counters) = self.fly_rounds(flight, &load, &place, hooks)?;
            let counters: Vec<i32> = self.executor.read(counters)?;
            if counters[photon_counter::OVERFLOWS as usize] != 0 {
                (load.scale, load.version) = (load.scale / 32.0, Version::fresh());
                continue;
            }
            let unit = 1.0 / (f64::from(load.scale) * photons as f64);
            self.add(flight, &load, deposits, unit, matrices)?;
            return Ok(u64::from(counters[photon_counter::TRUNCATED as usize] as u32));
        }
        Err(TransferError::Overflow.into())
    }

    /// Runs all rounds of photons, a look's at a time.
    fn fly_rounds(
        &mut self,
        flight: &Flight<'_>,
        load: &Load,
        place: &impl Fn(f32) -> f32,
        hooks: &mut Hooks<'_>,
    ) -> Result<(Buf<i32>, Buf<i32>), RenderError> {
        let step = (LOOK / load.table.directions.len() as u64).clamp(1, flight.rounds.into()) as u32;
        let mut round = 0;
        loop {
            cancelled(hooks)?;
            report(hooks, "photons", place(round as f32 / flight.rounds as f32));
            let rounds = step.min(flight.rounds - round);
            let mut inner = Hooks { progress: None, cancel: hooks.cancel };
            let (left, _) =
                self.executor.run(&mut inner, |plan| Ok::<_, RenderError>(flight.plan(load, round, rounds, plan)))?;
            round += rounds;
            if round == flight.rounds {
                return Ok(left);
            }
        }
    }

    /// Adds deposits to the matrices, some rows at a time.
    fn add(
        &mut self,
        flight: &Flight<'_>,
        load: &Load,
        deposits: Buf<i32>,
        unit: f64,
        matrices: &mut Matrices,
    ) -> Result<(), ExecError> {
        let functions = flight.survey.functions as usize;
        let moments = matrices.width / functions;
        let (first, lights) = (load.first as usize, load.lights as usize);
        let row = lights * moments;
        let some = ((1 << 20) / row).max(1);
        let mut part: Vec<i32> = vec![0; some * row];
        for (at, rows) in matrices.values.chunks_mut(some * matrices.width).enumerate() {
            let part = &mut part[..rows.len() / matrices.width * row];
            self.executor.read_into(deposits, (at * some * row) as u64, part)?;
            for (matrix, part) in rows.chunks_exact_mut(matrices.width).zip(part.chunks_exact(row)) {
                for (light, part) in part.chunks_exact(moments).enumerate() {
                    for (j, &value) in part.iter().enumerate() {
                        matrix[j * functions + first + light] += (f64::from(value) * unit) as f32;
                    }
                }
            }
        }
        Ok(())
    }
}

impl Flight<'_> {
    fn extinction(&self) -> f32 {
        self.scene.optics.extinction[self.channel]
    }

    fn albedo(&self) -> f32 {
        self.scene.optics.albedo[self.channel]
    }

    fn plan<'a>(&'a self, load: &'a Load, round: u32, rounds: u32, plan: &mut Plan<'a>) -> (Buf<i32>, Buf<i32>) {
        let (scene, survey) = (self.scene, self.survey);
        let lattice = scene.medium.lattice();
        let medium = upload_medium(scene, plan);
        let majorant = plan_occupancy(&medium, plan);
        let mut params = PhotonParams::new(lattice, survey.cells.into(), self.max_depth);
        load.table.place(&mut params);
        let tables = photon_tables(survey.bands, &scene.optics.phase, &mut params);
        params.majorant_cells = majorant.cells;
        (params.round, params.rounds, params.lights) = (round, rounds, load.lights);
        params.rows = survey.rows.len() as u32;
        params.deposit = match self.deposit {
            Deposit::Track => photon_deposit::TRACK,
            Deposit::Collision => photon_deposit::COLLISION,
            Deposit::Absorption => photon_deposit::ABSORPTION,
        };
        params.radius = self.radius;
        params.channel = self.channel as u32;
        (params.densest, params.albedo, params.scale) = (self.extinction(), self.albedo(), load.scale);
        let cells: u64 = survey.cells.iter().map(|&n| u64::from(n)).product();
        let rows = plan.upload("photon rows", cells, &load.version, || places(survey.cells, &survey.rows));
        let (directions, weights) = (&load.table.directions, &load.table.weights);
        let deposits = plan.kept("photon deposits", params.deposits(), &load.version);
        let counters = plan.kept("photon counters", photon_counter::COUNT.into(), &load.version);
        let photons = Photons {
            params,
            density: medium.density,
            scattering: medium.scattering,
            majorant: majorant.buffer,
            tables: plan.table("photon tables", tables),
            directions: plan.upload("photon directions", directions.len() as u64, &load.version, || directions.clone()),
            weights: plan.upload("photon weights", weights.len() as u64, &load.version, || weights.clone()),
            rows,
            deposits,
            counters,
        };
        plan.stage(Stage::Photons(photons));
        (deposits, counters)
    }
}

/// How often photons scatter at the most; none where they do not matter.
fn depth(scene: &Scene, orders: Orders) -> Option<u32> {
    match orders {
        Orders::Count(1) => None,
        Orders::Count(orders) => Some((orders - 1).min(MAX_DEPTH)),
        Orders::Converged { tolerance } => {
            let albedo = f64::from(scene.optics.albedo.max_element());
            let scatterings = f64::from(tolerance).ln() / albedo.ln();
            let bound = if albedo > 0.0 && albedo < 1.0 { scatterings.ceil() } else { f64::from(MAX_DEPTH) };
            Some(bound.clamp(1.0, MAX_DEPTH.into()) as u32)
        }
    }
}
