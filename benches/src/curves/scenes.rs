//! What grows along each curve, and what is timed.

use std::sync::Arc;

use airlight::glam::{DVec3, UVec3, Vec3};
use airlight::light::Light;
use airlight::media::{Gaussian, Gaussians, Medium, Optics};
use airlight::scene::{
    AllEstimate, Camera, Content, Direct, EnvironmentEstimate, Estimate, LightBasis, LightsEstimate, Opacity, Orders,
    Path, Precompute, Records, ScatteringEstimate, Scene, Solver, Sweeps, TransferEstimate, TransferSolver,
    TransferSource,
};

use super::{Curve, Point, Series};
use crate::frames::sky_of;
use crate::steady::{Frames, Making, MakingPart, Part, Work};
use crate::transfers::{CLUSTERS, COMPONENTS, arbitrary};
use crate::volume::{EYE, Volume};
use crate::{Frame, gaussians, scene_of};

/// All curves, with sides of volumes, grids and pictures divided by `small`, up to so many threads.
pub(super) fn all(small: u32, cores: u32) -> Vec<Curve> {
    let size = Size { small };
    vec![
        size.voxels(),
        size.cells(),
        size.directions(),
        size.lights(),
        size.gaussians(),
        size.basis_lights(),
        size.sky(),
        size.pixels(),
        size.threads(cores),
    ]
}

/// How large scenes are.
#[derive(Clone, Copy)]
struct Size {
    small: u32,
}

/// Voxels along a side where it is another number that grows.
const VOXELS: u32 = 96;

/// 1/m.
const EXTINCTION: f32 = 6.0;

impl Size {
    fn side(self, n: u32) -> u32 {
        n.div_ceil(self.small)
    }

    fn volume(self) -> Volume {
        Volume::kept(UVec3::splat(self.side(VOXELS)))
    }

    /// The volume seen whole in so many columns and three quarters as many rows.
    fn seen(self, medium: Arc<dyn Medium>, columns: u32, estimate: Estimate) -> Scene {
        let (width, height) = (self.side(columns), self.side(columns * 3 / 4));
        Scene {
            camera: Camera { origin: EYE, target: DVec3::ZERO, up: DVec3::Y, fov: 30.0, width, height, samples: 1 },
            optics: Optics::grey(EXTINCTION, 0.9),
            estimate,
            ..scene_of(Frame::RecordsDynamicLight, medium)
        }
    }

    /// As [`Size::seen`], in few pixels, as the march is not what is timed.
    fn scene(self, estimate: Estimate) -> Scene {
        self.seen(Arc::new(self.volume()), 32, estimate)
    }

    fn voxels(self) -> Curve {
        let volume = move |side| Volume::kept(UVec3::splat(side));
        let still = move |side, columns, estimate| self.seen(Arc::new(volume(side)), columns, estimate);
        let moved = move |side, part| {
            let volume = volume(side);
            let frames = Frames::new(self.seen(Arc::new(volume.again()), 32, Estimate::none()), move |scene, _| {
                scene.medium = Arc::new(volume.again());
            });
            Work::Frames(frames.part(part))
        };
        Curve {
            name: "voxels",
            title: "Voxels of a cube; the eye stays as far away, view steps are of a voxel.",
            points: [64, 96, 128, 192, 256].map(|n| self.side(n)).map(|n| point(n, u64::from(n).pow(3))).into(),
            series: vec![
                series("upload", 1.0, "every voxel is written", move |side| {
                    moved(side, Part { uploads: true, stages: &[] })
                }),
                series("reduce", 1.0, "every voxel is read", move |side| {
                    moved(side, Part { uploads: false, stages: &["reduce"] })
                }),
                series("march", THIRD, "a ray has as many steps as voxels along it", move |side| {
                    stages(eye(still(side, 128, Estimate::none())), &["march"])
                }),
                series(
                    "path",
                    THIRD,
                    "flights depend on the medium alone; they cross majorants of 8³ voxels",
                    move |side| stages(eye(still(side, 64, paths())), &["path"]),
                ),
            ],
            threads: false,
        }
    }

