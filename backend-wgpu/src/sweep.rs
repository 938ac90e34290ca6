//! `sweep` by kernels that share its steps. Where kernels read storage textures, what its cells hold lies in textures of our own, by
//! texels of four cells in rows that lie in the planes of a direction (`sweep/fours.wgsl`).

use std::ops::Range;

use airlight_core::device::{Binding, BindingAccess, Buf, DeviceError};
use airlight_core::stage::{Kernel as _, Stage, Sweep, SweepParams};

use crate::WgpuDevice;
use crate::memory::Resource;
use crate::part::Part;
use crate::source::sweep::Kernel;
use crate::source::{ABREAST, FEW_ROWS};
use crate::store::own;
use crate::texels::{self, Texels};

/// Textures that a sweep's planes read: all of its bindings.
const TEXTURES: u32 = 5;

/// What cells scatter toward a batch of directions, in memory.
fn toward(p: &SweepParams) -> Buf<f32> {
    Buf::new(own::TOWARD, u64::from(p.batch) * u64::from(p.channels) * u64::from(p.count()))
}

/// The textures that a sweep's cells lie in, as `sweep/fours.wgsl` has them.
struct Fours {
    optics: Buf<[f32; 4]>,
    toward: Buf<[f32; 4]>,
    radiance: Buf<[f32; 4]>,
    /// Squares of four by four cells.
    tiles: u32,
}

impl Fours {
    fn of(p: &SweepParams) -> Self {
        let [x, y, z, _] = p.cells;
        // Rows along x, or along y.
        let texels = u64::from((x.div_ceil(4) * y).max(y.div_ceil(4) * x)) * u64::from(z);
        let channels = u64::from(p.channels);
        let extinctions = if p.grey == 1 { 1 } else { channels };
        let albedos = if p.source_coefficients > 0 { channels } else { 0 };
        let emissions = if p.emits == 1 { channels } else { 0 };
        let of_batch = u64::from(p.batch) * channels * texels;
        Self {
            optics: Buf::new(own::OPTICS, 2 * (extinctions + albedos + emissions) * texels),
            toward: Buf::new(own::TOWARD_TEXELS, if albedos > 0 { of_batch } else { 0 }),
            radiance: Buf::new(own::RADIANCE, of_batch),
            tiles: x.div_ceil(4) * y.div_ceil(4) * z,
        }
    }

    fn all(&self) -> [Buf<[f32; 4]>; 3] {
        [self.optics, self.toward, self.radiance]
    }
}

/// What is taken of a batch: planes, if there are any, before them what cells scatter toward its directions, and after them its
/// moments.
struct Piece {
    planes: Range<u32>,
    scatters: bool,
    gathers: bool,
}

impl WgpuDevice {
    /// The parts of a range of `sweep`: for each batch its sources, its planes, and its moments. Where it goes on with what the range
    /// before left of the same sweep, sources stand: of a batch they are found once, in however many pieces its planes are taken.
    pub(crate) fn sweep_parts(
        &mut self,
        stage: &Stage,
        sweep: &Sweep,
        range: Range<u32>,
    ) -> Result<Vec<Part>, DeviceError> {
        let fours = self.fours(sweep);
        if let Some(fours) = &fours {
            for texels in fours.all().into_iter().filter(|texels| texels.len > 0) {
                self.reserve_texels(texels)?;
            }
        } else if sweep.sources.is_some() {
            let toward = toward(&sweep.params);
            self.reserve(toward.id, toward.bytes())?;
        }
        let p = &sweep.params;
        let (steps, planes) = (p.batch_steps(), p.cells[3]);
        let goes_on = self.swept.take().is_some_and(|(swept, end)| swept == *sweep && end == range.start);
        let mut parts = Vec::new();
        if let (Some(fours), false) = (&fours, goes_on) {
            let bindings =
                vec![Binding::read("optics", Some(sweep.optics)), Binding::write("turned", Some(fours.optics))];
            parts.push(Part::of_sweep(Kernel::Turn, bindings, 0..1, fours.optics.len as u32));
        }
        let mut next = range.start;
        while next < range.end {
            let gather = next / steps * steps + planes;
            let piece = Piece {
                planes: next..range.end.min(gather),
                scatters: next.is_multiple_of(steps) || !goes_on,
                gathers: gather < range.end,
            };
            match &fours {
                Some(fours) => self.batch_by_fours(sweep, fours, piece, &mut parts),
                None => Self::batch(stage, sweep, piece, &mut parts),
            }
            next = gather + 1;
        }
        self.swept = Some((sweep.clone(), range.end));
        Ok(parts)
    }

    /// Parts of a batch whose light lies in memory.
    fn batch(stage: &Stage, sweep: &Sweep, piece: Piece, parts: &mut Vec<Part>) {
        let Piece { planes, scatters, gathers } = piece;
        let p = &sweep.params;
        let toward = toward(p);
        let sources = sweep.sources.zip(sweep.source_weights);
        let gather = planes.end;
        if !planes.is_empty() {
            let (first, taken) = batch_of(p, planes.start);
            if let (Some((sources, weights)), true) = (sources, scatters) {
                let bindings = vec![
                    Binding::read("optics", Some(sweep.optics)),
                    Binding::read("sources", Some(sources)),
                    Binding::read("source_weights", Some(weights)),
                    Binding::write("toward", Some(toward)),
                ];
                let items = taken.div_ceil(4) * p.count().div_ceil(4);
                let mut part = Part::of_sweep(Kernel::Toward, bindings, 0..1, items);
                part.steps = Some(first..first + taken);
                parts.push(part);
            }
            let mut part = Part::of(stage, planes);
            let places = part.bindings.iter_mut().filter(|binding| binding.name == "sources");
            places.for_each(|binding| *binding = Binding::read("sources", sources.map(|_| toward)));
            part.sequential = Some(p.batch * p.plane);
            parts.push(part);
        }
        if gathers {
            let mut part = Part::of(stage, gather..gather + 1);
            part.gathers = true;
            part.sequential = Some(p.count() * p.coefficients.div_ceil(4));
            parts.push(part);
        }
    }

