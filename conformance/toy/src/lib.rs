//! A device of airlight that is as plain as a device can be: memory in a map, and every stage by its slow f64 twin.

use std::collections::HashMap;
use std::ops::Range;
use std::time::Instant;

use airlight_core::device::{
    Binding, Buf, Device, DeviceError, DeviceInfo, DeviceKind, Field, Limits, Provider, ResourceId, ResourceSpec,
    StageTime, Unavailable,
};
use airlight_core::reference::{
    self, AccumulateInputs, ClassifyInputs, CoarsenInputs, EvaluateInputs, IlluminateInputs, InjectInputs, MarchInputs,
    PathInputs, PhotonInputs, ProjectInputs, PropagateInputs, ReconstructInputs, ReduceInputs, RelightInputs,
    ShadeInputs, ShadowInputs, SweepInputs, TraceInputs, UpsampleInputs,
};
use airlight_core::stage::{Classify, ClassifyParams, Inject, March, Photons, Stage, photon_counter};
use bytemuck::Pod;

/// The backend, for a program to gather.
pub const PROVIDER: Provider = Provider {
    name: "toy",
    enumerate: || Ok(vec![info()]),
    open: |index| match index {
        0 => Ok(Box::new(Toy::default())),
        _ => Err(Unavailable(format!("there is no toy:{index}; the only one is toy:0"))),
    },
};

fn info() -> DeviceInfo {
    DeviceInfo {
        backend: "toy",
        index: 0,
        name: "Toy in f64".into(),
        kind: DeviceKind::Other,
        memory_bytes: None,
        limits: Limits { buffer_bytes: 1 << 30, binding_bytes: 1 << 30, field_side: 4096, loop_turns: None },
        features: Vec::new(),
        filter_bits: 24,
        contracts: false,
        unusable: None,
    }
}

/// The device.
pub struct Toy {
    info: DeviceInfo,
    memory: HashMap<ResourceId, Resource>,
    times: Vec<StageTime>,
    /// The stage that ran last, with all that it writes, until memory changes.
    last: Option<(Stage, Outputs)>,
}

/// Everything that stages read and write is made of 4-byte words, almost all of them floats.
struct Resource {
    spec: ResourceSpec,
    words: Vec<f32>,
}

/// What a stage writes, by the names of its bindings.
type Outputs = Vec<(&'static str, Vec<f64>)>;

impl Default for Toy {
    fn default() -> Self {
        Self { info: info(), memory: HashMap::new(), times: Vec::new(), last: None }
    }
}

impl Device for Toy {
    fn info(&self) -> &DeviceInfo {
        &self.info
    }

    fn create(&mut self, id: ResourceId, spec: &ResourceSpec) -> Result<(), DeviceError> {
        if self.memory.contains_key(&id) {
            return Err(DeviceError::Invalid(format!("resource {} exists", id.0)));
        }
        spec.check_kind(self.field_kinds())?;
        let Limits { buffer_bytes, field_side, .. } = self.info.limits;
        if let ResourceSpec::Field(field) = spec {
            if field.texels() == 0 {
                return Err(DeviceError::Invalid(format!("{field:?} holds nothing")));
            }
            let (requested, limit) = (field.dims.into_iter().max().unwrap_or(0), field_side);
            if requested > limit {
                return Err(DeviceError::Limit {
                    what: "a side of a field",
                    requested: requested.into(),
                    limit: limit.into(),
                });
            }
        }
        let requested = spec.bytes();
        if requested > buffer_bytes {
            return Err(DeviceError::Limit { what: "a resource", requested, limit: buffer_bytes });
        }
        let mut words = Vec::new();
        let count = requested.div_ceil(4) as usize;
        words.try_reserve_exact(count).map_err(|_| DeviceError::OutOfMemory { requested, available: None })?;
        words.resize(count, 0.0);
        self.memory.insert(id, Resource { spec: *spec, words });
        Ok(())
    }

    fn destroy(&mut self, id: ResourceId) {
        self.last = None;
        self.memory.remove(&id);
    }

    fn write(&mut self, id: ResourceId, offset: u64, data: &[u8]) -> Result<(), DeviceError> {
        self.last = None;
        let resource = self.memory.get_mut(&id).ok_or_else(|| missing(id))?;
        resource.spec.check_write(offset, data)?;
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut resource.words);
        bytes[offset as usize..][..data.len()].copy_from_slice(data);
        Ok(())
    }

    fn read(&mut self, id: ResourceId, offset: u64, out: &mut [u8]) -> Result<(), DeviceError> {
        let resource = self.get(id)?;
        resource.spec.check_read(offset, out.len())?;
        let bytes: &[u8] = bytemuck::cast_slice(&resource.words);
        out.copy_from_slice(&bytes[offset as usize..][..out.len()]);
        Ok(())
    }

    fn publish(&mut self, from: ResourceId, to: ResourceId) -> Result<(), DeviceError> {
        self.last = None;
        let (source, target) = (self.get(from)?, self.get(to)?);
        source.spec.check_publish(&target.spec)?;
        // What was written to the buffer afterwards must not reach the field, so it is a copy.
        let words = source.words.clone();
        self.memory.entry(to).and_modify(|field| field.words = words);
        Ok(())
    }

    fn dispatch(&mut self, stage: &Stage, range: Range<u32>) -> Result<(), DeviceError> {
        stage.check(&range, |id| self.memory.get(&id).map(|resource| resource.spec))?;
        let begin = Instant::now();
        if !range.is_empty() {
            self.run(stage, &range);
        }
        self.times.push(StageTime { stage: stage.name(), range, time: begin.elapsed() });
        Ok(())
    }

    fn finish(&mut self) -> Result<Vec<StageTime>, DeviceError> {
        Ok(std::mem::take(&mut self.times))
    }
}

