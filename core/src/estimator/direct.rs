//! `direct`: every analytic light at every view sample (the course project of `docs/papers.md`, with falloff and
//! phase function).

use super::opacity::propagate;
use super::{Estimator, LightShadow, Lights, MediumFields, Sources};
use crate::exec::{Plan, RenderError};
use crate::scene::{Direct, Opacity, Scene, Shadow};

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
        sources.lights = scattered(scene, sources, plan, |plan| match self.shadow {
            Shadow::March => LightShadow::March,
            Shadow::Propagated => LightShadow::Field(propagate(Opacity::default(), scene, medium, plan)),
            Shadow::None => LightShadow::Off,
        });
        Ok(())
    }
}

/// The lights for the march, where any light is scattered, with what `shadow` plans.
pub(super) fn scattered<'a>(
    scene: &'a Scene,
    sources: &Sources,
    plan: &mut Plan<'a>,
    shadow: impl FnOnce(&mut Plan<'a>) -> LightShadow,
) -> Option<Lights> {
    let records = sources.records.filter(|_| scene.optics.albedo != glam::Vec3::ZERO)?;
    Some(Lights { records, shadow: shadow(plan) })
}
