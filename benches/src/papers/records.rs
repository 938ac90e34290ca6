//! Delalandre, Gautron and Marvie 2013, *Real-Time Image-Based Volume Lighting*: table 1.

use std::sync::Arc;

use airlight::Version;
use airlight::glam::{DVec3, UVec3};
use airlight::media::{Lattice, Medium, Optics};
use airlight::scene::{Camera, Content, Elimination, EnvironmentEstimate, Estimate, Interpolation, Records, Scene};

use super::{Form, Frames, Row, Table};
use crate::{Frame, fill_slice, scene_of};

/// Voxels along a side of the paper's volume.
pub(super) const VOXELS: u32 = 512;

/// What changes from frame to frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dynamic {
    /// The records, and the eye.
    Records,
    /// The environment, and the eye.
    Light,
    /// The eye.
    Eye,
}

impl Dynamic {
    const ALL: [Self; 3] = [Self::Records, Self::Light, Self::Eye];

    fn name(self) -> &'static str {
        match self {
            Self::Records => "medium and light",
            Self::Light => "light",
            Self::Eye => "nothing",
        }
    }

    fn stages(self) -> Vec<&'static str> {
        match self {
            Self::Records => vec!["project", "relight", "march"],
            Self::Light => vec!["relight", "march"],
            Self::Eye => vec!["march"],
        }
    }
}

/// Speed by record cells, with dynamic and static light, of a cube of `voxels` a side.
pub(super) fn table_1(voxels: u32) -> Table {
    let volume = Arc::new(Volume::new(voxels));
    let mut rows = Vec::new();
    for (cells, figure) in [(10, 28.0), (50, 10.7), (100, 3.81)] {
        for dynamic in Dynamic::ALL {
            let paper = match dynamic {
                Dynamic::Records => Some(figure),
                Dynamic::Light => None,
                Dynamic::Eye => Some(31.9),
            };
            let volume = volume.clone();
            rows.push(Row {
                at: vec![cells.to_string(), dynamic.name().into()],
                paper,
                frames: Box::new(move |form| frames(volume.clone(), cells, dynamic, form)),
                stages: Box::new(move |_| dynamic.stages()),
            });
        }
    }
    Table {
        name: "000-table-1",
        title: "speed by cells of records",
        paper: "Delalandre, Gautron and Marvie 2013",
        hardware: "NVIDIA GeForce GTX 580, Intel Xeon X5680 3.36 GHz; 512³ voxels, 9 coefficients, 1280 × 720 pixels",
        ours: "A volume of our own of as many voxels, a third of them not empty, seen whole; 48 directions, content \
               `transmittance`, view steps of a voxel. The paper's dynamic light evaluates the records in every frame, its \
               static light once; here a new light needs no new records, so that the medium's extinction changes too where \
               they shall be made anew. No volume is uploaded between frames. *Ours* is trilinear records and exact \
               elimination, *published* the nearest record and 3³ probes.",
        axes: &["cells a side", "dynamic"],
        rows,
    }
}

fn frames(volume: Arc<Volume>, cells: u32, dynamic: Dynamic, form: Form) -> Frames {
    let (interpolation, elimination) = match form {
        Form::Ours => (Interpolation::Trilinear, Elimination::Exact),
        Form::Published => (Interpolation::Nearest, Elimination::Probes(3)),
    };
    let records = Records { cells, content: Content::Transmittance, interpolation, elimination, ..Records::default() };
    let scene = Scene {
        camera: Camera {
            origin: EYE,
            target: DVec3::ZERO,
            up: DVec3::Y,
            fov: 30.0,
            width: 1280,
            height: 720,
            samples: 1,
        },
        optics: Optics::grey(EXTINCTION, 0.9),
        estimate: Estimate { environment: Some(EnvironmentEstimate::Records(records)), lights: None, all: None },
        ..scene_of(Frame::RecordsDynamicLight, volume)
    };
    Frames::new(scene, move |scene, number| {
        let turn = f64::from(number) * 0.01;
        scene.camera.origin = EYE + DVec3::new(0.1 * turn.sin(), 0.0, 0.0);
        if dynamic != Dynamic::Eye
            && let Some(environment) = &mut scene.environment
        {
            environment.rotation = turn.to_degrees();
        }
        if dynamic == Dynamic::Records {
            scene.optics.extinction = airlight::glam::Vec3::splat(EXTINCTION + 0.01 * number as f32);
        }
    })
}

const EYE: DVec3 = DVec3::new(1.9, 1.1, 2.1);
/// 1/m.
const EXTINCTION: f32 = 12.0;

/// The benchmarks' density in a cube of one metre, made slice by slice: it is held by the device alone.
#[derive(Debug)]
struct Volume {
    lattice: Lattice,
    version: Version,
}

impl Volume {
    fn new(voxels: u32) -> Self {
        let lattice = Lattice::in_box(UVec3::splat(voxels), DVec3::splat(-0.5), DVec3::splat(0.5));
        Self { lattice: lattice.expect("the box has volume"), version: Version::fresh() }
    }
}

impl Medium for Volume {
    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn version(&self) -> Version {
        self.version
    }

    fn density_slice(&self, k: u32, out: &mut [f32]) {
        fill_slice(self.lattice.dims(), k, out);
    }
}
