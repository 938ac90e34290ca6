//! Small scenes without any symmetry.

use std::sync::Arc;

use airlight_core::basis::recurrence_table;
use airlight_core::device::{Device, Field, ResourceId, ResourceSpec};
use airlight_core::glam::{DAffine3, DMat3, DVec3, UVec3, Vec3};
use airlight_core::light::{Environment, Image, Light};
use airlight_core::media::{Grid, GridMedium, Medium, Optics, Phase, PhaseTable};
use airlight_core::scene::{
    Camera, Content, Direct, Elimination, EnvironmentEstimate, Estimate, Interpolation, LightsEstimate, Quality,
    Records, Scene, Shadow,
};
use airlight_core::stage::{March, MarchParams};

/// A scene, and what it is there for.
pub(super) struct Case {
    pub(super) name: &'static str,
    pub(super) scene: Scene,
}

/// Some number between 0 and 1 for each index: Weyl's sequence.
fn noise(i: u32) -> f32 {
    (f64::from(i) * 0.618_033_988_749_895).fract() as f32
}

/// A turned and stretched grid with empty corners, and an emission of its own where asked for.
pub(super) fn medium(dims: UVec3, emits: bool) -> Arc<dyn Medium> {
    let turn = DMat3::from_rotation_y(0.3) * DMat3::from_diagonal(DVec3::new(1.1, 0.9, 1.0) / f64::from(dims.x));
    let map = DAffine3::from_mat3_translation(turn, DVec3::new(0.02, 0.05, 0.3));
    let grid = |power: f32, seed: u32| {
        let values = (0..dims.element_product()).map(|n| {
            let at = UVec3::new(n % dims.x, n / dims.x % dims.y, n / dims.x / dims.y).as_vec3() + 0.5;
            let from_center = ((at / dims.as_vec3() - Vec3::new(0.45, 0.55, 0.5)) * 2.3).length();
            (1.0 - from_center).max(0.0).powf(power) * (0.5 + noise(n + seed))
        });
        Arc::new(Grid::dense(dims, map, values.collect()).unwrap())
    };
    Arc::new(GridMedium::new(grid(0.5, 0), emits.then(|| grid(1.5, 77))).unwrap())
}

/// A sky that differs in every texel and colour.
fn sky() -> Environment {
    let (width, height) = (14, 6);
    let texel = |n: u32| [0.2 + noise(3 * n), 0.1 + 2.0 * noise(3 * n + 1), noise(3 * n + 2)];
    let texels = (0..width * height).map(texel).collect();
    let mut sky = Environment::new(Image { width, height, texels }).unwrap();
    (sky.rotation, sky.scale) = (35.0, Vec3::new(1.0, 0.8, 1.3));
    // Behind the medium it would outshine what the medium scatters.
    sky.visible = false;
    sky
}

pub(super) fn lights() -> Vec<Light> {
    vec![
        Light::directional(DVec3::new(0.4, 1.0, -0.2), Vec3::new(2.0, 1.5, 1.0)).unwrap(),
        Light::point(DVec3::new(0.7, 0.9, 1.1), Vec3::new(0.2, 0.4, 0.3)).unwrap(),
        Light::spot(DVec3::new(-0.5, 1.2, 0.6), DVec3::new(0.4, 0.4, 0.5), Vec3::splat(1.5), 0.1, 0.5).unwrap(),
    ]
}

pub(super) fn records(content: Content, bands: u32) -> Records {
    Records { cells: 9, bands, directions: 108, content, ..Records::default() }
}

/// A scene lit by a sky through records, and by lights where they are given.
pub(super) fn scene(medium: Arc<dyn Medium>, optics: Optics, records: Records, lights: Vec<Light>) -> Scene {
    Scene {
        camera: Camera {
            origin: DVec3::new(1.9, 1.3, 2.2),
            target: DVec3::new(0.55, 0.45, 0.7),
            up: DVec3::Y,
            fov: 38.0,
            width: 45,
            height: 31,
            samples: 2,
        },
        medium,
        optics,
        environment: Some(sky()),
        lights,
        estimate: Estimate {
            environment: Some(EnvironmentEstimate::Records(records)),
            lights: Some(LightsEstimate::Direct(Direct { shadow: Shadow::March })),
        },
        quality: Quality::default(),
    }
}

