//! Making a transfer: each light of a basis carried through the medium, and what it leaves compressed.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use super::error::{ExecError, RenderError};
use super::executor::{Hooks, Progress};
use super::photons::{DEPOSITS, Flown};
use super::renderer::{Renderer, upload_medium};
use crate::Version;
use crate::basis::SphericalHarmonics;
use crate::device::Buf;
use crate::estimator::{BasisLights, Batch, TOGETHER, grid};
use crate::host;
use crate::scene::{
    AllEstimate, Deposit, EstimateError, LightBasis, Orders, Precompute, Scene, SceneError, Sweeps, TransferEstimate,
    TransferSolver, TransferSource,
};
use crate::stage::{Reduce, ReduceParams, Stage};
use crate::transfer::{Channel, Matrices, Origin, Shape, Transfer, TransferError, compress, identity, is_grey};

/// What making a transfer takes, as far as is known before.
#[derive(Clone, Debug, PartialEq)]
pub struct Survey {
    /// Cells along x, y, z.
    pub cells: [u32; 3],
    /// Cells that light matters to, rising.
    pub rows: Vec<u32>,
    /// Functions of the basis.
    pub functions: u32,
    /// Bands of the moments.
    pub bands: u32,
    /// Channels that differ: 1 or 3.
    pub channels: u32,
    /// How often lights are carried through the medium.
    pub batches: u32,
    /// Bytes that the host takes at the most, beside what the device does.
    pub bytes: u64,
}

/// How the making of a transfer went.
#[derive(Clone, Debug, PartialEq)]
pub struct Precomputed {
    /// The transfer.
    pub transfer: Transfer,
    /// What it took.
    pub survey: Survey,
    /// Time in which light was carried.
    pub transport: Duration,
    /// Time in which it was compressed.
    pub compression: Duration,
    /// The largest change of the last sweep over all lights, as a share of the light; 0 of photons.
    pub residual: f64,
    /// What photons did; nothing of ordinates.
    pub flown: Flown,
}

/// The transfer that a renderer made, and what it knows of one that was given to it.
#[derive(Default)]
pub(super) struct Transfers {
    made: Option<(u64, Precompute, Arc<Transfer>)>,
    /// The transfer and the medium that were found to belong together.
    checked: Option<(Version, u64)>,
}

/// The share of the free memory that matrices may take where the caller sets no bound.
const SHARE: (u64, u64) = (3, 4);

impl Renderer {
    /// The transfer that a scene is lit with, where it is lit with one; made now where it was not before.
    pub(super) fn transfer(
        &mut self,
        scene: &Scene,
        hooks: &mut Hooks<'_>,
    ) -> Result<Option<Arc<Transfer>>, RenderError> {
        let Some(AllEstimate::Transfer(TransferEstimate { source, .. })) = &scene.estimate.all else { return Ok(None) };
        let medium = identity(scene);
        match source {
            TransferSource::Made(transfer) => {
                if self.transfers.checked != Some((transfer.version(), medium)) {
                    transfer.origin().check(&Origin::of(scene))?;
                    self.transfers.checked = Some((transfer.version(), medium));
                }
                Ok(Some(transfer.clone()))
            }
            TransferSource::Making(options) => {
                if let Some((of, with, transfer)) = &self.transfers.made
                    && (*of, with) == (medium, options)
                {
                    return Ok(Some(transfer.clone()));
                }
                let transfer = Arc::new(self.precompute(scene, options, hooks)?.transfer);
                self.transfers.made = Some((medium, *options, transfer.clone()));
                Ok(Some(transfer))
            }
        }
    }

