//! Sizes of workgroups.

use airlight_core::exec::Renderer;

use super::device;
use super::steady::scene;

#[test]
fn pictures_do_not_depend_on_the_size_of_workgroups() {
    let render = |units| {
        let mut device = device()?;
        device.units = units;
        let film = Renderer::new(Box::new(device)).render(&scene()).unwrap().film;
        Some(film.beauty.iter().flatten().map(|value| value.to_bits()).collect::<Vec<_>>())
    };
    let Some(expected) = render(64) else { return };
    for units in [16, 32, 256] {
        assert_eq!(render(units).as_ref(), Some(&expected), "{units}");
    }
}
