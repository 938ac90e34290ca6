//! The scene's lights and surfaces: what view rays meet, how it is lit, and how it shadows lights.

use bytemuck::Zeroable;
use glam::Vec3;

use super::plan::Plan;
use crate::device::Buf;
use crate::estimator::{MediumFields, MeshBuffers, Occupancy, Sources};
use crate::scene::{Camera, Hierarchy, Mesh, Scene, SurfaceShadow};
use crate::stage::{
    LightRecord, MaterialRecord, MeshRecord, Shade, ShadeParams, Shadow, ShadowParams, Stage, Trace, TraceParams,
    surface_shadow,
};

/// How surfaces shadow lights in the medium.
#[derive(Clone, Copy)]
pub(super) struct SurfaceShadowing {
    /// A constant of [`surface_shadow`].
    pub(super) kind: u32,
    /// Texels along each side of a face of the maps.
    pub(super) side: u32,
    pub(super) map: Option<Buf<f32>>,
    /// What rays go through.
    pub(super) rays: Option<Buf<MeshRecord>>,
}

/// What lights surfaces.
pub(super) struct Frame<'f, 'a> {
    pub(super) scene: &'a Scene,
    pub(super) medium: &'f MediumFields,
    pub(super) occupancy: Occupancy,
    pub(super) lights: Option<Buf<LightRecord>>,
    /// Floor of r² in 1/r², m².
    pub(super) floor: f32,
}

/// The scene's surfaces; none without triangles.
pub(super) fn upload_mesh<'a>(scene: &'a Scene, plan: &mut Plan<'a>) -> Option<MeshBuffers> {
    let mesh: &'a Mesh = scene.surfaces.as_deref()?;
    let hierarchy: &'a Hierarchy = mesh.hierarchy()?;
    let records = hierarchy.records();
    let write = move |device: &mut dyn crate::device::Device, buf: Buf<MeshRecord>| {
        device.write(buf.id, 0, bytemuck::cast_slice(records))
    };
    Some(MeshBuffers {
        records: plan.external("mesh", records.len() as u64, &mesh.version(), write),
        materials: plan.table("materials", mesh.materials().iter().map(MaterialRecord::new).collect()),
        nodes: hierarchy.nodes(),
        origin: hierarchy.origin(),
        extent: hierarchy.extent(),
    })
}

/// The scene's lights, relative to the eye, where an estimator takes them and the medium scatters or surfaces are lit.
pub(super) fn upload_lights<'a>(scene: &'a Scene, surfaces: bool, plan: &mut Plan<'a>) -> Option<Buf<LightRecord>> {
    let estimate = &scene.estimate;
    let taken =
        (estimate.lights.is_some() || estimate.all.is_some()) && (surfaces || scene.optics.albedo != Vec3::ZERO);
    (taken && !scene.lights.is_empty())
        .then(|| plan.table("lights", LightRecord::of(&scene.lights, scene.camera.origin)))
}

/// How surfaces shadow the lights that the medium scatters.
pub(super) fn plan_shadow<'a>(
    scene: &'a Scene,
    mesh: &MeshBuffers,
    sources: &Sources,
    plan: &mut Plan<'a>,
) -> Option<SurfaceShadowing> {
    sources.lights?;
    match scene.estimate.lights.as_ref()?.surface_shadow() {
        SurfaceShadow::None => None,
        SurfaceShadow::Ray => {
            Some(SurfaceShadowing { kind: surface_shadow::RAY, side: 0, map: None, rays: Some(mesh.records) })
        }
        SurfaceShadow::Map(side) => {
            let mut lights = LightRecord::of(&scene.lights, mesh.origin);
            for light in &mut lights {
                // A light of another colour has the same map.
                light.power[..3].fill(0.0);
                light.cone[..3].fill(0.0);
            }
            let faces = scene.lights.iter().map(Shadow::faces).sum();
            let texels = u64::from(faces) * u64::from(side).pow(2);
            let params = ShadowParams {
                lights: lights.len() as u32,
                faces,
                side,
                nodes: mesh.nodes,
                node_begin: 0,
                node_end: mesh.nodes,
                extent: mesh.extent,
                unused: 0,
            };
            let lights = plan.table("shadow lights", lights);
            let out = plan.work("shadow map", texels);
            plan.stage(Stage::Shadow(Shadow { params, lights, mesh: mesh.records, out }));
            Some(SurfaceShadowing { kind: surface_shadow::MAP, side, map: Some(out), rays: None })
        }
    }
}

