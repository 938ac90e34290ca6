//! Delalandre, Gautron and Marvie 2013, *Real-Time Image-Based Volume Lighting*: the frames per second of its figures.

use std::sync::Arc;

use airlight::glam::{UVec3, Vec3};
use airlight::media::{Medium, Optics, Phase};
use airlight::scene::{Content, Elimination, Records, Scene};

use super::records::{Dynamic, EXTINCTION, HARDWARE, PAPER, lit, move_eye, moving, published};
use super::{FRAMES, Form, Row, Table, Unit};
use crate::steady::{Frames, Work};
use crate::volume::Volume;

/// Voxels along a side of the paper's animated volumes.
const ANIMATED: u32 = 128;
/// Cells where the paper does not tell their number.
const CELLS: u32 = 50;

/// Animated smoke, thick and thin.
pub(super) fn figure_1(small: u32) -> Table {
    let volume = Volume::kept(UVec3::splat(ANIMATED / small));
    let row = |(name, extinction): (&str, f32)| {
        let volume = volume.clone();
        let frames = move |form| {
            let records = of(form, published(CELLS.div_ceil(small), form));
            animated(&volume, |volume| lit(volume, Optics::grey(extinction, 0.9), records, small))
        };
        Row {
            at: vec![name.into()],
            unit: Unit::FramesPerSecond,
            paper: Some(20.8),
            work: Box::new(move |form| Work::Frames(frames(form))),
            stages: Box::new(|form| match form {
                Form::Ours => vec!["coarsen", "sweep", "relight", "reduce", "march"],
                Form::Published => vec!["reduce", "project", "relight", "reduce", "march"],
            }),
        }
    };
    Table {
        name: "000-fig-1",
        title: "animated smoke",
        paper: PAPER,
        hardware: HARDWARE,
        ours: "A volume of our own of 128³ voxels, uploaded anew in every frame, while the eye moves; 50³ cells, as the \
               paper's 512³ cloud has (that one is in 000-table-1). Thick and thin differ in extinction by ten. *Ours* is \
               the defaults of `records`, by sweeps; *published* a march from every cell that one of 3³ probes finds, read \
               by the nearest record.",
        figures: FRAMES,
        axes: &["smoke"],
        rows: [("thick", 4.0 * EXTINCTION), ("thin", 0.4 * EXTINCTION)].map(row).into(),
    }
}

/// Elimination of empty cells.
pub(super) fn figure_5(small: u32) -> Table {
    let volume = Volume::kept(UVec3::splat(ANIMATED / small));
    let row = |(name, elimination, paper): (&str, Elimination, Option<f64>)| {
        let volume = volume.clone();
        let frames = move |form| {
            let records = Records { elimination, ..published(CELLS.div_ceil(small), form) };
            animated(&volume, |volume| lit(volume, Optics::grey(EXTINCTION, 0.9), records, small))
        };
        Row {
            at: vec![name.into()],
            unit: Unit::FramesPerSecond,
            paper,
            work: Box::new(move |form| Work::Frames(frames(form))),
            stages: Box::new(move |_| match elimination {
                Elimination::None => vec!["project", "relight", "reduce", "march"],
                _ => vec!["reduce", "project", "relight", "reduce", "march"],
            }),
        }
    };
    Table {
        name: "000-fig-5",
        title: "speed by elimination of empty cells",
        paper: PAPER,
        hardware: HARDWARE,
        ours: "The paper does not tell which volume and how many cells these are: 128³ voxels and 50³ cells here, a new \
               volume in every frame, so that cells are eliminated anew. *Ours* reads trilinear records, *published* the \
               nearest.",
        figures: FRAMES,
        axes: &["probes"],
        rows: [
            ("none", Elimination::None, Some(29.0)),
            ("3³", Elimination::Probes(3), Some(48.0)),
            ("10³", Elimination::Probes(10), Some(10.0)),
            ("exact", Elimination::Exact, None),
        ]
        .map(row)
        .into(),
    }
}

/// A medium that shines, and one that scatters forward.
pub(super) fn figure_6(small: u32) -> Table {
    let cells = 100u32.div_ceil(small);
    let emissive = Volume::kept(UVec3::splat(ANIMATED / small));
    let optics = Optics { emission: Vec3::new(3.0, 1.2, 0.3), ..Optics::grey(EXTINCTION, 0.6) };
    let shining = move |form| {
        let records = of(form, published(cells, form));
        animated(&emissive, |volume| lit(volume, optics.clone(), records, small))
    };
    let mut rows = vec![Row {
        at: vec!["emissive".into(), "medium".into()],
        unit: Unit::FramesPerSecond,
        paper: Some(7.14),
        work: Box::new(move |form| Work::Frames(shining(form))),
        stages: Box::new(|form| match form {
            Form::Ours => vec!["coarsen", "sweep", "sweep", "relight", "reduce", "march"],
            Form::Published => vec!["reduce", "project", "relight", "reduce", "march"],
        }),
    }];
    let production = Arc::new(Volume::new(UVec3::new(813, 460, 324) / small));
    rows.extend(Dynamic::ALL.map(|dynamic| {
        let volume = production.clone();
        let frames = move |form| {
            let records = match form {
                Form::Ours => Records { cells, ..Records::default() },
                Form::Published => Records { content: Content::Phase, ..published(cells, form) },
            };
            let optics = Optics { phase: Phase::HenyeyGreenstein { g: 0.6 }, ..Optics::grey(EXTINCTION, 0.9) };
            moving(lit(volume.clone(), optics, records, small), dynamic)
        };
        Row {
            at: vec!["anisotropic".into(), dynamic.name().into()],
            unit: Unit::FramesPerSecond,
            paper: Some(8.16),
            work: Box::new(move |form| Work::Frames(frames(form))),
            stages: Box::new(move |form| match (form, dynamic) {
                (Form::Published, _) => vec!["project", "relight", "march"],
                (Form::Ours, Dynamic::Records) => vec!["coarsen", "sweep", "relight", "march"],
                (Form::Ours, Dynamic::Light) => vec!["sweep", "relight", "march"],
                (Form::Ours, Dynamic::Eye) => vec!["march"],
            }),
        }
    }));
    Table {
        name: "000-fig-6",
        title: "an emissive and an anisotropic medium",
        paper: PAPER,
        hardware: HARDWARE,
        ours: "Volumes of our own: 128³ voxels that shine, uploaded anew in every frame, and 813 × 460 × 324 that scatter \
               forward (g = 0.6) and stay; 100 cells along the longest side. What moves the paper does not tell, so that its \
               one figure stands beside every row. *Ours* is the defaults of `records`, whose anisotropic records serve \
               every view; *published* marches, and its anisotropic records (content `phase`) are of one direction of view \
               each and made anew when the eye moves.",
        figures: FRAMES,
        axes: &["medium", "dynamic"],
        rows,
    }
}

/// The defaults, or records as the paper makes them.
fn of(form: Form, published: Records) -> Records {
    match form {
        Form::Ours => Records { cells: published.cells, ..Records::default() },
        Form::Published => published,
    }
}

/// A scene whose volume is another one in every frame, and whose eye moves.
fn animated(volume: &Volume, scene: impl FnOnce(Arc<dyn Medium>) -> Scene) -> Frames {
    let volume = volume.clone();
    Frames::new(scene(Arc::new(volume.again())), move |scene, number| {
        move_eye(scene, number);
        scene.medium = Arc::new(volume.again());
    })
}