fn missing(id: ResourceId) -> DeviceError {
    DeviceError::Invalid(format!("resource {} does not exist", id.0))
}

impl Toy {
    fn get(&self, id: ResourceId) -> Result<&Resource, DeviceError> {
        self.memory.get(&id).ok_or_else(|| missing(id))
    }

    /// Writes what a range of a stage writes. Twins compute a stage whole, so the pieces of one share its result.
    fn run(&mut self, stage: &Stage, range: &Range<u32>) {
        if let Stage::Photons(photons) = stage {
            return self.add(photons, range.clone());
        }
        let whole = match self.last.take() {
            Some((last, whole)) if last == *stage => whole,
            _ => self.twin(stage),
        };
        for binding in stage.bindings() {
            let Some((_, values)) = whole.iter().find(|(name, _)| *name == binding.name) else { continue };
            let Some(output) = binding.id.and_then(|id| self.memory.get_mut(&id)) else { continue };
            for (word, value) in values.iter().enumerate() {
                // What runs in order may leave all of it with every piece.
                if stage.sequential().is_some() || range.contains(&unit(stage, &binding, word)) {
                    output.words[word] = *value as f32;
                }
            }
        }
        self.last = Some((stage.clone(), whole));
    }

    /// Adds what photons leave, which is integers, to what is there.
    fn add(&mut self, s: &Photons, range: Range<u32>) {
        self.last = None;
        let inputs = PhotonInputs {
            density: self.field(s.density),
            scattering: s.scattering.map(|f| self.field(f)),
            majorant: self.buffer(s.majorant),
            tables: self.buffer(s.tables),
            directions: &self.records(s.directions),
            weights: self.buffer(s.weights),
            rows: self.buffer(s.rows),
        };
        let (deposits, counters) = reference::photons(&s.params, &inputs, range);
        let mut counters = counters.map(i64::from);
        for (id, counts) in [(s.deposits.id, false), (s.counters.id, true)] {
            let Some(output) = self.memory.get_mut(&id) else { continue };
            let sums: &mut [i32] = bytemuck::cast_slice_mut(&mut output.words);
            let more = if counts { counters.to_vec() } else { deposits.clone() };
            for (sum, more) in sums.iter_mut().zip(more) {
                let all = i64::from(*sum).saturating_add(more);
                counters[photon_counter::OVERFLOWS as usize] += i64::from(i32::try_from(all).is_err());
                *sum = all as i32;
            }
        }
    }

