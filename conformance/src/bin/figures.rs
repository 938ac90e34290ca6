//! .
use airlight_conformance::{Subject, pictures};
fn main() {
    let s = Subject::of_choice("cpu");
    println!("coefficients {:e}", pictures::coefficient_error().unwrap());
    for p in pictures::pictures() {
        let m = p.measure(&s).unwrap();
        println!(
            "{:32} {:9.3e} (limit {:.0e}) alpha {:9.3e}  {:.2} s  max {:.3e} peak {:.3e}",
            p.name,
            m.radiance.relative_l2,
            p.limit,
            m.alpha.relative_l2,
            m.seconds,
            m.radiance.max_abs,
            m.radiance.peak
        );
    }
}
