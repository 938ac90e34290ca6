//! The sets of parameters that `march` is tried with.

use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Optics, Phase};
use airlight::scene::Camera;
use airlight::stage::{alone, shadow_kind, surface_shadow};

use super::case;
use super::march::{InScatter, Set, occupancies, one, plain};
use crate::fixtures::{Map, camera, chromatic, grey, phases};
use crate::{Case, Record, Subject, tolerance};

pub(crate) fn cases() -> Vec<Case> {
    let sets = [
        transmittance(),
        emission(),
        varying(),
        in_scatter(),
        lights(),
        local(),
        shadowed(),
        background(),
        views(),
        samples(),
    ];
    let made = |set: Set| {
        let (name, map) = (set.name.clone(), format!("{:?}", set.map).to_lowercase());
        let run = move |subject: &Subject, record: &mut Record| {
            // Normals are differences, whose last bits other roundings turn over.
            if set.phong[3] > 0.0 && record.info().contracts {
                let tolerance = tolerance::CONTRACTED_NORMALS.filtered(record.info());
                return record.within(tolerance, |record| one(subject, record, &set));
            }
            one(subject, record, &set)
        };
        case("march", &name, "film", &tolerance::STAGE, run).varies(&occupancies()).at("map", map)
    };
    sets.into_iter().flatten().map(made).collect()
}

/// Radiance J that the medium scatters, from records or lights.
fn scattering(name: &str, phase: Phase) -> Set {
    Set { optics: chromatic(phase), ..plain(name) }
}

fn transmittance() -> Vec<Set> {
    let black = |optics: Optics| Optics { albedo: Vec3::ZERO, ..optics };
    let mut sets: Vec<Set> = Map::ALL
        .into_iter()
        .map(|map| Set {
            map,
            optics: black(chromatic(Phase::Isotropic)),
            ..plain(&format!("transmittance_{map:?}").to_lowercase())
        })
        .collect();
    sets.extend([
        plain("transmittance_grey"),
        Set { step: 5.0, ..plain("one_step") },
        Set { step: 0.004, ..plain("many_steps") },
        // Rays end where they are cut.
        Set {
            optics: Optics { extinction: Vec3::new(90.0, 60.0, 40.0), ..grey(Phase::Isotropic) },
            lights: vec![sun()],
            ..plain("cut")
        },
        Set {
            optics: Optics { extinction: Vec3::new(4.0, 0.0, 1.0), ..black(grey(Phase::Isotropic)) },
            ..plain("one_clear_channel")
        },
    ]);
    sets
}

fn emission() -> Vec<Set> {
    let glow = |optics: Optics| Optics { emission: Vec3::new(1.2, 0.4, 0.1), ..optics };
    vec![
        Set { optics: glow(grey(Phase::Isotropic)), ..plain("emission_of_density") },
        Set { optics: glow(chromatic(Phase::Isotropic)), own_emission: true, ..plain("emission_of_its_own") },
        Set {
            optics: Optics { extinction: Vec3::ZERO, ..glow(grey(Phase::Isotropic)) },
            own_emission: true,
            map: Map::Sheared,
            ..plain("emission_without_extinction")
        },
    ]
}

/// Albedo and the colour of emission vary in space.
fn varying() -> Vec<Set> {
    let hg = || Phase::HenyeyGreenstein { g: 0.4 };
    let records = Some(InScatter { bands: 2, trilinear: true });
    let shares = |name: &str, optics: Optics| Set { optics, own_scattering: true, ..plain(name) };
    let colors = |name: &str, optics: Optics| Set {
        optics: Optics { emission: Vec3::new(1.2, 0.4, 0.9), ..optics },
        colored_emission: true,
        ..plain(name)
    };
    vec![
        Set { in_scatter: records, ..shares("scattering_of_records", chromatic(hg())) },
        Set {
            map: Map::Sheared,
            lights: vec![sun(), lamp()],
            shadow: shadow_kind::MARCH,
            ..shares("scattering_of_lights", grey(hg()))
        },
        colors("emission_color", chromatic(Phase::Isotropic)),
        Set {
            optics: Optics { extinction: Vec3::ZERO, emission: Vec3::ONE, ..grey(Phase::Isotropic) },
            map: Map::Mirrored,
            ..colors("emission_color_without_extinction", grey(Phase::Isotropic))
        },
        Set {
            own_scattering: true,
            map: Map::Rotated,
            in_scatter: records,
            lights: vec![spot()],
            shadow: shadow_kind::MARCH,
            surface: true,
            ..colors("scattering_and_emission_color", chromatic(hg()))
        },
    ]
}