    /// All that a stage writes. Each pass of a stage that runs in passes leaves all up to its end, so that the last one
    /// leaves the whole.
    fn twin(&self, stage: &Stage) -> Outputs {
        match stage {
            Stage::Reduce(s) => {
                let inputs = ReduceInputs { density: self.field(s.density), other: s.other.map(|f| self.field(f)) };
                vec![("reduced", reference::reduce(&s.params, &inputs))]
            }
            Stage::Project(s) => {
                let inputs = ProjectInputs {
                    density: self.field(s.density),
                    emission: s.emission.map(|f| self.field(f)),
                    emission_color: s.emission_color.map(|f| self.field(f)),
                    occupancy: s.occupancy.map(|b| self.buffer(b)),
                    directions: self.buffer(s.directions),
                    weights: self.buffer(s.weights),
                    emission_weights: s.emission_weights.map_or(&[], |b| self.buffer(b)),
                    phase_table: s.phase_table.map_or(&[], |b| self.buffer(b)),
                };
                let (records, emission_records) = reference::project(&s.params, &inputs);
                vec![("records", records), ("emission_records", emission_records)]
            }
            Stage::Relight(s) => {
                let inputs = RelightInputs {
                    records: self.buffer(s.records),
                    emission_records: s.emission_records.map_or(&[], |b| self.buffer(b)),
                    light: self.buffer(s.light),
                };
                vec![("in_scatter", reference::relight(&s.params, &inputs))]
            }
            Stage::Inject(s) => {
                let blobs = s.blobs.map(|b| self.records(b)).unwrap_or_default();
                let inputs = InjectInputs {
                    base: s.base.map(|f| self.field(f)),
                    blobs: &blobs,
                    starts: s.starts.map_or(&[], |b| self.buffer(b)),
                    list: s.list.map_or(&[], |b| self.buffer(b)),
                };
                vec![("injected", reference::inject(&s.params, &inputs))]
            }
            Stage::Propagate(s) => {
                let lights = self.records(s.lights);
                let inputs = PropagateInputs {
                    density: self.field(s.density),
                    occupancy: s.occupancy.map_or(&[], |b| self.buffer(b)),
                    lights: &lights,
                };
                vec![("light_depth", reference::propagate(&s.params, &inputs))]
            }
            Stage::March(s) => {
                let lights = s.lights.map(|b| self.records(b)).unwrap_or_default();
                let mesh = s.mesh.map(|b| self.records(b)).unwrap_or_default();
                let inputs = MarchInputs {
                    density: self.field(s.density),
                    scattering: s.scattering.map(|f| self.field(f)),
                    emission: s.emission.map(|f| self.field(f)),
                    emission_color: s.emission_color.map(|f| self.field(f)),
                    in_scatter: s.in_scatter.map(|f| self.field(f)),
                    scattered: s.scattered.map(|f| self.field(f)),
                    light_depth: s.light_depth.map(|f| self.field(f)),
                    lights: &lights[..s.params.lights as usize],
                    tables: self.buffer(s.tables),
                    environment: s.environment.map(|f| self.field(f)),
                    surface: s.surface.map(|b| self.buffer(b)),
                    mesh: &mesh,
                    shadow_map: s.shadow_map.map_or(&[], |b| self.buffer(b)),
                };
                vec![("film", reference::march(&s.params, &inputs))]
            }
            Stage::Trace(s) => {
                let inputs = TraceInputs { tables: self.buffer(s.tables), mesh: &self.records(s.mesh) };
                vec![("hits", reference::trace(&s.params, &inputs))]
            }
            Stage::Shade(s) => {
                let lights = s.lights.map(|b| self.records(b)).unwrap_or_default();
                let inputs = ShadeInputs {
                    density: self.field(s.density),
                    lights: &lights,
                    tables: self.buffer(s.tables),
                    mesh: &self.records(s.mesh),
                    materials: &self.records(s.materials),
                    hits: self.buffer(s.hits),
                    background: s.background.map(|b| self.buffer(b)),
                };
                vec![("surface", reference::shade(&s.params, &inputs))]
            }
            Stage::Shadow(s) => {
                let inputs = ShadowInputs { lights: &self.records(s.lights), mesh: &self.records(s.mesh) };
                vec![("shadow_map", reference::shadow(&s.params, &inputs))]
            }
            Stage::Upsample(s) => {
                let inputs = UpsampleInputs {
                    medium: self.buffer(s.medium),
                    rims: s.rims.map(|b| self.buffer(b)),
                    surface: s.surface.map(|b| self.buffer(b)),
                    normals: s.normals.map(|b| self.buffer(b)),
                    environment: s.environment.map(|f| self.field(f)),
                    subpixels: self.buffer(s.subpixels),
                };
                vec![("film", reference::upsample(&s.params, &inputs))]
            }
            Stage::Accumulate(s) => {
                let inputs = AccumulateInputs { medium: self.buffer(s.medium), last: self.buffer(s.last) };
                let (next, mean) = reference::accumulate(&s.params, &inputs);
                vec![("next", next), ("mean", mean)]
            }
            Stage::Path(s) => {
                let lights = s.lights.map(|b| self.records(b)).unwrap_or_default();
                let mesh = s.mesh.map(|b| self.records(b)).unwrap_or_default();
                let inputs = PathInputs {
                    density: self.field(s.density),
                    scattering: s.scattering.map(|f| self.field(f)),
                    seen: s.seen.map(|f| self.field(f)),
                    emission: s.emission.map(|f| self.field(f)),
                    emission_color: s.emission_color.map(|f| self.field(f)),
                    environment: s.environment.map(|f| self.field(f)),
                    majorant: self.buffer(s.majorant),
                    lights: &lights,
                    tables: self.buffer(s.tables),
                    mesh: &mesh,
                    background: s.background.map(|b| self.buffer(b)),
                };
                let (sums, paths, film) = reference::path(&s.params, &inputs);
                vec![("sums", sums), ("paths", paths), ("film", film)]
            }
            Stage::Coarsen(s) => {
                let inputs = CoarsenInputs {
                    density: self.field(s.density),
                    scattering: s.scattering.map(|f| self.field(f)),
                    emission: s.emission.map(|f| self.field(f)),
                    emission_color: s.emission_color.map(|f| self.field(f)),
                };
                vec![("optics", reference::coarsen(&s.params, &inputs))]
            }
            Stage::Classify(s) => {
                let inputs = ClassifyInputs { values: self.field(s.values), points: &self.records(s.points) };
                vec![("classified", reference::classify(&s.params, &inputs))]
            }
            Stage::Illuminate(s) => {
                let inputs = IlluminateInputs {
                    density: self.field(s.density),
                    lights: &self.records(s.lights),
                    mesh: &s.mesh.map(|b| self.records(b)).unwrap_or_default(),
                };
                vec![("moments", reference::illuminate(&s.params, &inputs))]
            }
            Stage::Sweep(s) => {
                let inputs = SweepInputs {
                    optics: self.buffer(s.optics),
                    directions: &self.records(s.directions),
                    sources: s.sources.map_or(&[], |b| self.buffer(b)),
                    source_weights: s.source_weights.map_or(&[], |b| self.buffer(b)),
                    weights: self.buffer(s.weights),
                    obstructed: s.obstructed.map_or(&[], |b| self.buffer(b)),
                };
                vec![("moments", reference::sweep(&s.params, &inputs))]
            }
            Stage::Obstruct(s) => {
                // Words of few bits, which no float takes for none.
                let words = reference::obstruct(&s.params, &self.records(s.mesh));
                vec![("obstructed", words.into_iter().map(|word| f32::from_bits(word).into()).collect())]
            }
            Stage::Evaluate(s) => {
                let inputs = EvaluateInputs {
                    matrices: self.buffer(s.matrices),
                    light: self.buffer(s.light),
                    views: s.views.map_or(&[], |b| self.buffer(b)),
                };
                vec![("evaluated", reference::evaluate(&s.params, &inputs))]
            }
            Stage::Reconstruct(s) => {
                let inputs = ReconstructInputs {
                    rows: self.buffer(s.rows),
                    clusters: self.buffer(s.clusters),
                    weights: s.weights.map_or(&[], |b| self.buffer(b)),
                    radiance: self.buffer(s.radiance),
                    tables: self.buffer(s.tables),
                };
                vec![("in_scatter", reference::reconstruct(&s.params, &inputs))]
            }
            // Theirs is added.
            Stage::Photons(_) => Vec::new(),
        }
    }