    fn cells(self) -> Curve {
        Curve {
            name: "cells",
            title: "Cells of what light is kept in, a cube of them over 96³ voxels; 48 directions, one light.",
            points: [8, 12, 18, 27, 40].map(|n| self.side(n)).map(|n| point(n, u64::from(n).pow(3))).into(),
            series: vec![
                series("records by marches", 1.0, "a march of as many steps from every cell", move |cells| {
                    stages(thicker(self.scene(marched(cells, 48))), &["project"])
                }),
                series("records by sweeps", 1.0, "one update a cell and direction", move |cells| {
                    stages(turned(self.scene(swept(cells, 48))), &["sweep"])
                }),
                series("opacity", 1.0, "one update a cell and light", move |cells| {
                    stages(lamps(self.scene(opacity(cells)), 1), &["propagate"])
                }),
                series("scattering", 1.0, "four orders, one update a cell, direction and order", move |cells| {
                    stages(lamps(self.scene(scattering(cells, 48)), 1), &["illuminate", "sweep"])
                }),
                series("transfer, a new light", 1.0, "every cell is put together anew", move |cells| {
                    stages(turned(self.relit(cells, 162)), &["reconstruct"])
                }),
            ],
            threads: false,
        }
    }

    fn directions(self) -> Curve {
        let cells = self.side(20);
        Curve {
            name: "directions",
            title: "Directions of records and of scattered light, over 20³ cells and 96³ voxels.",
            points: [2, 3, 4, 5, 6].map(|n| 12 * n * n).map(|n| point(n, n.into())).into(),
            series: vec![
                series("records by marches", 1.0, "a march a direction", move |directions| {
                    stages(thicker(self.scene(marched(cells, directions))), &["project"])
                }),
                series("records by sweeps", 1.0, "a sweep a direction", move |directions| {
                    stages(turned(self.scene(swept(cells, directions))), &["sweep"])
                }),
                series("scattering", 1.0, "four orders, a sweep a direction and order", move |directions| {
                    stages(lamps(self.scene(scattering(cells, directions)), 1), &["sweep"])
                }),
            ],
            threads: false,
        }
    }

    fn lights(self) -> Curve {
        let cells = self.side(40);
        let seen = move |estimate| self.seen(Arc::new(self.volume()), 64, estimate);
        Curve {
            name: "lights",
            title: "Point lights around 96³ voxels; columns over 40³ cells.",
            points: [1, 2, 4, 8, 16, 32].map(|n| point(n, n.into())).into(),
            series: vec![
                series("opacity, columns", 1.0, "each light spreads by itself", move |lights| {
                    stages(lamps(self.scene(opacity(cells)), lights), &["propagate"])
                }),
                series("opacity, march", 1.0, "every light at every view sample", move |lights| {
                    stages(lamps(seen(opacity(cells)), lights), &["march"])
                }),
                series("direct, march", 1.0, "a march toward every light from every view sample", move |lights| {
                    stages(lamps(self.scene(direct()), lights), &["march"])
                }),
            ],
            threads: false,
        }
    }

    fn gaussians(self) -> Curve {
        let still = move |medium: Gaussians| {
            // Their cube stands beside what the eye looks at, which does not matter.
            let blobs = medium.blobs().to_vec();
            Frames::new(self.seen(Arc::new(medium), 32, Estimate::none()), move |scene, number| {
                let shift = DVec3::new(0.001 * f64::from(number % 16), 0.0, 0.0);
                let moved = blobs.iter().map(|blob| Gaussian { center: blob.center + shift, ..*blob }).collect();
                let lattice = scene.medium.lattice().clone();
                scene.medium = Arc::new(Gaussians::new(moved, lattice).expect("as good as before"));
            })
        };
        let blobs = move |side: u32, cells, a: f64| {
            let medium = gaussians(side.pow(3), cells);
            let c = 1.0 / f64::from(side.pow(3));
            medium.with(medium.blobs().iter().map(|blob| Gaussian { a, c, ..*blob }).collect()).expect("in range")
        };
        // Reach ends within a few neighbours, which the smallest grid has too.
        let narrow = move |side| still(blobs(side, self.side(8 * side), 3.0 * f64::from(side)));
        Curve {
            name: "gaussians",
            title: "Gaussians on a jittered grid in a cube, all of which move in every frame; where it is not said otherwise, 8³ \
                    voxels for each, a third as wide as they are apart.",
            points: [4, 6, 8, 12, 16].map(|n: u32| point(n, u64::from(n).pow(3))).into(),
            series: vec![
                series("inject", 1.0, "as many reach each voxel, of which there are more", move |side| {
                    stages(narrow(side), &["inject"])
                }),
                series("inject, 32³ voxels, each over all", 1.0, "each reaches every voxel", move |side| {
                    stages(still(blobs(side, self.side(32), 2.0)), &["inject"])
                }),
                series("a whole frame", 1.0, "the host lists each in the bricks that it reaches", move |side| {
                    Work::Frames(narrow(side))
                }),
            ],
            threads: false,
        }
    }