fn in_scatter() -> Vec<Set> {
    let records = |name: &str, bands: u32, trilinear: bool| Set {
        in_scatter: Some(InScatter { bands, trilinear }),
        ..scattering(name, Phase::Isotropic)
    };
    vec![
        records("records_trilinear", 1, true),
        Set { map: Map::Mirrored, ..records("records_nearest", 1, false) },
        Set { map: Map::Sheared, ..records("two_bands_trilinear", 2, true) },
        records("three_bands_trilinear", 3, true),
        Set { map: Map::Rotated, ..records("three_bands_nearest", 3, false) },
        Set { optics: grey(Phase::Isotropic), ..records("six_bands_trilinear", 6, true) },
        records("ten_bands_trilinear", 10, true),
        Set { map: Map::Mirrored, ..records("ten_bands_nearest", 10, false) },
        Set { scattered: Some(1), ..scattering("scattered_before", Phase::Isotropic) },
        Set { scattered: Some(3), map: Map::Rotated, ..scattering("three_bands_scattered_before", Phase::Isotropic) },
        Set { scattered: Some(2), ..records("records_and_scattered_before", 3, true) },
        Set { scattered: Some(4), lights: vec![sun()], ..records("all_orders", 1, false) },
    ]
}

/// Light as of surfaces across the density's gradient.
fn local() -> Vec<Set> {
    let set = |name: &str, map: Map| Set {
        map,
        lights: vec![sun(), lamp(), spot()],
        phong: [0.7, 0.8, 0.3, 9.0],
        ..scattering(name, Phase::HenyeyGreenstein { g: 0.4 })
    };
    vec![
        set("local", Map::Plain),
        set("local_sheared", Map::Sheared),
        set("local_mirrored", Map::Mirrored),
        Set { phong: [0.0, 0.0, 1.0, 40.0], ..set("local_gloss", Map::Rotated) },
        Set { shadow: shadow_kind::MARCH, own_scattering: true, ..set("local_shadowed", Map::Rotated) },
    ]
}

fn sun() -> Light {
    Light::directional(DVec3::new(0.5, 0.8, -0.35), Vec3::new(3.0, 2.6, 2.0)).expect("a light")
}

fn lamp() -> Light {
    Light::point(DVec3::new(-0.2, 0.9, 0.6), Vec3::new(0.6, 0.7, 1.0)).expect("a light")
}

/// Its cone's rim falls within the medium.
fn spot() -> Light {
    let (from, to) = (DVec3::new(-0.9, 1.1, 0.6), DVec3::new(0.2, -0.1, 0.1));
    Light::spot(from, to, Vec3::new(4.0, 3.0, 2.0), 8.0, 17.0).expect("a light")
}

