//! .
use airlight::media::Phase;
use airlight::scene::*;
use airlight_conformance::{Subject, pictures};
fn main() {
    let s = Subject::of_choice("cpu");
    for (content, cells, bands, dirs) in [
        (Content::Phase, 40, 6, 768),
        (Content::Phase, 40, 6, 1728),
        (Content::Phase, 60, 6, 768),
        (Content::Phase, 40, 8, 768),
        (Content::Phase, 40, 10, 768),
        (Content::Radiance, 40, 6, 768),
        (Content::Radiance, 60, 6, 768),
        (Content::Radiance, 40, 10, 768),
        (Content::Radiance, 40, 8, 768),
    ] {
        let mut sc = pictures::in_environment(Records { cells, ..pictures::records(content, bands, dirs) }).unwrap();
        sc.optics.phase = Phase::HenyeyGreenstein { g: 0.5 };
        sc.camera.samples = 4;
        sc.quality.step = 1.0;
        let f = s.renderer().unwrap().render(&sc).unwrap();
        let d = pictures::against("env_hg0.5_single.exr", &f.film).unwrap();
        let rows: Vec<String> =
            f.report.stages.iter().map(|s| format!("{} {:.2}", s.stage, s.time.as_secs_f64())).collect();
        println!("{content:?} cells {cells} bands {bands} dirs {dirs}: {:.3e} {rows:?}", d.relative_l2);
    }
}
