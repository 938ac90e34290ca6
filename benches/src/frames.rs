//! Whole frames of which one thing changes.

use std::sync::Arc;

use airlight::Renderer;
use airlight::device::Device;
use airlight::exec::{RenderError, Report};
use airlight::glam::{DVec3, Vec3};
use airlight::light::{Environment, Image, Light};
use airlight::media::{Medium, Optics};
use airlight::scene::{
    Content, Direct, EnvironmentEstimate, Estimate, Jitter, LightsEstimate, Material, Quality, Records,
    ScatteringEstimate, Scene, Shape, Solver, Sweeps,
};

use crate::{View, medium};

/// What changes from frame to frame, and what lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Frame {
    /// Records of the environment; only the eye moves.
    RecordsStatic,
    /// Records of the environment, which turns.
    RecordsDynamicLight,
    /// Records of the environment over a medium that is another one in each frame.
    RecordsDynamicMedium,
    /// A directional light with the medium's own shadow; the light moves.
    Direct,
    /// The same with all orders of scattering.
    Scattering,
    /// The same in and around a room, which the light shines on and which shadows it.
    Surfaces,
    /// The same as a sequence: 32 jittered steps, half the size, accumulated; the eye moves.
    Sequence,
}

impl Frame {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::RecordsStatic,
        Self::RecordsDynamicLight,
        Self::RecordsDynamicMedium,
        Self::Direct,
        Self::Scattering,
        Self::Surfaces,
        Self::Sequence,
    ];

    /// Its name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::RecordsStatic => "records-static",
            Self::RecordsDynamicLight => "records-dynamic-light",
            Self::RecordsDynamicMedium => "records-dynamic-medium",
            Self::Direct => "direct",
            Self::Scattering => "scattering",
            Self::Surfaces => "surfaces",
            Self::Sequence => "sequence",
        }
    }

    /// The stages that every frame but the first runs.
    pub fn stages(self) -> &'static [&'static str] {
        match self {
            Self::RecordsStatic | Self::Direct => &["march"],
            Self::RecordsDynamicLight => &["relight", "march"],
            Self::Scattering => &["illuminate", "sweep", "relight", "march"],
            Self::RecordsDynamicMedium => &["reduce", "project", "relight", "reduce", "march"],
            Self::Surfaces => &["shadow", "shade", "march"],
            Self::Sequence => &["march", "accumulate", "upsample"],
        }
    }

    /// A function that renders the next frame on `device`; the first one has been rendered.
    ///
    /// # Errors
    /// A device fault.
    pub fn start(
        self,
        device: Box<dyn Device>,
    ) -> Result<impl FnMut() -> Result<Report, RenderError> + use<>, RenderError> {
        let mut scene = scene(self);
        let media: [Arc<dyn Medium>; 2] = [scene.medium.clone(), medium()];
        let mut renderer = Renderer::new(device);
        renderer.render(&scene)?;
        let eye = scene.camera.origin;
        let mut number = 0u32;
        Ok(move || {
            number += 1;
            scene.frame = number;
            let turn = f64::from(number) * 0.01;
            match self {
                Self::RecordsStatic | Self::Sequence => {
                    scene.camera.origin = eye + DVec3::new(0.1 * turn.sin(), 0.0, 0.0)
                }
                Self::RecordsDynamicLight => {
                    if let Some(environment) = &mut scene.environment {
                        environment.rotation = turn.to_degrees();
                    }
                }
                Self::RecordsDynamicMedium => scene.medium = media[number as usize % 2].clone(),
                Self::Direct | Self::Scattering | Self::Surfaces => {
                    scene.lights = sun(turn).into_iter().collect();
                }
            }
            let rendered = renderer.render(&scene)?;
            renderer.recycle(rendered.film);
            Ok(rendered.report)
        })
    }
}

/// The first frame.
pub fn scene(frame: Frame) -> Scene {
    scene_of(frame, medium())
}

/// The first frame with another medium.
pub(crate) fn scene_of(frame: Frame, medium: Arc<dyn Medium>) -> Scene {
    let records = !matches!(frame, Frame::Direct | Frame::Scattering | Frame::Surfaces | Frame::Sequence);
    let room = || Shape::CornellBox.mesh(Material::default()).expect("a material in range");
    let few = Quality { steps: Some(32), jitter: Jitter::BlueNoise, scale: 2, temporal: true, ..Quality::default() };
    Scene {
        camera: View::new(192, 144).camera,
        medium,
        optics: Optics::grey(12.0, 0.9),
        environment: records.then(sky),
        background: None,
        surfaces: (frame == Frame::Surfaces).then(|| Arc::new(room())),
        frame: 0,
        lights: if records { Vec::new() } else { sun(0.0).into_iter().collect() },
        estimate: Estimate {
            // The paper's form for light that changes: another light needs no other records.
            environment: records.then(|| {
                let content = Content::Transmittance;
                EnvironmentEstimate::Records(Records {
                    cells: 36,
                    content,
                    solver: Solver::March,
                    ..Records::default()
                })
            }),
            scattering: (frame == Frame::Scattering).then(|| ScatteringEstimate::Sweeps(Sweeps::default())),
            lights: Some(LightsEstimate::Direct(Direct::default())),
            all: None,
        },
        quality: if frame == Frame::Sequence { few } else { Quality::default() },
    }
}

fn sun(turn: f64) -> Option<Light> {
    Light::directional(DVec3::new(turn.sin(), 0.8, turn.cos()), Vec3::splat(3.0)).ok()
}

/// A blue gradient with a bright patch.
fn sky() -> Environment {
    sky_of(32)
}

/// A sky of so many rows, and twice as many columns.
pub(crate) fn sky_of(height: u32) -> Environment {
    let width = 2 * height;
    let texels = (0..width * height).map(|n| {
        let (x, y) = ((n % width) as f32 / width as f32, (n / width) as f32 / height as f32);
        let patch = 5.0 * (1.0 - 8.0 * ((x - 0.3).powi(2) + (y - 0.25).powi(2)).sqrt()).max(0.0);
        [0.3 + patch, 0.5 + patch, 0.9 - 0.5 * y + patch]
    });
    Environment::new(Image { width, height, texels: texels.collect() }).expect("every texel is a radiance")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_redoes_what_it_says_and_no_more() {
        for frame in Frame::ALL {
            let mut next = frame.start(airlight::open("cpu").unwrap()).unwrap();
            for _ in 0..2 {
                assert_eq!(next().unwrap().ran(), frame.stages(), "{}", frame.name());
            }
        }
    }
}