fn lights() -> Vec<Set> {
    let lit = |name: &str, phase: Phase, lights: Vec<Light>| Set {
        lights,
        shadow: shadow_kind::MARCH,
        ..scattering(name, phase)
    };
    let mut sets: Vec<Set> = phases()
        .into_iter()
        .map(|(name, phase)| Set { map: Map::Rotated, ..lit(&format!("directional_{name}"), phase, vec![sun()]) })
        .collect();
    let hg = || Phase::HenyeyGreenstein { g: 0.6 };
    let inside = Light::point(DVec3::new(0.08, 0.02, 0.23), Vec3::new(0.06, 0.07, 0.1)).expect("a light");
    let hard = Light::spot(DVec3::new(-0.9, 1.1, 0.6), DVec3::ZERO, Vec3::ONE, 12.0, 12.0).expect("a light");
    sets.extend([
        Set { shadow: shadow_kind::NONE, ..lit("no_shadow", hg(), vec![sun(), lamp()]) },
        Set { optics: grey(hg()), ..lit("directional_grey", hg(), vec![sun()]) },
        Set { map: Map::Sheared, ..lit("point", Phase::Rayleigh, vec![lamp()]) },
        Set { map: Map::Mirrored, ..lit("point_inside", Phase::Isotropic, vec![inside]) },
        lit("spot", Phase::DoubleHenyeyGreenstein { forward: 0.8, backward: -0.3, weight: 0.7 }, vec![spot()]),
        Set { camera: camera(21, 13, 4), ..lit("spot_without_rim", Phase::Isotropic, vec![hard]) },
        Set { map: Map::Rotated, ..lit("three_lights", hg(), vec![sun(), lamp(), spot()]) },
    ]);
    let many = || vec![sun(), lamp(), spot(), inside, lamp(), sun(), spot()];
    for (name, shadow) in [("columns", shadow_kind::COLUMN), ("means", shadow_kind::MEAN)] {
        sets.extend([
            Set { shadow, ..lit(&format!("{name}_of_one_light"), hg(), vec![lamp()]) },
            Set { shadow, map: Map::Sheared, ..lit(&format!("{name}_of_seven_lights"), hg(), many()) },
            Set {
                shadow,
                optics: grey(hg()),
                in_scatter: Some(InScatter { bands: 2, trilinear: true }),
                ..lit(&format!("{name}_beside_records"), hg(), vec![sun(), inside])
            },
        ]);
    }
    sets
}

/// Lights that surfaces shadow.
fn shadowed() -> Vec<Set> {
    let lit = |name: String, surface_shadow: u32, lights: Vec<Light>| Set {
        lights,
        surface_shadow,
        ..scattering(&name, Phase::HenyeyGreenstein { g: 0.4 })
    };
    let wide = Light::spot(DVec3::new(0.3, 0.9, 0.2), DVec3::new(0.2, 0.0, 0.2), Vec3::ONE, 20.0, 80.0);
    let mut sets = Vec::new();
    for (how, kind) in [("by_rays", surface_shadow::RAY), ("by_maps", surface_shadow::MAP)] {
        sets.extend([
            lit(format!("directional_{how}"), kind, vec![sun()]),
            lit(format!("point_{how}"), kind, vec![lamp()]),
            lit(format!("spot_{how}"), kind, vec![spot()]),
            Set { map: Map::Sheared, ..lit(format!("wide_spot_{how}"), kind, vec![wide.clone().expect("a light")]) },
            Set {
                shadow: shadow_kind::MARCH,
                optics: grey(Phase::Isotropic),
                map: Map::Rotated,
                ..lit(format!("several_{how}"), kind, vec![spot(), lamp(), sun(), lamp(), spot()])
            },
        ]);
    }
    sets
}

fn background() -> Vec<Set> {
    vec![
        Set { surface: true, fine: true, camera: camera(21, 13, 3), environment: Some(75.0), ..plain("fine_surface") },
        Set { environment: Some(0.0), ..plain("environment") },
        Set { environment: Some(-130.0), map: Map::Sheared, ..plain("environment_turned") },
        Set { surface: true, ..plain("surface") },
        Set {
            surface: true,
            environment: Some(75.0),
            lights: vec![sun()],
            shadow: shadow_kind::MARCH,
            ..scattering("surface_before_environment", Phase::HenyeyGreenstein { g: 0.3 })
        },
    ]
}

