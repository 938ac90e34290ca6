//! `direct`: every analytic light at every view sample (the course project of `docs/papers.md`, with falloff and
//! phase function).

use glam::DVec3;

use super::opacity::propagate;
use super::{Estimator, LightShadow, Lights, MediumFields, Sources};
use crate::exec::{Plan, RenderError};
use crate::light::Light;
use crate::scene::{Direct, Opacity, Scene, Shadow};
use crate::stage::LightRecord;

impl Estimator for Direct {
    fn name(&self) -> &'static str {
        "direct"
    }

    fn plan<'a>(
        &'a self,
        scene: &'a Scene,
        medium: &MediumFields,
        plan: &mut Plan<'a>,
        sources: &mut Sources,
    ) -> Result<(), RenderError> {
        sources.lights = records(scene, plan, |plan| match self.shadow {
            Shadow::March => LightShadow::March,
            Shadow::Propagated => LightShadow::Field(propagate(Opacity::default(), scene, medium, plan)),
            Shadow::None => LightShadow::Off,
        });
        Ok(())
    }
}

/// The lights for the march, where any light is scattered, with what `shadow` plans.
pub(super) fn records<'a>(
    scene: &'a Scene,
    plan: &mut Plan<'a>,
    shadow: impl FnOnce(&mut Plan<'a>) -> LightShadow,
) -> Option<Lights> {
    if scene.lights.is_empty() || scene.optics.albedo == glam::Vec3::ZERO {
        return None;
    }
    let records = light_records(&scene.lights, scene.camera.origin);
    Some(Lights { records: plan.table("lights", records), shadow: shadow(plan) })
}

/// Lights as kernels see them. Positions are relative to the eye, subtracted in f64, so that scenes far from the origin
/// keep their precision.
pub(crate) fn light_records(lights: &[Light], eye: DVec3) -> Vec<LightRecord> {
    lights.iter().map(|light| record(light, eye)).collect()
}

fn record(light: &Light, eye: DVec3) -> LightRecord {
    let relative = |p: DVec3| (p - eye).as_vec3().extend(1.0).to_array();
    let rgb = |v: glam::Vec3| v.extend(0.0).to_array();
    match *light {
        Light::Directional { to_light, irradiance } => LightRecord {
            position: to_light.as_vec3().extend(0.0).to_array(),
            power: rgb(irradiance),
            axis: [0.0; 4],
            cone: [0.0; 4],
        },
        Light::Point { position, intensity } => {
            LightRecord { position: relative(position), power: rgb(intensity), axis: [0.0; 4], cone: [0.0; 4] }
        }
        Light::Spot { position, axis, intensity, beam, cutoff } => LightRecord {
            position: relative(position),
            power: rgb(intensity),
            axis: rgb(axis.as_vec3()),
            cone: [beam as f32, cutoff as f32, 1.0, 0.0],
        },
    }
}