    fn basis_lights(self) -> Curve {
        let solver = |directions| TransferSolver::Ordinates { directions };
        let made = move |functions, options: Precompute, timed| {
            let options = Precompute { basis: LightBasis::Discrete { functions }, ..options };
            Work::Making(Making { scene: self.scene(Estimate::none()), options, timed })
        };
        let whole = Precompute { cells: self.side(16), clusters: None, ..Precompute::default() };
        let relit = move |functions| self.relit(self.side(24), functions);
        Curve {
            name: "basis-lights",
            title: "Discrete spherical functions of the light of a transfer, of 96³ voxels.",
            points: [12, 42, 162, 642].map(|n| point(n, n.into())).into(),
            series: vec![
                series("making by ordinates, 16³ cells", 1.0, "each is carried by itself", move |functions| {
                    made(functions, Precompute { solver: solver(None), ..whole }, MakingPart::Transport)
                }),
                series(
                    "making by photons, 16³ cells",
                    1.0,
                    "ten photons a boundary cell and function",
                    move |functions| made(functions, whole, MakingPart::Transport),
                ),
                series("compression of 16³ cells", 1.0, "matrices are as wide", move |functions| {
                    let (clusters, components) = (Some(CLUSTERS.div_ceil(self.small)), COMPONENTS);
                    let options =
                        Precompute { orders: Orders::Count(1), solver: solver(None), clusters, components, ..whole };
                    made(functions, options, MakingPart::Compression)
                }),
                series(
                    "projection of a new light",
                    0.0,
                    "a ray of the picture meets three functions",
                    move |functions| Work::Frames(turned(relit(functions)).part(Part { uploads: true, stages: &[] })),
                ),
                series("evaluate", 1.0, "a product each in every cluster", move |functions| {
                    stages(turned(relit(functions)), &["evaluate"])
                }),
            ],
            threads: false,
        }
    }

    fn sky(self) -> Curve {
        let under = move |height, estimate| {
            let scene = Scene { environment: Some(sky_of(height)), ..self.scene(estimate) };
            Work::Frames(turned(scene).part(Part { uploads: true, stages: &[] }))
        };
        Curve {
            name: "sky",
            title: "Texels of a sky that turns in every frame; what the host makes of it.",
            points: [128, 256, 512, 1024, 2048].map(|n| self.side(n)).map(|n| point(n, 2 * u64::from(n).pow(2))).into(),
            series: vec![
                series("light of records", 1.0, "every texel is in the integrals", move |height| {
                    under(height, swept(self.side(20), 48))
                }),
                series("light of scattering", 1.0, "every texel is in a pixel's integrals", move |height| {
                    let Estimate { scattering, .. } = scattering(self.side(20), 48);
                    under(height, Estimate { scattering, ..swept(self.side(20), 48) })
                }),
            ],
            threads: false,
        }
    }

    fn pixels(self) -> Curve {
        let seen = move |columns, estimate| self.seen(Arc::new(self.volume()), columns, estimate);
        Curve {
            name: "pixels",
            title: "Pixels of a picture of 96³ voxels.",
            points: [64, 128, 256, 512]
                .map(|n| point(n, u64::from(self.side(n)) * u64::from(self.side(n * 3 / 4))))
                .into(),
            series: vec![
                series("march", 1.0, "a ray a pixel", move |columns| {
                    stages(eye(seen(columns, swept(self.side(20), 48))), &["march"])
                }),
                series("path", 1.0, "a path a pixel", move |columns| stages(eye(seen(columns, paths())), &["path"])),
                series("a whole frame", 1.0, "a ray a pixel, and the film's way back", move |columns| {
                    Work::Frames(eye(seen(columns, swept(self.side(20), 48))))
                }),
            ],
            threads: false,
        }
    }

    fn threads(self, cores: u32) -> Curve {
        let cells = self.side(24);
        let doubled = std::iter::successors(Some(1), |n| Some(2 * n)).take_while(|&n| n < cores);
        let seen = move |columns, estimate| self.seen(Arc::new(self.volume()), columns, estimate);
        Curve {
            name: "threads",
            title: "Threads of the processor, up to all of its own; 96³ voxels, 24³ cells, 256 × 192 pixels.",
            points: doubled.chain([cores]).map(|n| point(n, n.into())).collect(),
            series: vec![
                series("march", -1.0, SHARED, move |_| stages(eye(seen(256, Estimate::none())), &["march"])),
                series("path", -1.0, SHARED, move |_| stages(eye(seen(256, paths())), &["path"])),
                series("records by marches", -1.0, SHARED, move |_| {
                    stages(thicker(self.scene(marched(cells, 48))), &["project"])
                }),
                series("records by sweeps", -1.0, SHARED, move |_| {
                    stages(turned(self.scene(swept(cells, 48))), &["sweep"])
                }),
                series("opacity", -1.0, SHARED, move |_| stages(lamps(self.scene(opacity(cells)), 4), &["propagate"])),
                series("scattering", -1.0, SHARED, move |_| {
                    stages(lamps(self.scene(scattering(cells, 48)), 1), &["sweep"])
                }),
                series("a whole frame", -1.0, "most of the host's part is one thread's", move |_| {
                    Work::Frames(thicker(seen(256, swept(cells, 48))))
                }),
            ],
            threads: true,
        }
    }

