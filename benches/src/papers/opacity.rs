//! Giroud and Biri 2011, *Illuminating and Rendering Heterogeneous Participating Media in Real Time using Opacity
//! Propagation*: tables 2 and 3, whose rows say with table 1 what is recomputed when.

use std::sync::Arc;

use airlight::glam::{DVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Gaussian, Optics};
use airlight::scene::{Camera, LightsEstimate, Opacity, Scene, Scheme};

use super::{FRAMES, Form, Row, Table, Unit};
use crate::steady::{Frames, Work};
use crate::{Frame, gaussians, scene_of};

const PAPER: &str = "Giroud and Biri 2011";
const HARDWARE: &str = "NVIDIA GeForce GTX 280, Intel Core 2 Quad 2.8 GHz; 800 × 600 pixels";

/// What does not change from frame to frame: the rows of table 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Static {
    /// Medium, lights and eye move.
    Nothing,
    /// Lights and eye move.
    Medium,
    /// The eye moves.
    LightingAndMedium,
}

impl Static {
    const ALL: [Self; 3] = [Self::LightingAndMedium, Self::Medium, Self::Nothing];

    /// Its name in table 1.
    fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Medium => "medium",
            Self::LightingAndMedium => "lighting and medium",
        }
    }

    /// What a frame runs: injection and propagation are updated (U) or precomputed (P) as table 1 says. The first
    /// `reduce` makes the cells' mean densities, which the published scheme reads; the second is the march's.
    fn stages(self, form: Form) -> Vec<&'static str> {
        match (self, form) {
            (Self::Nothing, Form::Ours) => vec!["inject", "propagate", "reduce", "march"],
            (Self::Nothing, Form::Published) => vec!["inject", "reduce", "propagate", "reduce", "march"],
            (Self::Medium, _) => vec!["propagate", "march"],
            (Self::LightingAndMedium, _) => vec!["march"],
        }
    }
}

/// Speed by resolution and number of lights. That table 3 has the same figures for one Gaussian in 20³ cells tells that
/// the paper's medium is of one.
pub(super) fn table_2() -> Table {
    // One light with everything precomputed; 1, 2, 4 and 8 lights with nothing static.
    let paper = [
        (15, 320.0, [62.0, 62.0, 51.0, 34.0]),
        (20, 251.0, [38.0, 37.0, 35.0, 22.0]),
        (30, 203.0, [17.0, 17.0, 16.0, 9.0]),
        (40, 120.0, [9.0, 9.0, 9.0, 5.0]),
    ];
    let lights = [1, 2, 4, 8];
    let mut rows = Vec::new();
    for cells in [15, 20, 30, 40, 64, 128] {
        let known = paper.iter().find(|(known, ..)| *known == cells);
        for (n, count) in lights.into_iter().enumerate() {
            for kept in Static::ALL {
                let figure = match (known, kept) {
                    (Some((_, _, dynamic)), Static::Nothing) => Some(dynamic[n]),
                    (Some((_, still, _)), Static::LightingAndMedium) if count == 1 => Some(*still),
                    _ => None,
                };
                let at = vec![cells.to_string(), count.to_string(), kept.name().into()];
                rows.push(row(at, figure, Setting { gaussians: 1, cells, lights: count, kept }));
            }
        }
    }
    Table {
        name: "001-table-2",
        title: "speed by resolution and number of lights",
        paper: PAPER,
        hardware: HARDWARE,
        ours: "A box of 1 m that fills the picture's height, not the paper's Cornell box: surfaces are left out. One Gaussian, \
               point lights within the box, as many cells for the density as for the propagation, view steps of a cell (the \
               paper's are not stated). *Ours* is short characteristics, *published* equation 6.",
        figures: FRAMES,
        axes: &["cells a side", "lights", "static"],
        rows,
    }
}

