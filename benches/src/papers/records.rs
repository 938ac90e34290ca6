//! Delalandre, Gautron and Marvie 2013, *Real-Time Image-Based Volume Lighting*: table 1.

use std::sync::{Arc, OnceLock};

use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::media::{GridMedium, Medium, Optics};
use airlight::scene::{
    Camera, Content, Elimination, EnvironmentEstimate, Estimate, Interpolation, Precision, Quality, Records, Scene,
    Solver,
};

use super::{FRAMES, Form, Row, Table, Unit};
use crate::steady::{Frames, Work};
use crate::volume::{EYE, Volume};
use crate::{Frame, scene_of};

pub(super) const PAPER: &str = "Delalandre, Gautron and Marvie 2013";
pub(super) const HARDWARE: &str =
    "NVIDIA GeForce GTX 580, Intel Xeon X5680 3.36 GHz; 9 coefficients, 1280 × 720 pixels";

/// What changes from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dynamic {
    /// The records, and the eye.
    Records,
    /// The environment, and the eye.
    Light,
    /// The eye.
    Eye,
}

impl Dynamic {
    pub(super) const ALL: [Self; 3] = [Self::Records, Self::Light, Self::Eye];

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Records => "medium and light",
            Self::Light => "light",
            Self::Eye => "nothing",
        }
    }

    fn stages(self, form: Form, saving: Saving) -> Vec<&'static str> {
        let mut stages = match (self, form) {
            (Self::Records, Form::Ours) => vec!["coarsen", "sweep", "relight", "march"],
            (Self::Records, Form::Published) => vec!["project", "relight", "march"],
            (Self::Light, _) => vec!["relight", "march"],
            (Self::Eye, _) => vec!["march"],
        };
        if saving.pixels > 1 {
            stages.push("upsample");
        }
        stages
    }
}

/// How the picture saves work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Saving {
    name: &'static str,
    /// Pixels along each side of one that is marched.
    pixels: u32,
    /// Voxels along each side of one that is marched through, their mean.
    voxels: u32,
    /// How densities are held.
    precision: Precision,
}

impl Saving {
    const ALL: [Self; 6] = [
        Self { precision: Precision::F32, ..Self::halves("whole", 1, 1) },
        Self::halves("halves", 1, 1),
        Self::halves("means of 2³", 1, 2),
        Self::halves("means of 4³", 1, 4),
        Self::halves("half", 2, 2),
        Self::halves("quarter", 4, 4),
    ];

    const fn halves(name: &'static str, pixels: u32, voxels: u32) -> Self {
        Self { name, pixels, voxels, precision: Precision::F16 }
    }

    /// Whether it saves anything.
    fn any(self) -> bool {
        self != Self::ALL[0]
    }

    /// The volume, or what `coarser` keeps of it.
    fn medium(self, volume: &Arc<Volume>, coarser: &Coarser) -> Arc<dyn Medium> {
        match self.voxels {
            1 => volume.clone(),
            side => coarser[side as usize / 4].get_or_init(|| Arc::new(volume.coarsened(side))).clone(),
        }
    }
}

/// Copies of a volume in which 2³ and 4³ voxels are one, once they were asked for.
type Coarser = [OnceLock<Arc<GridMedium>>; 2];