    /// A scene that is lit by a transfer.
    fn relit(self, cells: u32, functions: u32) -> Scene {
        let scene = self.scene(Estimate::none());
        let source = TransferSource::Made(Arc::new(arbitrary(&scene, cells, functions)));
        let estimate = TransferEstimate { source, ..TransferEstimate::default() };
        Scene { estimate: Estimate { all: Some(AllEstimate::Transfer(estimate)), ..Estimate::none() }, ..scene }
    }
}

/// The exponent of a side among voxels.
const THIRD: f64 = 1.0 / 3.0;
const SHARED: &str = "the work is shared";

fn point(setting: u32, at: u64) -> Point {
    Point { setting, at }
}

fn series(
    name: &'static str,
    expected: f64,
    why: &'static str,
    work: impl Fn(u32) -> Work + Send + Sync + 'static,
) -> Series {
    Series { name, expected, why, work: Box::new(work) }
}

/// Frames of which these stages are timed.
fn stages(frames: Frames, stages: &'static [&'static str]) -> Work {
    Work::Frames(frames.part(Part { uploads: false, stages }))
}

/// The eye moves.
fn eye(scene: Scene) -> Frames {
    Frames::new(scene, |scene, number| scene.camera.origin = EYE + DVec3::new(0.001 * f64::from(number), 0.0, 0.0))
}

/// The environment turns.
fn turned(scene: Scene) -> Frames {
    Frames::new(scene, |scene, number| {
        if let Some(environment) = &mut scene.environment {
            environment.rotation = f64::from(number);
        }
    })
}

/// The extinction grows.
fn thicker(scene: Scene) -> Frames {
    Frames::new(scene, |scene, number| scene.optics.extinction = Vec3::splat(EXTINCTION + 0.01 * number as f32))
}

/// So many lights in place of the environment, on a circle over the medium, which turns.
fn lamps(scene: Scene, count: u32) -> Frames {
    Frames::new(Scene { environment: None, lights: circle(count, 0.0), ..scene }, move |scene, number| {
        scene.lights = circle(count, 0.1 * f64::from(number));
    })
}

fn circle(count: u32, turn: f64) -> Vec<Light> {
    let lamp = |n: u32| {
        let angle = turn + std::f64::consts::TAU * f64::from(n) / f64::from(count);
        let position = DVec3::new(0.8 * angle.cos(), 0.7, 0.8 * angle.sin());
        Light::Point { position, intensity: Vec3::splat(1.0 / count as f32) }
    };
    (0..count).map(lamp).collect()
}

/// Records as published, of so many cells and directions.
fn marched(cells: u32, directions: u32) -> Estimate {
    records(Records { cells, directions, content: Content::Transmittance, solver: Solver::March, ..Records::default() })
}

/// Records by sweeps.
fn swept(cells: u32, directions: u32) -> Estimate {
    records(Records { cells, directions, ..Records::default() })
}

fn records(records: Records) -> Estimate {
    Estimate { environment: Some(EnvironmentEstimate::Records(records)), ..Estimate::none() }
}

fn opacity(cells: u32) -> Estimate {
    Estimate { lights: Some(LightsEstimate::Opacity(Opacity { cells, ..Opacity::default() })), ..Estimate::none() }
}

fn direct() -> Estimate {
    Estimate { lights: Some(LightsEstimate::Direct(Direct::default())), ..Estimate::none() }
}

/// Four orders of scattering of lights.
fn scattering(cells: u32, directions: u32) -> Estimate {
    let sweeps = Sweeps { cells, directions, orders: Orders::Count(4), ..Sweeps::default() };
    Estimate { scattering: Some(ScatteringEstimate::Sweeps(sweeps)), ..direct() }
}

/// One path a pixel.
fn paths() -> Estimate {
    Estimate { all: Some(AllEstimate::Path(Path { samples: 1, ..Path::default() })), ..Estimate::none() }
}
