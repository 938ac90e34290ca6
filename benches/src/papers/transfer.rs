//! Zhang, Dong and Ma 2013, *Precomputed Volume Radiance Transfer*: table 1.

use std::sync::{Arc, OnceLock};

use airlight::glam::UVec3;
use airlight::light::Prefilter;
use airlight::media::Optics;
use airlight::scene::{
    AllEstimate, Camera, Deposit, Estimate, LightBasis, Precompute, Scene, TransferEstimate, TransferSolver,
    TransferSource, ViewDependence,
};
use airlight::stage::Photons;
use airlight::transfer::Transfer;

use super::records::{EXTINCTION, lit, move_eye};
use super::{Form, Row, Table, Unit};
use crate::steady::{Frames, Making, MakingPart, Part, Work};
use crate::transfers::arbitrary;
use crate::volume::Volume;

/// Discrete spherical functions of the light.
const FUNCTIONS: u32 = 642;
/// Cells along the longest side of a transfer that is made,
const MADE: u32 = 32;
/// and of one that is lit.
const LIT: u32 = 64;

/// What is timed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// The transfer is made.
    Precompute,
    /// A new light over a transfer that is there: its projection, `evaluate` and `reconstruct`.
    Relight,
    /// A frame in which the eye moves.
    Frame,
}

/// Times of precomputation, of the radiance volume and of a frame.
pub(super) fn table_1(small: u32) -> Table {
    let paper = [
        ("smoke plume", [300, 300, 150], [110.0, 0.8, 20.0]),
        ("smoke wall", [400, 300, 100], [165.0, 0.8, 23.0]),
        ("aneurism", [256, 256, 256], [81.0, 0.9, 19.0]),
        ("bonsai", [256, 256, 256], [113.0, 0.9, 20.0]),
        ("bone", [512, 512, 512], [241.0, 1.0, 23.0]),
        ("part", [504, 504, 228], [395.0, 1.0, 25.0]),
        ("machine room", [417, 345, 60], [73.0, 0.7, 21.0]),
    ];
    let mut rows = Vec::new();
    for (data, voxels, figures) in paper {
        let dims = UVec3::from(voxels);
        let scene = Arc::new(Lit { volume: Arc::new(Volume::new(dims / small)), small, transfer: OnceLock::new() });
        let [x, y, z] = voxels;
        let steps = [
            (Step::Precompute, "precomputation, s", Unit::Seconds),
            (Step::Relight, "a new light, ms", Unit::Milliseconds),
            (Step::Frame, "a frame, ms", Unit::Milliseconds),
        ];
        for ((step, name, unit), figure) in steps.into_iter().zip(figures) {
            let scene = scene.clone();
            rows.push(Row {
                at: vec![data.into(), format!("{x} × {y} × {z}"), name.into()],
                unit,
                paper: Some(figure),
                work: Box::new(move |form| scene.work(step, form)),
                stages: Box::new(move |_| match step {
                    Step::Precompute => vec![],
                    Step::Relight => vec!["evaluate", "reconstruct", "march"],
                    Step::Frame => vec!["march"],
                }),
            });
        }
    }
    Table {
        name: "004-table-1",
        title: "precomputation, a new light, a frame",
        paper: "Zhang, Dong and Ma 2013",
        hardware: "NVIDIA GeForce GTX 460M, Intel Core i7 740QM 1.73 GHz; 642 functions, 128 clusters of 4 components",
        ours: "Volumes of our own of as many voxels, grey and isotropic, albedo 0.9. A transfer is made of 32 cells along \
               the longest side, where the paper has a matrix a voxel, with 10 photons for each cell of the box's faces and \
               function. A new light and a frame do not depend on what is in a transfer: theirs has arbitrary numbers in \
               every one of 64 cells along the longest side. A new light is its projection on the host, `evaluate` and `reconstruct`; a frame is of 800 × 600 \
               pixels (the paper's are not told), after the eye moved. *Ours* leaves light along the photons' tracks, \
               *published* around where they are absorbed, and the published light is blurred by a Gaussian.",
        figures: "Seconds of precomputation, milliseconds of the rest.",
        axes: &["data", "voxels", "what"],
        rows,
    }
}

/// A volume of the table, and a transfer of it.
struct Lit {
    volume: Arc<Volume>,
    small: u32,
    transfer: OnceLock<Arc<Transfer>>,
}

impl Lit {
    fn work(&self, step: Step, form: Form) -> Work {
        let mut scene = self.scene();
        if step == Step::Precompute {
            return Work::Making(Making { scene, options: self.options(form), timed: MakingPart::Whole });
        }
        let made = || Arc::new(arbitrary(&scene, LIT.div_ceil(self.small), FUNCTIONS));
        let transfer = self.transfer.get_or_init(made).clone();
        let (view, prefilter) = match form {
            Form::Ours => (ViewDependence::Cell, Prefilter::Energy),
            Form::Published => (ViewDependence::Cluster, Prefilter::Gaussian { width: 1.0 }),
        };
        let estimate = TransferEstimate { source: TransferSource::Made(transfer), view, prefilter };
        scene.estimate = Estimate { all: Some(AllEstimate::Transfer(estimate)), ..Estimate::none() };
        if step == Step::Frame {
            return Work::Frames(Frames::new(scene, move_eye));
        }
        // The march is not timed.
        (scene.camera.width, scene.camera.height) = (40, 30);
        let turned = Frames::new(scene, |scene, number| {
            if let Some(environment) = &mut scene.environment {
                environment.rotation = 25.0 * f64::from(number);
            }
        });
        Work::Frames(turned.part(Part { uploads: true, stages: &["evaluate", "reconstruct"] }))
    }

    /// Without an estimator that counts.
    fn scene(&self) -> Scene {
        let optics = Optics::grey(EXTINCTION, 0.9);
        let scene = lit(self.volume.clone(), optics, airlight::scene::Records::default(), self.small);
        let (width, height) = (800 / self.small, 600 / self.small);
        Scene { camera: Camera { width, height, ..scene.camera }, ..scene }
    }

    fn options(&self, form: Form) -> Precompute {
        let basis = LightBasis::Discrete { functions: FUNCTIONS };
        let deposit = match form {
            Form::Ours => Deposit::Track,
            Form::Published => Deposit::Absorption,
        };
        let count = Precompute::photons(basis);
        Precompute {
            cells: MADE.div_ceil(self.small),
            basis,
            solver: TransferSolver::Photons { count, deposit, radius: Photons::RADIUS },
            ..Precompute::default()
        }
    }
}