/// Every estimator and option that is built.
pub(super) fn all() -> Vec<Case> {
    let dims = UVec3::new(21, 13, 17);
    let grey = |phase| Optics { phase, ..Optics::grey(9.0, 0.9) };
    let colored = |phase| Optics {
        extinction: Vec3::new(9.0, 6.0, 12.0),
        albedo: Vec3::new(0.95, 0.8, 0.6),
        emission: Vec3::ZERO,
        phase,
    };
    let hg = Phase::HenyeyGreenstein { g: 0.6 };
    let double = Phase::DoubleHenyeyGreenstein { forward: 0.7, backward: -0.3, weight: 0.8 };
    let table = PhaseTable::new(&[0.0, 20.0, 90.0, 180.0], &[9.0, 3.0, 0.4, 0.7]).unwrap();
    let glowing = |optics: Optics| Optics { emission: Vec3::new(1.5, 0.4, 0.1), ..optics };
    let case = |name, optics: Optics, records, lights| {
        let medium = medium(dims, optics.emits());
        Case { name, scene: scene(medium, optics, records, lights) }
    };
    let mut all = vec![
        case("radiance, isotropic", grey(Phase::Isotropic), records(Content::Radiance, 3), vec![]),
        case("radiance, layers", colored(hg.clone()), records(Content::Radiance, 5), vec![]),
        case("transmittance", grey(Phase::Isotropic), records(Content::Transmittance, 4), vec![]),
        case("phase, table", colored(Phase::Table(Arc::new(table))), records(Content::Phase, 3), lights()),
        case("phase, Rayleigh", grey(Phase::Rayleigh), records(Content::Phase, 4), vec![]),
        case("emission, layers", glowing(colored(hg)), records(Content::Radiance, 3), vec![]),
        case("emission, one layer", glowing(grey(Phase::Isotropic)), records(Content::Transmittance, 3), vec![]),
        case("lights", colored(double), records(Content::Radiance, 2), lights()),
    ];
    let nearest = Records {
        interpolation: Interpolation::Nearest,
        elimination: Elimination::Probes(3),
        directions: 192,
        ..records(Content::Radiance, 3)
    };
    all.push(case("nearest, probes", grey(Phase::Rayleigh), nearest, vec![]));
    let mut seen = case("sky", grey(Phase::Isotropic), records(Content::Radiance, 1), vec![]);
    if let Some(sky) = &mut seen.scene.environment {
        sky.visible = true;
    }
    all.push(seen);
    let mut dark = case("lights alone, no shadow", grey(Phase::Rayleigh), records(Content::Radiance, 1), lights());
    dark.scene.environment = None;
    dark.scene.estimate.environment = None;
    dark.scene.estimate.lights = Some(LightsEstimate::Direct(Direct { shadow: Shadow::None }));
    all.push(dark);
    all
}

/// A march through a uniform medium that scatters the layers of a field, two bands of them.
pub(super) fn layered_march(device: &mut dyn Device, in_scatter: Field) -> March {
    let density = Field { id: ResourceId(10), spec: super::scalar([8, 6, 10]) };
    device.create(density.id, &ResourceSpec::Field(density.spec)).unwrap();
    device.write(density.id, 0, bytemuck::cast_slice(&[0.3f32; 8 * 6 * 10])).unwrap();
    let mut params: MarchParams = bytemuck::Zeroable::zeroed();
    params.dims = [8, 6, 10, 0];
    (params.index_x, params.index_y) = ([8.0, 0.0, 0.0, 0.0], [0.0, 6.0, 0.0, 0.0]);
    params.index_z = [0.0, 0.0, 10.0, 0.0];
    params.eye = [-4.0, 2.5, 14.0, 0.0];
    params.forward = [0.7, 0.1, -0.7, 0.0];
    (params.right, params.up) = ([0.4, 0.0, 0.4, 0.0], [0.0, 0.5, 0.0, 0.0]);
    (params.extinction, params.albedo) = ([3.0; 4], [1.0, 0.9, 0.8, 0.0]);
    let [x, y, z] = in_scatter.spec.dims;
    params.cells = [x, y, z, in_scatter.spec.layers];
    params.cells_per_voxel = [x as f32 / 8.0, y as f32 / 6.0, z as f32 / 10.0, 0.0];
    (params.width, params.height, params.samples) = (19, 11, 1);
    (params.sample_end, params.step_end) = (1, March::ALL_STEPS);
    (params.step, params.cut) = (0.1, March::CUT);
    (params.bands, params.trilinear, params.harmonics_at) = (2, 1, 2);
    let tables: Vec<f32> = [0.5, 0.5].into_iter().chain(recurrence_table(2)).collect();
    March {
        params,
        density,
        emission: None,
        in_scatter: Some(in_scatter),
        occupancy: None,
        lights: None,
        tables: super::filled(device, 11, &tables),
        environment: None,
        surface: None,
        paths: None,
        film: super::empty(device, 12, 2 * 19 * 11),
    }
}