/// Speed by number of Gaussians.
pub(super) fn table_3() -> Table {
    // Nothing static; lighting and medium static.
    let paper = [
        (1, [38.0, 251.0]),
        (125, [36.0, 250.0]),
        (1000, [35.0, 252.0]),
        (8000, [22.0, 215.0]),
        (27_000, [9.0, 142.0]),
    ];
    let mut rows = Vec::new();
    for cells in [20, 64, 128] {
        for (count, figures) in paper {
            for (kept, figure) in [(Static::Nothing, figures[0]), (Static::LightingAndMedium, figures[1])] {
                let at = vec![cells.to_string(), count.to_string(), kept.name().into()];
                let setting = Setting { gaussians: count, cells, lights: 1, kept };
                rows.push(row(at, (cells == 20).then_some(figure), setting));
            }
        }
    }
    Table {
        name: "001-table-3",
        title: "speed by number of Gaussians",
        paper: PAPER,
        hardware: HARDWARE,
        ours: "As 001-table-2, with one light. Gaussians as wide as they are apart, on a jittered grid that fills the box: \
               the sums get shorter as their number grows.",
        figures: FRAMES,
        axes: &["cells a side", "Gaussians", "static"],
        rows,
    }
}

/// What a row sets.
#[derive(Clone, Copy)]
struct Setting {
    gaussians: u32,
    cells: u32,
    lights: u32,
    kept: Static,
}

fn row(at: Vec<String>, paper: Option<f64>, setting: Setting) -> Row {
    Row {
        at,
        unit: Unit::FramesPerSecond,
        paper,
        work: Box::new(move |form| Work::Frames(setting.frames(form))),
        stages: Box::new(move |form| setting.kept.stages(form)),
    }
}

impl Setting {
    fn frames(self, form: Form) -> Frames {
        let medium = gaussians(self.gaussians, self.cells);
        let blobs = medium.blobs().to_vec();
        let at = move |turn: f64| {
            let shift = DVec3::new(0.1 * turn.sin(), 0.05 * turn.sin(), 0.0);
            let moved = blobs.iter().map(|blob| Gaussian { center: blob.center + shift, ..*blob });
            medium.with(moved.collect()).expect("as good as before")
        };
        let mut scene = Scene {
            camera: Camera {
                origin: EYE,
                target: DVec3::splat(0.5),
                up: DVec3::Y,
                fov: 40.0,
                width: 800,
                height: 600,
                samples: 1,
            },
            optics: Optics::grey(0.5, 0.9),
            lights: lamps(self.lights, 0.0),
            ..scene_of(Frame::Direct, Arc::new(at(0.0)))
        };
        let scheme = match form {
            Form::Ours => Scheme::ShortCharacteristics,
            Form::Published => Scheme::Published,
        };
        scene.estimate.lights =
            Some(LightsEstimate::Opacity(Opacity { cells: self.cells, scheme, ..Opacity::default() }));
        Frames::new(scene, move |scene, number| {
            let turn = f64::from(number) * 0.05;
            scene.camera.origin = EYE + DVec3::new(0.1 * turn.sin(), 0.0, 0.0);
            if self.kept != Static::LightingAndMedium {
                // By more than a cell: the published scheme takes a light for one at the centre of its cell.
                scene.lights = lamps(self.lights, 0.7 * f64::from(number));
            }
            if self.kept == Static::Nothing {
                scene.medium = Arc::new(at(turn));
            }
        })
    }
}

/// The box's face fills the picture from here: ½ m / tan 20° before it.
const EYE: DVec3 = DVec3::new(0.5, 0.5, 2.374);

/// Lights on a circle in the upper half of the box, turned by an angle.
fn lamps(count: u32, turn: f64) -> Vec<Light> {
    let lamp = |n: u32| {
        let angle = turn + std::f64::consts::TAU * f64::from(n) / f64::from(count);
        let position = DVec3::new(0.5 + 0.31 * angle.cos(), 0.77, 0.5 + 0.31 * angle.sin());
        Light::Point { position, intensity: Vec3::splat(1.0 / count as f32) }
    };
    (0..count).map(lamp).collect()
}