    /// What a resource holds, as far as a stage's binding reaches. `Stage::check` has seen that it does.
    fn words(&self, id: ResourceId, bytes: u64) -> &[f32] {
        self.memory.get(&id).map_or(&[], |resource| &resource.words[..bytes as usize / 4])
    }

    fn buffer<T: Pod>(&self, buf: Buf<T>) -> &[T] {
        bytemuck::cast_slice(self.words(buf.id, buf.bytes()))
    }

    /// Structs want to lie at multiples of 16 bytes, which floats do not promise, and so are copied.
    fn records<T: Pod>(&self, buf: Buf<T>) -> Vec<T> {
        let bytes: &[u8] = bytemuck::cast_slice(self.words(buf.id, buf.bytes()));
        bytes.chunks_exact(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect()
    }

    fn field<T: Pod>(&self, field: Field) -> &[T] {
        bytemuck::cast_slice(self.words(field.id, field.spec.bytes()))
    }
}

/// The unit of the work axis that writes a word of an output.
fn unit(stage: &Stage, output: &Binding, word: usize) -> u32 {
    match stage {
        // Blocks of 8 × 8 pixels, row by row, and eight words a pixel, or twelve.
        Stage::March(march) => block(word / 8, march.params.width),
        Stage::Upsample(upsample) => block(word / 8, upsample.params.full_width),
        Stage::Accumulate(accumulate) => {
            let words = if output.name == "next" { 12 } else { 8 };
            block(word / words, accumulate.params.width)
        }
        // Bricks of 8 × 8 × 8 samples, x fastest.
        Stage::Inject(inject) => {
            let ([x, y, ..], word) = (inject.params.dims, word as u32);
            let [i, j, k] = [word % x, word / x % y, word / x / y].map(|at| at / Inject::BRICK);
            (k * y.div_ceil(Inject::BRICK) + j) * x.div_ceil(Inject::BRICK) + i
        }
        // Packs of a slice's voxels.
        Stage::Classify(classify) => {
            let (ClassifyParams { dims: [x, y, ..], .. }, words) = (classify.params, classify.params.channels());
            let (slice, voxel) = (x * y, word as u32 / words);
            voxel / slice * stage.group() + voxel % slice / Classify::PACK
        }
        // Planes of a value a cell.
        Stage::Coarsen(_) | Stage::Illuminate(_) => word as u32 % stage.axis(),
        // Cells, texels, pixels or sub-pixel positions, each with a part of its own or an even share of its group's.
        Stage::Reduce(_)
        | Stage::Project(_)
        | Stage::Relight(_)
        | Stage::Propagate(_)
        | Stage::Sweep(_)
        | Stage::Obstruct(_)
        | Stage::Trace(_)
        | Stage::Shade(_)
        | Stage::Shadow(_)
        | Stage::Path(_)
        | Stage::Evaluate(_)
        | Stage::Reconstruct(_)
        | Stage::Photons(_) => {
            let part = output.part.unwrap_or(u64::MAX) / 4 / u64::from(stage.group());
            (word as u64 / part) as u32
        }
    }
}

/// The block of a pixel in a picture of so many columns.
fn block(pixel: usize, width: u32) -> u32 {
    let (x, y) = (pixel as u32 % width, pixel as u32 / width);
    y / March::BLOCK * width.div_ceil(March::BLOCK) + x / March::BLOCK
}
