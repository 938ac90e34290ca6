//! `local`: every analytic light at every view sample, as a surface across the density's gradient sends it on, without any
//! shadow (the baseline of Zhang, Dong and Ma 2013, Figure 14).

use super::direct::scattered;
use super::{Estimator, LightShadow, MediumFields, Sources};
use crate::exec::{Plan, RenderError};
use crate::scene::{Local, Scene};

impl Estimator for Local {
    fn name(&self) -> &'static str {
        "local"
    }

    fn plan<'a>(
        &'a self,
        scene: &'a Scene,
        _: &MediumFields,
        plan: &mut Plan<'a>,
        sources: &mut Sources,
    ) -> Result<(), RenderError> {
        sources.lights = scattered(scene, sources, plan, |_| LightShadow::Off);
        sources.phong = Some(*self);
        Ok(())
    }
}