    /// What making a transfer of the scene's medium takes, without doing so.
    ///
    /// # Errors
    /// A scene or options that do not do; a device fault.
    pub fn survey_transfer(
        &mut self,
        scene: &Scene,
        options: &Precompute,
        hooks: &mut Hooks<'_>,
    ) -> Result<Survey, RenderError> {
        scene.validate()?;
        options.validate(&scene.optics.phase).map_err(SceneError::from)?;
        if let TransferSolver::Photons { deposit: Deposit::Absorption, .. } = options.solver
            && scene.optics.albedo.max_element() == 1.0
        {
            let text = "deposit = \"absorption\" leaves light where it is absorbed, and an albedo of 1 absorbs none; take \"track\"";
            return Err(SceneError::from(EstimateError::Conflict(text.into())).into());
        }
        let lattice = scene.medium.lattice();
        let cells = grid(options.cells, lattice.edges() * lattice.dims().as_dvec3());
        let count = cells.iter().map(|&n| u64::from(n)).product();
        let (occupancy, _) = self.executor.run(hooks, |plan| {
            let medium = upload_medium(scene, plan);
            let side = |a: usize| medium.grid.dims[a] as f32 / cells[a] as f32;
            let out: Buf<[f32; 2]> = plan.output("transfer occupancy", count);
            plan.stage(Stage::Reduce(Reduce {
                // A trilinear lookup reads all cells whose centre is less than one cell away.
                params: ReduceParams::new(
                    medium.grid.dims,
                    [cells[0], cells[1], cells[2], 0],
                    [side(0), side(1), side(2), 0.5],
                ),
                density: medium.density,
                other: None,
                out,
            }));
            Ok::<_, RenderError>(out)
        })?;
        let found = self.executor.read(occupancy)?;
        let rows: Vec<u32> = (0..).zip(&found).filter(|(_, [_, most])| *most > 0.0).map(|(cell, _)| cell).collect();
        let grey = is_grey(&scene.optics, scene.medium.optics_fields().scattering.is_none());
        let (functions, bands) = (options.basis.count(), options.bands_of(&scene.optics.phase));
        let coefficients = u64::from(bands * bands);
        let channels = if grey { 1 } else { 3 };
        let matrices = (rows.len() as u64 * channels).saturating_mul(coefficients * u64::from(functions) * 4);
        let planes = count.saturating_mul(coefficients * 3 * 4);
        let deposits = match options.solver {
            TransferSolver::Photons { .. } => DEPOSITS.min(rows.len() as u64 * coefficients * u64::from(functions) * 4),
            TransferSolver::Ordinates { .. } => 0,
        };
        let local = matches!(options.basis, LightBasis::Discrete { .. });
        let lights = BasisLights::bytes(functions.into(), options.basis.nside(), coefficients, local);
        let bytes = [matrices, Matrices::workspace(rows.len() as u64), planes, deposits, lights]
            .into_iter()
            .fold(0, u64::saturating_add);
        let batches =
            functions.div_ceil(if Self::alike(scene, options, channels as u32) { TOGETHER as u32 } else { 1 });
        Ok(Survey { cells, rows, functions, bands, channels: channels as u32, batches, bytes })
    }

    /// Whether what is carried along sweeps is the same in all channels: as many lights go together.
    fn alike(scene: &Scene, options: &Precompute, channels: u32) -> bool {
        channels == 1 || (carried(scene, options).orders == Orders::Count(1) && scene.optics.is_grey())
    }

    /// Makes the transfer of a scene's medium. Camera, lights and environment do not matter.
    ///
    /// # Errors
    /// As [`Renderer::survey_transfer`]; too little memory, before light is carried; cancellation.
    pub fn precompute(
        &mut self,
        scene: &Scene,
        options: &Precompute,
        hooks: &mut Hooks<'_>,
    ) -> Result<Precomputed, RenderError> {
        let begin = Instant::now();
        let survey = self.survey_transfer(scene, options, hooks)?;
        let budget = options.memory.or_else(|| host::free_memory().map(|free| free / SHARE.1 * SHARE.0));
        if let Some(budget) = budget.filter(|&budget| survey.bytes > budget) {
            let Survey { functions, bands, channels, bytes: needed, .. } = survey;
            let rows = survey.rows.len() as u64;
            return Err(TransferError::Memory { needed, budget, rows, functions, bands, channels }.into());
        }
        let origin = Origin::of(scene);
        let basis = options.basis.functions().map_err(TransferError::from)?;
        let width = (survey.bands * survey.bands * survey.functions) as usize;
        let mut channels = Vec::new();
        for _ in 0..survey.channels {
            let mut values: Vec<f32> = Vec::new();
            self.executor.fit(&mut values, survey.rows.len() as u64 * width as u64)?;
            channels.push(Matrices { width, values });
        }
        let harmonics = SphericalHarmonics::new(survey.bands).map_err(TransferError::from)?;
        let lights = BasisLights::new(basis.as_ref(), options.basis.nside(), &harmonics);
        let residual = self.carry_all(scene, options, &lights, &survey, &mut channels, hooks)?;
        let flown = match options.solver {
            TransferSolver::Photons { count, deposit, radius } => {
                self.fly_all(scene, options, (count, deposit, radius), &survey, &lights, &mut channels, hooks)?
            }
            TransferSolver::Ordinates { .. } => Flown::default(),
        };
        let transport = begin.elapsed();
        let begin = Instant::now();
        let mut compressed = Vec::new();
        for (at, matrices) in channels.into_iter().enumerate() {
            cancelled(hooks)?;
            report(hooks, "compression", at as f32 / survey.channels as f32);
            compressed.push(match options.clusters {
                Some(clusters) => compress(&matrices, clusters as usize, options.components as usize),
                None => matrices.whole(),
            });
        }
        let shape = Shape {
            cells: survey.cells,
            rows: survey.rows.clone(),
            basis: options.basis,
            bands: survey.bands,
            clusters: compressed.first().map_or(0, |channel: &Channel| channel.errors.len() as u32),
            components: options.clusters.map_or(0, |_| options.components),
        };
        let transfer = Transfer::new(shape, origin, compressed)?;
        Ok(Precomputed { transfer, survey, transport, compression: begin.elapsed(), residual, flown })
    }

