//! Sizes of workgroups, and the threads that they are dealt out to.

use airlight_core::exec::Renderer;

use super::device;
use super::steady::scene;
use crate::WgpuDevice;

fn rendered(change: impl Fn(&mut WgpuDevice)) -> Option<Vec<u32>> {
    let mut device = device()?;
    change(&mut device);
    let film = Renderer::new(Box::new(device)).render(&scene()).unwrap().film;
    Some(film.beauty.iter().flatten().map(|value| value.to_bits()).collect())
}

#[test]
fn pictures_do_not_depend_on_the_size_of_workgroups() {
    let Some(expected) = rendered(|device| device.units = 64) else { return };
    for units in [16, 32, 256] {
        assert_eq!(rendered(|device| device.units = units).as_ref(), Some(&expected), "{units}");
    }
}

#[test]
fn pictures_do_not_depend_on_how_many_threads_workgroups_are_dealt_out_to() {
    let Some(expected) = rendered(|device| device.gpu.threads = 1) else { return };
    // The picture has 24 blocks.
    for threads in [2, 3, 7, 24, 25] {
        assert_eq!(rendered(|device| device.gpu.threads = threads).as_ref(), Some(&expected), "{threads}");
    }
}