/// Speed by record cells, with dynamic and static light.
pub(super) fn table_1(small: u32) -> Table {
    let volume = Arc::new(Volume::new(UVec3::splat(512 / small)));
    let coarser: Arc<Coarser> = Arc::default();
    let mut rows = Vec::new();
    for (cells, figure) in [(10u32, 28.0), (50, 10.7), (100, 3.81)] {
        for (saving, dynamic) in Saving::ALL.into_iter().flat_map(|s| Dynamic::ALL.map(|d| (s, d))) {
            let paper = match dynamic {
                Dynamic::Records => Some(figure),
                Dynamic::Light => None,
                Dynamic::Eye => Some(31.9),
            };
            let (volume, coarser) = (volume.clone(), coarser.clone());
            let frames = move |form| {
                let optics = Optics::grey(EXTINCTION, 0.9);
                let mut records = published(cells.div_ceil(small), form);
                if form == Form::Ours {
                    records.solver = Solver::Sweep;
                }
                let whole = lit(volume.clone(), optics, records, small);
                let quality = Quality { scale: saving.pixels, density: saving.precision, ..whole.quality };
                let medium = saving.medium(&volume, &coarser);
                let frames = moving(Scene { medium, quality, ..whole.clone() }, dynamic);
                if saving.any() { frames.beside(whole) } else { frames }
            };
            rows.push(Row {
                at: vec![cells.to_string(), dynamic.name().into(), saving.name.into()],
                unit: Unit::FramesPerSecond,
                paper,
                work: Box::new(move |form| Work::Frames(frames(form))),
                stages: Box::new(move |form| dynamic.stages(form, saving)),
            });
        }
    }
    Table {
        name: "000-table-1",
        title: "speed by cells of records",
        paper: PAPER,
        hardware: HARDWARE,
        ours: "A volume of our own of 512³ voxels, a third of them not empty, seen whole; 48 directions, content \
               `transmittance`, view steps of a voxel. The paper's dynamic light evaluates the records in every frame, its \
               static light once; here a new light needs no new records, so that the medium's extinction changes too where \
               they shall be made anew. No volume is uploaded between frames. *Ours* is trilinear records of all cells by \
               sweeps, *published* the nearest record by marches from cells that 3³ probes find not empty. All pictures but \
               *whole* are of a volume in halves: *means* march every pixel through a copy of it in which 2³ or 4³ voxels are \
               one, in steps of one of these; *half* is one ray for 2 × 2 pixels through the copy of 2³, *quarter* one for \
               4 × 4 through that of 4³; with the relative L2 of the first picture to the whole one's. The copies are made once.",
        figures: FRAMES,
        axes: &["cells a side", "dynamic", "picture"],
        rows,
    }
}

/// Records as the paper makes them, which *ours* reads and eliminates by its defaults.
pub(super) fn published(cells: u32, form: Form) -> Records {
    let (interpolation, elimination) = match form {
        Form::Ours => (Interpolation::Trilinear, Elimination::Exact),
        Form::Published => (Interpolation::Nearest, Elimination::Probes(3)),
    };
    Records {
        cells,
        content: Content::Transmittance,
        interpolation,
        elimination,
        solver: Solver::March,
        ..Records::default()
    }
}

/// A volume under the sky, seen whole in the paper's size of picture.
pub(super) fn lit(volume: Arc<dyn Medium>, optics: Optics, records: Records, small: u32) -> Scene {
    Scene {
        camera: Camera {
            origin: EYE,
            target: DVec3::ZERO,
            up: DVec3::Y,
            fov: 30.0,
            width: 1280 / small,
            height: 720 / small,
            samples: 1,
        },
        optics,
        estimate: Estimate {
            environment: Some(EnvironmentEstimate::Records(records)),
            lights: None,
            scattering: None,
            all: None,
        },
        ..scene_of(Frame::RecordsDynamicLight, volume)
    }
}

/// The scene in motion; a little more extinction from frame to frame asks for other records.
pub(super) fn moving(scene: Scene, dynamic: Dynamic) -> Frames {
    let extinction = scene.optics.extinction;
    Frames::new(scene, move |scene, number| {
        move_eye(scene, number);
        if dynamic != Dynamic::Eye
            && let Some(environment) = &mut scene.environment
        {
            environment.rotation = (f64::from(number) * 0.01).to_degrees();
        }
        if dynamic == Dynamic::Records {
            scene.optics.extinction = extinction + Vec3::splat(0.01 * number as f32);
        }
    })
}

pub(super) fn move_eye(scene: &mut Scene, number: u32) {
    scene.camera.origin = EYE + DVec3::new(0.1 * (f64::from(number) * 0.01).sin(), 0.0, 0.0);
}

/// 1/m.
pub(super) const EXTINCTION: f32 = 12.0;