    /// The same of a batch whose light lies in textures.
    fn batch_by_fours(&self, sweep: &Sweep, fours: &Fours, piece: Piece, parts: &mut Vec<Part>) {
        let Piece { planes, scatters, gathers } = piece;
        let p = &sweep.params;
        let sources = sweep.sources.zip(sweep.source_weights);
        let directions = Binding::read("directions", Some(sweep.directions));
        let optics = Binding::read("optics", Some(fours.optics));
        let gather = planes.end;
        if !planes.is_empty() {
            let (first, taken) = batch_of(p, planes.start);
            if let (Some((sources, weights)), true) = (sources, scatters) {
                let bindings = vec![
                    optics,
                    directions,
                    Binding::read("sources", Some(sources)),
                    Binding::read("source_weights", Some(weights)),
                    Binding::write("toward", Some(fours.toward)),
                ];
                let mut part = Part::of_sweep(Kernel::Scatter, bindings, 0..1, taken.div_ceil(4) * fours.tiles);
                part.steps = Some(first..first + taken);
                parts.push(part);
            }
            let bindings = vec![
                optics,
                directions,
                Binding::read("toward", sources.map(|_| fours.toward)),
                Binding::read("obstructed", sweep.obstructed),
                Binding::write("radiance", Some(fours.radiance)),
            ];
            let most = self.planes_at_once(p);
            for step in planes.clone().step_by(most as usize) {
                let mut part = Part::of_sweep(Kernel::Rows, bindings.clone(), 0..taken, 0);
                part.steps = Some(step..planes.end.min(step.saturating_add(most)));
                part.sequential = None;
                parts.push(part);
            }
        }
        if gathers {
            let bindings = vec![
                directions,
                Binding::read("weights", Some(sweep.weights)),
                Binding::read("radiance", Some(fours.radiance)),
                Binding::write("moments", Some(sweep.moments)),
            ];
            let items = fours.tiles.next_multiple_of(self.units) * p.coefficients.div_ceil(5);
            parts.push(Part::of_sweep(Kernel::Moments, bindings, gather..gather + 1, items));
        }
    }

    /// Planes of a direction that a workgroup may take one after the other, by how often its loops turn: once more than they
    /// have to, which is when they end.
    fn planes_at_once(&self, p: &SweepParams) -> u32 {
        let items = u64::from(p.plane / 8 + p.cells[3] + 1).div_ceil(ABREAST.into());
        let turns = 1 + (items + 1) * (2 + u64::from(p.channels));
        let most = self.info.limits.loop_turns.map_or(u64::MAX, |turns| turns.saturating_sub(1).into()) / turns;
        most.try_into().unwrap_or(u32::MAX)
    }

    /// Bytes of our own that a sweep takes.
    pub(crate) fn sweep_scratch(&self, sweep: &Sweep) -> u64 {
        match self.fours(sweep) {
            Some(fours) => fours.all().iter().map(|texels| texels.bytes()).sum(),
            None if sweep.sources.is_some() => toward(&sweep.params).bytes(),
            None => 0,
        }
    }

    /// The textures that a sweep's cells may lie in: where all fit one, there are enough, all else is a binding, and a plane the turns
    /// of loops.
    fn fours(&self, sweep: &Sweep) -> Option<Fours> {
        let bytes = |binding: Binding| match binding.access {
            BindingAccess::Read(bytes) | BindingAccess::Write(bytes) => bytes,
            BindingAccess::Sample(_) => 0,
        };
        let fours = Fours::of(&sweep.params);
        let own = fours.all().map(|texels| texels.bytes());
        let most = sweep.bindings().into_iter().map(bytes).chain(own).fold(0, u64::max);
        let whole = most <= self.info.limits.binding_bytes && self.planes_at_once(&sweep.params) > 0;
        let textures = self.limits.max_storage_textures_per_shader_stage >= TEXTURES;
        let fit = own.iter().all(|&bytes| texels::fits(bytes, 4, &self.limits));
        (self.rewrites && whole && textures && fit && sweep.params.count() < FEW_ROWS).then_some(fours)
    }

    /// Makes a texture of our own hold so many texels at least.
    fn reserve_texels(&mut self, buf: Buf<[f32; 4]>) -> Result<(), DeviceError> {
        if let Ok(Resource::Texels(texels)) = self.store.get(buf.id)
            && texels.bytes >= buf.bytes()
        {
            return Ok(());
        }
        self.remove(buf.id);
        self.store.add(buf.id, || Texels::new(&self.gpu, buf.bytes(), 4).map(Resource::Texels))
    }
}

/// The first direction of the batch that a step is of, and how many it has.
fn batch_of(p: &SweepParams, step: u32) -> (u32, u32) {
    let first = step / p.batch_steps() * p.batch;
    (first, p.batch.min(p.directions - first))
}