/// Where view rays meet surfaces.
pub(super) fn plan_trace(scene: &Scene, mesh: &MeshBuffers, plan: &mut Plan<'_>) -> Hits {
    let camera = &scene.camera;
    let mut params = TraceParams::zeroed();
    params.eye = mesh.from_origin(camera.origin);
    [params.forward, params.right, params.up] = axes(camera);
    (params.width, params.height, params.samples) = (camera.width, camera.height, camera.samples);
    (params.nodes, params.node_end) = (mesh.nodes, mesh.nodes);
    let positions = camera.subpixels().iter().flat_map(|p| p.as_vec2().to_array()).collect();
    let tables = plan.table("positions", positions);
    let hits = plan.work("hits", 2 * rays(camera));
    plan.stage(Stage::Trace(Trace { params, tables, mesh: mesh.records, hits }));
    Hits { tables, hits }
}

/// What `trace` found, and for which sub-pixel positions.
#[derive(Clone, Copy)]
pub(super) struct Hits {
    tables: Buf<f32>,
    pub(super) hits: Buf<[f32; 4]>,
}

/// Light that surfaces send to the eye.
pub(super) fn plan_shade(
    frame: &Frame<'_, '_>,
    mesh: &MeshBuffers,
    Hits { tables, hits }: Hits,
    background: Option<Buf<[f32; 4]>>,
    plan: &mut Plan<'_>,
) -> Buf<[f32; 4]> {
    let Frame { scene, medium, occupancy, lights, floor } = *frame;
    let (camera, grid) = (&scene.camera, &medium.grid);
    let mut params = ShadeParams::zeroed();
    params.dims = grid.dims;
    [params.index_x, params.index_y, params.index_z] = grid.index;
    let eye = scene.medium.lattice().world_to_index().transform_point3(camera.origin);
    params.eye = eye.as_vec3().extend(0.0).to_array();
    params.mesh_eye = mesh.from_origin(camera.origin);
    [params.forward, params.right, params.up] = axes(camera);
    params.extinction = scene.optics.extinction.extend(0.0).to_array();
    params.occupancy_cells = occupancy.cells;
    (params.width, params.height, params.samples) = (camera.width, camera.height, camera.samples);
    let count = lights.map_or(0, |lights| lights.len as u32);
    (params.lights, params.light_end, params.spots) = (count, count, LightRecord::spots(&scene.lights));
    (params.nodes, params.materials) = (mesh.nodes, mesh.materials.len as u32);
    let shadows = scene.estimate.lights.as_ref().map(|lights| lights.surface_shadow());
    params.visibility = (shadows != Some(SurfaceShadow::None)).into();
    (params.step, params.light_floor) = (medium.step, floor);
    let out = plan.work("surface", rays(camera));
    plan.stage(Stage::Shade(Shade {
        params,
        density: medium.density,
        occupancy: Some(occupancy.buffer),
        lights,
        tables,
        mesh: mesh.records,
        materials: mesh.materials,
        hits,
        background,
        out,
    }));
    out
}

/// The camera's axes as kernels see them.
fn axes(camera: &Camera) -> [[f32; 4]; 3] {
    camera.axes().map(|a| a.as_vec3().extend(0.0).to_array())
}

/// Sub-pixel positions of a picture.
fn rays(camera: &Camera) -> u64 {
    u64::from(camera.width) * u64::from(camera.height) * u64::from(camera.samples)
}