    /// Adds every function's light along the swept directions: all orders by ordinates, else as it comes in. The
    /// largest residual.
    fn carry_all(
        &mut self,
        scene: &Scene,
        options: &Precompute,
        lights: &BasisLights,
        survey: &Survey,
        channels: &mut [Matrices],
        hooks: &mut Hooks<'_>,
    ) -> Result<f64, RenderError> {
        let sweeps = carried(scene, options);
        let cells: usize = survey.cells.iter().map(|&n| n as usize).product();
        let functions = survey.functions as usize;
        let alike = Self::alike(scene, options, survey.channels);
        let mut residual = 0.0f64;
        for number in 0..survey.batches as usize {
            cancelled(hooks)?;
            report(hooks, "transfer", number as f32 / survey.batches as f32);
            let function = |channel: usize| {
                Some(if alike { TOGETHER * number + channel } else { number }).filter(|&k| k < functions)
            };
            let batch = Batch { number, functions: [0, 1, 2].map(function) };
            let mut inner = Hooks { progress: None, cancel: hooks.cancel };
            let (moments, run) = self.executor.run(&mut inner, |plan| {
                let medium = upload_medium(scene, plan);
                Ok::<_, RenderError>(lights.carry(scene, &medium, sweeps, &batch, plan))
            })?;
            residual = run.solved.iter().fold(residual, |most, solved| most.max(solved.residual));
            let moments = self.executor.read(moments)?;
            for (plane, values) in moments.chunks_exact(cells).enumerate() {
                let (j, of) = (plane / TOGETHER, plane % TOGETHER);
                let Some(k) = batch.functions[of] else { continue };
                let into = if alike { &mut channels[..] } else { &mut channels[of..=of] };
                for Matrices { width, values: into } in into {
                    for (row, &cell) in survey.rows.iter().enumerate() {
                        into[row * *width + j * functions + k] = values[cell as usize];
                    }
                }
            }
        }
        Ok(residual)
    }
}

/// What is carried along sweeps: all orders of scattering, or light as it comes in where photons bring the others.
fn carried(scene: &Scene, options: &Precompute) -> Sweeps {
    let Precompute { cells, bands, orders, .. } = *options;
    match options.solver {
        TransferSolver::Ordinates { directions } => {
            let directions = directions.unwrap_or_else(|| options.directions(&scene.optics.phase));
            Sweeps { cells, bands, directions, orders }
        }
        TransferSolver::Photons { .. } => Sweeps { cells, bands, directions: 12, orders: Orders::Count(1) },
    }
}

/// Says how far the making has come.
pub(super) fn report(hooks: &mut Hooks<'_>, stage: &'static str, done: f32) {
    if let Some(progress) = &mut hooks.progress {
        progress(Progress { stage, done });
    }
}

pub(super) fn cancelled(hooks: &Hooks<'_>) -> Result<(), ExecError> {
    match hooks.cancel.is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
        true => Err(ExecError::Cancelled),
        false => Ok(()),
    }
}