fn views() -> Vec<Set> {
    let hg = Phase::HenyeyGreenstein { g: 0.5 };
    let records = Some(InScatter { bands: 3, trilinear: true });
    let within = |width, height| Camera {
        origin: DVec3::new(0.13, -0.07, 0.31),
        target: DVec3::new(-0.4, 0.1, -0.5),
        fov: 75.0,
        ..camera(width, height, 1)
    };
    let all = Set {
        optics: Optics { emission: Vec3::new(0.3, 0.2, 0.1), ..chromatic(hg.clone()) },
        own_emission: true,
        in_scatter: records,
        lights: vec![sun(), lamp(), spot()],
        shadow: shadow_kind::MARCH,
        environment: Some(200.0),
        surface: true,
        ..plain("everything")
    };
    vec![
        Set { camera: camera(21, 13, 7), environment: Some(10.0), ..plain("seven_samples") },
        Set { camera: within(19, 14), lights: vec![sun()], ..scattering("eye_inside", hg.clone()) },
        Set { camera: within(8, 8), map: Map::Sheared, in_scatter: records, ..scattering("eye_inside_slanted", hg) },
        // Large enough for most blocks to be empty, and for rays to pass over several of them.
        Set {
            dims: UVec3::new(37, 21, 29),
            block: 4,
            step: 0.03,
            map: Map::Rotated,
            lights: vec![sun()],
            shadow: shadow_kind::MARCH,
            ..scattering("empty_space", Phase::Isotropic)
        },
        Set { name: "everything_slanted".into(), map: Map::Sheared, camera: camera(21, 13, 3), ..all.clone() },
        all,
    ]
}

/// Where samples lie, and of which pixels.
fn samples() -> Vec<Set> {
    let hg = || Phase::HenyeyGreenstein { g: 0.4 };
    let lit = |name: &str| Set { lights: vec![sun()], shadow: shadow_kind::MARCH, ..scattering(name, hg()) };
    // Larger than the tile, so that it repeats.
    let wide = Camera { fov: 25.0, ..camera(139, 9, 1) };
    let empty = Set { dims: UVec3::new(37, 21, 29), block: 4, map: Map::Rotated, ..lit("jittered_empty_space") };
    vec![
        Set { steps: 9, ..lit("nine_steps") },
        Set { steps: 1, surface: true, map: Map::Sheared, ..plain("steps_to_a_surface") },
        Set { steps: 700, step: 2.0, ..plain("more_steps_than_the_step_asks_for") },
        Set { jitter: Some(0), ..lit("jittered") },
        Set { jitter: Some(3), steps: 6, camera: wide, ..plain("jittered_steps") },
        Set { jitter: Some(u32::MAX), camera: camera(21, 13, 5), surface: true, ..lit("jittered_samples") },
        Set { jitter: Some(2), step: 0.03, ..empty.clone() },
        Set { name: "jittered_steps_through_empty_space".into(), jitter: Some(1), steps: 60, ..empty },
        Set { alone: alone::ALL, surface: true, environment: Some(20.0), ..lit("alone") },
        Set {
            alone: alone::ALL,
            scale: 2,
            surface: true,
            camera: camera(43, 29, 1),
            jitter: Some(4),
            ..lit("half_size")
        },
        Set {
            alone: alone::ALL,
            scale: 4,
            surface: true,
            camera: camera(85, 51, 1),
            map: Map::Mirrored,
            ..lit("quarter_size")
        },
        Set { alone: alone::ALL, scale: 4, camera: camera(84, 53, 1), ..plain("quarter_size_without_surfaces") },
        Set { alone: alone::RIMS, surface: true, camera: camera(45, 31, 1), ..lit("rims_at_full_size") },
        Set {
            alone: alone::RIMS,
            scale: 2,
            surface: true,
            camera: camera(117, 73, 1),
            map: Map::Sheared,
            jitter: Some(6),
            steps: 11,
            ..lit("rims_at_half_size")
        },
    ]
}
